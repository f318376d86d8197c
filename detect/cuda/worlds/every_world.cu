// SPDX-License-Identifier: MIT
#include "detect/cuda/worlds/every_world.h"

#include <thrust/iterator/counting_iterator.h>
#include <cub/device/device_radix_sort.cuh>
#include <cub/device/device_select.cuh>

#include "detect/boxes/halo.h"
#include "detect/cuda/device/exclusive_sum.h"
#include "detect/cuda/output/output.h"
#include "detect/cuda/worlds/curve.h"

namespace padder::detect::cuda {
namespace {

struct OfEveryWorld {
  DeviceSpheres source;
  __device__ bool operator()(std::uint32_t k) const { return source.world[k] == kEveryWorld; }
};
struct NumberedSphere {
  DeviceSpheres source;
  const std::uint32_t* numbers;
  __device__ Sphere operator()(std::uint32_t k) const { return source.sphere(numbers[k]); }
};

// Calls found(pair, sphere, sphere) for each contact of sphere k, of another world, with one of kEveryWorld.
// OwnsAll: there is no region. Without code for one the search takes 4 % less time.
template <bool OwnsAll, class Found>
__device__ void find(const EveryWorldTask& task, std::uint32_t k, Found found) {
  if (task.source.world[k] == kEveryWorld) return;
  const Sphere s = task.source.sphere(k);
  const Filter filter = task.source.filter(k);
  bool owns_contacts = OwnsAll;
  if constexpr (!OwnsAll) {
    const detect::Bounds halo = halo_of(s, task.radius_max, task.margin);
    if (!meets(halo, task.own)) return;
    owns_contacts = lies_within(halo, task.own);
  }
  const TreeBox box = box_of(s, task.margin);
  task.tree.visit(box, 0, task.every, [&](std::uint32_t e) {
    const Sphere other = task.spheres[e];
    if (!touching(s, other, task.margin) || !admitted(filter, task.filters[e])) return true;
    const std::uint32_t number = task.numbers[e];
    const Sphere &first = k < number ? s : other, &second = k < number ? other : s;
    if (owns_contacts || owns(task.own, midpoint(first, second)))
      found(Pair{min(k, number), max(k, number)}, first, second);
    return true;
  });
}

// Device lambdas may not stand in member functions that are not public, so these are functions of their own.
void read_spheres(const DeviceSpheres& source, std::uint32_t every, const std::uint32_t* numbers,
                  Sphere* spheres, Filter* filters, cudaStream_t stream) {
  each(every, stream, "read the spheres of every world", [=] __device__(std::uint64_t e) {
    spheres[e] = source.sphere(numbers[e]), filters[e] = source.filter(numbers[e]);
  });
}
void build_tree(const WideTree& tree, const Sphere* spheres, std::uint32_t every, cudaStream_t stream) {
  for (int level = 0; level < tree.levels.count; level++)
    each(tree.boxes_of(level), stream, "build the tree of every world",
         [=] __device__(std::uint64_t k) { tree.set(level, static_cast<std::uint32_t>(k), spheres, every); });
}
template <bool OwnsAll>
void count_contacts(const EveryWorldTask& task, cudaStream_t stream) {
  each(task.source.count, stream, "count contacts with every world", [=] __device__(std::uint64_t k) {
    std::uint32_t n = 0;
    find<OwnsAll>(task, static_cast<std::uint32_t>(k),
                  [&](const Pair&, const Sphere&, const Sphere&) { n++; });
    task.counts[k] = n;
  });
}
template <bool OwnsAll>
void write_contacts(const EveryWorldTask& task, const Output& output, std::uint64_t first,
                    cudaStream_t stream) {
  each(task.source.count, stream, "write contacts with every world", [=] __device__(std::uint64_t k) {
    std::uint64_t at = first + task.offsets[k];
    if (task.offsets[k] == task.offsets[k + 1]) return;
    find<OwnsAll>(task, static_cast<std::uint32_t>(k),
                  [&](const Pair& pair, const Sphere& a, const Sphere& b) {
                    output.pairs[at] = pair;
                    put_geometry(output, at++, a, b);
                  });
  });
}

}  // namespace

EveryWorld::EveryWorld(MemoryBook& book)
    : numbers_(book, "the spheres of every world"),
      spare_numbers_(book, "the spheres of every world"),
      counts_(book, "the contacts with every world"),
      curve_(book, "the order of worlds"),
      spare_curve_(book, "the order of worlds"),
      curve_box_(book, "the order of worlds"),
      spheres_(book, "the spheres of every world"),
      filters_(book, "the spheres of every world"),
      groups_(book, "the tree of worlds"),
      offsets_(book, "the contacts with every world"),
      total_(book, "the contacts with every world", true),
      scratch_(book, "sorting") {}

// The numbers of the spheres of kEveryWorld, along the curve.
void EveryWorld::order(const DeviceSpheres& source, std::uint32_t every, cudaStream_t stream) {
  std::uint32_t *const numbers = numbers_.reserve(every + std::uint64_t(1)), *const given =
                                                                                 spare_numbers_.reserve(
                                                                                     every);
  std::size_t bytes = 0;
  const auto select = [&](void* room) {
    cuda_check(cub::DeviceSelect::If(room, bytes, thrust::counting_iterator<std::uint32_t>(0), given,
                                     numbers + every, static_cast<std::int64_t>(source.count),
                                     OfEveryWorld{source}, stream),
               "find the spheres of every world");
  };
  select(nullptr), select(scratch_.reserve(bytes));
  std::uint64_t *const curve = curve_.reserve(every), *const sorted = spare_curve_.reserve(every);
  put_on_curve(every, NumberedSphere{source, given}, curve_box_.reserve(1), curve, stream);
  const auto sort = [&](void* room) {
    cuda_check(
        cub::DeviceRadixSort::SortPairs(room, bytes, curve, sorted, given, numbers, every, 0, 63, stream),
        "sort the spheres of every world");
  };
  sort(nullptr), sort(scratch_.reserve(bytes));
}

void EveryWorld::count(const DeviceSpheres& source, std::uint64_t every, double radius_max,
                       const CallOptions& options, cudaStream_t stream) {
  const auto n = static_cast<std::uint32_t>(every);
  order(source, n, stream);
  task_.source = source, task_.margin = options.margin, task_.numbers = numbers_.data();
  task_.own = options.own, task_.radius_max = radius_max;
  Sphere* const spheres = spheres_.reserve(n);
  Filter* const filters = filters_.reserve(n);
  read_spheres(source, n, numbers_.data(), spheres, filters, stream);
  task_.every = n, task_.spheres = spheres, task_.filters = filters;
  task_.tree.levels = WideTreeLevels::of(n);
  task_.tree.groups = groups_.reserve(task_.tree.levels.first[task_.tree.levels.count]);
  build_tree(task_.tree, spheres, n, stream);
  const std::uint64_t all = source.count + std::uint64_t(1);
  task_.counts = counts_.reserve(all), task_.offsets = offsets_.reserve(all);
  cuda_check(cudaMemsetAsync(task_.counts + source.count, 0, sizeof *task_.counts, stream), "begin");
  (task_.own == Region{} ? count_contacts<true> : count_contacts<false>)(task_, stream);
  exclusive_sum(task_.counts, task_.offsets, all, scratch_, stream);
  cuda_check(cudaMemcpyAsync(total_.reserve(1), task_.offsets + source.count, sizeof *task_.offsets,
                             cudaMemcpyDeviceToHost, stream),
             "count contacts with every world");
}

std::uint64_t EveryWorld::counted(cudaStream_t stream) {
  cuda_check(cudaStreamSynchronize(stream), "count contacts with every world");
  return *total_.data();
}

void EveryWorld::write(const Output& output, std::uint64_t first, cudaStream_t stream) const {
  (task_.own == Region{} ? write_contacts<true> : write_contacts<false>)(task_, output, first, stream);
}

}  // namespace padder::detect::cuda
