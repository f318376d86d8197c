// SPDX-License-Identifier: GPL-3.0-or-later
// What TinyUSDZ, a reader of USD in C++, finds in a .usda that pad wrote.
import {readFileSync} from 'node:fs';
import {join} from 'node:path';
import {pathToFileURL} from 'node:url';

// {spheres, radii, numbers, text}: the place of every sphere in the world, its radius, the values of an attribute in their order, and
// the whole file as TinyUSDZ understood it.
export const readUsd = async (packages, file) => {
  const folder = join(packages, 'tinyusdz');
  const type = process.type;
  process.type = 'renderer';  // the package was built for browsers only
  globalThis.window ??= globalThis;
  const usd = await (await import(pathToFileURL(join(folder, 'tinyusdz.js')))).default({wasmBinary: readFileSync(join(folder, 'tinyusdz.wasm'))});
  process.type = type;
  const read = (how) => {
    const loader = new usd.TinyUSDZLoaderNative();
    if (!loader[how](readFileSync(file), 'file.usda')) throw new Error(`TinyUSDZ: ${loader.error()}`);
    return loader;
  };
  const spheres = [];
  const walk = (node) => {
    if (node.primName.startsWith('sphere_')) spheres.push(node.globalMatrix.slice(12, 15));
    node.children.forEach(walk);
  };
  walk(read('loadFromBinary').getDefaultRootNode());
  const text = read('loadAsLayerFromBinary').layerToString();
  const numbers = (name) => [...text.matchAll(new RegExp(`${name} = (\\S+)`, 'g'))].map((m) => Number(m[1]));
  return {spheres, radii: numbers('radius'), numbers, text};
};
