// SPDX-License-Identifier: MIT
#include "detect/boxes/device_worker.h"

#include <algorithm>
#include <new>
#include <string_view>

#include "detect/core/errors.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::uint64_t kBatch = 1 << 14;        // contacts handed over at once
constexpr std::uint64_t kSmallestSplit = 64;     // spheres; a box that cannot hold so few will not hold any
constexpr std::uint64_t kSplitSample = 1 << 16;  // points that the plane of a split is chosen by

// Bytes of a normal, or of both points, of one contact.
std::size_t normal_bytes(Scalar s) {
  return s == Scalar::f32 ? sizeof(Normal<float>) : sizeof(Normal<double>);
}
std::size_t point_bytes(Scalar s) {
  return s == Scalar::f32 ? sizeof(Points<float>) : sizeof(Points<double>);
}

const void* advanced(const void* array, std::uint64_t bytes) {
  return array ? static_cast<const char*>(array) + bytes : nullptr;
}

}  // namespace

void BoxResult::add(const BoxResult& more) {
  contacts += more.contacts, hash += more.hash, doubtful += more.doubtful, splits += more.splits;
}

DeviceWorker::DeviceWorker(const DeviceChoice& device) : device_(device), detector_(device) {
  on_host_ = std::string_view(detector_.backend()) == "omp";
}

std::uint64_t DeviceWorker::host_memory() const {
  return (on_host_ ? detector_.memory() : 0) + pairs_.capacity() * sizeof(WidePair);
}

void DeviceWorker::fail(const Failure& failure) const {
  const std::string box = "box " + std::to_string(box_),
                    device = on_host_ ? "the CPU" : "GPU " + std::to_string(device_.device);
  if (options_.memory_limit && failure.of_memory)
    throw Error(box + " needs more memory on " + device + " than the " +
                std::to_string(options_.memory_limit) + " bytes that its limit leaves it: raise the limit");
  throw Error(box + " failed on " + device + ": " + failure.reason);
}

BoxResult DeviceWorker::run(const BoxLoad& load, std::uint32_t box, const CallOptions& options, int threads,
                            Delivery& delivery) {
  options_ = options, box_ = box, threads_ = threads;
  options_.output = Memory::host, options_.stream = nullptr;
  if (!delivery.consumer) options_.width = Width::pairs;
  peak_of_splits_ = 0;
  return find(load, 0, delivery);
}

// `copied`: bytes of the loads that were made by splitting and are still held.
BoxResult DeviceWorker::find(const BoxLoad& load, std::uint64_t copied, Delivery& delivery) {
  peak_of_splits_ = std::max(peak_of_splits_, copied);
  auto& options = detector_.options();
  options = options_;
  options.own = common(options_.own, load.region);
  if (load.spheres() < 2 || is_empty(options.own)) return {};
  // Contacts that are only counted stay on the GPU. The numbers of the spheres of bodies are not in an array.
  const bool stay = !delivery.consumer && !on_host_ && load.body_spheres == 0;
  const std::uint64_t ids = load.loose * sizeof(std::uint64_t);
  if (stay) options.output = Memory::device;
  if (stay && options.memory_limit) options.memory_limit -= std::min(ids, options.memory_limit - 1);
  const Contacts* contacts = nullptr;
  try {
    contacts = &detector_.detect(load.input());
    if (stay)
      return {contacts->count,
              hash_.of(device_.device, contacts->pairs, contacts->count, {load.ids.data(), load.loose}),
              contacts->doubtful};
  } catch (const MemoryError& e) {
    return split(load, copied, {e.what(), true}, delivery);
  } catch (const Error& e) {
    return split(load, copied, {e.what(), false}, delivery);
  } catch (const std::bad_alloc&) {
    return split(load, copied, {"there is not enough memory", true}, delivery);
  }
  return deliver(load, *contacts, delivery);
}

// The input was checked before, so the likely reason of a failure is memory. For any other reason the halves
// fail too, and the smallest one says so.
BoxResult DeviceWorker::split(const BoxLoad& load, std::uint64_t copied, const Failure& failure,
                              Delivery& delivery) {
  if (load.spheres() < kSmallestSplit) fail(failure);
  detector_ = Detector(device_), hash_.release();  // gives their memory back
  const Input input = load.input();
  Assignment assignment(input, threads_);
  assignment.set_margin(options_.margin);
  const BoxTree halves = cut_space(assignment.sample(kSplitSample), 2, load.region, threads_);
  assignment.count(halves, kSplitSample);
  const std::uint64_t larger_half = std::max(assignment.spheres_of(0), assignment.spheres_of(1));
  if (larger_half > load.spheres() / 16 * 15) fail(failure);  // they all meet at one place
  BoxResult sum;
  sum.splits = 1;
  for (std::uint32_t half = 0; half < 2; half++) {
    BoxLoad part;
    assignment.fill(halves, half, {&part, 1});
    std::uint64_t near = 0;
    for (std::uint64_t k = 0; k < part.loose; k++) part.ids.data()[k] = load.id_of(part.ids.data()[k], near);
    for (std::uint64_t b = 0; b < part.body_count; b++)
      if (part.first_of_body[b] < part.first_of_body[b + 1])
        part.body_ids.data()[b] = load.id_of(part.body_ids.data()[b], near);
    sum.add(find(part, copied + part.bytes(), delivery));
  }
  return sum;
}

// Numbers of the box become numbers of the scene.
BoxResult DeviceWorker::deliver(const BoxLoad& load, const Contacts& c, Delivery& delivery) {
  BoxResult result;
  result.contacts = c.count, result.doubtful = c.doubtful;
  const std::uint64_t batch = delivery.consumer ? kBatch : std::max<std::uint64_t>(c.count, 1);
  if (delivery.consumer) pairs_.resize(std::min(batch, c.count));
  for (std::uint64_t begin = 0; begin < c.count; begin += batch) {
    const auto count = static_cast<std::int64_t>(std::min(batch, c.count - begin));
    std::uint64_t hash = 0;
#pragma omp parallel num_threads(threads_) reduction(+ : hash) if (count > 1024)
    {
      std::uint64_t near_i = 0, near_j = 0;
#pragma omp for schedule(static)
      for (std::int64_t k = 0; k < count; k++) {
        const Pair p = c.pairs[begin + static_cast<std::uint64_t>(k)];
        const WidePair wide{load.id_of(p.i, near_i), load.id_of(p.j, near_j)};
        hash += wide_pair_hash(wide.i, wide.j);
        if (delivery.consumer) pairs_[static_cast<std::size_t>(k)] = wide;
      }
    }
    result.hash += hash;
    if (!delivery.consumer) continue;
    const std::lock_guard lock(delivery.mutex);
    delivery.consumer({box_,
                       {pairs_.data(), static_cast<std::size_t>(count)},
                       c.width,
                       c.scalar,
                       advanced(c.normals, begin * normal_bytes(c.scalar)),
                       advanced(c.points, begin * point_bytes(c.scalar))});
  }
  return result;
}

}  // namespace padder::detect
