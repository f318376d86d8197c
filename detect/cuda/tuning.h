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

// Spheres a thread, of a portion that is divided among buckets at once. Row "tiles of 7 spheres a thread
// instead of 8". Bounded by shared memory (18 bytes a sphere) and by 64 registers a thread.
inline constexpr int kPortionItems = 8;

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

// ---- Search and output ----
// All were measured on the same H200 and on no other chip. Each names the scenes whose rows it moves, and
// what was tried. Those marked "Order." decide how work is divided among producers: another value also gives
// a stable list another order.

// Threads of a processor. Registers are limited so that this many blocks of 128 (the first group) or of 256
// threads run on a processor at once. GPUs of compute capability 8.6 and 8.9 have 1536 threads a processor,
// all others 2048.
#if defined(__CUDA_ARCH__) && (__CUDA_ARCH__ == 860 || __CUDA_ARCH__ == 870 || __CUDA_ARCH__ == 890)
inline constexpr int kThreadsOfProcessor = 1536;
#else
inline constexpr int kThreadsOfProcessor = 2048;
#endif
constexpr int at_most_resident(int blocks, int threads) {
  return blocks * threads <= kThreadsOfProcessor ? blocks : kThreadsOfProcessor / threads;
}

// dense 2e7: 32, 36, 40 warps a processor took 1.92, 1.98, 1.83 ms: few registers and many warps pay.
inline constexpr int kOneLevelBlocks = 10;
// dense 1e5: of few tiles all run at once anyway, and more registers shorten each.
inline constexpr int kFewTilesBlocks = 8;
// poly100 5e6: 32, 36, 40 warps took 1.320, 1.294, 1.275 ms.
inline constexpr int kCoarseToFineBlocks = 10;
// Hashed levels: no row; more blocks spill registers.
inline constexpr int kFineToCoarseBlocks = 6;
// poly100 5e6: 8, 9, 10 blocks took 0.994, 0.991, 1.012 ms: more leave too little of the L1 cache.
inline constexpr int kFusedBlocks = 9;
// Moving spilled contacts waits for memory, so that many under way pay. poly100 5e6: 5, 6, 7 blocks
// took 31.4, 31.8, 30.7 us after a fused search. After other searches registers allow no more than 5.
inline constexpr int kMoveBlocks = 5, kFusedMoveBlocks = at_most_resident(7, 256);

// Contacts that a warp's queue in shared memory holds. A warp that finds more searches twice. dense (all
// sizes), poly100 1e5, and scenes with hashed levels.
inline constexpr std::uint32_t kSameLevelQueue = 256, kCoarseToFineQueue = 320, kFineToCoarseQueue = 192;

// Up to this many tiles a processor, one dense level has a kernel of its own, in which latency is all. dense
// 1e5: the search took 12 us instead of 18.
inline constexpr std::uint32_t kFewTilesOfProcessor = 16;
// Up to this many tiles and units (if all run at once), each waits for the counts of those before it. dense
// 1e5: 0.049 instead of 0.056 ms; 2,344 tiles: 0.105 instead of 0.090 ms; poly100 1e5 with up to 2,816: 0.077
// instead of 0.0685. Order.
inline constexpr std::uint32_t kMostOrderedTiles = 1056;

// From this many spheres on, a warp of the coarse-to-fine search takes units as long as there are any, and
// units have quotas. poly100 1e6 and 5e6 in double records or with filters; quotas: 5e6 1.65 to 1.39 ms.
// Order.
inline constexpr std::uint64_t kManySpheres = 300000;
// Units that a warp of that search takes one after the other. poly100 5e6: 1, 2, 3, 4
// took 1.59, 1.49, 1.46, 1.49 ms.
inline constexpr std::uint32_t kWarpUnits = 3;
// Contacts that a unit of several spheres, or a part of one sphere's rows, is planned to find. poly100 5e6:
// parts of 100, 130, 160, 200 took 1.49, 1.47, 1.49, 1.53 ms. The fused search divides nothing but its work
// by units: larger ones. Order.
inline constexpr double kUnitContacts = 128, kPartContacts = 160;
inline constexpr double kFusedUnitContacts = 500, kFusedPartContacts = 1000;
// Rows of bins that a unit looks at, at most. poly100 (scenes whose fine level is sparse). Order.
inline constexpr double kUnitRows = 2048;

// From this many spheres on, levels are searched by the fused kernel. poly100 1.5e5: 0.081 instead of 0.094
// ms, 2e5: 0.084 instead of 0.102; but from 50,000 on 1e5: 0.073 instead of 0.061. Order.
inline constexpr std::uint64_t kFusedSpheres = 140000;
// Stable lists of fewer spheres: the fused search takes all tiles first. poly100 1e6 and 2e6 gained, 5e6 lost
// 1 %.
inline constexpr std::uint32_t kTilesFirstBelow = 3000000;
// Rounds of the fused search: 2^bits. poly100 5e6: 256 and 2,048 rounds took the same. Stable lists: 2^2
// rounds. poly100 1e6: 256, 64, 16, 4, 2, 1 rounds took 0.226, 0.2255, 0.224, 0.2225, 0.2215, 0.2195 ms; 2e6:
// one round 0.411, four 0.385.
inline constexpr std::uint32_t kRoundBits = 8, kStableRoundBits = 2;

// Up to this many groups of eight producers, the compaction adds up all of them in each block instead of in a
// kernel before. After a fused search: poly100 1e6 11 instead of 14 us, 2e5: the call 0.098 instead of 0.103
// ms. After other searches, where units have no quotas: dense 1e6 and poly100 1e5, where a predecessor of
// this kernel saved 3 and 4 us. Shared memory may allow fewer.
inline constexpr std::uint32_t kMostFusedOctets = 25000, kMostOctets = 1750;

}  // namespace padder::detect::cuda::tuning
