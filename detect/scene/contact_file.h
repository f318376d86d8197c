// SPDX-License-Identifier: MIT
// Contacts as files: .csv, .npz, .vtp. Sorted by i, then j, so that every backend and path writes the same
// bytes.
#pragma once
#include <filesystem>

#include "detect/detector.h"

namespace padder::detect {

// Contacts in host memory with Width::points and Scalar::f64, in any order, into a file:
// .csv: header i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz (the deepest point of i, of j); numbers with the digits
// that give the
//   same double back.
// .npz: `pairs` (N, 2) uint32, `normals` (N, 3), `depths` (N), `points_i` (N, 3), `points_j` (N, 3).
// .vtp: a vertex for each contact halfway between its two points, with point data i, j, normal, depth.
// The file is written in blocks while it is being sorted: whatever the number of contacts, less than 64 MiB
// are held beside them. `threads` as in Options (at most 16 are used). Written whole or not at all. Throws
// Error for another ending, before any work when asked through check_contact_ending, for other records, and
// when the file cannot be written.
void check_contact_ending(const std::filesystem::path& path);
void write_contacts(const Contacts& contacts, const std::filesystem::path& path, int threads = 0);

}  // namespace padder::detect
