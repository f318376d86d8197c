// SPDX-License-Identifier: MIT
// Contacts as files: .csv, .npz, .vtp. Sorted by i, then j, so that every backend and path writes the same
// bytes.
#pragma once
#include <filesystem>

#include "detect/detector.h"

namespace padder::detect {

// Writes contacts, in any order, in host memory with Width::points and Scalar::f64. The file's ending says
// how:
//
// .csv: header i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz (the deepest point of i, then of j), as many digits of
//       each number as give the same double back
//
// .npz: `pairs` (N, 2) uint32, `normals` (N, 3), `depths` (N), `points_i` (N, 3), `points_j` (N, 3)
//
// .vtp: a vertex for each contact halfway between its two points, with point data i, j, normal, depth
//
// The file is written whole or not at all. The threads sort a part of the contacts, write it in blocks, and
// go on with the next part: whatever the number of contacts, they hold less than 64 MiB beside them.
// `threads` is as in Options; at most 16 are used. Throws Error for another ending, for other records, and
// when the file cannot be written. check_contact_ending() throws for another ending alone, before there are
// any contacts.
void check_contact_ending(const std::filesystem::path& path);
void write_contacts(const Contacts& contacts, const std::filesystem::path& path, int threads = 0);

}  // namespace padder::detect
