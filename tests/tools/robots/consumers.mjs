// SPDX-License-Identifier: GPL-3.0-or-later
// consumers.mjs BIN ROBOT.usda ROBOT.xml SPHERES: a robot that pad wrote, read by three.js' USD loader and by the official
// build of MuJoCo, which npm has: each must find so many spheres.
import {readFileSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

const [bin, usda, xml, spheres] = process.argv.slice(2);
const at = (path) => import(pathToFileURL(join(resolve(bin), '../page/work/node_modules', path)));
const expect = (what, found) => {
  if (found !== Number(spheres)) throw new Error(`${what} finds ${found} spheres and not ${spheres}`);
};

const {USDLoader} = await at('three/examples/jsm/loaders/USDLoader.js');
let balls = 0;
new USDLoader().parse(readFileSync(usda, 'utf8')).traverse((o) => { balls += o.isMesh ? 1 : 0; });
expect('three.js', balls);

const mujoco = await (await at('mujoco-js/dist/mujoco_wasm.js')).default();
mujoco.FS.writeFile('/robot.xml', readFileSync(xml, 'utf8'));
expect('MuJoCo', mujoco.MjModel.loadFromXML('/robot.xml').ngeom);
process.exit(0);
