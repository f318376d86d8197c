// SPDX-License-Identifier: GPL-3.0-or-later
// A cluster to look at: Cluster.page, and what a notebook shows of it.
#include <pybind11/stl.h>

#include <filesystem>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "tools/python/module.h"
#include "tools/python/unlocked.h"
#ifdef PADDER_VIEW
#include "padding/view/page.h"
#endif

namespace padder::python {

using namespace pybind11::literals;
namespace fs = std::filesystem;

namespace {

std::string escaped(const std::string& text) {
  return py::cast<std::string>(py::module_::import("html").attr("escape")(text));
}

// A table of what the cluster is.
std::string table_of(const Cluster& c) {
  const auto row = [](const std::string& name, const std::string& value) {
    return "<tr><th style='text-align:left'>" + name + "</th><td style='text-align:left'>" + value +
           "</td></tr>";
  };
  const double diagonal = c.bounds.empty() ? 0 : c.bounds.diagonal();
  const auto length = [&](double value) {
    return short_number(value, 4) + " " + escaped(c.unit) +
           (diagonal > 0 ? " (" + short_number(100 * value / diagonal, 3) + " %)" : "");
  };
  std::string out = "<table>" + row("cluster", escaped(c.name)) + row("spheres", std::to_string(c.size()));
  if (c.accuracy.proved_against != SurfaceKind::none)
    out += row("protrusion at most", length(c.accuracy.protrusion_max)) +
           row("gap at most", length(c.accuracy.gap_max)) +
           row("certified", c.accuracy.certified ? "yes" : "no");
  if (c.family != 0) out += row("family", std::to_string(c.family));
  return out + "</table>";
}

#ifdef PADDER_VIEW

// The template of pages: beside the module in a build folder, where pip or Debian installs it.
fs::path page_template() {
  const fs::path folder =
      fs::path(py::cast<std::string>(py::module_::import("padder._core").attr("__file__"))).parent_path();
  const fs::path prefix = py::cast<std::string>(py::module_::import("sys").attr("prefix"));
  for (const fs::path& candidate :
       {folder / "../../page/page.html", folder / "../share/padder/page.html",
        prefix / "share/padder/page.html", fs::path("/usr/share/padder/page.html")})
    if (std::error_code code; fs::is_regular_file(candidate, code)) return candidate.lexically_normal();
  return {};
}

std::string page_of(const Cluster& c, const py::object& vertices, const py::object& faces,
                    const std::string& colour) {
  PageOptions options;
  bool known = false;
  for (const ColourBy by : kColourings)
    if (colour == name_of(by)) options.colour = by, known = true;
  if (!known) throw py::value_error("colour must be family, radius, protrusion, gap or triangle");
  options.script = page_template();
  if (options.script.empty())
    throw Error("the template of pages is not there: npm bundles it when the module is built (target page)");
  // A mesh that is not given is looked for by its name and sha256 in the current folder.
  const bool given = !vertices.is_none() || !faces.is_none();
  const Mesh mesh =
      given ? padder::mesh_of(c, given_mesh(vertices, faces), "the mesh") : padder::mesh_of(c, "");
  return unlocked([&] { return page_html(view_of(c, mesh), options); });
}

#endif

// In a notebook: the page in a frame of its own, which neither reads nor changes the notebook, and the table.
std::string html_of(const Cluster& c) {
  std::string out = table_of(c);
#ifdef PADDER_VIEW
  constexpr std::size_t kMost = 200000;  // spheres: 3 MB, and a notebook keeps what it shows
  if (c.size() > 0 && c.size() <= kMost && !page_template().empty())
    out += "<iframe sandbox='allow-scripts' style='width:100%;height:480px;border:0' srcdoc='" +
           escaped(page_of(c, py::none(), py::none(), "family")) + "'></iframe>";
#endif
  return out;
}

}  // namespace

void add_page(PyCluster& cluster) {
  cluster.def("_repr_html_", &html_of);
#ifdef PADDER_VIEW
  cluster.def(
      "page", &page_of, "vertices"_a = py::none(), "faces"_a = py::none(), "colour"_a = "family",
      "The page of docs/preview.md as a text: write it to a file that ends in .html. vertices, faces: "
      "the mesh, or one\nobject that has both; without them it is looked for by its name in the current "
      "folder.");
#endif
}

}  // namespace padder::python
