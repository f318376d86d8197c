// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/mend.h"

#include <algorithm>
#include <utility>

#include "padding/meshing/cavities/cavities.h"
#include "padding/meshing/holes/joined_pieces.h"
#include "padding/meshing/holes/open_groups.h"

namespace padder {
namespace {

class Mender {
 public:
  Mender(const Mesh& input, const RepairOptions& options)
      : options_(options), input_(input), diagonal_(input.bounds().diagonal()) {
    pieces_ = find_joined_pieces(input, options, diagonal_, out_.steps);
  }
  Mender(std::shared_ptr<const Surface> piece, const RepairOptions& options)
      : options_(options),
        input_(piece->mesh()),
        diagonal_(piece->bounds().diagonal()),
        surface_(std::move(piece)) {
    pieces_.mesh = input_;
    Piece& all = pieces_.pieces.emplace_back();
    all.triangles = numbered(input_.triangles.size()), all.closed = true;
  }

  // Nothing where the pieces make no body; why_not() says why.
  std::optional<Repaired> run() {
    out_.thickness = options_.thickness;
    out_.steps.pieces = pieces_.pieces.size();
    out_.steps.repeated = pieces_.repeated, out_.steps.turned = pieces_.turned;
    std::vector<std::uint32_t> open, walls;
    for (Piece& piece : pieces_.pieces) {
      if (piece.closed && !piece.bounds_nothing) {
        // Outward, so that no inner shell takes away from the winding number around it.
        units_.inward.push_back(turn_outward(pieces_.mesh, piece.triangles));
        closed_.push_back(std::move(piece.triangles));
        continue;
      }
      auto& list = piece.bounds_nothing ? walls : open;
      list.insert(list.end(), piece.triangles.begin(), piece.triangles.end());
    }
    const OpenGroups open_groups =
        close_open_pieces(pieces_.mesh, open, closed_, options_, diagonal_, out_.steps);
    if (open_groups.parts_of_one) {
      why_not_ = "its open pieces enclose a body together, but not one by one";
      return std::nullopt;
    }
    assemble(open_groups.groups, walls);
    return finish();
  }

  const std::string& why_not() const { return why_not_; }

 private:
  void add(std::uint32_t t, TriangleRole role, std::uint32_t unit, std::uint32_t patch) {
    soup_.triangles.push_back(pieces_.mesh.triangles[t]);
    units_.roles.push_back(role), units_.unit_of.push_back(unit), patch_.push_back(patch);
  }

  void assemble(const std::vector<OpenGroup>& groups, const std::vector<std::uint32_t>& walls) {
    soup_.points = pieces_.mesh.points;
    std::uint32_t unit = 0;
    for (const auto& triangles : closed_) {
      for (const auto t : triangles) add(t, TriangleRole::bounds, unit, kNone);
      unit++;
    }
    for (const OpenGroup& group : groups) {
      std::size_t k = 0;
      for (; k < group.own; k++)
        add(group.triangles[k], group.solid ? TriangleRole::bounds : TriangleRole::sheet, unit, kNone);
      unit++;
      units_.inward.push_back(group.solid && group.inward);
      if (!group.solid) {
        out_.steps.sheet_pieces++;
        if (group.winding >= out_.steps.sheet_winding)
          out_.steps.sheet_winding = group.winding, out_.steps.sheet_rim = group.opening / group.diagonal;
        continue;
      }
      for (std::size_t c = 0; c < group.cracks.size(); c++)
        add(group.triangles[k++], TriangleRole::patch, unit - 1, kNone);
      out_.steps.cracks += group.cracks.size();
      out_.steps.crack_width = std::max(out_.steps.crack_width, group.crack_width);
      for (std::size_t r = 0; r < group.rims.size(); r++) {
        for (std::size_t c = 0; c < group.patches[r].size(); c++)
          add(group.triangles[k++], TriangleRole::patch, unit - 1,
              static_cast<std::uint32_t>(out_.patches.size()));
        Patch& patch = out_.patches.emplace_back();
        patch.rim = rim_length(pieces_.mesh, group.rims[r]);
        for (const auto v : group.rims[r])
          patch.place += pieces_.mesh.points[v] / double(group.rims[r].size());
      }
    }
    for (const auto t : walls) add(t, TriangleRole::sheet, unit, kNone);
    units_.count = unit + 1;
  }

  void turn_cavities(Contacts& contacts) {
    if (units_.count < 2 || options_.mode == RepairMode::united) return;
    const auto [cavity, copy] = find_cavities(*surface_, units_, contacts, diagonal_);
    for (std::size_t t = 0; t < units_.unit_of.size(); t++) {
      const std::uint32_t unit = units_.unit_of[t];
      if (cavity[unit]) std::swap(soup_.triangles[t][1], soup_.triangles[t][2]);
      if (copy[unit]) units_.roles[t] = TriangleRole::sheet;  // or it would fill a cavity of the other
    }
    // A cavity may cross itself, and its cuts name corners and edges by their place in a triangle.
    constexpr std::array turned = {0, 2, 1, 5, 4, 3, 6};
    for (Cut& cut : contacts.cuts)
      if (cavity[units_.unit_of[cut.triangle]])
        for (MeetingPoint& end : cut.ends) end.place = turned[static_cast<std::size_t>(end.place)];
    for (std::size_t u = 0; u < units_.count; u++)
      out_.steps.cavities += cavity[u], out_.steps.copies += copy[u];
    for (std::size_t u = 0; u < units_.inward.size(); u++) units_.inward[u] = units_.inward[u] && !cavity[u];
    if (out_.steps.cavities > 0) surface_ = std::make_shared<const Surface>(soup_);
  }

  std::optional<Repaired> finish() {
    if (!surface_) surface_ = std::make_shared<const Surface>(soup_);
    const std::vector<TriangleRole>& roles = units_.roles;
    const auto is_sheet = [](TriangleRole role) { return role == TriangleRole::sheet; };
    std::vector<char> passive(roles.size());  // what bounds nothing has no cells
    std::transform(roles.begin(), roles.end(), passive.begin(), is_sheet);
    Contacts contacts = find_contacts(*surface_, options_.most_pairs, passive);
    why_not_ = "its triangles cross at more than " + std::to_string(options_.most_pairs) + " places";
    if (contacts.too_many) return std::nullopt;
    turn_cavities(contacts);
    for (std::size_t u = 0; u < closed_.size(); u++) out_.steps.turned_pieces += units_.inward[u];
    out_.steps.crossing_pairs = contacts.pairs.size();
    OuterCells cells = outer_cells(*surface_, roles, contacts, options_.most_pairs);
    if (cells.too_many) return std::nullopt;
    out_.mesh = std::move(cells.mesh);
    out_.sheet = out_.mesh.triangles.size() - cells.boundary;
    out_.kind = cells.boundary > 0 ? BodyKind::solid : BodyKind::sheet;
    out_.steps.buried_area = cells.buried.area();
    if (!cells.buried.triangles.empty()) out_.marks.push_back({MarkKind::buried, std::move(cells.buried)});
    for (std::uint32_t t = 0; t < out_.mesh.triangles.size(); t++) {
      const auto from = cells.source[t];
      const double area = out_.mesh.area_normal(t).norm();
      if (t >= cells.boundary) out_.steps.sheet_area += area;
      if (patch_[from] == kNone) continue;
      Patch& patch = out_.patches[patch_[from]];
      patch.area += area, patch.triangles.push_back(t);
    }
    // A patch without area closes a crack, and one that is buried closes nothing outside.
    std::erase_if(out_.patches, [&](const Patch& p) { return !(p.area > 0); });
    out_.filled = out_.patches.size();
    for (const Patch& patch : out_.patches) out_.filled_area += patch.area;
    out_.solid = std::move(surface_);
    if (std::any_of(roles.begin(), roles.end(), is_sheet)) {
      Mesh solid;
      solid.points = soup_.points;
      for (std::size_t t = 0; t < roles.size(); t++)
        if (!is_sheet(roles[t])) solid.triangles.push_back(soup_.triangles[t]);
      out_.solid = std::make_shared<const Surface>(solid);
    }
    keep_flat();
    return std::move(out_);
  }

  // Triangles without area that lie neither in the surface nor inside the body.
  void keep_flat() {
    std::vector<std::array<std::uint32_t, 3>> flat;
    for (std::uint32_t t = 0; t < input_.triangles.size(); t++)
      if (is_flat(input_, t)) flat.push_back(input_.triangles[t]);
    if (flat.empty()) return;
    const Surface surface = out_.surface();
    const auto covered = [&](const Point& p) {
      return surface.any_within(p, 1e-9 * diagonal_) || surface.winding_number(p).value_or(0) > 0;
    };
    for (const auto& [a, b, c] : flat) {
      const Point &p = input_.points[a], &q = input_.points[b], &r = input_.points[c];
      bool all = true;
      for (const Point& x : {p, q, r, Point(0.5 * (p + q)), Point(0.5 * (q + r)), Point(0.5 * (r + p))})
        all = all && covered(x);
      if (!all) out_.flat.triangles.push_back({a, b, c});
    }
    if (!out_.flat.triangles.empty()) out_.flat.points = input_.points;
  }

  static constexpr std::uint32_t kNone = ~0u;
  const RepairOptions& options_;
  const Mesh& input_;
  const double diagonal_;
  Pieces pieces_;                                   // its mesh gets the patches, too
  std::vector<std::vector<std::uint32_t>> closed_;  // pieces
  Mesh soup_;                                       // closed
  std::shared_ptr<const Surface> surface_;          // of soup_
  Units units_;                                     // of soup_
  std::vector<std::uint32_t> patch_;                // of each triangle of soup_
  std::string why_not_;
  Repaired out_;
};

std::optional<Repaired> run(Mender&& mender, std::string* why_not) {
  auto body = mender.run();
  if (why_not) *why_not = mender.why_not();
  return body;
}

}  // namespace

std::optional<Repaired> mend(const Mesh& input, const RepairOptions& options, std::string* why_not) {
  return run(Mender(input, options), why_not);
}

std::optional<Repaired> mend_piece(std::shared_ptr<const Surface> piece, const RepairOptions& options,
                                   std::string* why_not) {
  return run(Mender(std::move(piece), options), why_not);
}

}  // namespace padder
