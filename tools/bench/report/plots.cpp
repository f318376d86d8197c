// SPDX-License-Identifier: GPL-3.0-or-later
// From a bench's document to scripts for gnuplot. Documents come from anywhere: text of theirs goes into a
// script in quotes only, and nothing but numbers into its data.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "padding/asset/error.h"
#include "tools/bench/report/document.h"
#include "tools/bench/report/draw.h"

namespace padder::bench {
namespace {

// In single quotes gnuplot expands nothing; a quote is doubled.
std::string in_quotes(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') out += '\'';
    out += static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  }
  return out + "'";
}

std::string title(const std::string& text) { return " title " + in_quotes(text) + " noenhanced"; }

std::string cell(double value) { return number(value, "%.9g"); }

// 1,000,000
std::string grouped(double count) {
  std::string digits = number(std::min(count, 1e18), "%.0f");
  for (std::size_t k = digits.size(); k > 3; k -= 3) digits.insert(k - 3, ",");
  return digits;
}

std::string processor_of(const std::string& backend) { return backend == "omp" ? "CPU" : "GPU"; }

// Where it was measured, as far as these rows are concerned.
std::string machine_of(const Json& document, const std::string& where, const std::vector<Reader>& rows) {
  const Reader all(document, where + ": document");
  bool cpu = false, gpu = false;
  for (const Reader& r : rows) (r.text("backend") == "omp" ? cpu : gpu) = true;
  return (gpu ? all.text("device") : "") + (cpu && gpu ? ", " : "") + (cpu ? all.text("machine") : "");
}

// --- scaling and bodies: time against contacts, or against the spheres of bodies ---

struct Line {
  std::string name;
  bool cpu;
  std::map<double, std::string> points;  // by x: lines go from left to right, whatever the order of --spheres
};

Plot times(const Json& document, const std::string& where, const std::vector<Reader>& rows, const char* name,
           const char* x_key, const std::string& x_label, double unit) {
  bool both = false;
  for (const Reader& r : rows) both = both || r.text("backend") != rows[0].text("backend");
  std::vector<Line> lines;
  std::vector<std::string> colours;  // of a scene the same on both processors
  for (const Reader& r : rows) {
    const bool cpu = r.text("backend") == "omp", body = std::string(x_key) == "spheres";
    const std::string scene = r.text("scene") + (body || r.flag("random_order") ? "" : ", coherent");
    const double x = r.amount(x_key) / unit;
    std::string point = cell(x);
    for (const char* key : {"seconds_fast", "seconds_exact", "seconds_exact_fixed"})
      point += " " + cell(r.amount(key) * 1e3);
    auto line = std::find_if(lines.begin(), lines.end(),
                             [&](const Line& l) { return l.name == scene && l.cpu == cpu; });
    if (line == lines.end()) line = lines.insert(line, {scene, cpu, {}});
    if (std::find(colours.begin(), colours.end(), scene) == colours.end()) colours.push_back(scene);
    if (x > 0) line->points[x] = point + "\n";  // a logarithmic axis has no 0
  }
  std::erase_if(lines, [](const Line& l) { return l.points.empty(); });
  if (lines.empty()) throw Error(where + ": no row has a contact: there is nothing to draw");
  std::string data, plots;
  for (std::size_t k = 0; k < lines.size(); k++) {
    const std::string block = "$line" + std::to_string(k);
    data += block + " << EOD\n";
    for (const auto& [x, point] : lines[k].points) data += point;
    data += "EOD\n";
    const auto colour = std::find(colours.begin(), colours.end(), lines[k].name) - colours.begin() + 1;
    const std::string lc = " lc " + std::to_string(colour);
    // Fast and exact often lie on each other: rings around the points.
    plots += block + " using 1:3 with linespoints lw 2 ps 0.6 pt " + (lines[k].cpu ? "5" : "7") + lc +
             title(lines[k].name + (both ? ", " + processor_of(lines[k].cpu ? "omp" : "cuda") : "")) + ", " +
             block + " using 1:2 with points pt 6 ps 1" + lc + " notitle, " + block +
             " using 1:4 with linespoints lw 1 dt 2 pt 2 ps 0.6" + lc + " notitle, ";
  }
  const char* key = " lc rgb 'gray30' title ";
  plots += std::string("NaN with linespoints lw 2 pt 7 ps 0.6") + key + "'exact', NaN with points pt 6 ps 1" +
           key + "'fast', NaN with linespoints lw 1 dt 2 pt 2 ps 0.6" + key + "'exact, fixed order'";
  return {name,
          "set title " + in_quotes(machine_of(document, where, rows)) + " noenhanced\nset xlabel '" +
              x_label +
              "'\nset ylabel 'Time of a call [ms]'\nset logscale xy\nset grid\nset key outside right Left "
              "reverse\nset linetype 5 lc rgb '#c03030'\n" +
              data + "plot " + plots + "\n",
          960};
}

// Loose spheres are the paper's Fig. 26; bodies, of which few touch, have a picture of their own.
std::vector<Plot> scaling_plots(const Json& document, const std::string& where) {
  std::vector<Reader> loose, bodies;
  for (const Reader& r : rows_of(document, where))
    (r.text("scene").starts_with("cluster") ? bodies : loose).push_back(r);
  std::vector<Plot> plots;
  if (!loose.empty())
    plots.push_back(times(document, where, loose, "", "contacts", "Contacts [millions]", 1e6));
  if (!bodies.empty())
    plots.push_back(times(document, where, bodies, loose.empty() ? "" : "_bodies", "spheres",
                          "Spheres, 64 a body [millions]", 1e6));
  return plots;
}

// --- stages: bars of the nine stages beside what remains of them on the fast path ---

constexpr const char* kParts[] = {"place",  "stage1", "stage2", "stage3", "stage4", "stage5",
                                  "stage6", "stage7", "stage8", "stage9", "total"};

std::vector<Plot> stages_plots(const Json& document, const std::string& where) {
  const std::vector<Reader> rows = rows_of(document, where);
  struct Panel {
    std::string title;
    std::string bars[2];  // nine stages, fast
  };
  std::vector<Panel> panels;
  double least = INFINITY, most = 0;
  for (const Reader& r : rows) {
    const std::string head = grouped(r.amount("spheres")) + " spheres, " + grouped(r.amount("contacts")) +
                             " contacts, " + processor_of(r.text("backend"));
    auto panel = std::find_if(panels.begin(), panels.end(), [&](const Panel& p) { return p.title == head; });
    if (panel == panels.end()) panel = panels.insert(panel, {head, {}});
    const Reader seconds = r.inner("seconds");
    std::string& bars = panel->bars[r.text("path") == "fast"];
    for (std::size_t k = 0; k < std::size(kParts); k++) {
      const double ms = seconds.amount(kParts[k]) * 1e3;
      if (!(ms > 0)) continue;  // the fast path has no such stage
      least = std::min(least, ms), most = std::max(most, ms);
      bars += std::to_string(k) + " " + cell(ms) + " " + number(ms, ms < 1 ? "%.3f" : "%.2f") + "\n";
    }
  }
  if (!(most > 0)) throw Error(where + ": no stage has a time: there is nothing to draw");
  std::string script =
      "set title noenhanced\nset ylabel 'Time [ms]'\nset logscale y\nset grid y\nset boxwidth 0.4\n"
      "set style fill solid\nset key left top\nset xrange [-0.6:10.6]\nset yrange [" +
      cell(std::pow(10, std::floor(std::log10(least)))) + ":" + cell(most * 6) + "]\nset xtics (";
  for (std::size_t k = 0; k < std::size(kParts); k++) {
    std::string name = kParts[k];
    if (name.size() == 6) name.insert(5, " ");
    script += (k ? ", '" : "'") + name + "' " + std::to_string(k);
  }
  script += ")\nset multiplot layout " + std::to_string(panels.size()) + ",1 title " +
            in_quotes(machine_of(document, where, rows)) + " noenhanced\n";
  const char* names[] = {"nine stages, as in the paper", "fast path"};
  const char* colours[] = {"'#9aa5b1'", "'#1f6fb4'"};
  const char* shifts[] = {"$1-0.2", "$1+0.2"};
  for (const Panel& p : panels) {
    std::string plots;
    for (int k = 0; k < 2; k++) {
      if (p.bars[k].empty()) continue;
      const std::string block = "$bars" + std::to_string(k);
      script += block + " << EOD\n" + p.bars[k] + "EOD\n";
      plots += (plots.empty() ? "" : ", ") + block + " using (" + shifts[k] + "):2 with boxes lc rgb " +
               colours[k] + " title '" + names[k] + "', " + block + " using (" + shifts[k] +
               "):2:3 with labels offset 0,0.6 font ',9' notitle";
    }
    script += "set title " + in_quotes(p.title) + "\nplot " + plots + "\n";
  }
  return {{"", script + "unset multiplot\n", 960, 60 + 320 * static_cast<int>(panels.size())}};
}

// A line with points for each name, by x.
using NamedLines = std::map<std::string, std::map<double, double>>;

// The axes, and what is drawn after the lines, are in gnuplot's words.
Plot line_plot(const NamedLines& lines, const std::string& axes, const std::string& after) {
  std::string data, plots;
  std::size_t k = 0;
  for (const auto& [name, points] : lines) {
    const std::string block = "$line" + std::to_string(k++);
    data += block + " << EOD\n";
    for (const auto& [x, y] : points) data += cell(x) + " " + cell(y) + "\n";
    data += "EOD\n";
    plots +=
        (plots.empty() ? "" : ", ") + block + " using 1:2 with linespoints lw 2 pt 7 ps 0.6" + title(name);
  }
  return {"", "set grid\nset key left top\n" + axes + data + "plot " + plots + after + "\n"};
}

// --- boxes: time against contacts on one and several GPUs, with straight lines ---

std::vector<Plot> boxes_plots(const Json& document, const std::string& where) {
  NamedLines lines;
  for (const Reader& r : rows_of(document, where)) {
    if (r.text("scene") != "dense") continue;
    const double devices = r.amount("devices");
    const std::string name = r.text("backend") == "cuda"
                                 ? number(devices, "%.0f") + (devices > 1 ? " GPUs" : " GPU")
                                 : r.text("backend");
    lines[name][r.amount("contacts") / 1e6] = r.amount("seconds") * 1e3;
    if (r.amount("seconds_pinned") > 0)
      lines[name + ", from pinned memory"][r.amount("contacts") / 1e6] = r.amount("seconds_pinned") * 1e3;
  }
  if (lines.empty()) return {};  // fronts alone
  return {line_plot(lines,
                    "set xlabel 'Contacts [millions]'\nset ylabel 'Time of a call [ms]'\n"
                    "set xrange [0:*]\nset yrange [0:*]\n",
                    "")};
}

// --- speedup: over a warm Bullet step, against contacts ---

std::vector<Plot> speedup_plots(const Json& document, const std::string& where) {
  NamedLines lines;
  for (const Reader& r : rows_of(document, where))
    lines[r.text("backend") == "omp" ? "CPU" : "GPU, from and to host memory"][r.amount("contacts") / 1e6] =
        r.amount("speedup");
  return {line_plot(lines,
                    "set xlabel 'Contacts [millions]'\nset ylabel 'Speedup over a warm Bullet step'\n"
                    "set logscale y\n",
                    ", 180 with lines dt 2 title 'the paper, at most'")};
}

// --- frontier: spheres against the larger of the two errors, a picture a mesh ---

std::vector<Plot> frontier_plots(const Json& document, const std::string& where) {
  struct Point {
    double error, spheres;
  };
  struct Mesh {
    std::string name;
    std::map<std::string, std::vector<Point>> methods;
  };
  constexpr std::pair<const char*, const char*> titles[] = {
      {"tolerance", "--tolerance"}, {"depth", "--depth 0.2, refitted"}, {"paper", "fixed depth 0.2 (paper)"}};
  std::vector<Mesh> meshes;
  for (const Reader& r : rows_of(document, where)) {
    const std::string name = r.text("mesh");
    const Point p{std::max(r.amount("protrusion_bound"), r.amount("gap_bound")), r.amount("spheres")};
    auto mesh = std::find_if(meshes.begin(), meshes.end(), [&](const Mesh& m) { return m.name == name; });
    if (mesh == meshes.end()) mesh = meshes.insert(mesh, {name, {}});
    if (p.error > 0 && p.spheres > 0) mesh->methods[r.text("method")].push_back(p);
  }
  std::vector<Plot> plots;
  for (Mesh& mesh : meshes) {
    std::string script =
        "set xlabel 'Largest error, protrusion or gap [% of the diagonal]'\nset ylabel 'Spheres'\n"
        "set logscale xy\nset grid\nset key right top\nset title " +
        in_quotes(mesh.name) + " noenhanced\n";
    std::string lines;
    for (const auto& [method, words] : titles) {
      const std::vector<Point>& points = mesh.methods[method];
      if (points.empty()) continue;
      script += "$" + std::string(method) + " << EOD\n";
      for (const Point& p : points) script += cell(p.error) + " " + cell(p.spheres) + "\n";
      script += "EOD\n";
      lines += (lines.empty() ? "$" : ", $") + std::string(method) +
               " using 1:2 with linespoints lw 2 title '" + words + "'";
    }
    if (lines.empty()) throw Error(where + ": " + mesh.name + " has no row to draw");
    // What counts would be if they grew with these powers from the coarsest rung of each on.
    const auto guide = [&](const char* method, const char* power, const char* dash) {
      const std::vector<Point>& points = mesh.methods[method];
      if (points.empty()) return;
      lines += ", " + cell(points[0].spheres) + "*(" + cell(points[0].error) + "/x)**" + power +
               " with lines lw 1 dt " + dash + " lc rgb 'gray40' title '1/error^{" + power + "}'";
    };
    guide("tolerance", "1.5", "2"), guide("depth", "2", "3");
    std::string file = "_" + mesh.name;
    std::replace_if(
        file.begin(), file.end(), [](char c) { return c == '/' || static_cast<unsigned char>(c) < ' '; },
        '_');
    plots.push_back({file, script + "plot " + lines + "\n"});
  }
  return plots;
}

// --- table3: a step of the silo against contacts (Fig. 29) and objects (Fig. 30) ---

Plot silo_plot(const std::vector<Reader>& rows, const std::string& backend, const char* x_key,
               const std::string& name, const std::string& label, double unit) {
  std::map<double, std::string> points;
  bool history = false;
  for (const Reader& r : rows) {
    if (r.text("backend") != backend) continue;
    std::string& times = points[r.amount(x_key) / unit];
    for (const char* key : {"seconds", "seconds_detection", "seconds_every_step"})
      times += cell(r.amount(key) * 1e3) + " ";
    if (r.has("seconds_history")) history = true, times += cell(r.amount("seconds_history") * 1e3);
  }
  std::string data = "$silo << EOD\n";
  for (const auto& [x, times] : points) data += cell(x) + " " + times + "\n";
  std::string script =
      "set xlabel '" + label +
      "'\nset ylabel 'Time of a step [ms]'\nset grid\nset key left top\nset xrange [0:*]\nset yrange "
      "[0:*]\n" +
      data +
      "EOD\nplot $silo using 1:2 with linespoints lw 2 pt 7 title 'step', $silo using 1:3 with linespoints "
      "lw 2 pt 5 title 'of it detection, candidates kept', $silo using 1:4 with linespoints lw 2 pt 9 title "
      "'detection in every step'";
  if (history) script += ", $silo using 1:5 with linespoints lw 2 pt 11 title 'one call with a history'";
  return {name, script + "\n"};
}

std::vector<Plot> table3_plots(const Json& document, const std::string& where) {
  const std::vector<Reader> rows = rows_of(document, where);
  std::set<std::string> backends;
  for (const Reader& r : rows) backends.insert(r.text("backend"));
  std::vector<Plot> plots;
  for (const std::string& backend : backends) {
    const std::string end = backend == "omp" ? "" : "_" + backend;
    plots.push_back(silo_plot(rows, backend, "contacts", end, "Contacts [millions]", 1e6));
    plots.push_back(silo_plot(rows, backend, "spheres", "_objects" + end, "Objects [thousands]", 1e3));
  }
  return plots;
}

// --- shoe: what a step takes against what the padding gets wrong ---

// Errors over the time of a step: one line each, from the coarsest padding to the finest.
std::vector<Plot> shoe_plots(const Json& document, const std::string& where) {
  std::map<std::string, std::string> points;
  for (const Reader& r : rows_of(document, where)) {
    if (r.flag("again")) continue;
    const std::string backend = r.text("backend");
    const char* const time = backend == "omp" ? "seconds_processor" : "seconds";
    points[backend] += cell(r.amount(time) * 1e3) + " " + cell(r.amount("normal_error_mean_deg")) + " " +
                       cell(r.amount("depth_error_mean_percent")) + " " +
                       cell(r.amount("height_difference_percent")) + " \"" +
                       cell(r.amount("tolerance_percent")) + " %\"\n";
  }
  std::vector<Plot> plots;
  for (const auto& [backend, rows] : points)
    plots.push_back(
        {backend == "omp" ? "" : "_" + backend,
         "set xlabel 'Time of a step [ms]" + std::string(backend == "omp" ? ", of processors" : "") +
             "'\nset ylabel 'Mean error of a normal [degrees]'\nset y2label 'Error [% of the diagonal]'\nset "
             "y2tics\nset xrange [0:*]\nset logscale y\nset logscale y2\nset ytics nomirror\nset grid\nset "
             "key right top\n$shoe << EOD\n" +
             rows +
             "EOD\nplot $shoe using 1:2 with linespoints lw 2 pt 7 title 'normal', $shoe using 1:2:5 with "
             "labels offset 0,1 notitle, $shoe using 1:3 axes x1y2 with linespoints lw 2 pt 5 title "
             "'distance (right)', $shoe using 1:4 axes x1y2 with linespoints lw 2 pt 9 title 'resting height "
             "(right)'\n"});
  return plots;
}

// --- precision: error against time of float, exact and double, each scene's times over that of double ---

std::vector<Plot> precision_plots(const Json& document, const std::string& where) {
  const std::vector<Reader> rows = rows_of(document, where);
  std::map<std::string, double> double_seconds, double_contacts;
  const auto scene = [](const Reader& r) { return r.text("scene") + "\n" + r.text("backend"); };
  for (const Reader& r : rows)
    if (r.text("mode") == "double")
      double_seconds[scene(r)] = r.amount("seconds"), double_contacts[scene(r)] = r.amount("contacts");
  std::map<std::string, std::string> points;
  for (const Reader& r : rows) {
    const double seconds = double_seconds[scene(r)], contacts = std::max(double_contacts[scene(r)], 1.0);
    if (!(seconds > 0) || !(r.amount("seconds") > 0)) continue;  // refused
    const double pairs = (r.amount("wrong") + r.amount("by_rounding")) / contacts;
    points[r.text("mode")] += cell(r.amount("seconds") / seconds) + " " +
                              cell(std::max(r.amount("normal_error"), 1e-17)) + " " +
                              cell(std::max(pairs, 1e-7)) + "\n";
  }
  if (points.empty()) throw Error(where + ": no scene was measured: there is nothing to draw");
  std::string data, panels;
  for (const auto& [mode, lines] : points) data += "$" + mode + " << EOD\n" + lines + "EOD\n";
  const char* labels[] = {"Largest error of a normal (1e-17: none)",
                          "Pairs wrong, over the contacts of the doubles (1e-7: none)"};
  for (int k = 0; k < 2; k++) {
    std::string plots;
    for (const auto& [mode, lines] : points)
      plots += (plots.empty() ? "$" : ", $") + mode + " using 1:" + std::to_string(2 + k) +
               " with points pt 7 ps 0.8 title '" + mode + "'";
    panels += std::string("set ylabel '") + labels[k] + "'\nplot " + plots + "\n";
  }
  return {
      {"",
       "set logscale xy\nset grid\nset format y '%.0e'\nset xlabel 'Time of a call over that of double'\n" +
           data + "set multiplot layout 1,2\n" + panels + "unset multiplot\n",
       1100}};
}

// --- hard: each mesh's larger proved error over its tolerance, and its time against its triangles ---

std::vector<Plot> hard_plots(const Json& document, const std::string& where) {
  std::string points;
  for (const Reader& r : rows_of(document, where)) {
    if (!r.has("spheres")) continue;  // refused
    points +=
        cell(std::max(r.amount("triangles"), 1.0)) + " " + cell(std::max(r.amount("seconds"), 1e-3)) + " " +
        cell(std::max(r.amount("protrusion"), r.amount("gap")) / std::max(r.amount("tolerance"), 1e-300)) +
        "\n";
  }
  if (points.empty()) throw Error(where + ": no mesh was padded: there is nothing to draw");
  return {{"",
           "set logscale xy\nset grid\nset format y '%g'\n$hard << EOD\n" + points +
               "EOD\nset multiplot layout 1,2\nset xlabel 'Time [s]'\n"
               "set ylabel 'Larger proved error over the tolerance'\nset yrange [0.3:10]\n"
               "plot 1 lc rgb 'gray' notitle, $hard using 2:3 with points pt 7 ps 0.8 lc 1 notitle\n"
               "set xlabel 'Triangles'\nset ylabel 'Time [s]'\nset autoscale y\n"
               "plot $hard using 1:2 with points pt 7 ps 0.8 lc 1 notitle\nunset multiplot\n",
           1100}};
}

}  // namespace

std::vector<Plot> plots_of(const Json& document, const std::string& where) {
  const std::string name = bench_of(document, where);
  if (name == "scaling" || name == "bodies") return scaling_plots(document, where);
  if (name == "boxes") return boxes_plots(document, where);
  if (name == "shoe") return shoe_plots(document, where);
  if (name == "table3") return table3_plots(document, where);
  if (name == "stages") return stages_plots(document, where);
  if (name == "speedup") return speedup_plots(document, where);
  if (name == "frontier") return frontier_plots(document, where);
  if (name == "precision") return precision_plots(document, where);
  if (name == "hard") return hard_plots(document, where);
  return {};
}

}  // namespace padder::bench
