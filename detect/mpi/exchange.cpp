// SPDX-License-Identifier: MIT
#include "detect/mpi/exchange.h"

#include <algorithm>
#include <type_traits>
#include <utility>

#include "detect/mpi/messages.h"
#include "detect/mpi/together.h"

namespace padder::detect {
namespace {

// Calls use(array of a, array of b, numbers for each item, the items' member of LoadSizes) for each array
// that is sent, in the same order on all ranks.
template <class Use>
void each_array(const LoadForm& form, BoxLoad& a, BoxLoad& b, const Use& use) {
  const auto loose = &LoadSizes::loose, bodies = &LoadSizes::bodies;
  if (form.scalar == Scalar::f32)
    use(a.single, b.single, 4, loose);
  else
    use(a.twice, b.twice, 4, loose);
  use(a.ids, b.ids, 1, loose);
  if (form.has_family) use(a.family, b.family, 1, loose);
  if (form.has_mask) use(a.mask, b.mask, 1, loose);
  if (form.has_static) use(a.is_static, b.is_static, 1, loose);
  if (form.has_world) use(a.world, b.world, 1, loose);
  use(a.bodies, b.bodies, 1, bodies);
  use(a.body_ids, b.body_ids, 1, bodies);
}

void number_bodies(BoxLoad& load) {
  for (std::uint64_t b = 0; b < load.body_count; b++)
    load.first_of_body[b + 1] = load.first_of_body[b] + load.shapes[load.bodies.data()[b].shape].count;
}

}  // namespace

Exchange::Exchange(MPI_Comm ranks, const LoadForm& form, std::vector<LoadSizes> sending)
    : ranks_(ranks), form_(form), sending_(std::move(sending)) {
  int rank = 0;
  MPI_Comm_rank(ranks, &rank);
  me_ = static_cast<std::size_t>(rank);
  coming_.resize(sending_.size());
  MPI_Alltoall(sending_.data(), 3, MPI_UNSIGNED_LONG_LONG, coming_.data(), 3, MPI_UNSIGNED_LONG_LONG, ranks);
  for (const LoadSizes& from : coming_) {
    begin_.push_back(all_);
    all_.loose += from.loose, all_.bodies += from.bodies, all_.body_spheres += from.body_spheres;
  }
}

LoadRoom Exchange::room() const {
  const LoadSizes &before = begin_[me_], &own = sending_[me_];
  return {before.loose, all_.loose - before.loose - own.loose, before.bodies,
          all_.bodies - before.bodies - own.bodies};
}

// Gives a load the arrays that the form asks for: a rank without families, say, has 0 for all.
void Exchange::complete(BoxLoad& load) const {
  const std::uint64_t first = load.room.loose_before, size = first + load.loose + load.room.loose_behind;
  const auto fill = [&](bool wanted, bool& has, auto& array, auto value) {
    if (wanted && !has) std::fill_n(array.at_least(size) + first, load.loose, value);
    has = wanted;
  };
  fill(form_.has_family, load.has_family, load.family, 0u),
      fill(form_.has_mask, load.has_mask, load.mask, 0u);
  fill(form_.has_static, load.has_static, load.is_static, std::uint8_t(0));
  fill(form_.has_world, load.has_world, load.world, load.world_of_all);
  load.world_of_all = form_.world_of_all;
  if (form_.scalar == Scalar::f64 && load.scalar == Scalar::f32)
    std::copy_n(load.single.data() + 4 * first, 4 * load.loose, load.twice.at_least(4 * size) + 4 * first);
  load.scalar = form_.scalar;
}

Traffic Exchange::run(std::vector<BoxLoad>& loads) const {
  BoxLoad& own = loads[me_];
  together(ranks_, [&] {
    for (BoxLoad& load : loads) complete(load);
    own.loose = all_.loose, own.body_count = all_.bodies, own.body_spheres = all_.body_spheres;
    own.first_of_body.assign(own.body_count + 1, 0);
  });
  Messages messages(ranks_);
  for (std::size_t k = 0; k < loads.size(); k++) {
    if (k == me_) continue;
    each_array(form_, own, loads[k], [&](auto& to, auto& from, std::uint64_t width, auto items) {
      using Item = std::remove_pointer_t<decltype(to.data())>;
      const std::uint64_t each = width * sizeof(Item);
      messages.receive(static_cast<int>(k), to.data() + width * begin_[k].*items, each * coming_[k].*items);
      messages.send(static_cast<int>(k), from.data(), each * sending_[k].*items);
    });
  }
  const Traffic traffic = messages.wait();
  number_bodies(own);
  return traffic;
}

}  // namespace padder::detect
