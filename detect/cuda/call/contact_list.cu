// SPDX-License-Identifier: MIT
#include "detect/cuda/call/contact_list.h"

#include <algorithm>

namespace padder::detect::cuda {
namespace {

std::uint64_t scalar_bytes(const CallOptions& options) { return options.scalar == Scalar::f32 ? 4 : 8; }
std::uint64_t normal_bytes(const CallOptions& options) { return 4 * scalar_bytes(options); }
std::uint64_t point_bytes(const CallOptions& options) { return 6 * scalar_bytes(options); }

// Returns the address on the host.
const void* copied_to_host(Buffer<unsigned char>& host, const void* from, std::uint64_t bytes,
                           cudaStream_t stream) {
  if (bytes > host.capacity()) host.reserve(bytes + bytes / 8);
  void* to = host.reserve(1);
  if (bytes)
    cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream), "copy the contacts");
  return to;
}

}  // namespace

ContactList::ContactList(MemoryBook& book)
    : pairs_{{book, "the contacts"}, {book, "the contacts"}},
      normals_(book, "the contacts"),
      points_(book, "the contacts"),
      host_pairs_(book, "the contacts", true),
      host_normals_(book, "the contacts", true),
      host_points_(book, "the contacts", true),
      host_history_(book, "the history of contacts", true) {}

const Pair* ContactList::keep_pairs() {
  const Buffer<Pair>& kept = pairs_[now_];
  now_ = 1 - now_;
  if (kept.capacity()) reserve_pairs(kept.capacity());
  return kept.data();
}

void ContactList::reserve_pairs(std::uint64_t count) {
  const std::uint64_t before = pairs_[now_].capacity();
  Pair* const p = pairs_[now_].reserve(count);
  // A history is sought in a list that turns out too short as well, and then anew.
  if (pairs_[now_].capacity() != before) clear_for_initcheck(p, pairs_[now_].capacity(), nullptr);
}

void ContactList::reserve(const CallOptions& options, std::uint64_t count) {
  reserve_pairs(count);
  if (options.width != Width::pairs) normals_.reserve(count * normal_bytes(options));
  if (options.width == Width::points) points_.reserve(count * point_bytes(options));
}

std::uint64_t ContactList::capacity(const CallOptions& options) const {
  std::uint64_t n = pairs_[now_].capacity();
  if (options.width != Width::pairs) n = std::min(n, normals_.capacity() / normal_bytes(options));
  if (options.width == Width::points) n = std::min(n, points_.capacity() / point_bytes(options));
  return n;
}

Output ContactList::output(const CallOptions& options) const {
  return {pairs(), normals_.data(), points_.data(), capacity(options), options.width, options.scalar};
}

Lent ContactList::lent() const {
  return {reinterpret_cast<float4*>(normals_.data()), normals_.capacity() / sizeof(float4),
          reinterpret_cast<std::uint32_t*>(pairs()), pairs_[now_].capacity() * 2};
}

void ContactList::deliver(const CallOptions& options, Contacts& c, const std::uint32_t* history,
                          cudaStream_t stream) {
  c.pairs = pairs(), c.history = history;
  if (options.width != Width::pairs) c.normals = normals_.data();
  if (options.width == Width::points) c.points = points_.data();
  if (options.output == Memory::device) {
    // A search has waited for its count, which comes last. The nine stages have not.
    if (options.path != Path::grid) cuda_check(cudaStreamSynchronize(stream), "finish");
    return;
  }
  c.pairs = static_cast<const Pair*>(copied_to_host(host_pairs_, c.pairs, c.count * sizeof(Pair), stream));
  if (c.normals)
    c.normals = copied_to_host(host_normals_, c.normals, c.count * normal_bytes(options), stream);
  if (c.points) c.points = copied_to_host(host_points_, c.points, c.count * point_bytes(options), stream);
  if (history)
    c.history = static_cast<const std::uint32_t*>(
        copied_to_host(host_history_, history, c.count * sizeof *history, stream));
  cuda_check(cudaStreamSynchronize(stream), "copy the contacts");
}

}  // namespace padder::detect::cuda
