// SPDX-License-Identifier: MIT
// The page that plays a run, without its data: WebGL 2 and no library. Each sphere is a point whose fragments
// are lit and given the depth of a sphere.
#pragma once

namespace padder::settle {

inline constexpr char kPageTemplate[] = R"PAGE(<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>settle</title><style>
html,body{margin:0;height:100%;background:#f4f2ee;color:#222;font:14px system-ui,sans-serif;overflow:hidden}
canvas{width:100%;height:100%;display:block;touch-action:none}
#bar{position:fixed;left:0;right:0;bottom:0;padding:8px 12px;background:#fffc;display:flex;gap:10px;align-items:center}
#bar input{flex:1}#title{position:fixed;left:12px;top:8px}button{font:inherit}
</style></head><body><canvas id="view"></canvas><div id="title"></div>
<div id="bar"><button id="play" title="space">Pause</button><input id="time" type="range" min="0" value="0" aria-label="time"><span id="now"></span></div>
<script>
"use strict";
const head = @HEAD@;
const bytes = (text) => {
  const from = atob(text), to = new Uint8Array(from.length);
  for (let k = 0; k < to.length; k++) to[k] = from.charCodeAt(k);
  return to.buffer;
};
const packed = [@FRAMES@], frames = [], radii = new Float32Array(bytes("@RADII@")), movers = new Uint32Array(bytes("@MOVERS@"));
const n = head.spheres, count = head.times.length, canvas = document.getElementById("view");
document.title = head.title;
const counted = (n, one, many) => n + " " + (n === 1 ? one : many);
document.getElementById("title").textContent = head.title + ": " + counted(head.all, "sphere", "spheres") +
  (head.bodies ? ", " + counted(head.bodies, "body", "bodies") : "") + (n < head.all ? "; those that are hidden throughout are left out, " + n + " are here" : "");
const gl = canvas.getContext("webgl2", {antialias: true, preserveDrawingBuffer: true});
if (!gl || !window.DecompressionStream)
  document.getElementById("title").textContent = "This page needs WebGL 2 and a browser of 2023 or later: open it in another one.";
const shader = (type, text) => {
  const s = gl.createShader(type);
  gl.shaderSource(s, text), gl.compileShader(s);
  if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
  return s;
};
const program = gl.createProgram();
gl.attachShader(program, shader(gl.VERTEX_SHADER, `#version 300 es
in vec3 place; in float radius; in vec3 colour;
uniform mat4 view; uniform vec3 low, size; uniform float focal, aspect, height;
out vec3 tint; out vec3 center; out float ball;
void main() {
  vec4 p = view * vec4(low + place * size, 1.0);
  tint = colour; center = p.xyz; ball = radius;
  gl_Position = vec4(p.x * focal / aspect, p.y * focal, 0.0, -p.z);
  gl_PointSize = 1.05 * height * focal * radius / max(-p.z - radius, 1e-6);
}`));
gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `#version 300 es
precision highp float;
in vec3 tint; in vec3 center; in float ball;
uniform float near, far;
out vec4 shown;
void main() {
  vec2 q = (gl_PointCoord * 2.0 - 1.0) * vec2(1.05, -1.05);
  float r2 = dot(q, q);
  if (r2 > 1.0 || -center.z < near) discard;
  vec3 normal = vec3(q, sqrt(1.0 - r2));
  float light = 0.35 + 0.65 * max(dot(normal, normalize(vec3(0.4, 0.7, 0.8))), 0.0);
  float z = -(center.z + ball * normal.z);
  gl_FragDepth = clamp(log(z / near) / log(far / near), 0.0, 1.0);
  shown = vec4(tint * light, 1.0);
}`));
gl.linkProgram(program);
gl.useProgram(program);
const at = (name) => gl.getUniformLocation(program, name);
const feed = (name, data, size, type, normalized) => {
  const buffer = gl.createBuffer(), slot = gl.getAttribLocation(program, name);
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
  gl.enableVertexAttribArray(slot), gl.vertexAttribPointer(slot, size, type, normalized, 0, 0);
  return buffer;
};
// Frames are there one after the other: each says by how many steps a sphere has moved since the one before.
(async () => {
  let before = new Uint16Array(3 * n);
  for (const text of packed) {
    const moved = new Uint8Array(await new Response(new Blob([bytes(text)]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
    const now = new Uint16Array(3 * n);
    for (let a = 0, q = 0; a < 3; a++)
      for (let k = a; k < 3 * n; k += 3, q++) {
        const folded = moved[q] | moved[q + 3 * n] << 8;
        now[k] = before[k] + (folded >>> 1 ^ -(folded & 1));
      }
    frames.push(before = now);
  }
})();
const places = feed("place", new Uint16Array(3 * n), 3, gl.UNSIGNED_SHORT, true);
feed("radius", radii, 1, gl.FLOAT, false);
const colours = new Uint8Array(3 * n), kinds = [[196, 78, 82], [76, 114, 176], [85, 168, 104], [221, 160, 66], [129, 114, 178], [100, 181, 205]];
for (let k = 0; k < n; k++) {
  const m = movers[k], shade = 0.8 + 0.2 * ((m * 2654435761 >>> 16) % 256) / 255;
  const base = m < head.bodies ? kinds[m % kinds.length] : [214, 186, 140];
  for (let c = 0; c < 3; c++) colours[3 * k + c] = base[c] * shade;
}
feed("colour", colours, 3, gl.UNSIGNED_BYTE, true);
const size = head.high.map((h, a) => h - head.low[a]), reach = Math.hypot(...size);
const target = head.low.map((l, a) => l + size[a] / 2), eye = {around: -1.05, above: 0.35, far: 0.65 * reach};
const bar = document.getElementById("time"), play = document.getElementById("play"), now = document.getElementById("now");
bar.max = count - 1;
let frame = 0, shownFrame = -1, playing = count > 1, dirty = true, last = 0;
function draw() {
  const w = canvas.clientWidth * devicePixelRatio | 0, h = canvas.clientHeight * devicePixelRatio | 0;
  if (canvas.width !== w || canvas.height !== h) canvas.width = w, canvas.height = h, dirty = true;
  const k = Math.min(frame | 0, frames.length - 1);
  if (k < 0) return;
  if (k !== shownFrame) {
    gl.bindBuffer(gl.ARRAY_BUFFER, places);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, frames[k]);
    shownFrame = k, dirty = true, bar.value = k, now.textContent = head.times[k].toFixed(3) + " s";
  }
  if (!dirty) return;
  dirty = false;
  const ca = Math.cos(eye.around), sa = Math.sin(eye.around), cb = Math.cos(eye.above), sb = Math.sin(eye.above);
  const back = [cb * ca, cb * sa, sb], right = [-sa, ca, 0], up = [-sb * ca, -sb * sa, cb];
  const from = target.map((t, a) => t + eye.far * back[a]), dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  gl.viewport(0, 0, w, h);
  gl.clearColor(0.957, 0.949, 0.933, 1), gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT), gl.enable(gl.DEPTH_TEST);
  gl.uniformMatrix4fv(at("view"), false, [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0,
                                          -dot(right, from), -dot(up, from), -dot(back, from), 1]);
  gl.uniform3fv(at("low"), head.low), gl.uniform3fv(at("size"), head.step.map((s) => 65535 * s));
  gl.uniform1f(at("focal"), 1.8), gl.uniform1f(at("aspect"), w / h), gl.uniform1f(at("height"), h);
  gl.uniform1f(at("near"), reach * 1e-3), gl.uniform1f(at("far"), eye.far + 4 * reach);
  gl.drawArrays(gl.POINTS, 0, n);
}
function tick(t) {
  if (playing) frame = (frame + Math.min(t - last, 100) * 0.03) % count;
  last = t, draw(), requestAnimationFrame(tick);
}
const toggle = () => { playing = !playing, play.textContent = playing ? "Pause" : "Play"; };
play.onclick = toggle;
bar.oninput = () => { playing = false, play.textContent = "Play", frame = +bar.value; };
onkeydown = (e) => {
  if (e.key === " ") e.preventDefault(), toggle();
  if (e.key === "ArrowRight") frame = Math.min(frame + 1, count - 1);
  if (e.key === "ArrowLeft") frame = Math.max(frame - 1, 0);
};
canvas.onpointerdown = (e) => canvas.setPointerCapture(e.pointerId);
canvas.onpointermove = (e) => {
  if (!e.buttons) return;
  eye.around -= 0.006 * e.movementX, eye.above = Math.max(n < head.all ? 0 : -1.5, Math.min(1.5, eye.above + 0.006 * e.movementY)), dirty = true;
};
canvas.addEventListener("wheel", (e) => { e.preventDefault(), eye.far *= Math.exp(0.001 * e.deltaY), dirty = true; }, {passive: false});
play.textContent = playing ? "Pause" : "Play";
requestAnimationFrame(tick);
</script></body></html>
)PAGE";

}  // namespace padder::settle
