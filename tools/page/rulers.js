// SPDX-License-Identifier: MIT
// The axes and a scale bar, in the lower left corner of the picture.
import {number} from './data.js';

const AXES = ['#d04038', '#409850', '#4a86cc'];  // x, y, z

// The largest of 1, 2 and 5 times a power of ten that is not above `most`.
function roundLength(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * ([5, 2].find((step) => step * power <= most) ?? 1);
}

// `pixels` is how many one of the user's lengths takes at the middle of the view.
export function drawRulers(svg, head, camera, pixels) {
  const view = camera.matrixWorldInverse.elements, at = [34, 34], reach = 22, parts = [];
  const axes = [0, 1, 2].map((k) => ({k, x: view[4 * k], y: -view[4 * k + 1], z: view[4 * k + 2]}));
  for (const {k, x, y} of axes.sort((a, b) => a.z - b.z)) {
    const end = [at[0] + reach * x, at[1] + reach * y], name = [at[0] + (reach + 8) * x, at[1] + (reach + 8) * y + 4];
    parts.push(`<path d="M${at.join(' ')}L${end.join(' ')}" stroke="${AXES[k]}" stroke-width="2" stroke-linecap="round"/>`,
      `<text x="${name[0]}" y="${name[1]}" text-anchor="middle" style="fill:${AXES[k]}">${'xyz'[k]}</text>`);
  }
  const length = roundLength(Math.min(140, svg.clientWidth / 4) / pixels), width = length * pixels;
  if (Number.isFinite(width))
    parts.push(`<path d="M80 44v8M80 48h${width}m0 -4v8" stroke="currentColor" stroke-width="1.5" fill="none"/>`, '<text x="80" y="38"></text>');
  svg.innerHTML = parts.join('');
  if (Number.isFinite(width)) svg.lastElementChild.textContent = `${number(Number(length.toPrecision(3)))}${head.unit ? ' ' + head.unit : ''}`;
}
