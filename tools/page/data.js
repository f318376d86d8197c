// SPDX-License-Identifier: MIT
// What padding/view/page.cpp wrote into the page: a JSON head and arrays as base64.

function bytesOf(id) {
  const element = document.getElementById(id);
  if (!element) return null;
  const text = atob(element.textContent);
  element.remove();  // the text is larger than the array: let it go
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
  return bytes.buffer;
}

function array(id, Type) {
  const buffer = bytesOf(id);
  return buffer && new Type(buffer);
}

// Coordinates here are those of the page: the middle of the box at 0, its diagonal 1. `head.center` and `head.scale` lead
// back. `packed` is what the GPU reads: three words a sphere, 21 bits for each of x, y, z and a float radius.
export function readData() {
  const element = document.getElementById('head');
  if (!element) throw new Error('this page holds no data: it is the template that the tool preview fills');
  const head = JSON.parse(element.textContent);
  const packed = array('spheres', Uint32Array) ?? new Uint32Array(0);
  const n = head.spheres;
  const asFloat = new Float32Array(packed.buffer);
  const centers = new Float32Array(3 * n), radii = new Float32Array(n);
  const [lx, ly, lz] = head.low, [sx, sy, sz] = head.step;
  for (let k = 0; k < n; k++) {
    const a = packed[3 * k], b = packed[3 * k + 1];
    centers[3 * k] = lx + (a & 0x1fffff) * sx;
    centers[3 * k + 1] = ly + ((a >>> 21) | ((b & 0x3ff) << 11)) * sy;
    centers[3 * k + 2] = lz + (b >>> 10) * sz;
    radii[k] = asFloat[3 * k + 2];
  }
  return {
    head, n, packed, centers, radii,
    family: array('family', Uint32Array),          // null: head.family for all
    triangle: array('triangle', Int32Array),
    protrusion: array('protrusion', Float32Array),  // in the user's unit
    gap: array('gap', Float32Array),                // as well: of the surface that the sphere is nearest to
    body: array('body', Uint32Array),
    points: array('points', Float32Array),
    triangles: array('triangles', Uint32Array),
    // The mesh in triangles that are small enough for the errors on it: its points go on behind those of the mesh.
    finerPoints: array('finer-points', Float32Array),
    finerTriangles: array('finer-triangles', Uint32Array),
    meshGap: head.rungs.map((_, k) => array(`mesh-gap${k}`, Float32Array)),  // at each of its points; below 0: inside the spheres
    marks: (head.marks ?? []).map((mark, k) => ({...mark, points: array(`mark${k}`, Float32Array) ?? new Float32Array(0)})),  // corners, three a triangle
    pairs: array('pairs', Uint32Array),     // i, j of each contact
    contacts: array('contacts', Float32Array),  // at x y z, normal x y z, depth (user's unit) of each
  };
}

// Back to the user's frame and unit.
export const placed = (head, x, y, z) => [x, y, z].map((v, k) => head.center[k] + v * head.scale);

// Seven digits are what the page keeps.
export function number(v) {
  if (v === 0) return '0';
  const a = Math.abs(v);
  return a >= 1e7 || a < 1e-4 ? v.toExponential(4) : String(Number(v.toPrecision(7)));
}
