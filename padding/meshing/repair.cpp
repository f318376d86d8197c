// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/repair.h"

#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polygon_mesh_processing/repair_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/meshing/cavities/shells.h"
#include "padding/meshing/cells/contacts.h"
#include "padding/meshing/cgal_mesh.h"
#include "padding/meshing/mend.h"
#include "padding/meshing/pieces.h"
#include "padding/meshing/wrap.h"

namespace padder {
namespace {

namespace pmp = CGAL::Polygon_mesh_processing;

constexpr const char* no_surface =
    ": no triangle has an area that shows at 1.5e-11 of the diagonal: either there is no surface to pad, or "
    "its parts lie so far apart that they must be padded one by one";

// Collects what repair did as "a; b; c".
class RepairReport {
 public:
  void add(const std::string& sentence) { text_ += (text_.empty() ? "" : "; ") + sentence; }
  std::string text() const { return text_.empty() ? "none needed" : text_; }

 private:
  std::string text_;
};

// Has triangle t no area? Its height is what counts: a small part far from another one has small triangles.
bool has_no_area(const Mesh& mesh, std::size_t t, double diagonal) {
  const Point &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
  const double longest2 = std::max({(b - a).squaredNorm(), (c - b).squaredNorm(), (a - c).squaredNorm()});
  return !(mesh.area_normal(t).norm() > 1e-14 * diagonal * std::sqrt(longest2));
}

bool any_flat(const Mesh& mesh, double diagonal) {
  for (std::size_t t = 0; t < mesh.triangles.size(); t++)
    if (has_no_area(mesh, t, diagonal)) return true;
  return false;
}

// Drops triangles without area. They carry no surface, and three points on a line would spoil the normals
// nearby.
Soup soup_with_area(const Mesh& mesh, Mesh& flat) {
  Soup soup;
  const double diagonal = mesh.bounds().diagonal();
  for (const Point& p : mesh.points) soup.points.push_back(to_cgal(p));
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const auto& c = mesh.triangles[t];
    if (has_no_area(mesh, t, diagonal))
      flat.triangles.push_back(c);
    else
      soup.triangles.push_back({c[0], c[1], c[2]});
  }
  if (!flat.triangles.empty()) flat.points = mesh.points;
  return soup;
}

Repaired as_given(Soup soup, const std::string& name) {
  pmp::merge_duplicate_points_in_polygon_soup(soup.points, soup.triangles);
  if (!pmp::is_polygon_soup_a_polygon_mesh(soup.triangles))
    throw Error(
        name +
        ": not a manifold, oriented mesh, so it cannot be padded without repair: leave out --repair never");
  CgalMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
  Repaired out;
  out.kind = CGAL::is_closed(mesh) ? BodyKind::solid : BodyKind::sheet;
  out.report = out.kind == BodyKind::solid ? "none (as given)"
                                           : "none (as given: an open sheet, padded below its normals)";
  out.mesh = from_cgal(mesh);
  return out;
}

// The triangles that hang together, shell by shell, in a fixed order.
std::vector<std::vector<std::uint32_t>> shells_of(CgalMesh& mesh) {
  const auto shell = mesh.add_property_map<CgalMesh::Face_index, std::size_t>("f:shell", 0).first;
  std::vector<std::vector<std::uint32_t>> shells(pmp::connected_components(mesh, shell));
  std::uint32_t t = 0;
  for (const auto f : mesh.faces()) shells[shell[f]].push_back(t++);
  return shells;
}

std::string cavities_text(std::size_t n) { return "kept " + counted(n, "inner shell") + " as cavities"; }

// Counts the cavities of `oriented`, which is `given` with its shells turned so that they bound a volume.
// Returns how many face outward in the file; nothing if one of them only repeats the shell around it.
std::optional<std::size_t> outward_cavities(const Surface& given, const Mesh& oriented,
                                            const std::vector<std::vector<std::uint32_t>>& triangles,
                                            bool inside_out, std::size_t& cavities) {
  std::vector<NestedShell> shells(triangles.size());
  std::vector<std::uint32_t> shell_of(oriented.triangles.size());
  std::vector<std::size_t> outward;
  for (std::uint32_t k = 0; k < triangles.size(); k++) {
    const double volume = signed_volume(given.mesh(), triangles[k]);
    shells[k] = {triangles[k], {}, volume < 0, std::abs(volume)};
    for (const auto t : triangles[k]) shell_of[t] = k;
    if (signed_volume(oriented, triangles[k]) >= 0) continue;
    cavities++;
    if ((volume > 0) != inside_out) outward.push_back(k);
  }
  if (outward.empty()) return 0;
  const auto none = [](std::uint32_t) { return false; };
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t k = 0; k < shells.size(); k++)
    shells[k].around = shells_around(given, shells[k].triangles, shell_of, none);
  const std::vector<char> repeats = find_repeats(given.mesh(), shells);
  if (std::any_of(repeats.begin(), repeats.end(), [](char c) { return c; })) return std::nullopt;
  return outward.size();
}

// The mesh, if it is closed and meets itself nowhere.
std::optional<Repaired> closed_solid(Soup soup, std::size_t flat, double diagonal) {
  RepairReport report;
  if (flat > 0) report.add("dropped " + counted(flat, "triangle") + " without area");
  const std::size_t before = soup.triangles.size();
  pmp::repair_polygon_soup(soup.points, soup.triangles);
  if (soup.triangles.size() < before)
    report.add("dropped " + counted(before - soup.triangles.size(), "duplicate triangle"));
  if (!pmp::is_polygon_soup_a_polygon_mesh(soup.triangles))
    report.add(pmp::orient_polygon_soup(soup.points, soup.triangles) ? "oriented the triangles alike"
                                                                     : "split non-manifold edges");
  CgalMesh mesh;
  pmp::polygon_soup_to_polygon_mesh(soup.points, soup.triangles, mesh);
  pmp::stitch_borders(mesh);
  if (!CGAL::is_closed(mesh)) return std::nullopt;
  const Surface given(from_cgal(mesh));
  if (any_contact(given)) return std::nullopt;
  // Nested shells become cavities. Parts that lie apart all face outward.
  const bool inside_out = pmp::volume(mesh) < 0;
  if (inside_out) report.add("turned inside out");
  pmp::orient_to_bound_a_volume(mesh);
  if (!(pmp::volume(mesh) > 1e-12 * std::pow(diagonal, 3))) return std::nullopt;
  Repaired out;
  out.mesh = from_cgal(mesh);
  const auto outward = outward_cavities(given, out.mesh, shells_of(mesh), inside_out, out.steps.cavities);
  if (!outward) return std::nullopt;
  if (out.steps.cavities > 0)
    report.add(cavities_text(out.steps.cavities) + (*outward > 0
                                                        ? ", though " + counted(*outward, "faces", "face") +
                                                              " outward (--repair union fills them)"
                                                        : ""));
  out.report = report.text(), out.checked = true;
  return out;
}

std::string percent(double share) { return short_number(100 * share, 3) + " %"; }

// What mend() did, in words.
std::string words(const Repaired& body, RepairMode mode, double diagonal) {
  RepairReport report;
  const RepairSteps& s = body.steps;
  const double area = body.mesh.area();
  constexpr double crumbs = 1e-5;  // of the area: not worth a word, and in RepairSteps all the same
  if (s.repeated > 0) report.add("dropped " + counted(s.repeated, "duplicate triangle"));
  if (s.turned > 0) report.add("turned " + counted(s.turned, "triangle"));
  if (s.turned_pieces > 0)
    report.add("turned " + counted(s.turned_pieces, "closed piece") + " that faced inward");
  if (s.split > 0) report.add("split " + counted(s.split, "edge") + " at corners that lie on them");
  if (s.joined > 0)
    report.add("joined " + counted(s.joined, "corner") + " up to " + percent(s.joined_width / diagonal) +
               " apart");
  if (s.cracks > 0) report.add("closed cracks up to " + percent(s.crack_width / diagonal) + " wide");
  if (!body.patches.empty()) {
    double longest = 0;
    for (const Patch& p : body.patches) longest = std::max(longest, p.rim);
    report.add("closed " + counted(body.patches.size(), "hole") + " (" + percent(body.filled_area / area) +
               " of the surface, longest rim " + percent(longest / diagonal) + ")");
  }
  if (s.crossing_pairs > 0 && body.kind == BodyKind::solid)
    report.add((s.pieces == 1 ? std::string("made one body of a piece that crosses itself (")
                              : "made one body of " + counted(s.pieces, "piece") + " that cross or touch (") +
               counted(s.crossing_pairs, "pair") + " of triangles)");
  if (s.crossing_pairs == 0 && s.buried_area > crumbs * area)
    report.add("left out walls inside (" + percent(s.buried_area / (area + s.buried_area)) +
               " of the surface)");
  if (s.copies > 0)
    report.add("took " + counted(s.copies, "inner shell") +
               " for a copy or a coarser level of the one around it");
  if (s.cavities > 0) report.add(cavities_text(s.cavities));
  if (body.kind == BodyKind::sheet || s.sheet_area > crumbs * area) {
    std::string why;
    if (s.sheet_pieces > 0 && s.sheet_rim > 0) {
      constexpr double nearly_solid = 0.7;  // the mean winding number of half a ball
      why = " (its widest hole is " + short_number(s.sheet_rim, 3) +
            " diagonals around; mean winding number inside it " + short_number(s.sheet_winding, 3) +
            (mode == RepairMode::automatic && s.sheet_winding > nearly_solid
                 ? "; if it is a solid with holes, use --repair fill)"
                 : ")");
    }
    report.add(body.kind == BodyKind::sheet
                   ? "an open sheet" + why
                   : percent(s.sheet_area / area) + " of the surface bounds nothing and is a sheet" + why);
  }
  return report.text();
}

// Is it a terrain, nearly all of it seen from one side, and nothing of it behind another part? A box without
// its lid is none: its normals cancel. Nor is a stack of sheets.
bool is_terrain(const Mesh& mesh) {
  Vector sum = Vector::Zero();
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) sum += mesh.area_normal(t);
  const double area = mesh.area();
  if (sum.norm() < 0.5 * area) return false;
  const Vector up = sum.normalized();
  const Vector along = (up + 1e-3 * Surface::ray_directions()[0]).normalized();  // no component is 0
  const Surface surface(mesh);
  const std::size_t step = mesh.triangles.size() / 4096 + 1;  // enough rays for a share of a thousandth
  double facing = 0, asked = 0, behind = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    const Vector a = mesh.area_normal(t);
    if (a.dot(up) > 0) facing += a.norm();
    if (t % step != 0) continue;
    asked += a.norm();
    const auto self = [t](std::uint32_t other) { return other == t; };
    if (surface.crossings(mesh.middle(t), along, self).value_or(0) != 0) behind += a.norm();
  }
  return facing > 0.999 * area && behind < 0.001 * asked;
}

Repaired wrapped(const Mesh& input, const RepairOptions& options, double diagonal, const std::string& name,
                 const std::string& why) {
  Mesh flat;
  Soup soup = soup_with_area(input, flat);
  if (soup.triangles.empty()) throw Error(name + no_surface);
  pmp::repair_polygon_soup(soup.points, soup.triangles);
  Repaired out = wrap(soup, options, diagonal, why);
  out.flat = std::move(flat);
  return out;
}

// `body` is what mend() made of the input, or nothing, for the reason `why_not`.
Repaired mended(std::optional<Repaired> body, const std::string& why_not, const Mesh& input,
                const RepairOptions& options, double diagonal, const std::string& name) {
  if (!body) {
    if (options.mode == RepairMode::automatic) return wrapped(input, options, diagonal, name, why_not);
    throw Error(name + ": " + why_not + ", too many to be cut apart: smooth the mesh, or give --repair wrap");
  }
  Repaired& out = *body;
  out.report = words(out, options.mode, diagonal);
  if (options.below_terrain && out.kind == BodyKind::sheet && is_terrain(out.mesh))
    out.solid.reset(), out.sheet = 0, out.report += ", padded below its normals";
  return std::move(out);
}

Repaired mend_all(const Mesh& input, const RepairOptions& options, double diagonal, const std::string& name) {
  std::string why_not;
  std::optional<Repaired> body = mend(input, options, &why_not);
  return mended(std::move(body), why_not, input, options, diagonal, name);
}

// A closed piece, if it encloses a volume.
std::optional<Repaired> piece_repaired(Mesh piece, const Mesh& input, const RepairOptions& options,
                                       double diagonal, const std::string& name) {
  const double volume = mass_properties(piece).volume;
  if (!(std::abs(volume) > 1e-12 * std::pow(diagonal, 3))) return std::nullopt;
  if (volume < 0)
    for (auto& t : piece.triangles) std::swap(t[1], t[2]);
  auto surface = std::make_shared<Surface>(piece);
  RepairReport report;
  if (volume < 0) report.add("turned inside out");
  const std::optional<std::size_t> folds = count_folds(*surface, options.fold_size);
  if (!folds) {
    std::string why_not;
    std::optional<Repaired> body = mend_piece(std::move(surface), options, &why_not);
    if (body) body->steps.turned_pieces = volume < 0;
    return mended(std::move(body), why_not, input, options, diagonal, name);
  }
  Repaired out;
  if (*folds > 0) {
    report.add("kept folds smaller than the tolerance (" + counted(*folds, "pair") + " of triangles)");
    out.steps.pieces = 1, out.steps.crossing_pairs = *folds;
    surface->set_side(SideBy::winding);
  }
  out.mesh = std::move(piece), out.report = report.text(), out.checked = *folds == 0;
  out.ready = std::move(*surface);
  return out;
}

}  // namespace

Repaired repair(const Mesh& input, const RepairOptions& options, const std::string& name) {
  const double diagonal = input.bounds().diagonal();
  const bool keep_solids = options.mode == RepairMode::automatic || options.mode == RepairMode::fill ||
                           options.mode == RepairMode::sheet;
  // Most meshes are one closed piece. Then nothing is to be dropped, turned or split, which saves CGAL's work
  // on one core.
  std::optional<Mesh> piece;
  if (keep_solids && !any_flat(input, diagonal)) piece = one_closed_piece(input);
  if (piece) {
    auto body = piece_repaired(std::move(*piece), input, options, diagonal, name);
    return body ? std::move(*body) : mend_all(input, options, diagonal, name);
  }
  if (options.mode == RepairMode::wrap) return wrapped(input, options, diagonal, name, "as asked");
  Mesh flat;
  Soup soup = soup_with_area(input, flat);
  if (soup.triangles.empty()) throw Error(name + no_surface);
  const auto with_flat = [&](Repaired out) {
    out.flat = std::move(flat);
    return out;
  };
  if (options.mode == RepairMode::never) return with_flat(as_given(std::move(soup), name));
  if (keep_solids)
    if (auto solid = closed_solid(std::move(soup), flat.triangles.size(), diagonal))
      return with_flat(std::move(*solid));
  return mend_all(input, options, diagonal, name);
}

}  // namespace padder
