// SPDX-License-Identifier: MIT
#include "padding/view/page.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/asset/file.h"
#include "padding/view/picture.h"

namespace padder {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little, "the page's arrays are little-endian");

constexpr double kSteps = (1 << 21) - 1;  // a coordinate is stored in 21 bits

// Receives the page piece by piece.
using Write = std::function<void(std::string_view)>;

// The page's frame: the middle of the box at 0, its diagonal 1.
struct Frame {
  Point center;
  double scale;
  Vector low, step;  // of the centres' box, and a 2^21st of its edges

  explicit Frame(const View& view) {
    const Box box = view.bounds();
    center = box.center();
    scale = box.diagonal() > 0 ? box.diagonal() : 1;
    Box centers;
    for (const Point& p : view.centers) centers.add(p);
    if (centers.empty()) centers.add(center);
    low = into(centers.low);
    step = (into(centers.high) - low) / kSteps;
  }
  Vector into(const Point& p) const { return (p - center) / scale; }
  std::uint64_t cell(double x, int k) const {
    return step[k] > 0 ? std::uint64_t(std::clamp(std::round((x - low[k]) / step[k]), 0.0, kSteps)) : 0;
  }
};

// Writes the page's elements that hold data. Text of a name or a note must not end an element, so < is
// escaped.
class Elements {
 public:
  explicit Elements(Write write) : write_(std::move(write)) {}

  // Writes `count` items; fill(k, numbers) appends the numbers of item k. Works in blocks, so that a large
  // scene is in memory neither twice nor as text.
  template <class T, class Fill>
  void add(const char* id, std::size_t count, const Fill& fill) {
    constexpr std::size_t block = 3 << 14;  // of items: a multiple of 3, so that its base64 needs no padding
    write_(std::string("<script type=\"application/octet-stream\" id=\"") + id + "\">");
    std::vector<T> numbers;
    for (std::size_t first = 0; first < count; first += block) {
      numbers.clear();
      for (std::size_t k = first; k < std::min(count, first + block); k++) fill(k, numbers);
      write_(base64({reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(T)}));
    }
    write_("</script>\n");
  }
  template <class T>
  void add(const char* id, const std::vector<T>& values) {
    add<T>(id, values.size(), [&](std::size_t k, std::vector<T>& out) { out.push_back(values[k]); });
  }
  void add(const char* id, const Json& json) {
    std::string text = std::string("<script type=\"application/json\" id=\"") + id + "\">";
    for (const char c : json.dump(-1, ' ', false, Json::error_handler_t::replace))
      c == '<' ? text += "\\u003c" : text += c;
    write_(text + "</script>\n");
  }

 private:
  Write write_;
};

Json accuracy_json(const Accuracy& a) { return Json::parse(to_json(a)); }

bool all_alike(const std::vector<std::uint32_t>& values) {
  return std::all_of(values.begin(), values.end(), [&](std::uint32_t v) { return v == values[0]; });
}

Json head_json(const View& view, const PageOptions& o, const Frame& frame) {
  const auto triple = [](const Vector& v) { return Json::array({v.x(), v.y(), v.z()}); };
  Json j;
  j["title"] = view.title, j["unit"] = view.unit, j["note"] = view.note;
  j["spheres"] = view.size();
  j["center"] = triple(frame.center), j["scale"] = frame.scale;
  j["low"] = triple(frame.low), j["step"] = triple(frame.step);
  // Of the mesh, as reports count; the spheres' where there is none.
  j["diagonal"] = view.has_mesh() ? view.mesh.bounds().diagonal() : frame.scale;
  j["family"] = view.family.empty() ? 0 : view.family[0];
  j["mask"] = view.mask;
  j["colour"] = name_of(o.colour);
  j["azimuth"] = o.azimuth, j["elevation"] = o.elevation, j["up"] = std::string(1, o.up);
  if (!view.accuracy.empty()) j["accuracy"] = accuracy_json(view.accuracy[0]);
  std::map<std::string, std::size_t> number_of;
  Json names = Json::array(), bodies = Json::array(), rungs = Json::array();
  for (const ViewBody& b : view.bodies) {
    const auto [it, fresh] = number_of.emplace(b.cluster, names.size());
    if (fresh) names.push_back(b.cluster);
    bodies.push_back({it->second, b.first, b.count, b.family, b.mask});
  }
  j["clusters"] = std::move(names), j["bodies"] = std::move(bodies);
  for (const ViewRung& r : view.rungs) {
    rungs.push_back({{"name", r.name}, {"first", r.first}, {"count", r.count}});
    if (!r.accuracy.empty()) rungs.back()["accuracy"] = accuracy_json(r.accuracy[0]);
  }
  if (rungs.empty()) rungs.push_back({{"name", "all"}, {"first", 0}, {"count", view.size()}});
  j["rungs"] = std::move(rungs), j["rung"] = o.rung;
  const Palette& p = palette();
  j["palette"] = {
      {"none", p.none},   {"mesh", p.mesh}, {"background", p.background}, {"dark", p.dark_background},
      {"kinds", p.kinds}, {"ramp", p.ramp}};
  if (view.has_mesh() && !view.marks.empty()) {
    Json& marks = j["marks"] = Json::array();
    for (const Mark& mark : view.marks)
      marks.push_back({{"name", name_of(mark.kind)},
                       {"colour", p.marks[std::size_t(mark.kind)]},
                       {"area", mark.mesh.area()}});
  }
  return j;
}

// The error map: its points behind those of the mesh, its triangles, and the gap at each point by level.
void write_errors(const ErrorMap& errors, std::size_t own, const Frame& frame, Elements& out) {
  if (errors.gap.empty()) return;
  out.add<float>("finer-points", errors.mesh.points.size() - own, [&](std::size_t k, std::vector<float>& to) {
    for (const double x : frame.into(errors.mesh.points[own + k])) to.push_back(float(x));
  });
  out.add("finer-triangles", errors.mesh.triangles);
  for (std::size_t k = 0; k < errors.gap.size(); k++)
    out.add(("mesh-gap" + std::to_string(k)).c_str(), errors.gap[k]);
}

void write_data(const View& view, const PageOptions& options, const Write& write) {
  const Frame frame(view);
  Elements out(write);
  out.add("head", head_json(view, options, frame));
  out.add<std::uint32_t>("spheres", view.size(), [&](std::size_t k, std::vector<std::uint32_t>& words) {
    const Vector p = frame.into(view.centers[k]);
    const std::uint64_t bits = frame.cell(p.x(), 0) | frame.cell(p.y(), 1) << 21 | frame.cell(p.z(), 2) << 42;
    words.push_back(std::uint32_t(bits));
    words.push_back(std::uint32_t(bits >> 32));
    words.push_back(std::bit_cast<std::uint32_t>(float(view.radii[k] / frame.scale)));
  });
  if (!view.family.empty() && !all_alike(view.family)) out.add("family", view.family);
  if (!view.triangle.empty())
    out.add<std::int32_t>(
        "triangle", view.triangle.size(),
        [&](std::size_t k, std::vector<std::int32_t>& to) { to.push_back(std::int32_t(view.triangle[k])); });
  if (!view.protrusion.empty()) out.add("protrusion", view.protrusion);
  if (!view.gap.empty()) out.add("gap", view.gap);
  if (!view.body.empty()) out.add("body", view.body);
  if (view.has_mesh()) {
    out.add<float>("points", view.mesh.points.size(), [&](std::size_t k, std::vector<float>& to) {
      for (const double x : frame.into(view.mesh.points[k])) to.push_back(float(x));
    });
    out.add("triangles", view.mesh.triangles);
    write_errors(view.errors, view.mesh.points.size(), frame, out);
    for (std::size_t m = 0; m < view.marks.size(); m++) {
      const Mesh& mesh = view.marks[m].mesh;
      out.add<float>(("mark" + std::to_string(m)).c_str(), mesh.triangles.size(),
                     [&](std::size_t t, std::vector<float>& to) {
                       for (int k = 0; k < 3; k++)
                         for (const double x : frame.into(mesh.corner(t, k))) to.push_back(float(x));
                     });
    }
  }
  if (!view.contacts.empty()) {
    out.add<std::uint32_t>("pairs", view.contacts.size(), [&](std::size_t k, std::vector<std::uint32_t>& to) {
      to.push_back(std::uint32_t(view.contacts[k].i)), to.push_back(std::uint32_t(view.contacts[k].j));
    });
    out.add<float>("contacts", view.contacts.size(), [&](std::size_t k, std::vector<float>& to) {
      const ViewContact& c = view.contacts[k];
      for (const double x : frame.into(c.at)) to.push_back(float(x));
      for (const double x : c.normal) to.push_back(float(x));
      to.push_back(float(c.depth));
    });
  }
}

void page(const View& view, const PageOptions& options, const Write& write) {
  if (view.size() == 0 && !view.has_mesh())
    throw Error(view.title + " holds no sphere, so there is nothing to show");
  if (view.size() > (std::size_t(1) << 25))
    throw Error(view.title + ": a page holds 33554432 spheres at most");
  if (options.up != 'x' && options.up != 'y' && options.up != 'z')
    throw Error("the axis that points up is x, y or z");
  if (options.rung >= std::max<std::size_t>(1, view.rungs.size()))
    one_rung(view, options.rung);                                            // throws the Error that says why
  if (options.colour != ColourBy::family) colours_of(view, options.colour);  // as well
  const fs::path script = options.script.empty() ? page_script() : options.script;
  const std::string html = read_file(script);
  const std::string_view marks[] = {"<!--padder:title-->", "<!--padder:data-->"};
  const std::size_t title = html.find(marks[0]), data = html.find(marks[1]);
  if (title == std::string::npos || data == std::string::npos || data < title)
    throw Error(script.string() + " is not the template of a page: build the target page again");
  const std::size_t behind = title + marks[0].size();
  write(std::string_view(html).substr(0, title));
  write(xml_text(view.title));
  write(std::string_view(html).substr(behind, data - behind));
  write_data(view, options, write);
  write(std::string_view(html).substr(data + marks[1].size()));
}

}  // namespace

fs::path page_script() {
  std::error_code code;
  const fs::path folder = fs::read_symlink("/proc/self/exe", code).parent_path();
  for (const fs::path& candidate : {folder / "../page/page.html", folder / "../share/padder/page.html"})
    if (fs::is_regular_file(candidate, code)) return candidate.lexically_normal();
  throw Error(
      "the script of pages is not there: `cmake --build BUILD --target page` makes it, before an "
      "installation or a package, too (it needs npm; `tools/run preview` does so by itself); a picture "
      "(.png) needs none");
}

std::string page_html(const View& view, const PageOptions& options) {
  std::string html;
  page(view, options, [&](std::string_view piece) { html += piece; });
  return html;
}

void write_page(const View& view, const fs::path& path, const PageOptions& options) {
  FileWriter out(path);
  page(view, options, [&](std::string_view piece) { out.append(piece); });
  out.commit();
}

bool is_preview(const fs::path& path) { return ending_of(path) == ".html" || ending_of(path) == ".png"; }

void write_preview(const View& view, const fs::path& path, ColourBy colour) {
  if (!is_preview(path))
    throw Error("cannot tell what to write to " + path.string() + ": end it with .html or .png");
  if (ending_of(path) == ".html")
    write_page(view, path, {.colour = colour, .script = {}});
  else
    write_png(render(view, {.colour = colour}), path);
}

}  // namespace padder
