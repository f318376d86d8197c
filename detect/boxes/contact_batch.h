// SPDX-License-Identifier: MIT
// Contacts as they leave the boxes: a batch at a time, with numbers that are wide enough for any scene.
#pragma once
#include <cstdint>
#include <functional>
#include <span>

#include "detect/detector.h"

namespace padder::detect {

// A contact of a scene of any size, i < j.
struct WidePair {
  std::uint64_t i, j;
  friend bool operator==(const WidePair&, const WidePair&) = default;
};

// The order-free hash of a contact set is the sum of this over its pairs, modulo 2^64. For numbers below 2^32
// it equals pair_hash (contact.h), so the hash is that of a Detector wherever one Detector can hold the
// scene.
PADDER_HD std::uint64_t wide_pair_hash(std::uint64_t i, std::uint64_t j) {
  const std::uint64_t low = i << 32 | (j & 0xffffffffu), high = (i >> 32) << 32 | j >> 32;
  return mixed(high ? low ^ mixed(high) : low);
}

// Some contacts of one box. The arrays are valid until the consumer returns.
struct ContactBatch {
  std::uint32_t box = 0;
  std::span<const WidePair> pairs;
  Width width = Width::pairs;
  Scalar scalar = Scalar::f32;
  const void* normals = nullptr;  // Normal<float> or Normal<double> of each pair; null for Width::pairs
  const void* points = nullptr;   // Points<float> or Points<double> of each pair; null unless Width::points
};

// Takes the contacts. It is called by one thread at a time, but not always by the same one. What it throws
// ends the call of detect(), which throws it on.
using ContactConsumer = std::function<void(const ContactBatch&)>;

}  // namespace padder::detect
