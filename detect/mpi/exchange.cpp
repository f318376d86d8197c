// SPDX-License-Identifier: MIT
#include "detect/mpi/exchange.h"

#include <algorithm>

#include "detect/mpi/together.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr std::uint64_t kMostBytes = 1 << 30;  // of a message: MPI counts in int

// How much of each kind a load has. Also where a load begins in the joined one.
struct Sizes {
  unsigned long long loose = 0, bodies = 0, body_spheres = 0;
};

// Calls use(array of a, array of b, numbers for each item, the items' member of Sizes) for each array that is
// sent, in the same order on all ranks.
template <class Use>
void each_array(const LoadForm& form, BoxLoad& a, BoxLoad& b, const Use& use) {
  const auto loose = &Sizes::loose, bodies = &Sizes::bodies;
  if (form.scalar == Scalar::f32)
    use(a.single, b.single, 4, loose);
  else
    use(a.twice, b.twice, 4, loose);
  use(a.ids, b.ids, 1, loose);
  if (form.has_family) use(a.family, b.family, 1, loose);
  if (form.has_mask) use(a.mask, b.mask, 1, loose);
  if (form.has_static) use(a.is_static, b.is_static, 1, loose);
  use(a.bodies, b.bodies, 1, bodies);
  use(a.body_ids, b.body_ids, 1, bodies);
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

// Gives the joined load room for `all`.
void make_room(const LoadForm& form, const Sizes& all, BoxLoad& to) {
  to.scalar = form.scalar;
  to.has_family = form.has_family, to.has_mask = form.has_mask, to.has_static = form.has_static;
  to.loose = all.loose, to.body_count = all.bodies, to.body_spheres = all.body_spheres;
  each_array(form, to, to, [&](auto& array, auto&, std::uint64_t width, auto items) {
    array.at_least(width * all.*items);
  });
  to.first_of_body.assign(to.body_count + 1, 0);
}

void number_bodies(BoxLoad& load) {
  for (std::uint64_t b = 0; b < load.body_count; b++)
    load.first_of_body[b + 1] = load.first_of_body[b] + load.shapes[load.bodies.data()[b].shape].count;
}

template <class T>
void copy(const T* from, std::uint64_t count, T* to, int threads) {
#pragma omp parallel for schedule(static) num_threads(threads) if (count > 1 << 16)
  for (std::uint64_t k = 0; k < count; k++) to[k] = from[k];
}

// Messages to and from one other rank, which do not wait.
class Messages {
 public:
  Messages(MPI_Comm ranks, std::size_t other, std::vector<MPI_Request>& waiting)
      : ranks_(ranks), other_(static_cast<int>(other)), waiting_(waiting) {}
  template <class T>
  void receive(T* to, std::uint64_t count) {
    each_part(to, count * sizeof(T), [&](char* at, int bytes, MPI_Request* request) {
      MPI_Irecv(at, bytes, MPI_BYTE, other_, kTag, ranks_, request);
    });
  }
  template <class T>
  void send(T* from, std::uint64_t count, Traffic& traffic) {
    each_part(from, count * sizeof(T), [&](const char* at, int bytes, MPI_Request* request) {
      MPI_Isend(at, bytes, MPI_BYTE, other_, kTag, ranks_, request);
      traffic.bytes += static_cast<std::uint64_t>(bytes), traffic.messages++;
    });
  }

 private:
  static constexpr int kTag = 7;  // the messages of two ranks come in the order in which they are sent

  template <class Use>
  void each_part(void* data, std::uint64_t bytes, const Use& use) {
    for (std::uint64_t at = 0; at < bytes; at += kMostBytes)
      use(static_cast<char*>(data) + at, static_cast<int>(std::min(kMostBytes, bytes - at)),
          &waiting_.emplace_back());
  }

  MPI_Comm ranks_;
  int other_;
  std::vector<MPI_Request>& waiting_;
};

}  // namespace

void exchange(MPI_Comm ranks, const LoadForm& form, std::vector<BoxLoad>& loads, BoxLoad& joined, int threads,
              Traffic& traffic) {
  int rank = 0, count = 1;
  MPI_Comm_rank(ranks, &rank), MPI_Comm_size(ranks, &count);
  const auto n = static_cast<std::size_t>(count), me = static_cast<std::size_t>(rank);
  std::vector<Sizes> sending(n), coming(n), begin(n);
  together(ranks, [&] {
    for (std::size_t k = 0; k < n; k++) {
      complete(form, loads[k]);
      sending[k] = {loads[k].loose, loads[k].body_count, loads[k].body_spheres};
    }
  });
  MPI_Alltoall(sending.data(), 3, MPI_UNSIGNED_LONG_LONG, coming.data(), 3, MPI_UNSIGNED_LONG_LONG, ranks);
  Sizes all;
  for (std::size_t k = 0; k < n; k++) {
    begin[k] = all;
    all.loose += coming[k].loose, all.bodies += coming[k].bodies;
    all.body_spheres += coming[k].body_spheres;
  }
  together(ranks, [&] { make_room(form, all, joined); });
  std::vector<MPI_Request> waiting;
  for (std::size_t k = 0; k < n; k++) {
    if (k == me) continue;
    Messages messages(ranks, k, waiting);
    each_array(form, joined, loads[k], [&](auto& to, auto& from, std::uint64_t width, auto items) {
      messages.receive(to.data() + width * begin[k].*items, width * coming[k].*items);
      messages.send(from.data(), width * sending[k].*items, traffic);
    });
  }
  each_array(form, joined, loads[me], [&](auto& to, auto& from, std::uint64_t width, auto items) {
    copy(from.data(), width * sending[me].*items, to.data() + width * begin[me].*items, threads);
  });
  MPI_Waitall(static_cast<int>(waiting.size()), waiting.data(), MPI_STATUSES_IGNORE);
  joined.shapes = loads[me].shapes;
  number_bodies(joined);
}

}  // namespace padder::detect
