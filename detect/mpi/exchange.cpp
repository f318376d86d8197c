// SPDX-License-Identifier: MIT
#include "detect/mpi/exchange.h"

#include <algorithm>
#include <cstring>

#include "detect/mpi/together.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::uint64_t kUnit = 64;  // bytes: MPI counts in int, and so a message may have 128 GiB
constexpr int kTag = 7;

using Bytes = std::vector<char>;

// Calls use(array, count, bytes of one) for each array of a load: what is sent, and in this order.
template <class Load, class Use>
void each_array(const LoadForm& form, Load& load, const Use& use) {
  if (form.scalar == Scalar::f32)
    use(load.single, 4 * load.loose);
  else
    use(load.twice, 4 * load.loose);
  use(load.ids, load.loose);
  if (form.has_family) use(load.family, load.loose);
  if (form.has_mask) use(load.mask, load.loose);
  if (form.has_static) use(load.is_static, load.loose);
  use(load.bodies, load.body_count);
  use(load.body_ids, load.body_count);
}

template <class T>
std::uint64_t bytes_of(const Scratch<T>&, std::uint64_t count) {
  return (count * sizeof(T) + 15) / 16 * 16;  // every array begins where any type may
}

struct Head {
  std::uint64_t loose, bodies, body_spheres, unused;
};

std::uint64_t bytes_of(const LoadForm& form, BoxLoad& load) {
  if (load.loose == 0 && load.body_count == 0) return 0;
  std::uint64_t sum = sizeof(Head);
  each_array(form, load, [&](auto& array, std::uint64_t count) { sum += bytes_of(array, count); });
  return (sum + kUnit - 1) / kUnit * kUnit;
}

// Gives a load the arrays that the form asks for: a rank without families, say, has 0 for all.
void complete(const LoadForm& form, BoxLoad& load) {
  const auto zeros = [&](bool wanted, bool& has, auto& array) {
    if (wanted && !has) std::fill_n(array.at_least(load.loose), load.loose, 0);
    has = wanted;
  };
  zeros(form.has_family, load.has_family, load.family), zeros(form.has_mask, load.has_mask, load.mask);
  zeros(form.has_static, load.has_static, load.is_static);
  if (form.scalar == Scalar::f64 && load.scalar == Scalar::f32)
    std::copy_n(load.single.data(), 4 * load.loose, load.twice.at_least(4 * load.loose));
  load.scalar = form.scalar;
}

Bytes packed(const LoadForm& form, BoxLoad& load) {
  Bytes bytes(bytes_of(form, load));
  if (bytes.empty()) return bytes;
  const Head head{load.loose, load.body_count, load.body_spheres, 0};
  std::memcpy(bytes.data(), &head, sizeof head);
  char* at = bytes.data() + sizeof head;
  each_array(form, load, [&](auto& array, std::uint64_t count) {
    if (count) std::memcpy(at, array.data(), count * sizeof *array.data());
    at += bytes_of(array, count);
  });
  return bytes;
}

// Where the next load is copied to in the joined one.
struct Place {
  std::uint64_t loose = 0, bodies = 0;
};

template <class T>
void append(Scratch<T>& to, std::uint64_t place, const void* from, std::uint64_t count) {
  if (count) std::memcpy(to.data() + place, from, count * sizeof(T));
}

void append_packed(const LoadForm& form, const Bytes& bytes, BoxLoad& to, Place& place) {
  if (bytes.empty()) return;
  Head head;
  std::memcpy(&head, bytes.data(), sizeof head);
  const char* at = bytes.data() + sizeof head;
  const auto take = [&](auto& array, std::uint64_t before, std::uint64_t count) {
    append(array, before, at, count);
    at += bytes_of(array, count);
  };
  if (form.scalar == Scalar::f32)
    take(to.single, 4 * place.loose, 4 * head.loose);
  else
    take(to.twice, 4 * place.loose, 4 * head.loose);
  take(to.ids, place.loose, head.loose);
  if (form.has_family) take(to.family, place.loose, head.loose);
  if (form.has_mask) take(to.mask, place.loose, head.loose);
  if (form.has_static) take(to.is_static, place.loose, head.loose);
  take(to.bodies, place.bodies, head.bodies);
  take(to.body_ids, place.bodies, head.bodies);
  place.loose += head.loose, place.bodies += head.bodies;
}

void append_own(const LoadForm& form, const BoxLoad& from, BoxLoad& to, Place& place) {
  if (form.scalar == Scalar::f32)
    append(to.single, 4 * place.loose, from.single.data(), 4 * from.loose);
  else
    append(to.twice, 4 * place.loose, from.twice.data(), 4 * from.loose);
  append(to.ids, place.loose, from.ids.data(), from.loose);
  if (form.has_family) append(to.family, place.loose, from.family.data(), from.loose);
  if (form.has_mask) append(to.mask, place.loose, from.mask.data(), from.loose);
  if (form.has_static) append(to.is_static, place.loose, from.is_static.data(), from.loose);
  append(to.bodies, place.bodies, from.bodies.data(), from.body_count);
  append(to.body_ids, place.bodies, from.body_ids.data(), from.body_count);
  place.loose += from.loose, place.bodies += from.body_count;
}

// Gives the joined load room for what all ranks sent.
void make_room(const LoadForm& form, const std::vector<Bytes>& got, const BoxLoad& own, BoxLoad& to) {
  to.scalar = form.scalar;
  to.has_family = form.has_family, to.has_mask = form.has_mask, to.has_static = form.has_static;
  to.loose = own.loose, to.body_count = own.body_count, to.body_spheres = own.body_spheres;
  for (const Bytes& b : got) {
    if (b.empty()) continue;
    Head head;
    std::memcpy(&head, b.data(), sizeof head);
    to.loose += head.loose, to.body_count += head.bodies, to.body_spheres += head.body_spheres;
  }
  each_array(form, to, [](auto& array, std::uint64_t count) { array.at_least(count); });
  to.first_of_body.assign(to.body_count + 1, 0);
}

void number_bodies(BoxLoad& load) {
  for (std::uint64_t b = 0; b < load.body_count; b++)
    load.first_of_body[b + 1] = load.first_of_body[b] + load.shapes[load.bodies.data()[b].shape].count;
}

}  // namespace

void exchange(MPI_Comm ranks, const LoadForm& form, std::vector<BoxLoad>& loads, BoxLoad& joined,
              Traffic& traffic) {
  int rank = 0, count = 1;
  MPI_Comm_rank(ranks, &rank), MPI_Comm_size(ranks, &count);
  const auto n = static_cast<std::size_t>(count), me = static_cast<std::size_t>(rank);
  std::vector<Bytes> sent(n), got(n);
  std::vector<unsigned long long> sending(n), coming(n);
  together(ranks, [&] {
    for (std::size_t k = 0; k < n; k++) {
      complete(form, loads[k]);
      if (k == me) continue;
      sent[k] = packed(form, loads[k]), sending[k] = sent[k].size();
      loads[k] = {};
    }
  });
  MPI_Alltoall(sending.data(), 1, MPI_UNSIGNED_LONG_LONG, coming.data(), 1, MPI_UNSIGNED_LONG_LONG, ranks);
  together(ranks, [&] {
    for (std::size_t k = 0; k < n; k++) got[k].resize(coming[k]);
  });
  MPI_Datatype unit;
  MPI_Type_contiguous(static_cast<int>(kUnit), MPI_BYTE, &unit), MPI_Type_commit(&unit);
  std::vector<MPI_Request> waiting;
  for (std::size_t k = 0; k < n; k++)
    if (coming[k])
      MPI_Irecv(got[k].data(), static_cast<int>(coming[k] / kUnit), unit, static_cast<int>(k), kTag, ranks,
                &waiting.emplace_back());
  for (std::size_t k = 0; k < n; k++) {
    if (!sending[k]) continue;
    MPI_Isend(sent[k].data(), static_cast<int>(sending[k] / kUnit), unit, static_cast<int>(k), kTag, ranks,
              &waiting.emplace_back());
    traffic.bytes += sending[k], traffic.messages++;
  }
  MPI_Waitall(static_cast<int>(waiting.size()), waiting.data(), MPI_STATUSES_IGNORE);
  MPI_Type_free(&unit);
  together(ranks, [&] {
    sent.clear();
    make_room(form, got, loads[me], joined);
    Place place;
    for (std::size_t k = 0; k < n; k++) {
      if (k == me)
        append_own(form, loads[k], joined, place);
      else
        append_packed(form, got[k], joined, place);
      got[k] = {};
    }
    joined.shapes = loads[me].shapes;
    number_bodies(joined);
  });
}

}  // namespace padder::detect
