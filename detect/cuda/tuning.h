// SPDX-License-Identifier: MIT
// Every threshold of the GPU half that was chosen by measuring: what it decides, the row of a table in
// docs/experiments that it was measured on, and the chips it holds for. A value here changes the speed,
// and some change the order of the list; none changes which contacts are found. What follows from the
// hardware or from an algorithm's limits stands beside the code.
#pragma once
#include <cstdint>

#include "detect/core/bodies/body_choice.h"

namespace padder::detect::cuda::tuning {

// ---- Host memory ----
// Memory that is not pinned is copied to the device in such blocks, by so many threads with so many pinned
// blocks each, from so many bytes on. docs/experiments/calls.md, "host memory". Below, the driver is at most
// half as fast, and threads that wait for each other lose more where other programs use the processors. The
// host's memory decides, not the GPU.
inline constexpr std::uint64_t kStagedCopy = 32 << 20, kCopyBlock = 2 << 20;
inline constexpr int kCopyThreads = 8, kCopyBlocks = 2;

// ---- The order of the spheres ----
// Rows: docs/experiments/order.md, or the page named. All were measured on an H200 (132 processors, 227 KB of
// shared memory a block, 50 MB of L2). What another chip would move is said with each.

// Below so many spheres a counting sort over bins; from here on through buckets. Row "counting sort over
// bins, counts in L2" (1e5, 1e6, 5e6). The counts must stay in L2: less L2, or fewer processors, move it
// down.
inline constexpr std::uint32_t kFewSpheres = 1u << 18;

// In any order the host asks once in so many calls whether fewer bins would do, for which it plans all
// levels. Row "in any order the host asks in each call" (page levels): in each call that took up to a third
// of a small scene's. The larger it is, the longer a grid stays too large after spheres have drawn together.
// Host.
inline constexpr std::uint64_t kCallsOfGrid = 16;

// Where spheres outgrow the buckets of the call before twice within so many calls, so many calls count what
// each bucket needs. Row "buckets that spheres outgrow in each call" (page calls): to put a million spheres
// in order twice costs 45 us, to count them 10. Host.
inline constexpr int kSeldomOutgrown = 5, kCallsCounted = 32;

// After a call of stable order whose grid is another than that of the call before, so many calls also foresee
// the grid of spheres that go on. Row "a stable order guesses its grid" (page calls): a guess costs 0.7 us
// on the host, with radii of 1:100 3 us. Host.
inline constexpr int kCallsGuessed = 16;

// Contacts for each sphere that the first list of few spheres has room for. A list that is made longer stops
// the device: row "a list of few spheres that grows". The room is memory alone, on any chip.
inline constexpr std::uint32_t kListOfFew = 4;

// Spheres of a bucket on average, where a block has kBucketShared bytes of shared memory; with less, buckets
// are as much smaller. Row "buckets of 5,000, 6,500, 7,000, 8,000 spheres". Larger ones overflow.
inline constexpr double kBucketSpheres = 6500;
inline constexpr std::uint32_t kBucketShared = 226 * 1024;

// The same of hashed levels, in parts of that, because lines and planes of spheres come in runs. Rows of
// bench scenes, 5e6, with 0.6, 0.7 and 0.8 (H100): lines 0.544, 0.521, 0.613 ms; sheet 0.513, 0.496, 0.489;
// poly_layer 0.739, 0.731, 0.767; escaped, clump and shell within 3 %.
inline constexpr double kHashedBucket = 0.7;

// How often buckets are halved on average before another way is tried, since some overflow. No row of its
// own: beyond, blocks have so few spheres that a sort is no slower.
inline constexpr int kMostCrowding = 2;

// Up to so many spheres, buckets and the blocks that put them in order are half as large, two a processor.
// Without it dense and dilute 1e6 take 6 % more, poly100 3e5 5 %. Fewer processors move it down.
inline constexpr std::uint32_t kHalvedBuckets = 3'000'000;

// Spheres a thread, of a portion that is divided among buckets at once. Row "tiles of 7 spheres a thread
// instead of 8". Bounded by shared memory (18 bytes a sphere) and by 64 registers a thread.
inline constexpr int kPortionItems = 8;

// Several bins along x share an entry of the table, up to 2^kMostMerge, while there would still be more than
// kEntriesASphere entries a sphere. Row "several bins along x share a table entry where bins outnumber
// spheres (dilute)". Any chip: the table is memory traffic.
inline constexpr int kMostMerge = 3;
inline constexpr double kEntriesASphere = 0.75;

// A bin is divided along x into so many, where bins hold more than kFullBin spheres on average. Row, page
// search, "bins along x halved; quartered". Any chip: fewer candidates are tested.
inline constexpr std::uint32_t kFineBins = 4;
inline constexpr double kFullBin = 4.0;

// Stable order by cells: sphere numbers for which each table entry has places of its own, before others go to
// a list. Row, page stable_order, "numbers of a bin: a chain for each entry; 16 places; 8 places where
// tickets are taken". Any chip.
inline constexpr std::uint32_t kNumbersOfEntry = 8;

// ---- Bounds ----
// Blocks a processor that gather the bounds of each octave. Row, page levels, "sizes by octave in shared
// memory; registers for two octaves". Bounded by registers (48 a thread).
inline constexpr int kOctaveBlocks = 5;

// ---- Bodies ----
// What it costs to search bodies first, in spheres that are expanded and searched: where a revision says that
// most of the scene stays, and where all is read in each call. Fitted to 412 piles of bodies of 1 to 200
// spheres, of 25,000 to 43 million spheres in all, and 459 mixtures of shapes, of which 115 have static
// bodies (docs/experiments/bodies.md).
inline constexpr BodyCosts kKnownBodies{.octave = 0.5,
                                        .loose = 0.5,
                                        .call = 100'000,
                                        .body = -0.5,
                                        .ball = 0.75,
                                        .pair = 0.5,
                                        .crowd = 12'000,
                                        .contact = 0.35,
                                        .static_call = 30'000,
                                        .static_each = 20},
    kNewBodies{.octave = 0.5,
               .call = 250'000,
               .body = 15,
               .ball = 18,
               .pair = 0.5,
               .crowd = 12'000,
               .contact = 0.35};

// Where the pairs of balls that touch may be too many, they are estimated: bodies that fill less of the balls
// about their pieces than kHollow (of a rod, n touching spheres in a row, the share is 1 / n^2), and scenes
// where fewer pairs an element would be too many than kPackedPairs. Of equal balls, densely packed, 6 touch
// (docs/experiments/bodies.md).
inline constexpr double kHollow = 1.0 / 32, kPackedPairs = 8;

// In any order the way that the costs did not choose is tried, too, where it takes less than kTried times as
// long by the costs; and none that would expand more than kTriedSpheres, some 300 MB.
inline constexpr double kTried = 4;
inline constexpr std::uint64_t kTriedSpheres = 4'000'000;

// Worlds. Where bodies, loose spheres counted as bodies, have no more than kSmallBody spheres on average, the
// spheres are searched side by side. Else the tree is tried first, and gives up where it would take longer
// than the spheres: these take about so long for a call, and for each sphere. A step of a warp and a pair of
// elements count for what they took in scenes where they were slow. Measured on an H200, with random scenes
// of up to a million spheres (docs/experiments/worlds.md).
inline constexpr std::uint64_t kSmallBody = 16;
inline constexpr double kApartOfCall = 60'000, kApartOfSphere = 0.2;  // ns
inline constexpr double kTreeStepOfWarp = 150, kTreePair = 1.5;       // ns
// In a world of more elements a list, or a count, takes longer by the tree; the other answers end early.
inline constexpr std::uint32_t kMostElementsOfList = 64, kMostElementsOfAnswer = 4096;

// Up to so many elements, the balls are tested each with each, without a grid. Rows "1000 at 0.6" of
// `bench piles`: a grid leaves most of the GPU without work there. Fewer processors move it down.
inline constexpr std::uint32_t kAllPairsElements = 6144;

// The narrow phase goes by groups of spheres where their balls are smaller than this, in radii of the pieces'
// balls. Rows of docs/experiments/bodies.md: shells of 64 spheres (0.72) lose a fourth by groups, padded
// shoes (0.39) gain a fifth.
inline constexpr double kSmallGroups = 0.55;

// Blocks a processor of the narrow phase; and of the two kernels that write the contacts of a stable order:
// with an offset for each batch, and with sums of their own. Rows "1e5 bodies of 64" of the table of bodies.
inline constexpr int kNarrowPhaseBlocks = 6, kWriteBlocks = 8, kSumAndWriteBlocks = 2;

// ---- Search and output ----
// Rows: docs/experiments, with the scene. All were measured on the same H200 and on no other chip.
// Numbers of blocks hold for chips with 64 K registers a processor (8.0 to 9.0); where a processor has less
// shared memory, or an L1 cache half as large (8.6, 8.9), fewer are better or run. Numbers of spheres and of
// tiles grow with the number of processors. Values marked "Order." decide how work is divided among
// producers: another value also gives a stable list another order.

// Threads of a processor: 1536 for compute capability 8.6 and 8.9, else 2048. Registers of a kernel are
// limited so that as many blocks as named here run on a processor at once; asking for more threads than it
// has would lift the limit.
#if defined(__CUDA_ARCH__) && (__CUDA_ARCH__ == 860 || __CUDA_ARCH__ == 870 || __CUDA_ARCH__ == 890)
inline constexpr int kThreadsOfProcessor = 1536;
#else
inline constexpr int kThreadsOfProcessor = 2048;
#endif
constexpr int at_most_resident(int blocks, int threads) {
  return blocks * threads <= kThreadsOfProcessor ? blocks : kThreadsOfProcessor / threads;
}

// Blocks of 128 threads. Row "32, 36, 40 warps a processor", page search: dense 2e7 1.92, 1.98, 1.83 ms. Few
// registers and many warps pay.
inline constexpr int kOneLevelBlocks = 10;
// The kernel for few tiles has more registers a thread instead of more blocks. Row "few tiles: all rows asked
// for at once".
inline constexpr int kFewTilesBlocks = 8;
// Row "float alone decides in the hot loop; 32, 36, 40 warps": poly100 5e6 1.320, 1.294, 1.275 ms.
inline constexpr int kSeveralLevelsBlocks = 10;
// Row "the same with 8, 9, 10 blocks a processor": poly100 5e6 0.994, 0.991, 1.012 ms. More leave too little
// of the L1 cache.
inline constexpr int kFusedBlocks = 9;
// Blocks of 256 threads that move spilled contacts: they wait for memory, so that many under way pay. Row "5,
// 6, 7 blocks a processor to move": poly100 5e6 31.4, 31.8, 30.7 us. After searches that are not fused: no
// row.
inline constexpr int kMoveBlocks = 5, kFusedMoveBlocks = at_most_resident(7, 256);

// Contacts that a warp's queue in shared memory holds. A warp that finds more searches twice. Rows of `bench
// scenes`, 1e6, with 256 and 512: clump 0.166, 0.116 ms; walk 0.148, 0.140; dense the same. The second is the
// "longer queue" of the row "work units of 128 contacts of a usual sphere", the third has no row.
inline constexpr std::uint32_t kSameLevelQueue = 512, kUnitQueue = 320;

// Up to this many tiles a processor, one dense level has a kernel of its own, in which latency is all. Row
// "few tiles: all rows asked for at once": dense 1e5, search 18 to 12 us.
inline constexpr std::uint32_t kFewTilesOfProcessor = 16;
// Up to this many tiles and units (if all run at once), each waits for the counts of those before it. Row
// "few tiles, numbered as they start": dense 1e5 0.056 to 0.049 ms; but 2,344 tiles 0.090 to 0.105. Row "up
// to 2,816 tiles wait": poly100 1e5 0.0685 to 0.077. Order.
inline constexpr std::uint32_t kMostOrderedTiles = 1056;

// Rows of bins that are not searched by the warp that comes upon them, but deferred to a list
// (search/long_rows.h): with more than kLongRow candidates, among those of 32 spheres at their own level; and
// with more than kLongRowOfUnit from where on a unit has had more than kLongUnit (fused search:
// kFusedLongUnit) candidates. A part of a row has kRowPart candidates at most, and so many blocks a processor
// search them. Row, page search, "long rows". Order.
inline constexpr std::uint32_t kLongRow = 64, kLongRowOfUnit = 16, kRowPart = 512;
inline constexpr std::uint32_t kLongUnit = 4096, kFusedLongUnit = 12288;
inline constexpr int kLongRowBlocks = 8;
// With more parts than this, rows are searched as they come: then each warp has enough to do, and the list
// would take much memory. No row.
inline constexpr std::uint64_t kMostRowParts = 1 << 22;

// From this many spheres on, a warp of the search of several levels takes units as long as there are any, and
// units have quotas. Row "a work unit has a quota by the volume it reaches into": poly100 5e6 1.65, 1.39 ms.
// Order.
inline constexpr std::uint64_t kManySpheres = 300000;
// Units that a warp of that search takes one after the other. Row "1, 2, 3, 4 units a warp": poly100
// 5e6 1.59, 1.49, 1.46, 1.49 ms.
inline constexpr std::uint32_t kWarpUnits = 3;
// Contacts that a unit of several spheres, or a part of one sphere's rows, is planned to find. Rows "work
// units of 128 contacts of a usual sphere", "parts of 100, 130, 160, 200 contacts": 1.49, 1.47, 1.49, 1.53
// ms. The fused search divides nothing but its work by units, so they are larger; no row. Order.
inline constexpr double kUnitContacts = 128, kPartContacts = 130;
inline constexpr double kFusedUnitContacts = 500, kFusedPartContacts = 1000;
// Rows of bins that a unit looks at, at most. No row; it bounds the time of a unit where the finer level is
// nearly empty. Order.
inline constexpr double kUnitRows = 2048;

// From this many spheres on, levels are searched by the fused kernel. Row "fused levels from 140,000
// spheres on, not 300,000; from 50,000": poly100 1.5e5 0.094 to 0.081 ms, 2e5 0.102 to 0.084; 1e5 0.061 to
// 0.073. Order.
inline constexpr std::uint64_t kFusedSpheres = 140000;
// The order in which the fused search takes its work (fused_work.h): in 2^bits rounds; of fewer spheres than
// the last two numbers largest spheres first, and then a stable list in 2^bits rounds. Rows "items in other
// order", "work in 2,048 parts instead of 256" and "largest spheres first". Stable, 256, 64, 16, 4, 2, 1
// rounds: poly100 1e6 0.226, 0.232, 0.226, 0.224, 0.2225, 0.2195 ms; 2e6 0.385, 0.388, 0.386, 0.385, 0.388,
// 0.411; 5e6 lost 1 % and more.
inline constexpr std::uint32_t kRoundBits = 8, kStableRoundBits = 2;
inline constexpr std::uint32_t kLargestFirst = 1500000, kStableLargestFirst = 3000000;

// Up to this many groups of eight producers, each block of the compaction adds up all of them; beyond, a
// kernel before it does. After a fused search: row "one kernel numbers and moves": poly100 1e6 14 to 11 us,
// 2e5 call 0.103 to 0.098 ms. After other searches, where units have no quotas: row "up to 14,000 tiles", of
// a kernel that added up single producers: dense 1e6 9.9 to 7.2 us, poly100 1e5 13.4 to 9 us. Shared memory
// may allow fewer.
inline constexpr std::uint32_t kMostFusedOctets = 25000, kMostOctets = 1750;

}  // namespace padder::detect::cuda::tuning
