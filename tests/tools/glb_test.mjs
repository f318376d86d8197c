// SPDX-License-Identifier: GPL-3.0-or-later
// glb_test.mjs BIN: what pad writes as .glb, judged by Khronos' glTF validator, which npm fetched beside the page's packages.
// Leaves with 77, and a sentence, where it is not there.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';

const bin = resolve(process.argv[2]), packages = join(bin, '../page/work/node_modules');
if (!existsSync(join(packages, 'gltf-validator'))) {
  console.log('skipped: the glTF validator is not there (cmake --build BUILD --target page fetches it)');
  process.exit(77);
}
const {validateBytes} = createRequire(join(packages, 'x.js'))('gltf-validator');

const folder = mkdtempSync(join(tmpdir(), 'padder-glb-'));
try {
  writeFileSync(join(folder, 'tetra.obj'), 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n');
  const report = JSON.parse(execFileSync(join(bin, 'pad'), ['tetra.obj', '--edge-length', '20%', '--family', '3', '-o', 'tetra.glb', '--json'],
                                         {cwd: folder}));
  execFileSync(join(bin, 'pad'), ['tetra.obj', '--edge-length', '20%', '--format', 'glb-instanced', '-o', 'instanced.glb', '-q'], {cwd: folder});
  const bytes = new Uint8Array(readFileSync(join(folder, 'tetra.glb')));
  const {issues, info} = await validateBytes(bytes);
  if (issues.numErrors + issues.numWarnings) throw new Error(JSON.stringify(issues.messages, null, 1));
  if (info.extensionsRequired) throw new Error(`not every viewer shows it: it needs ${info.extensionsRequired}`);
  // The validator does not know the one extension of the other form, EXT_mesh_gpu_instancing, and says so.
  const instanced = await validateBytes(new Uint8Array(readFileSync(join(folder, 'instanced.glb'))));
  const faults = instanced.issues.messages.filter((m) => m.code !== 'UNSUPPORTED_EXTENSION' && m.severity <= 1);
  if (faults.length) throw new Error(JSON.stringify(faults, null, 1));
  if (!instanced.info.extensionsRequired?.includes('EXT_mesh_gpu_instancing')) throw new Error('the spheres are no instances');
  // A file that is not as it should be is found out.
  bytes[4] = 9;  // there is no such version
  const bad = await validateBytes(bytes).then((r) => r.issues.numErrors, () => 1);
  if (!bad) throw new Error('the validator accepts anything');
  console.log(`${report.spheres} spheres: ${issues.numErrors} errors, ${issues.numWarnings} warnings`);
} finally {
  rmSync(folder, {recursive: true});
}
