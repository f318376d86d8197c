// SPDX-License-Identifier: MIT
// The spheres: one triangle each, 16 bytes on the GPU, ray against sphere in the fragment shader. The shader fetches the bytes
// from a texture by the number of the vertex: instances of one triangle are slow, and very slow without a graphics card.
import * as three from 'three';
import vertex from './spheres.vert.glsl';
import fragment from './spheres.frag.glsl';
import light from './light.glsl';

const kRow = 4096;  // spheres in a row of the texture; spheres.vert.glsl knows it too

// Random but the same every time: any first part of the order is an even sample of the spheres.
function shuffled(first, count) {
  const order = Uint32Array.from({length: count}, (_, k) => first + k);
  let state = 12345;
  for (let k = count - 1; k > 0; k--) {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    const other = Math.floor((state / 4294967296) * (k + 1)), kept = order[k];
    order[k] = order[other], order[other] = kept;
  }
  return order;
}

export class Spheres {
  // `light` uniforms are shared with the mesh.
  constructor(data, lightUniforms) {
    this.data = data;
    this.geometry = new three.BufferGeometry();  // without attributes
    this.uniforms = {
      ...lightUniforms,
      low: {value: new three.Vector3(...data.head.low)},
      size: {value: new three.Vector3(...data.head.step)},
      grow: {value: 1},
      picked: {value: -1},
      spheres: {value: null},
    };
    const material = new three.RawShaderMaterial({
      glslVersion: three.GLSL3, uniforms: this.uniforms, vertexShader: vertex, fragmentShader: fragment + light,
    });
    this.object = new three.Mesh(this.geometry, material);
    this.object.frustumCulled = false;
    this.setRung(data.head.rung);
  }

  setRung(index) {
    const {first, count} = this.data.head.rungs[index];
    this.rung = index, this.first = first, this.count = count;
    this.order = shuffled(first, count);
    this.slot = new Uint32Array(count);  // of sphere first + k, in the order
    for (let k = 0; k < count; k++) this.slot[this.order[k] - first] = k;
    const rows = Math.max(1, Math.ceil(count / kRow)), words = (this.words = new Uint32Array(4 * kRow * rows));
    for (let k = 0; k < count; k++) words.set(this.data.packed.subarray(3 * this.order[k], 3 * this.order[k] + 3), 4 * k);
    if (this.texture) this.texture.dispose();
    this.texture = new three.DataTexture(words, kRow, rows, three.RGBAIntegerFormat, three.UnsignedIntType);
    this.texture.internalFormat = 'RGBA32UI';
    this.uniforms.spheres.value = this.texture;
    this.pick(-1);
    this.draw(count);
  }

  // colour(k) gives 24 bits; hidden(k) leaves a sphere out.
  paint(colour, hidden) {
    for (let k = 0; k < this.count; k++) {
      const sphere = this.order[k];
      this.words[4 * k + 3] = hidden(sphere) ? 0 : (colour(sphere) | 0xff000000) >>> 0;
    }
    this.texture.needsUpdate = true;
  }

  hides(sphere) { return this.words[4 * this.slot[sphere - this.first] + 3] >>> 24 === 0; }
  colourOf(sphere) {
    const w = this.words[4 * this.slot[sphere - this.first] + 3];
    return [w & 255, (w >> 8) & 255, (w >> 16) & 255];
  }

  // The first `count` of the order. Fewer spheres are drawn larger, so that what they cover stays about the same.
  draw(count) {
    this.drawn = Math.min(this.count, Math.max(1, Math.round(count)));
    this.geometry.setDrawRange(0, 3 * this.drawn);
    this.uniforms.grow.value = Math.min(2.5, Math.sqrt(this.count / this.drawn));
  }

  pick(sphere) {
    this.picked = sphere;
    this.uniforms.picked.value = sphere < 0 ? -1 : this.slot[sphere - this.first];
  }

  // The sphere that a ray meets first, or -1. One pass over all: 10 ms a million.
  under(origin, direction) {
    const {centers, radii} = this.data;
    let best = -1, nearest = Infinity;
    for (let s = this.first; s < this.first + this.count; s++) {
      const x = centers[3 * s] - origin.x, y = centers[3 * s + 1] - origin.y, z = centers[3 * s + 2] - origin.z;
      const along = x * direction.x + y * direction.y + z * direction.z;
      if (along <= 0) continue;
      const px = x - along * direction.x, py = y - along * direction.y, pz = z - along * direction.z;
      const q = radii[s] * radii[s] - (px * px + py * py + pz * pz);
      if (q < 0) continue;
      const t = along - Math.sqrt(q);
      if (t > 0 && t < nearest && !this.hides(s)) nearest = t, best = s;
    }
    return best;
  }
}
