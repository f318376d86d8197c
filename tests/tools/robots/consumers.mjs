// SPDX-License-Identifier: GPL-3.0-or-later
// consumers.mjs BIN ROBOT.usda ROBOT.xml SPHERES: a robot that pad wrote, read by the USD readers three.js and TinyUSDZ and by the
// official build of MuJoCo, which npm has: each must find so many spheres. TinyUSDZ and MuJoCo must agree on every place at joints 0, and on
// the mass.
import {readFileSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {readUsd} from '../usd.mjs';

const [bin, usda, xml, spheres] = process.argv.slice(2);
const packages = join(resolve(bin), '../page/work/node_modules');
const at = (path) => import(pathToFileURL(join(packages, path)));
const expect = (what, found, wanted, tolerance = 0) => {
  if (!(Math.abs(found - wanted) <= tolerance)) throw new Error(`${what} ${found} and not ${wanted}`);
};

if (Number(spheres) <= 20000) {  // the loader of three.js takes more than four minutes for 29,000
  const {USDLoader} = await at('three/examples/jsm/loaders/USDLoader.js');
  let balls = 0;
  new USDLoader().parse(readFileSync(usda, 'utf8')).traverse((o) => { balls += o.isMesh ? 1 : 0; });
  expect('spheres for three.js:', balls, Number(spheres));
}

const mujoco = await (await at('mujoco-js/dist/mujoco_wasm.js')).default();
mujoco.FS.writeFile('/robot.xml', readFileSync(xml, 'utf8'));
const model = mujoco.MjModel.loadFromXML('/robot.xml'), data = new mujoco.MjData(model);
expect('spheres for MuJoCo:', model.ngeom, Number(spheres));

const usd = await readUsd(packages, usda);
expect('spheres for TinyUSDZ:', usd.spheres.length, Number(spheres));
mujoco.mj_kinematics(model, data);
const ordered = (balls) => balls.sort((a, b) => a.reduce((order, x, k) => order || (Math.abs(x - b[k]) > 1e-7 ? x - b[k] : 0), 0));
const ours = ordered(usd.spheres.map((c, k) => [...c, usd.radii[k]]));
const places = [...data.geom_xpos], sizes = [...model.geom_size];  // each mention of the originals builds a new array
const theirs = ordered(usd.radii.map((_, k) => [...places.slice(3 * k, 3 * k + 3), sizes[3 * k]]));
ours.forEach((ball, k) => ball.forEach((x, i) => expect(`TinyUSDZ has sphere ${k}, number ${i}, at`, x, theirs[k][i], 1e-6)));
const mass = usd.numbers('physics:mass').reduce((sum, x) => sum + x, 0);
expect('mass for TinyUSDZ:', mass, [...model.body_mass].reduce((sum, x) => sum + x, 0), 1e-5 * mass);
process.exit(0);
