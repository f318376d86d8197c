// SPDX-License-Identifier: MIT
// The tables beside the picture.
import {colourings, familyOf, kindColour, rampColour, rangeOf} from './colours.js';
import {number, placed} from './data.js';

const element = (id) => document.getElementById(id);
const css = (c) => `rgb(${c.join(' ')})`;

function fill(table, rows) {
  table.replaceChildren(...rows.map(([name, value]) => {
    const row = document.createElement('tr');
    for (const text of [name, value]) row.appendChild(document.createElement('td')).textContent = text;
    return row;
  }));
}

const withUnit = (head, v) => number(v) + (head.unit ? ' ' + head.unit : '');
const withShare = (head, v) => `${withUnit(head, v)} (${number(Number(((100 * v) / head.diagonal).toPrecision(3)))} %)`;

// Families that a mask rules out, as words.
function maskWords(mask) {
  const families = [];
  for (let k = 0; k < 32; k++) if ((mask >>> k) & 1) families.push(k + 1);
  return families.length ? 'not with ' + families.join(', ') : 'none';
}

export function showPicked(data, contacts, k) {
  element('picked-panel').hidden = k < 0;
  if (k < 0) return;
  const {head} = data, {centers, radii} = data;
  element('picked-index').textContent = String(k - data.head.rungs.find((r) => k < r.first + r.count).first);  // of its level
  const p = placed(head, centers[3 * k], centers[3 * k + 1], centers[3 * k + 2]);
  const rows = [
    ['x', withUnit(head, p[0])], ['y', withUnit(head, p[1])], ['z', withUnit(head, p[2])],
    ['radius', withShare(head, radii[k] * head.scale)],
    ['family', familyOf(data, k) === 0 ? 'none' : String(familyOf(data, k))],
  ];
  const b = data.body ? data.body[k] : -1, body = head.bodies[b];
  rows.push(['mask', maskWords(body ? body[4] : head.mask)]);
  if (data.triangle && data.triangle[k] >= 0) rows.push(['source triangle', String(data.triangle[k])]);
  if (data.protrusion) rows.push(['protrusion below', withShare(head, data.protrusion[k])]);
  if (data.gap) rows.push(['gap nearby', withShare(head, data.gap[k])]);
  if (data.body) rows.push(['body', body ? `${b} (${head.clusters[body[0]]})` : 'loose']);
  if (body) rows.push(['sphere of the body', String(k - body[1])]);
  if (contacts) {
    const found = contacts.of(k);
    rows.push(['contacts', String(found.length)]);
    for (const c of found.slice(0, 12)) {
      const other = contacts.pairs[2 * c] === k ? contacts.pairs[2 * c + 1] : contacts.pairs[2 * c];
      rows.push([`with ${other}`, 'depth ' + withUnit(head, data.contacts[7 * c + 6])]);
    }
    if (found.length > 12) rows.push(['', `and ${found.length - 12} more`]);
  }
  fill(element('picked'), rows);
}

// What stands behind the largest protrusion and gap, by what counts as body in their proof.
const LARGEST = {
  input: 'proved against the input', filled: 'proved; the patches count as surface', wrap: 'proved; what the wrap encloses counts as body',
};

// A line of a legend: a square of the colour, and the text.
function swatchRow(colour, text) {
  const row = document.createElement('div'), swatch = row.appendChild(document.createElement('span'));
  swatch.className = 'swatch', swatch.style.background = css(colour);
  row.append(text);
  return row;
}

// What repair did to the surface: a colour and the area of each kind.
export function showMarks({head, marks}) {
  element('marks-panel').hidden = !marks.length;
  const kinds = new Map();
  for (const {name, colour, area} of marks) {
    const kind = kinds.get(name) ?? {colour, area: 0, count: 0};
    kinds.set(name, kind);
    kind.area += area, kind.count++;
  }
  element('marks').replaceChildren(...[...kinds].map(([name, {colour, area, count}]) => swatchRow(colour,
    `${name}: ${count.toLocaleString('en')}, area ${number(Number(area.toPrecision(3)))}${head.unit ? ` ${head.unit}²` : ''}`)));
}

// A bar of colours with its lengths below it.
function rampOf(head, {low, high}, shares) {
  const bar = document.createElement('div'), ends = document.createElement('div');
  bar.className = 'bar', ends.className = 'ends';
  const stops = Array.from({length: 9}, (_, k) => css(rampColour(head, k / 8)));
  bar.style.background = `linear-gradient(to right, ${stops.join(', ')})`;
  const rounded = (v) => Number(v.toPrecision(4));
  for (const text of [withUnit(head, rounded(low)), shares ? withShare(head, rounded(high)) : withUnit(head, rounded(high))])
    ends.appendChild(document.createElement('span')).textContent = text;
  return [bar, ends];
}

const WHERE = {
  protrusion: 'On the mesh: how far spheres stand out there, at least. A sphere has the colour of the most that it can stand out.',
  gap: 'On the mesh: how far it lies outside the spheres. A sphere has the colour of the largest gap that it is nearest to.',
};

// Of the level of detail that is shown: `count` spheres from `first` on.
export function showLegend(data, by, level) {
  const {first, count} = level;
  const {head} = data, box = element('legend');
  element('legend-title').textContent = 'Colour: ' + colourings[by].label;
  box.replaceChildren();
  const range = rangeOf(data, by, level);
  if (range) {
    box.append(...rampOf(head, range, by !== 'radius'));
    if (WHERE[by]) box.appendChild(document.createElement('p')).textContent = WHERE[by];
    return;
  }
  const line = (colour, text) => box.appendChild(swatchRow(colour, text));
  if (by === 'triangle') return void (box.textContent = 'one colour for each triangle of the remeshed surface');
  const counts = new Map();
  for (let k = first; k < first + count; k++) {
    const kind = by === 'body' ? (data.body[k] < head.bodies.length ? data.body[k] + 1 : 0) : familyOf(data, k);
    counts.set(kind, (counts.get(kind) ?? 0) + 1);
  }
  const kinds = [...counts.keys()].sort((a, b) => a - b);
  for (const kind of kinds.slice(0, 16)) {
    const name = by === 'body' ? (kind ? `body ${kind - 1} (${head.clusters[head.bodies[kind - 1][0]]})` : 'loose')
                               : kind ? `family ${kind}` : 'no family';
    line(kindColour(head, kind), `${name}: ${counts.get(kind).toLocaleString('en')}`);
  }
  if (kinds.length > 16) box.appendChild(document.createElement('div')).textContent = `and ${kinds.length - 16} more`;
}

export function showAccuracy({head}, rung) {
  const a = head.rungs.length > 1 ? head.rungs[rung].accuracy : head.accuracy;
  element('accuracy-panel').hidden = !a;
  if (!a) return;
  const share = (v) => `${number(Number((100 * v).toPrecision(4)))} %`;
  fill(element('accuracy'), [
    ['diagonal', withUnit(head, head.diagonal)],
    ['protrusion, largest', withShare(head, a.protrusion_max)], ['protrusion, mean', withShare(head, a.protrusion_mean)],
    ['protrusion, 95 %', withShare(head, a.protrusion_p95)],
    ['gap, largest', withShare(head, a.gap_max)], ['gap, mean', withShare(head, a.gap_mean)], ['gap, 95 %', withShare(head, a.gap_p95)],
    ['surface covered', share(a.coverage)],
    ['normals off, mean', number(Number(a.normal_error_mean_deg.toPrecision(4))) + '°'],
    ['normals off, 95 %', number(Number(a.normal_error_p95_deg.toPrecision(4))) + '°'],
    ['union / body volume', number(Number(a.volume_ratio.toPrecision(5)))],
    ['largest values', LARGEST[a.proved_against] ?? 'measured'],
    ['certified', a.certified ? 'yes' : 'no'],
  ]);
}

export function showScene(data, contacts) {
  const {head} = data;
  if (!head.bodies.length && !contacts) return;
  element('scene-panel').hidden = false;
  const families = new Set(data.family ?? [head.family]);
  const rows = [['spheres', data.n.toLocaleString('en')], ['bodies', head.bodies.length.toLocaleString('en')],
                ['families', families.size.toLocaleString('en')]];
  if (contacts) {
    rows.push(['contacts', contacts.total.toLocaleString('en')], ['deepest', withUnit(head, contacts.deepest)]);
    if (contacts.drawn < contacts.total) rows.push(['arrows drawn', contacts.drawn.toLocaleString('en')]);
  }
  fill(element('scene'), rows);
  element('contacts-legend').hidden = !contacts || !contacts.total;
  if (contacts) element('contacts-ramp').replaceChildren(...rampOf(head, {low: 0, high: contacts.deepest}, false));
  element('only-body').max = String(head.bodies.length - 1);
  element('only-body').parentElement.hidden = !head.bodies.length;
  element('show-contacts').parentElement.hidden = !contacts;
}
