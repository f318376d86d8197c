// SPDX-License-Identifier: MIT
// One colour a sphere, by the palette in the head; the same rules as padding/view/view.cpp.

export const colourings = {
  family: {label: 'family', has: () => true},
  radius: {label: 'radius', has: (d) => d.n > 0},
  protrusion: {label: 'protrusion', has: (d) => d.protrusion !== null},
  gap: {label: 'gap', has: (d) => d.gap !== null},
  triangle: {label: 'source triangle', has: (d) => d.triangle !== null},
  body: {label: 'body', has: (d) => d.body !== null},
};

export const familyOf = (d, k) => (d.family ? d.family[k] : d.head.family);

export function kindColour(head, number) {
  const {none, kinds} = head.palette;
  return number === 0 ? none : kinds[(number - 1) % kinds.length];
}

export function rampColour(head, t) {
  const ramp = head.palette.ramp, x = Math.min(1, Math.max(0, t)) * (ramp.length - 1);
  const k = Math.min(Math.floor(x), ramp.length - 2);
  return ramp[k].map((v, i) => Math.round(v + (x - k) * (ramp[k + 1][i] - v)));
}

function triangleColour(head, triangle) {
  if (triangle < 0) return head.palette.none;
  const turns = (triangle * 0.6180339887498949) % 1;
  return [0, 4, 2].map((shift) => {
    const x = Math.abs(((turns * 6 + shift) % 6) - 3);
    return Math.round(255 * (0.28 + 0.57 * Math.min(1, Math.max(0, x - 1))));
  });
}

// The error at each point of the finer mesh, for the level of detail that is shown; null where the mesh has no colours of it.
export function meshErrors(d, by, rung) {
  const gap = by === 'gap' || by === 'protrusion' ? d.meshGap[rung] : null;
  return gap && gap.map((v) => Math.max(0, by === 'gap' ? v : -v));
}

// The lengths a ramp runs over, or null where the colours are of kinds. Errors start at 0, and the range holds those of the mesh.
export function rangeOf(d, by, {rung, first, count}) {
  const all = by === 'radius' ? d.radii : by === 'protrusion' ? d.protrusion : by === 'gap' ? d.gap : null;
  if (!all) return null;
  const unit = by === 'radius' ? d.head.scale : 1;
  let low = by === 'radius' ? Infinity : 0, high = 0;
  for (let k = first; k < first + count; k++) low = Math.min(low, all[k]), high = Math.max(high, all[k]);
  for (const v of meshErrors(d, by, rung) ?? []) high = Math.max(high, v);
  return {low: low * unit, high: high * unit, values: all, unit};
}

// Red, green and blue of sphere k in the low three bytes of a word.
export function painter(d, by, level) {
  const word = ([r, g, b]) => (r | (g << 8) | (b << 16)) >>> 0;
  const range = rangeOf(d, by, level);
  if (range) {
    const steps = 256, table = Uint32Array.from({length: steps}, (_, k) => word(rampColour(d.head, k / (steps - 1))));
    const {low, high, values, unit} = range, factor = high > low ? (steps - 1) / (high - low) : 0;
    return (k) => table[Math.round((values[k] * unit - low) * factor)];
  }
  if (by === 'triangle') return (k) => word(triangleColour(d.head, d.triangle[k]));
  const kinds = d.head.palette.kinds.map(word), none = word(d.head.palette.none);
  const kind = (number) => (number === 0 ? none : kinds[(number - 1) % kinds.length]);
  if (by === 'body') return (k) => kind(d.body[k] < d.head.bodies.length ? d.body[k] + 1 : 0);
  return (k) => kind(familyOf(d, k));
}
