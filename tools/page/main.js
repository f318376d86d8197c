// SPDX-License-Identifier: MIT
// The page of a cluster or a scene: picture, slider, keys. What it shows is in data.js, how in spheres.js, mesh.js and
// contacts.js, the tables in panels.js. A frame is drawn only when something has changed.
import * as three from 'three';
import {OrbitControls} from 'three/addons/controls/OrbitControls.js';
import {colourings, meshErrors, painter, rangeOf} from './colours.js';
import {Contacts} from './contacts.js';
import {readData} from './data.js';
import {Surface} from './mesh.js';
import {showAccuracy, showLegend, showMarks, showPicked, showScene} from './panels.js';
import {drawRulers} from './rulers.js';
import {Spheres} from './spheres.js';

const element = (id) => document.getElementById(id);

function fail(text) {
  element('message').textContent = text;
  element('message').hidden = false;
}

class Page {
  constructor(data) {
    this.data = data;
    const {head} = data, canvas = element('canvas');
    this.renderer = new three.WebGLRenderer({canvas, antialias: data.n < 200000});
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.outputColorSpace = three.LinearSRGBColorSpace;  // the shaders write sRGB themselves
    this.renderer.autoClear = false;
    this.light = {skyward: {value: new three.Vector3()}};
    this.up = new three.Vector3(head.up === 'x' ? 1 : 0, head.up === 'y' ? 1 : 0, head.up === 'z' ? 1 : 0);
    this.camera = new three.PerspectiveCamera(26, 1, 0.01, 20);
    this.camera.up.copy(this.up);
    const most = 4096 * this.renderer.capabilities.maxTextureSize;
    if (data.n > most) throw new Error(`this browser draws ${most.toLocaleString('en')} spheres at most, and here are ${data.n.toLocaleString('en')}`);
    this.spheres = new Spheres(data, this.light);
    this.surface = data.triangles ? new Surface(data, this.light) : null;
    this.contacts = data.contacts ? new Contacts(data) : null;
    this.left = new three.Scene(), this.right = new three.Scene();
    this.right.add(this.spheres.object);
    if (this.surface) this.left.add(this.surface.shown);
    if (this.contacts) this.right.add(this.contacts.object);
    this.split = this.surface ? 0.5 : 0;
    this.frames = 0;  // in full
    this.budget = 200000;  // spheres while moving; follows the speed of the machine
    this.colour = head.colour, this.overlay = 'none', this.onlyBody = -1;

    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.moved());
    this.controls.minDistance = 0.02, this.controls.maxDistance = 12;
    this.describe();
    this.listen();
    const dark = matchMedia('(prefers-color-scheme: dark)');
    dark.addEventListener('change', () => this.setTheme(dark.matches));
    this.setTheme(dark.matches);
    this.fit();
    this.paint();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  describe() {
    const {head} = this.data;
    element('title').textContent = head.title;
    element('note').textContent = head.note;
    for (const [name, {label, has}] of Object.entries(colourings))
      if (has(this.data)) element('colour').add(new Option(label, name));
    element('colour').value = this.colour;
    element('split-label').hidden = element('overlay-label').hidden = !this.surface;
    element('rung-label').hidden = head.rungs.length < 2;
    head.rungs.forEach((r, k) => element('rung').add(new Option(`${r.name} (${r.count.toLocaleString('en')})`, k)));
    element('rung').value = String(head.rung);
    showAccuracy(this.data, head.rung);
    showMarks(this.data);
    showScene(this.data, this.contacts);
  }

  listen() {
    const canvas = element('canvas');
    let down = null;
    canvas.addEventListener('pointerdown', (e) => { down = e.isPrimary ? {x: e.clientX, y: e.clientY} : null; });
    canvas.addEventListener('pointerup', (e) => {
      if (down && Math.hypot(e.clientX - down.x, e.clientY - down.y) < 6) this.click(e.clientX, e.clientY);
      down = null;
    });
    canvas.addEventListener('webglcontextlost', () => fail('The browser took the graphics context away: load the page again.'));
    element('split').addEventListener('input', (e) => this.setSplit(Number(e.target.value) / 100));
    element('colour').addEventListener('change', (e) => { this.colour = e.target.value; this.paint(); });
    element('overlay').addEventListener('change', (e) => this.setOverlay(e.target.value));
    element('detail').addEventListener('change', () => this.ask());
    element('rung').addEventListener('change', (e) => {
      this.spheres.setRung(Number(e.target.value));
      showAccuracy(this.data, this.spheres.rung);
      this.pick(-1);
      this.paint();
    });
    element('fit').addEventListener('click', () => this.fit());
    element('theme').addEventListener('click', () => this.setTheme(!this.dark));
    element('only-body').addEventListener('input', (e) => {
      this.onlyBody = e.target.value === '' ? -1 : Number(e.target.value);
      this.paint();
    });
    element('show-contacts').addEventListener('change', (e) => { this.contacts.object.visible = e.target.checked; this.ask(); });
    window.addEventListener('keydown', (e) => this.key(e));
  }

  key(e) {
    // A field, a list or the slider in use keeps its own keys.
    if (e.ctrlKey || e.metaKey || e.altKey || /^(INPUT|SELECT|BUTTON|SUMMARY)$/.test(e.target.tagName)) return;
    const turn = 5, move = 0.04, arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1]};
    if (arrows[e.key]) {
      const [x, y] = arrows[e.key];
      if (e.shiftKey) this.shift(move * x, move * y);
      else this.turn(turn * x, turn * y);
    } else {
      const next = (id) => {
        const list = element(id);
        if (!list.options.length || list.parentElement.hidden) return;
        list.selectedIndex = (list.selectedIndex + 1) % list.options.length;
        list.dispatchEvent(new Event('change'));
      };
      const panel = (id) => { if (!element(id).hidden) element(id).open = !element(id).open; };
      const step = (by) => {
        const {first, count} = this.spheres, at = this.spheres.picked;
        if (count) this.pick(at < 0 ? (by > 0 ? first : first + count - 1) : first + ((at - first + by + count) % count));
      };
      const actions = {
        '+': () => this.zoom(0.8), '=': () => this.zoom(0.8), '-': () => this.zoom(1.25),
        '[': () => this.setSplit(this.split - 0.05), ']': () => this.setSplit(this.split + 0.05),
        1: () => this.setSplit(1), 2: () => this.setSplit(0.5), 3: () => this.setSplit(0),
        c: () => next('colour'), o: () => next('overlay'), d: () => next('detail'), l: () => next('rung'), f: () => this.fit(), b: () => this.setTheme(!this.dark),
        n: () => step(1), p: () => step(-1), Escape: () => this.pick(-1),
        a: () => panel('accuracy-panel'), '?': () => panel('help-panel'),
      };
      const action = Object.hasOwn(actions, e.key) ? actions[e.key] : null;
      if (!action) return;
      action();
    }
    e.preventDefault();
  }

  // Degrees around the axis that points up, and above the ground.
  turn(around, above) {
    const toUp = new three.Quaternion().setFromUnitVectors(this.up, new three.Vector3(0, 1, 0));
    const offset = this.camera.position.clone().sub(this.controls.target).applyQuaternion(toUp);
    const s = new three.Spherical().setFromVector3(offset);
    s.theta -= three.MathUtils.degToRad(around);
    s.phi = three.MathUtils.clamp(s.phi - three.MathUtils.degToRad(above), 0.01, Math.PI - 0.01);
    this.camera.position.copy(offset.setFromSpherical(s).applyQuaternion(toUp.invert()).add(this.controls.target));
    this.controls.update();
    this.moved();
  }
  zoom(factor) {
    const offset = this.camera.position.clone().sub(this.controls.target);
    const distance = three.MathUtils.clamp(offset.length() * factor, this.controls.minDistance, this.controls.maxDistance);
    this.camera.position.copy(offset.setLength(distance).add(this.controls.target));
    this.controls.update();
    this.moved();
  }
  shift(x, y) {
    const by = new three.Vector3(x, y, 0).applyQuaternion(this.camera.quaternion)
      .multiplyScalar(this.camera.position.distanceTo(this.controls.target));
    this.camera.position.add(by), this.controls.target.add(by);
    this.controls.update();
    this.moved();
  }
  // Back from where the camera stands first until every point is in the frame. On each of its four sides the point that
  // lies farthest out decides; left and right together give the eye's place across and one distance, as do up and down.
  fit() {
    const {azimuth, elevation, up} = this.data.head, rad = three.MathUtils.degToRad, {centers, radii, points} = this.data;
    const p = [Math.cos(rad(elevation)) * Math.cos(rad(azimuth)), Math.cos(rad(elevation)) * Math.sin(rad(azimuth)), Math.sin(rad(elevation))];
    const back = new three.Vector3(...(up === 'y' ? [p[1], p[2], p[0]] : up === 'x' ? [p[2], p[0], p[1]] : p));
    const right = this.up.clone().cross(back).normalize(), above = back.clone().cross(right);
    const margin = 1.2, ty = Math.tan(rad(this.camera.fov / 2)) / margin, tx = ty * this.camera.aspect;
    const below = ty * Math.max(0.5, 1 - 96 / element('canvas').clientHeight);  // the lower side ends above the scale bar
    const most = [-Infinity, -Infinity, -Infinity, -Infinity];
    const reach = (a, k, r) => {
      const x = a[k] * right.x + a[k + 1] * right.y + a[k + 2] * right.z;
      const y = a[k] * above.x + a[k + 1] * above.y + a[k + 2] * above.z;
      const z = a[k] * back.x + a[k + 1] * back.y + a[k + 2] * back.z;
      const rx = r * Math.hypot(1, tx), ry = r * Math.hypot(1, ty), rb = r * Math.hypot(1, below);
      most[0] = Math.max(most[0], x + tx * z + rx), most[1] = Math.max(most[1], -x + tx * z + rx);
      most[2] = Math.max(most[2], y + ty * z + ry), most[3] = Math.max(most[3], -y + below * z + rb);
    };
    for (let k = 0; k < this.data.n; k++) reach(centers, 3 * k, radii[k]);
    for (let k = 0; points && k < points.length; k += 3) reach(points, k, 0);
    const distance = Math.max((most[0] + most[1]) / (2 * tx), (most[2] + most[3]) / (ty + below), 0.05);
    const across = right.multiplyScalar((most[0] - most[1]) / 2).add(above.multiplyScalar((most[2] - most[3] - (ty - below) * distance) / 2));
    this.controls.target.copy(across);
    this.camera.position.copy(across).addScaledVector(back, distance);
    this.controls.update();
    this.moved();
    this.fitted = true;
  }

  setTheme(dark) {
    this.dark = dark;
    document.documentElement.dataset.theme = dark ? 'dark' : 'light';
    const {palette} = this.data.head, colour = dark ? palette.dark : palette.background;
    this.renderer.setClearColor(new three.Color(`rgb(${colour.join(',')})`).convertLinearToSRGB(), 1);
    this.ask();
  }
  setSplit(share) {
    if (!this.surface) return;
    this.split = three.MathUtils.clamp(Math.round(share * 100) / 100, 0, 1);
    element('split').value = String(Math.round(this.split * 100));
    this.ask();
  }
  setOverlay(what) {
    this.overlay = what;
    this.right.remove(this.surface.glass);
    if (this.surface.lines) this.right.remove(this.surface.lines);
    if (what === 'glass') this.right.add(this.surface.glass);
    if (what === 'wire') this.right.add(this.surface.wire);
    this.ask();
  }
  paint() {
    const {body} = this.data, only = this.onlyBody;
    this.spheres.paint(painter(this.data, this.colour, this.spheres), (k) => only >= 0 && (!body || body[k] !== only));
    const errors = meshErrors(this.data, this.colour, this.spheres.rung);
    if (this.surface) this.surface.paint(errors, errors ? rangeOf(this.data, this.colour, this.spheres).high : 0);
    showLegend(this.data, this.colour, this.spheres);
    this.ask();
  }
  pick(k) {
    this.spheres.pick(k);
    showPicked(this.data, this.contacts, k);
    this.ask();
  }
  // Left of the divider only the mesh is seen, so there is no sphere to pick.
  click(x, y) {
    element('canvas').focus({preventScroll: true});
    const box = element('canvas').getBoundingClientRect();
    const u = (x - box.left) / box.width, v = (y - box.top) / box.height;
    if (u < this.split) return this.pick(-1);
    const ray = new three.Raycaster();
    ray.setFromCamera(new three.Vector2(2 * u - 1, 1 - 2 * v), this.camera);
    this.pick(this.spheres.under(ray.ray.origin, ray.ray.direction));
  }

  resize() {
    const box = element('canvas').getBoundingClientRect();
    if (!box.width || !box.height) return;
    const before = this.camera.aspect;
    this.renderer.setSize(box.width, box.height, false);
    this.camera.aspect = box.width / box.height;
    this.camera.updateProjectionMatrix();
    if (this.fitted && before !== this.camera.aspect) this.fit();
    this.ask();
  }
  moved() {
    this.fitted = false;
    this.restless = true;  // until nothing has moved for a quarter of a second
    clearTimeout(this.settle);
    this.settle = setTimeout(() => { this.restless = false; this.ask(); }, 250);
    this.ask();
  }
  // One frame at a time: while the graphics card works on one, whatever else is asked for makes one more.
  ask() {
    this.asked = true;
    if (this.waiting || this.busy) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.asked = false; this.draw(); });
  }
  // Calls back when the graphics card has done what it was told.
  whenDone(done) {
    const gl = this.renderer.getContext(), fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const look = () => {
      if (fence && !gl.isContextLost() && gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) return void setTimeout(look, 3);
      if (fence) gl.deleteSync(fence);
      done();
    };
    setTimeout(look, 0);
  }

  draw() {
    const detail = element('detail').value, total = this.spheres.count;
    const coarse = detail === 'auto' && this.restless && total > this.budget;
    this.spheres.draw(detail === 'auto' ? (coarse ? this.budget : total) : total * Number(detail));
    const began = performance.now();
    const {renderer, camera} = this, size = renderer.getSize(new three.Vector2());
    camera.updateMatrixWorld();
    this.light.skyward.value.copy(this.up).transformDirection(camera.matrixWorldInverse);
    const distance = camera.position.length();
    camera.near = Math.max(0.002, distance - 0.75), camera.far = distance + 0.75;
    camera.updateProjectionMatrix();
    const edge = Math.round(size.x * this.split);
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    const part = (scene, x, width) => {
      if (width <= 0) return;
      renderer.setScissor(x, 0, width, size.y);
      renderer.render(scene, camera);
    };
    part(this.left, 0, edge);
    part(this.right, edge, size.x - edge);
    element('divider').hidden = edge <= 0 || edge >= size.x;
    element('divider').style.left = edge + 'px';
    const far = Math.abs(new three.Vector3().applyMatrix4(camera.matrixWorldInverse).z);
    drawRulers(element('rulers'), this.data.head, camera, size.y / (2 * Math.tan(three.MathUtils.degToRad(camera.fov / 2)) * far * this.data.head.scale));
    element('drawn').textContent = `${this.spheres.drawn.toLocaleString('en')} of ${total.toLocaleString('en')} spheres`;
    this.busy = true;
    this.whenDone(() => {
      this.busy = false;
      if (coarse) {  // as many as make 30 frames a second
        const factor = three.MathUtils.clamp(33 / (performance.now() - began), 0.5, 1.5);
        this.budget = three.MathUtils.clamp(Math.round(this.budget * factor), 5000, 1e7);
      } else {
        this.frames++;
      }
      if (this.asked) this.ask();
    });
  }

  // For tests and the console: what is on the screen, in numbers.
  state() {
    this.camera.updateMatrixWorld();
    return {
      spheres: this.data.n, drawn: this.spheres.drawn, picked: this.spheres.picked, split: this.split, colour: this.colour,
      overlay: this.overlay, dark: this.dark, rung: this.spheres.rung, frames: this.frames, busy: Boolean(this.busy || this.waiting), contacts: this.contacts ? this.contacts.total : 0,
      view: this.camera.matrixWorldInverse.toArray(), projection: this.camera.projectionMatrix.toArray(),
    };
  }
}

try {
  const page = new Page(readData());
  window.padder = {
    state: () => page.state(),
    // Sphere k in the page's frame: centre x, y, z, radius; and its colour.
    sphere: (k) => [...page.data.centers.subarray(3 * k, 3 * k + 3), page.data.radii[k]],
    colour: (k) => page.spheres.colourOf(k),
  };
} catch (e) {
  console.error(e);
  fail(/WebGL/.test(e.message) ? 'This browser offers no WebGL 2: open the page in another one.' : e.message);
}
