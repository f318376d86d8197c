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
  Pair* pairs() const { return pairs_[now_].data(); }
  // The pairs of the list stay where they are until this is called again; the next list gets other memory.
  // Returns the address of those that stay.
  const Pair* keep_pairs();

  // `contacts.count` of them to where the options want them, and the pointers to `contacts`. `history` is
  // null or in device memory. Waits for the device where contacts are copied to the host.
  void deliver(const CallOptions& options, Contacts& contacts, const std::uint32_t* history,
               cudaStream_t stream);

 private:
  void reserve_pairs(std::uint64_t count);

  Buffer<Pair> pairs_[2];
  int now_ = 0;  // which of the two has the list
  Buffer<unsigned char> normals_, points_, host_pairs_, host_normals_, host_points_, host_history_;
};

}  // namespace padder::detect::cuda
