// Contacts as files: .csv, .npz, .vtp. Sorted by i, then j, so that every backend and path writes the same
// bytes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <vector>

#include "detect/detector.h"

namespace padder::detect {

// Contacts in host memory with Width::points and Scalar::f64, sorted.
struct ContactTable {
  std::vector<Pair> pairs;
  std::vector<Normal<double>> normals;
  std::vector<Points<double>> points;
};
ContactTable sorted_table(const Contacts& contacts);

// .csv: header i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz (the deepest point of i, of j); numbers with the digits
// that give the
//   same double back.
// .npz: `pairs` (N, 2) uint32, `normals` (N, 3), `depths` (N), `points_i` (N, 3), `points_j` (N, 3).
// .vtp: a vertex for each contact halfway between its two points, with point data i, j, normal, depth.
// Written whole or not at all. Throws Error for another ending, before any work when asked through
// check_contact_ending.
void check_contact_ending(const std::filesystem::path& path);
void write_contacts(const ContactTable& table, const std::filesystem::path& path);

}  // namespace padder::detect
