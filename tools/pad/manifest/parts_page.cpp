// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/manifest/parts_page.h"

#include <unordered_set>

#include "padding/asset/file.h"
#include "padding/view/picture.h"
#include "padding/view/view.h"

namespace padder {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

namespace {

// In folders by the first two digits: a folder of a hundred thousand files is slow to list.
std::string picture_name(const std::string& sha256) {
  return ".pad/pictures/" + sha256.substr(0, 2) + "/" + sha256 + ".png";
}

bool can_be_drawn(const Record& r) {
  return r.done() && !r.sha256.empty() && r.output.ends_with(".spheres.json");
}

void draw(const fs::path& asset, const fs::path& picture) {
  fs::create_directories(picture.parent_path());
  PictureOptions options;
  options.width = 160, options.height = 120, options.samples = 8, options.show = Show::spheres;
  write_png(render(view_of(read_cluster(asset)), options), picture);
}

void draw_all(const std::vector<PageRow>& rows, const fs::path& folder, Workers& workers, std::size_t at_once,
              const std::function<void(double)>& progress) {
  std::unordered_set<std::string> begun;
  for (std::size_t k = 0; k < rows.size() && workers.stopped() == 0; k++) {
    const Record& r = rows[k].record;
    if (!can_be_drawn(r) || !begun.insert(r.sha256).second) continue;
    const fs::path picture = folder / picture_name(r.sha256);
    std::error_code code;
    if (fs::exists(picture, code)) continue;
    if (workers.running() >= at_once) workers.wait();
    workers.start(k, {60, 0}, [&, picture] {
      draw(folder / r.output, picture);
      return std::string();
    });
    progress(double(k) / double(rows.size()));
  }
  while (workers.wait()) {
  }
}

// The page's own part; PARTS is replaced by an array with one array for each part.
constexpr const char* kPage = R"html(<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Parts</title>
<meta name="viewport" content="width=device-width">
<style>
:root{color-scheme:light dark}
body{font:14px system-ui,sans-serif;margin:1.5em;color:#222;background:#fff}
table{border-collapse:collapse;width:100%}
th{position:sticky;top:0;background:#eee;cursor:pointer;text-align:left;white-space:nowrap}
th,td{padding:.3em .6em;border-bottom:1px solid #ddd;vertical-align:middle}
td.number,th.number{text-align:right;font-variant-numeric:tabular-nums}
img{width:80px;height:60px;display:block}
tr.failed td{background:#fdecea}tr.left td{color:#777}
input,select,button{font:inherit;margin-right:.6em}
@media(prefers-color-scheme:dark){body{background:#1b1b1b;color:#ddd}th{background:#333}th,td{border-color:#444}
tr.failed td{background:#4a2320}}
@media(max-width:600px){body{margin:.7em}.detail{display:none}img{width:40px;height:30px}th{white-space:normal}td{overflow-wrap:anywhere}td:nth-child(2){min-width:8em}}
</style>
<h1>Parts</h1>
<p id="sum"></p>
<p><input id="text" type="search" placeholder="name or error" aria-label="name or error"><select id="state" aria-label="state">
<option value="">all<option>done<option>failed<option>left</select><span id="shown"></span></p>
<table><thead><tr id="head"></tr></thead><tbody id="rows"></tbody></table>
<p><button id="more">more</button></p>
<script>
"use strict";
const parts = PARTS;
// Each part: mesh, output, picture, state, spheres, triangles, protrusion, gap, seconds, bytes, words.
const columns = [["picture", 2], ["part", 0], ["state", 3], ["spheres", 4], ["triangles", 5],
                 ["protrusion %", 6], ["gap %", 7], ["seconds", 8], ["MiB", 9], ["what was said", 10]];
const byId = id => document.getElementById(id);
const page = 200;
let order = parts.map((_, k) => k), key = -1, down = false, limit = page;
const number = c => c >= 4 && c <= 9;
const classOf = c => (number(c) ? "number" : "") + (c === 3 || (c >= 5 && c <= 9) ? " detail" : "");  // no detail on a narrow screen
function shown() {
  const text = byId("text").value.toLowerCase(), state = byId("state").value;
  return order.filter(k => (!state || parts[k][3] === state) &&
    (!text || (parts[k][0] + " " + parts[k][1] + " " + parts[k][10]).toLowerCase().includes(text)));
}
function cell(row, c) {
  const td = document.createElement("td"), p = parts[row];
  td.className = classOf(c);
  if (c === 2 && p[2]) {
    const image = document.createElement("img");
    image.loading = "lazy"; image.src = p[2]; image.alt = "";
    td.append(image);
  } else if (c === 0 && p[3] === "done") {
    const a = document.createElement("a");
    a.href = p[1].split("/").map(encodeURIComponent).join("/"); a.textContent = p[1];
    td.append(a);
  } else if (c !== 2 && !(number(c) && (p[3] === "left" || (p[3] === "failed" && c <= 7)))) {
    const v = p[c];
    td.textContent = c === 6 || c === 7 ? (100 * v).toFixed(3) : c === 8 ? v.toFixed(2)
                   : c === 9 ? (v / 1048576).toFixed(0) : v;
  }
  return td;
}
function draw() {
  const rows = shown();
  byId("shown").textContent = rows.length + " shown";
  byId("rows").replaceChildren(...rows.slice(0, limit).map(k => {
    const tr = document.createElement("tr");
    tr.className = parts[k][3];
    tr.append(...columns.map(([, c]) => cell(k, c)));
    return tr;
  }));
  byId("more").hidden = rows.length <= limit;
}
function sort(c) {
  down = key === c ? !down : number(c);
  key = c;
  const sign = down ? -1 : 1;
  order.sort((i, j) => sign * (parts[i][c] < parts[j][c] ? -1 : parts[i][c] > parts[j][c] ? 1 : 0) || i - j);
  draw();
}
for (const [name, c] of columns) {
  const th = document.createElement("th");
  th.textContent = name;
  th.className = classOf(c);
  if (c !== 2) th.onclick = () => sort(c);
  byId("head").append(th);
}
const count = s => parts.filter(p => p[3] === s).length;
const counted = (n, one) => n.toLocaleString("en") + " " + one + (n === 1 ? "" : "s");
byId("sum").textContent = counted(parts.length, "part") + ": " + count("done") + " done, " + count("failed") + " failed, " +
  count("left") + " left; " + counted(parts.reduce((n, p) => n + p[4], 0), "sphere");
byId("text").oninput = byId("state").onchange = () => { limit = page; draw(); };
byId("more").onclick = () => { limit += page; draw(); };
draw();
</script>
</html>
)html";

std::string joined(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += (text.empty() ? "" : "; ") + sentence;
  return text;
}

}  // namespace

void write_parts_page(const std::vector<PageRow>& rows, const fs::path& folder, Workers& workers,
                      std::size_t at_once, const std::function<void(double)>& progress) {
  draw_all(rows, folder, workers, at_once, progress);
  if (workers.stopped() > 0) return;
  Json all = Json::array();
  for (const auto& [r, reached] : rows) {
    std::error_code code;
    const std::string picture = can_be_drawn(r) ? picture_name(r.sha256) : "";
    const char* state = !reached ? "left" : r.done() ? "done" : "failed";
    all.push_back({r.mesh, r.output, fs::exists(folder / picture, code) ? picture : "", state, r.spheres,
                   r.triangles, r.protrusion, r.gap, r.seconds, r.memory,
                   r.done() ? joined(r.warnings) : r.error});
  }
  std::string data = all.dump(-1, ' ', false, Json::error_handler_t::replace);
  for (std::size_t at = 0; (at = data.find('<', at)) != std::string::npos;)
    data.replace(at, 1, "\\u003c");  // no text of a part may end the script
  std::string page = kPage;
  const std::string place = "PARTS;";
  page.replace(page.find(place), place.size() - 1, data);
  write_file(folder / "index.html", page);
}

}  // namespace padder
