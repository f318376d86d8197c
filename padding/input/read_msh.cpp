// SPDX-License-Identifier: MIT
// Reads MuJoCo's binary .msh: four counts (vertices, normals, texture coordinates, faces), then these as
// floats and 32-bit indices. No library reads it but MuJoCo itself, with its compiler of models.
#include <array>
#include <bit>
#include <cstring>

#include "padding/input/read_internal.h"

static_assert(std::endian::native == std::endian::little, "a .msh is little-endian");

namespace padder::reading {

Soup read_msh(std::string_view bytes, const std::string& where) {
  if (bytes.starts_with("$MeshFormat"))
    fail(where, "it is a mesh of Gmsh, and a .msh is read as MuJoCo's: export it as .stl, .ply or .obj");
  // A count below 0 or of more than there is does not fit the size of the file.
  std::array<std::uint32_t, 4> counts = {};
  constexpr std::uint64_t head = sizeof counts, three = 3 * sizeof(float), two = 2 * sizeof(float);
  if (bytes.size() >= head) std::memcpy(counts.data(), bytes.data(), head);
  const auto [points, normals, textures, faces] = counts;
  if (head + three * points + three * normals + two * textures + three * faces != bytes.size())
    fail(where, "it is no .msh of MuJoCo, or cut short: export it again, or as .stl, .ply or .obj");
  Soup soup;
  const char* at = bytes.data() + head;
  for (std::uint32_t k = 0; k < points; k++, at += three) {
    float p[3];
    std::memcpy(p, at, sizeof p);
    soup.points.emplace_back(p[0], p[1], p[2]);
  }
  at += three * normals + two * textures;
  for (std::uint32_t f = 0; f < faces; f++, at += three) {
    std::int32_t corners[3];
    std::memcpy(corners, at, sizeof corners);
    for (const std::int32_t v : corners) {
      if (static_cast<std::uint32_t>(v) >= points)
        fail(where, "face " + std::to_string(f + 1) + " names vertex " + std::to_string(v) + " of " +
                        std::to_string(points) + ", counted from 0: export it again");
      soup.corners.push_back(static_cast<std::uint32_t>(v));
    }
    soup.close_face();
  }
  return soup;
}

}  // namespace padder::reading
