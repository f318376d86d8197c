// SPDX-License-Identifier: GPL-3.0-or-later
// Ranks of MPI, each with a GPU (or with its share of the processors), against threads of one process with as
// many devices, in repeated calls over the same spheres: in host memory, and on the GPUs, where the contacts
// stay as well. Each rank has the spheres of its box, as in a simulation.
#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/detect/launch.h"

#ifdef PADDER_MPI
#include <mpi.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <thread>

#include "detect/boxes/boxed_detector.h"
#include "detect/boxes/resident_detector.h"
#include "detect/mpi/rank_detector.h"
#include "detect/mpi/resident_ranks.h"
#include "tools/bench/device.h"
#endif

namespace padder::bench {

#ifndef PADDER_MPI

Json ranks(const Settings&) {
  throw Error("this program was built without MPI: install MPI and Zoltan, and configure with PADDER_MPI=ON");
}

#else
namespace {

using detect::FloatSphere, detect::Region;
using Scene = std::vector<FloatSphere>;

// MPI from here to the end of this object. Only rank 0 prints.
class Session {
 public:
  Session() {
    int given = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &given);
    MPI_Comm_size(MPI_COMM_WORLD, &count), MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  }
  ~Session() {
    wait();
    MPI_Finalize();
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
  // For the other ranks, without taking processors from them as a barrier does.
  static void wait() {
    MPI_Request request;
    MPI_Ibarrier(MPI_COMM_WORLD, &request);
    for (int done = 0; MPI_Test(&request, &done, MPI_STATUS_IGNORE), !done;)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  static double longest(double seconds) {
    MPI_Allreduce(MPI_IN_PLACE, &seconds, 1, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    return seconds;
  }
  int rank = 0, count = 1;
};

// The spheres of each rank's box, one rank's behind another's; `first` is where each begins.
Scene by_rank(const Scene& scene, std::span<const Region> boxes, std::vector<std::uint64_t>& first) {
  Scene sorted;
  sorted.reserve(scene.size());
  first.clear();
  for (const Region& box : boxes) {
    first.push_back(sorted.size());
    for (const FloatSphere& s : scene)
      if (detect::owns(box, {s.x, s.y, s.z})) sorted.push_back(s);
  }
  first.push_back(sorted.size());
  return sorted;
}

struct Times {
  double all = 0, cut = 0, copy = 0, detect = 0;  // of the median call
};

Times median_call(std::vector<Times> calls) {
  std::sort(calls.begin(), calls.end(), [](const Times& a, const Times& b) { return a.all < b.all; });
  return calls[calls.size() / 2];
}

struct Result {
  Times times;
  std::uint64_t contacts = 0, hash = 0;
};

// The boxes of all ranks.
std::vector<Region> boxes_of(const Session& session, const Region& own) {
  std::vector<Region> boxes(static_cast<std::size_t>(session.count));
  MPI_Allgather(&own, sizeof own, MPI_BYTE, boxes.data(), sizeof own, MPI_BYTE, MPI_COMM_WORLD);
  return boxes;
}

// The spheres of this rank's box. `scene` is sorted by boxes, and stays on rank 0 alone.
Scene take_part(const Session& session, const Region& own, Scene& scene) {
  std::vector<std::uint64_t> first;
  scene = by_rank(scene, boxes_of(session, own), first);
  const auto mine = static_cast<std::size_t>(session.rank);
  const Scene part(scene.begin() + static_cast<std::ptrdiff_t>(first[mine]),
                   scene.begin() + static_cast<std::ptrdiff_t>(first[mine + 1]));
  if (session.rank > 0) Scene().swap(scene);
  return part;
}

// Of the slowest rank.
Result by_ranks(const Settings& s, const Session& session, const detect::CallOptions& options, Scene& scene) {
  detect::RankOptions o;
  o.detector = options;
  if (s.backend == "omp") o.device = {detect::BackendKind::omp, 0};
  detect::RankDetector detector(MPI_COMM_WORLD, o);
  for (int k = 0; k < 2; k++) detector.detect(part_of(input_of(scene), session.rank, session.count), {});
  const Scene part = take_part(session, detector.region(), scene);
  for (int k = 0; k < 2; k++) detector.detect(input_of(part), {});
  std::vector<Times> calls;
  for (int k = 0; k < s.repeat; k++) {
    MPI_Barrier(MPI_COMM_WORLD);
    const double seconds = seconds_of([&] { detector.detect(input_of(part), {}); });
    const detect::RankReport& r = detector.report();
    calls.push_back({session.longest(seconds), session.longest(r.cut_seconds),
                     session.longest(r.exchange_seconds), session.longest(r.detect_seconds)});
  }
  return {median_call(calls), detector.report().contacts, detector.report().hash};
}
Result by_threads(const Settings& s, const Session& session, const detect::CallOptions& options,
                  const Scene& scene) {
  detect::BoxOptions o;
  o.detector = options, o.detector.threads *= session.count;
  if (s.backend != "omp") o.devices = detect::all_devices();
  o.devices.resize(static_cast<std::size_t>(session.count),
                   o.devices.empty() ? detect::DeviceChoice{detect::BackendKind::omp} : o.devices[0]);
  detect::BoxedDetector detector(o);
  for (int k = 0; k < 2; k++) detector.detect(input_of(scene), {});
  std::vector<Times> calls;
  for (int k = 0; k < s.repeat; k++) {
    const double seconds = seconds_of([&] { detector.detect(input_of(scene), {}); });
    const detect::BoxReport& r = detector.report();
    calls.push_back({seconds, r.cut_seconds, r.copy_seconds, r.detect_seconds});
  }
  return {median_call(calls), detector.report().contacts, detector.report().hash};
}

#ifdef PADDER_CUDA

// longest(v): the largest of the ranks' values.
template <class Longest>
Times resident_times(const Settings& s, detect::ResidentDetector& detector, const OnGpus& there,
                     const Longest& longest) {
  for (int k = 0; k < 3; k++) detector.detect(there.parts());
  std::vector<Times> calls;
  for (int k = 0; k < s.repeat; k++) {
    longest(0.);
    const double seconds = seconds_of([&] { detector.detect(there.parts()); });
    const detect::ResidentReport& r = detector.report();
    calls.push_back({longest(seconds), 0, longest(r.deal_seconds), longest(r.detect_seconds)});
  }
  return median_call(calls);
}

Result resident_by_ranks(const Settings& s, const Session& session, const detect::CallOptions& options,
                         Scene& scene) {
  detect::ResidentOptions o;
  o.detector = options, o.ranks = detect::resident_ranks(MPI_COMM_WORLD);
  detect::ResidentDetector detector(o);
  for (int k = 0; k < 2; k++) {
    const detect::Spheres part = part_of(input_of(scene), session.rank, session.count).spheres;
    detector.detect({&part, 1});
  }
  OnGpus there;
  there.add(detector.found()[0].device, input_of(take_part(session, detector.region(0), scene)).spheres);
  const Times times = resident_times(s, detector, there, [&](double v) { return session.longest(v); });
  return {times, detector.report().contacts, detector.hash()};
}

Result resident_by_threads(const Settings& s, const Session& session, const detect::CallOptions& options,
                           const Scene& scene) {
  detect::ResidentOptions o;
  o.detector = options;
  for (int k = 0; k < session.count; k++) o.devices.push_back(k % gpus());
  detect::ResidentDetector detector(o);
  std::vector<detect::Spheres> parts;
  for (int k = 0; k < session.count; k++) parts.push_back(part_of(input_of(scene), k, session.count).spheres);
  for (int k = 0; k < 2; k++) detector.detect(parts);
  const std::uint64_t hash = detector.hash();  // by the numbers of `scene`, as that of the ranks
  std::vector<Region> boxes;
  for (std::size_t k = 0; k < detector.devices(); k++) boxes.push_back(detector.region(k));
  std::vector<std::uint64_t> first;
  const Scene sorted = by_rank(scene, boxes, first);
  OnGpus there;
  for (std::size_t k = 0; k < detector.devices(); k++)
    there.add(o.devices[k], input_of({sorted.begin() + static_cast<std::ptrdiff_t>(first[k]),
                                      sorted.begin() + static_cast<std::ptrdiff_t>(first[k + 1])})
                                .spheres);
  const Times times = resident_times(s, detector, there, [](double v) { return v; });
  return {times, detector.report().contacts, hash};
}

#endif

class Table {
 public:
  void add(std::uint64_t spheres, int devices, const std::string& lie, const Result& of_ranks,
           const Result& of_threads) {
    if (of_ranks.hash != of_threads.hash) throw Error("the contacts of ranks differ from those of threads");
    for (const bool by_rank : {true, false}) {
      const Result& r = by_rank ? of_ranks : of_threads;
      const std::string by = by_rank ? "ranks" : "threads";
      const double ratio = r.times.all / of_threads.times.all;
      rows.push_back({{"spheres", spheres},
                      {"contacts", r.contacts},
                      {"devices", devices},
                      {"spheres_lie", lie},
                      {"by", by},
                      {"seconds", r.times.all},
                      {"seconds_cut", r.times.cut},
                      {"seconds_copy", r.times.copy},
                      {"seconds_detect", r.times.detect},
                      {"ratio", ratio}});
      const auto ms = [](double v) { return number(v * 1e3, "%.2f"); };
      table.push_back({std::to_string(spheres), std::to_string(r.contacts), std::to_string(devices), lie, by,
                       ms(r.times.all), ms(r.times.cut), ms(r.times.copy), ms(r.times.detect),
                       number(ratio, "%.2f")});
    }
  }
  Json rows = Json::array();
  Json table = Json::array({{"spheres", "contacts", "devices", "spheres lie", "by", "call [ms]", "cut [ms]",
                             "copy, exchange or deal [ms]", "detection [ms]", "of the threads' time"}});
};

}  // namespace

Json ranks(const Settings& s) {
  const tool::Launch launch = tool::launch_of_environment();
  if (launch.ranks == 0) wrong_usage("ranks is started by mpirun: mpirun --bind-to none -n 2 bench ranks");
  const Session session;
  if (session.rank > 0 && !std::freopen("/dev/null", "w", stdout)) throw Error("cannot close the output");
  detect::CallOptions options;
  options.order = detect::Order::any, options.threads = s.threads;
  Table table;
  // The ranks measure together; then rank 0 does with its threads, while the others wait. What fails on one
  // rank ends all, since the others could wait for it.
  const auto measure = [&](std::uint64_t n, const std::string& lie, const auto& by_ranks,
                           const auto& by_threads) {
    try {
      if (session.rank == 0) say(s, std::to_string(n) + " spheres " + lie);
      Scene scene = detect::generate("dense", n, false);
      const Result of_ranks = by_ranks(s, session, options, scene);
      if (session.rank == 0)
        table.add(n, session.count, lie, of_ranks, by_threads(s, session, options, scene));
      session.wait();
    } catch (const std::exception& e) {
      std::fprintf(stderr, "bench: %s\n", e.what());
      MPI_Abort(MPI_COMM_WORLD, 1);
    }
  };
  for (const std::uint64_t n : sizes_or(s, {57500000})) {
    measure(n, "in host memory", by_ranks, by_threads);
#ifdef PADDER_CUDA
    if (s.backend != "omp" && gpus() > 0) measure(n, "on the GPUs", resident_by_ranks, resident_by_threads);
#endif
  }
  if (session.rank > 0) return {{"table", table.table}};
  return {{"bench", "ranks"}, {"machine", machine()}, {"rows", table.rows}, {"table", table.table}};
}

#endif

}  // namespace padder::bench
