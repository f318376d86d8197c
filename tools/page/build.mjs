// SPDX-License-Identifier: MIT
// Makes the page's template: index.html with style.css and the bundled main.js inside. `node build.mjs OUT`.
// padding/view/page.cpp puts a cluster's data where the template says so.
import {build} from 'esbuild';
import {readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, 'page.html');
const bundled = await build({
  entryPoints: [join(here, 'main.js')],
  bundle: true, minify: true, write: false, format: 'iife', target: 'es2020',
  charset: 'ascii',
  legalComments: 'inline',  // three's licence goes with it
  loader: {'.glsl': 'text'},
  logLevel: 'warning',
});
const script = bundled.outputFiles[0].text;
if (/<\/script|<!--/i.test(script)) throw new Error('the bundle would end its own script element');
const parts = {'/*style*/': readFileSync(join(here, 'style.css'), 'utf8'), '/*script*/': script};
let html = readFileSync(join(here, 'index.html'), 'utf8');
for (const [mark, text] of Object.entries(parts)) {
  if (html.split(mark).length !== 2) throw new Error(`index.html must hold ${mark} once`);
  html = html.replace(mark, () => text);
}
writeFileSync(out, html);
