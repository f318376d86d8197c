// SPDX-License-Identifier: MIT
// Contacts as files: .csv, .npz, .vtp. Sorted by i, then j, so that every backend and path writes the same
// bytes.
#pragma once
#include <filesystem>

#include "detect/detector.h"

namespace padder::detect {

// Writes the contacts of `input`. They may be in any order, and their pairs must lie in host memory. The
// file's ending says how:
//
// .csv: header i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz (the deepest point of i, then of j), as many digits of
//       each number as give the same double back
//
// .npz: `pairs` (N, 2) uint32, `normals` (N, 3), `depths` (N), `points_i` (N, 3), `points_j` (N, 3)
//
// .vtp: a vertex for each contact halfway between its two points, with point data i, j, normal, depth
//
// Normals, depths and points are computed from the spheres in double, and have the bits of the records that a
// Detector writes. So the pairs alone are enough (Width::pairs): records of 80 bytes a contact would have to
// be written, and fetched from all over a list of gigabytes. `input` must lie in host memory. It is read as
// by a call with a new revision.
//
// The file is written whole or not at all. The threads sort a part of the contacts, write it in blocks, and
// go on with the next part. They hold less than 64 MiB beside the list, or a third of its bytes and 16 MiB if
// that is more, and 8 bytes for each body. The disk starts to write with the first block. `threads` is as in
// CallOptions; at most 16 are used. Throws Error for another ending, for a pair that is not in the input, for
// other memory, and when the file cannot be written. check_contact_ending() throws for another ending alone,
// before there are any contacts.
void check_contact_ending(const std::filesystem::path& path);
void write_contacts(const Contacts& contacts, const Input& input, const std::filesystem::path& path,
                    int threads = 0);

}  // namespace padder::detect
