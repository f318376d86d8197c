// SPDX-License-Identifier: MIT
// The mesh: flat faces, its edges, and itself as glass.
import * as three from 'three';
import light from './light.glsl';

const vertex = `
precision highp float;
uniform mat4 viewMatrix, projectionMatrix;
in vec3 position, normal;  // normal: of a coloured mesh
in float error;            // and its error, 0 to 1
out vec3 at, face;
out float share;
void main() {
  share = error;
  face = mat3(viewMatrix) * normal;
  at = (viewMatrix * vec4(position, 1.0)).xyz;
  gl_Position = projectionMatrix * vec4(at, 1.0);
}`;
const fragment = `
precision highp float;
uniform vec3 albedo, ramp[STOPS];
uniform float opacity;
uniform bool coloured;
in vec3 at, face;
in float share;
out vec4 pixel;
vec3 lit(vec3 albedo, vec3 normal, vec3 along);
void main() {
  vec3 along = normalize(at), normal = coloured ? normalize(face) : normalize(cross(dFdx(at), dFdy(at)));
  if (dot(normal, along) > 0.0) normal = -normal;
  vec3 colour = albedo;
  if (coloured) {
    float x = min(share, 1.0) * float(STOPS - 1);
    int k = min(int(x), STOPS - 2);
    colour = mix(ramp[k], ramp[k + 1], x - float(k));
  }
  pixel = vec4(lit(pow(colour, vec3(2.2)), normal, along), opacity);
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
    const ramp = data.head.palette.ramp.map((c) => new three.Vector3(...c).divideScalar(255));
    const material = (opacity, colour = data.head.palette.mesh, nearer = 0, coloured = false) => new three.RawShaderMaterial({
      glslVersion: three.GLSL3, vertexShader: vertex, fragmentShader: fragment.replaceAll('STOPS', String(ramp.length)) + light, side: three.DoubleSide,
      uniforms: {...lightUniforms, opacity: {value: opacity}, ramp: {value: ramp}, coloured: {value: coloured},
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
    this.coloured = new three.Mesh(new three.BufferGeometry(), material(1, undefined, 0, true));
    this.coloured.visible = false;
    this.shown = new three.Group().add(this.solid, this.coloured);
    for (const object of [this.coloured, this.solid, this.glass, ...this.solid.children, ...this.glass.children]) object.frustumCulled = false;
  }

  // Errors at the points of the finer mesh, or null: then the mesh has its own colour, and shows what repair did.
  paint(errors, high) {
    this.solid.visible = !errors, this.coloured.visible = Boolean(errors);
    if (!errors) return;
    const {geometry} = this.coloured, triangles = this.data.finerTriangles;
    if (!geometry.getAttribute('position')) this.cut(geometry);
    const shares = new Float32Array(triangles.length);
    for (let k = 0; k < triangles.length; k++) shares[k] = high > 0 ? errors[triangles[k]] / high : 0;
    geometry.setAttribute('error', new three.BufferAttribute(shares, 1));
  }
  // The finer triangles one by one, each with its own normal: they can be thinner than a pixel.
  cut(geometry) {
    const {points, finerPoints, finerTriangles} = this.data, own = points.length / 3;
    const positions = new Float32Array(3 * finerTriangles.length);
    for (let k = 0; k < finerTriangles.length; k++) {
      const p = finerTriangles[k], [from, at] = p < own ? [points, p] : [finerPoints, p - own];
      for (let i = 0; i < 3; i++) positions[3 * k + i] = from[3 * at + i];
    }
    geometry.setAttribute('position', new three.BufferAttribute(positions, 3));
    geometry.computeVertexNormals();  // without an index: of the faces
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
