// SPDX-License-Identifier: MIT
// A sphere is four words: 21 bits for each of x, y, z, a float radius, and the colour with a byte that shows or hides it.
precision highp float;
precision highp int;
precision highp usampler2D;
uniform usampler2D spheres;  // 4096 in a row
uniform mat4 viewMatrix, projectionMatrix;
uniform vec3 low, size;  // of the box that the 21 bits divide
uniform float grow;      // of the radii, while fewer are drawn
uniform int picked;
flat out vec4 ball;      // centre in the camera's frame, radius
flat out vec3 colour;
out vec3 at;             // on the triangle, in the camera's frame

void main() {
  int number = gl_VertexID / 3, corner = gl_VertexID - 3 * number;
  uvec4 sphere = texelFetch(spheres, ivec2(number & 4095, number >> 12), 0);
  // Of a triangle around the unit circle.
  vec2 position = corner == 2 ? vec2(0.0, 2.0) : vec2(corner == 0 ? -1.7320509 : 1.7320509, -1.0);
  if (sphere.w >> 24 == 0u) {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  uvec3 q = uvec3(sphere.x & 0x1fffffu, (sphere.x >> 21) | ((sphere.y & 0x3ffu) << 11), sphere.y >> 10);
  vec3 centre = (viewMatrix * vec4(low + vec3(q) * size, 1.0)).xyz;
  float radius = uintBitsToFloat(sphere.z) * grow;
  ball = vec4(centre, radius);
  colour = vec3(sphere.w & 255u, (sphere.w >> 8) & 255u, (sphere.w >> 16) & 255u) / 255.0;
  if (number == picked) colour = vec3(1.0, 0.1, 0.85);
  colour = pow(colour, vec3(2.2));  // linear
  // The outline of a ball in perspective is a circle around the line to its centre, wider than the ball: the
  // triangle stands across that line and just holds it.
  float d2 = dot(centre, centre);
  if (d2 <= radius * radius * 1.0001) {  // the eye is inside
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    return;
  }
  float reach = radius * sqrt(d2 / (d2 - radius * radius));
  vec3 u = normalize(cross(centre, abs(centre.y) < 0.9 * sqrt(d2) ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0)));
  vec3 v = cross(u, normalize(centre));
  at = centre + reach * (position.x * u + position.y * v);
  gl_Position = projectionMatrix * vec4(at, 1.0);
}
