// Sky above, a lamp over the left shoulder, a soft highlight; colours come and go as sRGB.
uniform vec3 skyward;  // up, in the camera's frame

vec3 lit(vec3 albedo, vec3 normal, vec3 along) {
  vec3 lamp = normalize(vec3(-0.65, 0.45, 0.62));
  vec3 linear = pow(albedo, vec3(2.2));
  float sky = 0.42 + 0.24 * dot(normal, skyward);
  float key = max(dot(normal, lamp), 0.0);
  float shine = pow(max(dot(normal, normalize(lamp - along)), 0.0), 40.0);
  return pow(min(linear * (sky + 0.66 * key) + 0.07 * shine, 1.0), vec3(1.0 / 2.2));
}
