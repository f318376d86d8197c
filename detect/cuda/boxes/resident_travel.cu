// SPDX-License-Identifier: MIT
// What comes to the GPUs of a ResidentDetector: from the host, from other GPUs, and from other ranks.
#include <utility>

#include "detect/cuda/boxes/resident_work.h"

namespace padder::detect {

using cuda::DealTarget;

// Where GPUs read each other's memory, poses stay where they are. Else every GPU gets those of all bodies.
void ResidentDetector::Work::bring_poses(std::span<const ResidentPoses> poses) {
  for (const auto& p : places_) p->all_poses = nullptr;
  if (poses.empty() || bodies_.bodies.empty()) return;
  if (poses_stay_) return let_poses_stay(poses);
  if (alone()) {
    places_[0]->all_poses = poses[0].poses;
    return;
  }
  together([&] {
    each_place([&](Place& p, std::size_t k) {
      if (poses[k].count) cuda::check_device_memory(poses[k].poses, p.device, "the poses");
      p.all_poses = p.poses.reserve(bodies_.bodies.size());
    });
  });
  report_.moved_bytes += (regions_.size() - 1) * bodies_.bodies.size() * sizeof(Pose);
  if (ranks_) return bring_from_ranks(poses[0]);
  each_place([&](Place& p, std::size_t) {
    Pose* to = p.poses.data();
    for (std::size_t from = 0; from < poses.size(); to += poses[from++].count)
      if (poses[from].count)
        cuda::cuda_check(cudaMemcpyPeerAsync(to, p.device, poses[from].poses, places_[from]->device,
                                             poses[from].count * sizeof(Pose), p.stream),
                         "copy poses to another GPU");
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy poses to another GPU");
  });
}

// Each GPU reads those that it needs.
void ResidentDetector::Work::let_poses_stay(std::span<const ResidentPoses> poses) {
  std::vector<PosePart> parts;
  std::uint32_t first = 0;
  for (std::size_t k = 0; k < poses.size(); k++) {
    const auto count = static_cast<std::uint32_t>(poses[k].count);
    parts.push_back({reinterpret_cast<const double*>(poses[k].poses), first, count});
    first += count;
  }
  for (std::size_t k = 0; k < places_.size(); k++) {
    Place& p = *places_[k];
    p.poses_around.parts = parts, p.poses_around.own = k;
    p.poses_around.exchange = [&p, k, this](std::vector<ListedElements> mine) {
      return exchange_elements(p, k, std::move(mine));
    };
  }
}

// Does every GPU search the balls of its bodies first? Else it needs the poses of all.
bool ResidentDetector::Work::goes_bodies_first() const {
  return options_.path == Path::grid && !have_worlds_ && !form_.world && form_.world_of_all == 0 &&
         (options_.bodies == Bodies::first || (options_.bodies == Bodies::automatic && bodies_first_));
}

std::vector<ListedElements> ResidentDetector::Work::exchange_elements(Place& p, std::size_t k,
                                                                      std::vector<ListedElements> mine) {
  p.listed = std::move(mine);
  crew_->meet(k);
  std::vector<ListedElements> lists;
  for (const auto& from : places_)  // one that failed has none; then the call fails
    lists.push_back(from->listed.empty() ? ListedElements{} : from->listed[k]);
  return lists;
}

void ResidentDetector::Work::bring_from_ranks(const ResidentPoses& poses) {
  Place& p = *places_[0];
  const bool direct = ranks_->reads_device_memory();
  const std::size_t count = bodies_.bodies.size();
  const auto copy = [&](Pose* to, const Pose* from, std::uint64_t n) {
    const cuda::OnDevice on(p.device);
    cuda::cuda_check(cudaMemcpyAsync(to, from, n * sizeof(Pose), cudaMemcpyDefault, p.stream), "copy poses");
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy poses");
  };
  Pose* all = nullptr;
  std::uint64_t mine = 0;
  for (std::size_t b = 0; b < first_box_; b++) mine += poses_of_[b];
  together([&] {
    all = direct ? p.poses.data() : p.poses_on_host.reserve(count);
    copy(all + mine, poses.poses, poses.count);
  });
  std::vector<RankMessage> to, from;
  std::uint64_t first = 0;
  for (std::size_t b = 0; b < regions_.size(); first += poses_of_[b++]) {
    if (b == first_box_) continue;
    to.push_back({static_cast<int>(b), all + mine, poses.count * sizeof(Pose)});
    from.push_back({static_cast<int>(b), all + first, poses_of_[b] * sizeof(Pose)});
  }
  ranks_->exchange(to, from);
  together([&] {
    if (!direct) copy(p.poses.data(), all, count);
  });
}

// Brings the part into the form in which it is read fastest, more than once.
void ResidentDetector::Work::pack(Place& p) const {
  const Spheres& s = p.part;
  cuda::Form form = cuda::Form::of(s);
  form.ids = false;
  p.packed->reserve(s.count, form);
  p.dealer->pack(s, p.packed->from(0, form), p.stream);
  p.part = p.packed->view(s.count, form);
}

// Waits for what the caller does on the default streams, and copies what lies in host memory.
void ResidentDetector::Work::bring(std::span<const Spheres> parts) {
  each_place([&](Place& p, std::size_t k) {
    cuda::cuda_check(cudaStreamSynchronize(nullptr), "finish the work given before");
    if (parts[k].memory == Memory::device && parts[k].count)
      cuda::check_device_memory(parts[k].centers, p.device, "the centres of the loose spheres");
    p.part = p.upload->run(parts[k], p.stream);
    if (!alone() && p.part.count && !cuda::is_packed(p.part)) pack(p);
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy spheres to the GPU");
  });
}

// Brings what the other GPUs have for this one: spheres that come before its own, then its own where they are
// copied, then those that come behind.
void ResidentDetector::Work::exchange(Place& p, std::size_t k) {
  const std::uint64_t own = stays_in_place(p) ? 0 : p.own;
  std::uint64_t before = 0, behind = p.before + own;
  if (behind + p.behind == 0) return;
  p.others->reserve(behind + p.behind, form_);
  std::vector<cuda::ComingSpheres> coming;
  for (std::size_t from = 0; from < places_.size(); from++) {
    if (from == k) continue;
    const Place& other = *places_[from];
    std::uint64_t there = 0;
    for (std::size_t to = 0; to < k; to++) there += to == from ? 0 : other.counts.to[to];
    const std::uint64_t count = other.counts.to[k];
    std::uint64_t& here = from < k ? before : behind;
    const std::uint64_t place = std::exchange(here, here + count);
    if (count == 0) continue;
    if (read_each_other_)
      coming.push_back({other.away->from(there, form_), place, count});
    else
      cuda::copy_to_peer(p.others->from(place, form_), p.device, other.away->from(there, form_), other.device,
                         count, form_.scalar, p.stream);
  }
  cuda::read_spheres(p.others->from(0, form_), coming, form_.scalar, p.stream);
  gather_own(p);
  cuda::cuda_check(cudaStreamSynchronize(p.stream), "bring spheres from the other GPUs");
}

// Copies the part's own spheres between those of others, unless they are read where they lie.
void ResidentDetector::Work::gather_own(Place& p) {
  if (!stays_in_place(p))
    p.dealer->gather_own(p.part, halos(), p.own, body_spheres_ + p.first, p.others->from(p.before, form_),
                         p.stream);
}

// The same between the GPUs of ranks, through pinned memory unless they read each other's.
void ResidentDetector::Work::exchange_with_ranks(Place& p) {
  const bool direct = ranks_->reads_device_memory();
  const std::uint64_t own = stays_in_place(p) ? 0 : p.own, come = p.before + p.behind;
  const auto on_gpu = [&](std::uint64_t k) { return p.others->from(k, form_); };
  const auto on_host = [&](std::uint64_t k) { return p.others_on_host->from(k, form_); };
  together([&] {
    const cuda::OnDevice on(p.device);
    p.others->reserve(p.before + own + p.behind, form_);
    gather_own(p);
    if (!direct) {
      p.away_on_host->reserve(p.counts.away, form_), p.others_on_host->reserve(come, form_);
      cuda::copy_spheres(p.away_on_host->from(0, form_), p.away->from(0, form_), p.counts.away, form_.scalar,
                         p.stream);
    }
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "copy the spheres for other ranks");
  });
  std::vector<RankMessage> to, from;
  const auto add = [&](std::vector<RankMessage>& messages, std::size_t rank, const DealTarget& at,
                       std::uint64_t count) {
    for (const cuda::SphereArray& a : cuda::arrays_of(at, form_.scalar))
      if (a.at && count) messages.push_back({static_cast<int>(rank), a.at, count * a.bytes_of_one});
  };
  std::uint64_t away = 0, come_first = 0;
  for (std::size_t b = 0; b < regions_.size(); b++) {
    if (b == first_box_) {
      if (direct) come_first += own;
      continue;
    }
    add(to, b, (direct ? p.away : p.away_on_host)->from(away, form_), p.counts.to[b]);
    add(from, b, direct ? on_gpu(come_first) : on_host(come_first), p.coming[b]);
    away += p.counts.to[b], come_first += p.coming[b];
  }
  ranks_->exchange(to, from);
  together([&] {
    if (direct) return;
    const cuda::OnDevice on(p.device);
    cuda::copy_spheres(on_gpu(0), on_host(0), p.before, form_.scalar, p.stream);
    cuda::copy_spheres(on_gpu(p.before + own), on_host(p.before), p.behind, form_.scalar, p.stream);
    cuda::cuda_check(cudaStreamSynchronize(p.stream), "bring spheres from other ranks");
  });
}

}  // namespace padder::detect
