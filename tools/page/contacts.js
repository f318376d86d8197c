// SPDX-License-Identifier: MIT
// Contacts as arrows from i to j, coloured by depth: flat, turned to the camera; what spheres hide of one shows faintly.
import * as three from 'three';
import {rampColour} from './colours.js';

const vertex = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
in vec3 position;  // along the arrow, across it
in vec3 at;
in vec4 arrow;     // direction, length
in vec3 tint;
out vec3 colour;
void main() {
  vec3 middle = (viewMatrix * vec4(at, 1.0)).xyz, along = mat3(viewMatrix) * arrow.xyz;
  vec3 across = cross(along, normalize(middle));
  float sine = length(across);
  across = sine > 1e-4 ? across / sine : vec3(1.0, 0.0, 0.0);
  colour = tint;
  gl_Position = projectionMatrix * vec4(middle + arrow.w * (position.x * along + position.y * across), 1.0);
}`;
const fragment = `
precision highp float;
uniform float opacity;
in vec3 colour;
out vec4 pixel;
void main() { pixel = vec4(colour, opacity); }`;

const kDrawn = 300000;

export class Contacts {
  constructor(data) {
    const {head, contacts, pairs, radii} = data, total = contacts.length / 7;
    this.total = total;
    this.drawn = Math.min(total, kDrawn);
    let deepest = 0;
    for (let k = 0; k < total; k++) deepest = Math.max(deepest, contacts[7 * k + 6]);
    this.deepest = deepest;
    const least = Math.min(0.03, 0.6 / Math.sqrt(total));  // a few arrows must be found, many must leave room
    const at = new Float32Array(3 * this.drawn), arrow = new Float32Array(4 * this.drawn), tint = new Float32Array(3 * this.drawn);
    for (let k = 0; k < this.drawn; k++) {
      const c = Math.floor((k * total) / this.drawn);
      at.set(contacts.subarray(7 * c, 7 * c + 3), 3 * k);
      arrow.set(contacts.subarray(7 * c + 3, 7 * c + 6), 4 * k);
      const smaller = Math.min(radii[pairs[2 * c]], radii[pairs[2 * c + 1]]), depth = contacts[7 * c + 6];
      arrow[4 * k + 3] = Math.max(depth / head.scale, smaller, least);
      const ramp = rampColour(head, deepest > 0 ? depth / deepest : 0);
      for (let i = 0; i < 3; i++) tint[3 * k + i] = ramp[i] / 255;
    }
    const geometry = new three.InstancedBufferGeometry();
    geometry.instanceCount = this.drawn;
    const outline = [-0.5, -0.05, 0.15, -0.05, 0.15, 0.05, -0.5, 0.05, 0.15, -0.18, 0.5, 0, 0.15, 0.18];
    const corners = new Float32Array(21);
    for (let k = 0; k < 7; k++) corners.set([outline[2 * k], outline[2 * k + 1], 0], 3 * k);
    geometry.setAttribute('position', new three.BufferAttribute(corners, 3));
    geometry.setIndex([0, 1, 2, 0, 2, 3, 4, 5, 6]);
    geometry.setAttribute('at', new three.InstancedBufferAttribute(at, 3));
    geometry.setAttribute('arrow', new three.InstancedBufferAttribute(arrow, 4));
    geometry.setAttribute('tint', new three.InstancedBufferAttribute(tint, 3));
    this.object = new three.Group();
    for (const [opacity, depthFunc] of [[0.7, three.GreaterDepth], [1, three.LessEqualDepth]]) {
      const mesh = new three.Mesh(geometry, new three.RawShaderMaterial({
        glslVersion: three.GLSL3, vertexShader: vertex, fragmentShader: fragment, side: three.DoubleSide,
        uniforms: {opacity: {value: opacity}}, transparent: opacity < 1, depthWrite: opacity === 1, depthFunc,
      }));
      mesh.frustumCulled = false;
      this.object.add(mesh);
    }
    this.pairs = pairs;
  }

  // The numbers of the contacts of a sphere.
  of(sphere) {
    const found = [];
    for (let c = 0; c < this.total; c++)
      if (this.pairs[2 * c] === sphere || this.pairs[2 * c + 1] === sphere) found.push(c);
    return found;
  }
}
