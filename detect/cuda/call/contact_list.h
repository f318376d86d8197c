// SPDX-License-Identifier: MIT
// The list of contacts: its memory on the device, and the way to where the caller wants it. Only .cu files
// include this.
#pragma once
#include "detect/cuda/search/search.h"

namespace padder::detect::cuda {

class ContactList {
 public:
  explicit ContactList(MemoryBook& book);

  // Room for so many contacts of the width and scalar that the options ask for; what was there is lost.
  void reserve(const CallOptions& options, std::uint64_t count);
  // Of the normals alone, as so many times 16 bytes: for those who only borrow memory (lent()).
  void reserve_slots(std::uint64_t count) { normals_.reserve(count * sizeof(float4)); }
  std::uint64_t capacity(const CallOptions& options) const;
  Output output(const CallOptions& options) const;
  // The memory of the list, before it is written.
  Lent lent() const;
  Pair* pairs() const { return pairs_.data(); }

  // `contacts.count` of them to where the options want them, and the pointers to `contacts`. Waits for the
  // device where contacts are copied to the host.
  void deliver(const CallOptions& options, Contacts& contacts, cudaStream_t stream);

 private:
  Buffer<Pair> pairs_;
  Buffer<unsigned char> normals_, points_, host_pairs_, host_normals_, host_points_;
};

}  // namespace padder::detect::cuda
