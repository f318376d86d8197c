// SPDX-License-Identifier: MIT
precision highp float;
uniform mat4 projectionMatrix;
flat in vec4 ball;
flat in vec3 colour;
in vec3 at;
out vec4 pixel;

vec3 lit(vec3 albedo, vec3 normal, vec3 along);

void main() {
  vec3 along = normalize(at);
  float middle = dot(along, ball.xyz);
  vec3 beside = ball.xyz - middle * along;  // not |c|^2 - b^2, which cancels for a small ball far away
  float q = ball.w * ball.w - dot(beside, beside);
  if (q < 0.0) discard;
  vec3 hit = (middle - sqrt(q)) * along;
  gl_FragDepth = 0.5 - 0.5 * (projectionMatrix[2].z + projectionMatrix[3].z / hit.z);
  pixel = vec4(lit(colour, (hit - ball.xyz) / ball.w, along), 1.0);
}
