// SPDX-License-Identifier: GPL-3.0-or-later
// consumer_npm_test.mjs BIN: what pad writes, read by programs that npm has: the loaders of three.js (.glb, .usda, .stl, .ply, .obj),
// TinyUSDZ (.usda) and the official build of MuJoCo (.xml). Leaves with 77, and a sentence, where they are not there.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {readUsd} from './usd.mjs';

const bin = resolve(process.argv[2]), packages = join(bin, '../page/work/node_modules');
for (const name of ['three', 'mujoco-js', 'tinyusdz'])
  if (!existsSync(join(packages, name))) {
    console.log(`skipped: ${name} is not there (cmake --build BUILD --target page fetches it)`);
    process.exit(77);
  }
const at = (path) => import(pathToFileURL(join(packages, path)));
const three = await at('three/build/three.module.js');
const loader = async (name) => new (await at(`three/examples/jsm/loaders/${name}.js`))[name]();

const folder = mkdtempSync(join(tmpdir(), 'padder-consumers-'));
const pad = (...more) => execFileSync(join(bin, 'pad'), ['box.obj', '--tolerance', '3%', '-q', ...more], {cwd: folder});
const bytes = (file) => {
  const b = readFileSync(join(folder, file));
  return b.buffer.slice(b.byteOffset, b.byteOffset + b.length);
};
const near = (what, found, wanted, tolerance) => {
  if (!(Math.abs(found - wanted) <= tolerance)) throw new Error(`${what}: ${found} and not ${wanted}`);
};
const nearBox = (what, object, low, high) => {
  const box = object.isBox3 ? object : new three.Box3().setFromObject(object, true);
  box.min.toArray().forEach((x, k) => near(`${what}, low ${k}`, x, low[k], 0.02));
  box.max.toArray().forEach((x, k) => near(`${what}, high ${k}`, x, high[k], 0.02));
};

try {
  writeFileSync(join(folder, 'box.obj'), [
    ...[0, 2].flatMap((z) => [[0, 0], [1, 0], [1, 1], [0, 1]].map(([x, y]) => `v ${x} ${y} ${z}`)),
    'f 4 3 2 1', 'f 5 6 7 8', 'f 1 2 6 5', 'f 2 3 7 6', 'f 3 4 8 7', 'f 4 1 5 8'].join('\n'));
  pad('-o', 'box.spheres.json');
  const {centers, radii} = JSON.parse(readFileSync(join(folder, 'box.spheres.json'))).spheres;
  const low = [0, 1, 2].map((x) => Math.min(...centers.map((c, k) => c[x] - radii[k])));
  const high = [0, 1, 2].map((x) => Math.max(...centers.map((c, k) => c[x] + radii[k])));
  const upright = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]];  // Y up

  pad('-o', 'seen.glb', '--family', '3');
  const glb = (await (await loader('GLTFLoader')).parseAsync(bytes('seen.glb'), '')).scene;
  glb.updateMatrixWorld(true);
  const shown = [];
  glb.traverse((o) => o.isMesh && shown.push(o));
  near('glb: meshes shown', shown.length, radii.length, 0);
  near('glb: geometries', new Set(shown.map((o) => o.geometry.attributes.position)).size, 1, 0);
  near('glb: colour of family 3', shown[0].material.color.getHex(), 0x409850, 0x030303);
  nearBox('glb', glb, ...upright);

  pad('-o', 'seen.usda');
  const usd = (await loader('USDLoader')).parse(readFileSync(join(folder, 'seen.usda'), 'utf8'));
  const balls = [];
  usd.traverse((o) => o.isMesh && balls.push(o));
  near('usda: spheres', balls.length, radii.length, 0);
  nearBox('usda', usd, ...upright);
  const tiny = await readUsd(packages, join(folder, 'seen.usda'));
  near('TinyUSDZ: spheres', tiny.spheres.length, radii.length, 0);
  tiny.spheres.forEach((place, k) => place.forEach((x, i) => near(`TinyUSDZ: place of sphere ${k}`, x, centers[k][i], 1e-15)));
  tiny.radii.forEach((r, k) => near(`TinyUSDZ: radius of sphere ${k}`, r, radii[k], 1e-15));
  near('TinyUSDZ: mass', tiny.numbers('physics:mass')[0], 2000, 0.01);
  // A file that is not as it should be is found out.
  writeFileSync(join(folder, 'bad.usda'), readFileSync(join(folder, 'seen.usda'), 'utf8').replace('float3 physics:diagonalInertia = (', '$&1, '));
  if (await readUsd(packages, join(folder, 'bad.usda')).then(() => true, () => false)) throw new Error('TinyUSDZ accepts anything');

  for (const [file, name] of [['seen.stl', 'STLLoader'], ['seen.ply', 'PLYLoader']]) {
    pad('-o', file);
    const geometry = (await loader(name)).parse(bytes(file));
    geometry.computeBoundingBox();
    nearBox(file, geometry.boundingBox, low, high);
    if (name === 'PLYLoader' && !geometry.attributes.color) throw new Error('ply: no colours');
  }
  pad('-o', 'seen.obj');
  nearBox('obj', (await loader('OBJLoader')).parse(readFileSync(join(folder, 'seen.obj'), 'utf8')), low, high);

  pad('-o', 'seen.xml');
  const mujoco = await (await at('mujoco-js/dist/mujoco_wasm.js')).default();
  mujoco.FS.writeFile('/seen.xml', readFileSync(join(folder, 'seen.xml'), 'utf8'));
  const model = mujoco.MjModel.loadFromXML('/seen.xml');
  near('mujoco: geoms', model.ngeom, radii.length, 0);
  near('mujoco: mass', model.body_mass[1], 2000, 0.01);
  console.log(`three.js ${three.REVISION}, TinyUSDZ, MuJoCo ${mujoco.mj_versionString()}: ${radii.length} spheres in each file`);
} finally {
  rmSync(folder, {recursive: true});
}
process.exit(0);
