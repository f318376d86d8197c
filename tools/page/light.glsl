// SPDX-License-Identifier: MIT
// Sky above, a lamp over the left shoulder, a soft highlight. The colour comes linear and goes as sRGB: powers are dear
// without a graphics card, so that of the colour is taken once a sphere.
uniform vec3 skyward;  // up, in the camera's frame

vec3 lit(vec3 linear, vec3 normal, vec3 along) {
  vec3 lamp = normalize(vec3(-0.65, 0.45, 0.62));
  float sky = 0.42 + 0.24 * dot(normal, skyward);
  float key = max(dot(normal, lamp), 0.0);
  float shine = max(dot(normal, normalize(lamp - along)), 0.0);
  shine *= shine, shine *= shine, shine *= shine;  // to the 8th
  float square = shine * shine;
  shine *= square * square;  // to the 40th
  // To 1 / 2.2 by roots, 1.3 of 255 off at most.
  vec3 root = sqrt(min(linear * (sky + 0.66 * key) + 0.07 * shine, 1.0)), quarter = sqrt(root);
  return 0.83526 * root + 0.21156 * quarter - 0.04682 * sqrt(quarter);
}
