// SPDX-License-Identifier: MIT
// The mesh: flat faces, its edges, and itself as glass.
import * as three from 'three';
import light from './light.glsl';

const vertex = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
in vec3 position;
out vec3 at;
void main() {
  at = (viewMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * vec4(at, 1.0);
}`;
const fragment = `
precision highp float;
uniform vec3 albedo;
uniform float opacity;
in vec3 at;
out vec4 pixel;
vec3 lit(vec3 albedo, vec3 normal, vec3 along);
void main() {
  vec3 along = normalize(at), normal = normalize(cross(dFdx(at), dFdy(at)));
  if (dot(normal, along) > 0.0) normal = -normal;
  pixel = vec4(lit(pow(albedo, vec3(2.2)), normal, along), opacity);
}`;

// Each edge once, however many triangles share it.
function edgesOf(triangles, points) {
  const keys = new Float64Array(triangles.length);
  for (let t = 0; t < triangles.length; t += 3)
    for (let k = 0; k < 3; k++) {
      const a = triangles[t + k], b = triangles[t + ((k + 1) % 3)];
      keys[t + k] = Math.min(a, b) * points + Math.max(a, b);
    }
  keys.sort();
  const out = new Uint32Array(2 * keys.length);
  let n = 0;
  for (let k = 0; k < keys.length; k++) {
    if (k && keys[k] === keys[k - 1]) continue;
    out[n++] = Math.floor(keys[k] / points), out[n++] = keys[k] % points;
  }
  return out.slice(0, n);
}

export class Surface {
  constructor(data, lightUniforms) {
    this.data = data;
    const geometry = (this.geometry = new three.BufferGeometry());
    geometry.setAttribute('position', new three.BufferAttribute(data.points, 3));
    geometry.setIndex(new three.BufferAttribute(data.triangles, 1));
    const material = (opacity, colour = data.head.palette.mesh, nearer = 0) => new three.RawShaderMaterial({
      glslVersion: three.GLSL3, vertexShader: vertex, fragmentShader: fragment + light, side: three.DoubleSide,
      uniforms: {...lightUniforms, opacity: {value: opacity},
                 albedo: {value: new three.Vector3(...colour).divideScalar(255)}},
      transparent: opacity < 1, depthWrite: opacity === 1,
      // Edges lie on the faces: these step back a little.
      polygonOffset: true, polygonOffsetFactor: 1 - nearer, polygonOffsetUnits: 1 - nearer,
    });
    this.solid = new three.Mesh(geometry, material(1));
    this.glass = new three.Mesh(geometry, material(0.35));
    // What repair did lies on the mesh or beside it, in colours of its own.
    this.marks = data.marks.map((mark) => {
      const corners = new three.BufferGeometry();
      corners.setAttribute('position', new three.BufferAttribute(mark.points, 3));
      return new three.Mesh(corners, material(1, mark.colour, 1.5));
    });
    if (this.marks.length) this.solid.add(...this.marks), this.glass.add(...this.marks.map((mark) => mark.clone()));
    for (const object of [this.solid, this.glass, ...this.solid.children, ...this.glass.children]) object.frustumCulled = false;
  }

  get wire() {  // made when first asked for
    if (!this.lines) {
      const geometry = new three.BufferGeometry();
      geometry.setAttribute('position', this.geometry.getAttribute('position'));
      geometry.setIndex(new three.BufferAttribute(edgesOf(this.data.triangles, this.data.points.length / 3), 1));
      // Spheres stand out of the mesh: edges show through what lies less than a hundredth of the diagonal before them.
      const lines = new three.RawShaderMaterial({
        glslVersion: three.GLSL3,
        vertexShader: vertex.replace('vec4(at, 1.0);', 'vec4(at * (1.0 - 0.01 / length(at)), 1.0);'),
        fragmentShader: 'precision highp float; out vec4 pixel; void main() { pixel = vec4(0.07, 0.1, 0.14, 0.55); }',
        transparent: true, depthWrite: false,
      });
      this.lines = new three.LineSegments(geometry, lines);
      this.lines.frustumCulled = false;
    }
    return this.lines;
  }
}
