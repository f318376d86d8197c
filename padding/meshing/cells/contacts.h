// SPDX-License-Identifier: GPL-3.0-or-later
// Finds where triangles touch, cross or overlap. Each decision is exact.
#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "padding/geometry/surface.h"

namespace padder {

// A point where triangles meet, named by what meets there. So each triangle that has the point gives it the
// same name, and the point gets the same coordinates everywhere.
struct MeetingPoint {
  // An edge is (smaller vertex << 32 | larger vertex). `with` is kNoOther for a vertex `what`, kTriangle +
  // the triangle where the edge `what` crosses it, and a larger edge where two edges cross.
  static constexpr std::uint64_t kNoOther = ~0ull, kTriangle = 1ull << 63;
  std::uint64_t what = 0, with = kNoOther;
  int place =
      0;  // in the triangle that is cut: 0 to 2 a corner, 3 to 5 the edge behind corner 0 to 2, 6 inside

  bool same(const MeetingPoint& other) const { return what == other.what && with == other.with; }
  bool is_vertex() const { return with == kNoOther; }
};

// Another triangle meets `triangle` along the segment from one point to the other, which may be the same.
struct Cut {
  std::uint32_t triangle = 0;
  std::array<MeetingPoint, 2> ends;
};

// All contacts of a soup. Triangles that share a vertex or an edge do not touch there.
struct Contacts {
  std::vector<Cut> cuts;
  std::vector<std::array<std::uint32_t, 2>> overlaps;  // pairs in one plane that have an area in common
  std::vector<std::array<std::uint32_t, 2>> pairs;     // all that meet, these among them
  bool too_many = false;                               // more pairs than the limit: the lists are empty
};

// A triangle so thin that its normal means nothing; it meets nothing.
bool is_flat(const Mesh& mesh, std::uint32_t triangle);

// All contacts of the triangles of `surface`, whose equal points have one index, unless more than `limit`
// pairs meet. A triangle marked in `passive` cuts no other one, and two such triangles are not compared: a
// thousand sheets that cross each other have no contact. The order does not depend on the number of threads.
// Takes about 2 us for each triangle and contact.
Contacts find_contacts(const Surface& surface, std::size_t limit = std::numeric_limits<std::size_t>::max(),
                       const std::vector<char>& passive = {});

// Do any two triangles meet? Stops at the first.
bool any_contact(const Surface& surface);

// The number of pairs that meet, where all are folds no larger than `size`, as the noise of a scan makes
// them: from one triangle of a pair the surface leads to the other without leaving a ball of that radius
// around the first. Nothing where one pair is none; stops at the first of these.
std::optional<std::size_t> count_folds(const Surface& surface, double size);

}  // namespace padder
