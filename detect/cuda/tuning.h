// SPDX-License-Identifier: MIT
// Every threshold of the GPU half that was chosen by measuring: what it decides, the row of
// docs/results/h200.md that it was measured on, and the chips it holds for. A value here changes the speed,
// and some change the order of the list; none changes which contacts are found. What follows from the
// hardware or from an algorithm's limits stands beside the code.
#pragma once
#include <cstdint>

namespace padder::detect::cuda::tuning {

// ---- The order of the spheres ----
// Rows: "Designs tried", part "order" or as named. All were measured on an H200 (132 processors, 227 KB of
// shared memory a block, 50 MB of L2). What another chip would move is said with each.

// Below so many spheres a counting sort over bins; from here on through buckets. Row "counting sort over
// bins, counts in L2" (1e5, 1e6, 5e6). The counts must stay in L2: less L2, or fewer processors, move it
// down.
inline constexpr std::uint32_t kFewSpheres = 1u << 18;

// Spheres of a bucket on average, where a block has kBucketShared bytes of shared memory; with less, buckets
// are as much smaller. Row "buckets of 5,000, 6,500, 7,000, 8,000 spheres". Larger ones overflow.
inline constexpr double kBucketSpheres = 6500;
inline constexpr std::uint32_t kBucketShared = 226 * 1024;

// Spheres a thread, of a tile that is divided among buckets at once. Row "tiles of 7 spheres a thread instead
// of 8". Bounded by shared memory (18 bytes a sphere) and by 64 registers a thread.
inline constexpr int kTileItems = 8;

// Several bins along x share an entry of the table, up to 2^kMostMerge, while there would still be more than
// kEntriesASphere entries a sphere. Row "several bins along x share a table entry where bins outnumber
// spheres (dilute)". Any chip: the table is memory traffic.
inline constexpr int kMostMerge = 3;
inline constexpr double kEntriesASphere = 0.75;

// A bin is divided along x into so many, where bins hold more than kFullBin spheres on average. Row, part
// "search", "bins along x halved; quartered". Any chip: fewer candidates are tested.
inline constexpr std::uint32_t kFineBins = 4;
inline constexpr double kFullBin = 4.0;

// Stable order by cells: sphere numbers for which each table entry has places of its own, before others go to
// a list. Row, part "fixed order", "numbers of a bin: a chain for each entry; 16 places; 8 places where
// tickets are taken". Any chip.
inline constexpr std::uint32_t kNumbersOfEntry = 8;

// ---- Bounds ----
// Blocks a processor that gather the bounds of each octave. Row, part "levels", "sizes by octave in shared
// memory; registers for two octaves; …". Bounded by registers (48 a thread).
inline constexpr int kOctaveBlocks = 5;

// ---- Bodies ----
// What it costs to search a ball about a piece of a body, in spheres that are expanded and searched: so it is
// decided whether bodies are searched first. Rows "1e4 bodies of 64", "1e5 bodies of 64" of the table of
// bodies.
inline constexpr double kBallCost = 0.75;

// Blocks a processor of the narrow phase, and of the two kernels that write its contacts: with an offset for
// each batch, and with sums of their own. Rows "1e5 bodies of 64" of the table of bodies.
inline constexpr int kNarrowPhaseBlocks = 8, kWriteBlocks = 8, kSumAndWriteBlocks = 2;

}  // namespace padder::detect::cuda::tuning
