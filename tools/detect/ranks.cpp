// SPDX-License-Identifier: GPL-3.0-or-later
// detect as it is started by mpirun or srun: the ranks share the scene, and rank 0 prints the result.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "padding/asset/error.h"
#include "tools/detect/arguments.h"

#ifdef PADDER_MPI
#include <mpi.h>

#include "detect/mpi/rank_contact_file.h"
#include "detect/mpi/rank_detector.h"
#include "detect/mpi/together.h"
#endif

namespace padder::tool {
namespace {

int loud = 2;  // what stays of the standard error stream on a rank that is silent

}  // namespace

bool silence_other_ranks() {
  if (launch_of_environment().rank == 0) return false;
  loud = ::dup(2);
  if (!std::freopen("/dev/null", "w", stdout) || !std::freopen("/dev/null", "w", stderr)) std::exit(1);
  return true;
}

#ifndef PADDER_MPI

int run_ranks(const Arguments&, const Launch& launch) {
  throw Error("this program was built without MPI and cannot be one of " + std::to_string(launch.ranks) +
              " ranks: install MPI and Zoltan, and configure with PADDER_MPI=ON");
}

#else
namespace {

// MPI from here to the end of this object.
class Session {
 public:
  explicit Session(const Launch& launch) {
    int given = 0, size = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &given);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    if (size == launch.ranks) return;
    MPI_Finalize();
    throw Error(
        "the launcher has started " + std::to_string(launch.ranks) + " processes, but MPI knows of " +
        std::to_string(size) +
        ": start them with the mpirun of the MPI that this program was built with, or with srun --mpi=pmix");
  }
  ~Session() { MPI_Finalize(); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;
};

void check_rank_arguments(const Arguments& a) {
  if (a.stages) throw UsageError("--stages is for small scenes: start one process");
  if (!a.devices.empty()) throw UsageError("--devices: each rank takes one GPU; start one rank for each");
  if (a.memory) throw UsageError("--memory is for one process: start more ranks instead");
  if (!a.output.empty() && std::filesystem::path(a.output).extension() != ".npy")
    throw UsageError("-o " + a.output + ": several ranks write a .npy, one record for each contact");
}

RankOptions rank_options(const Arguments& a, const Scene& scene) {
  RankOptions o;
  o.detector = a.options;
  o.detector.path = a.path.value(), o.detector.precision = a.precision.value();
  o.detector.width = a.output.empty() ? Width::pairs : Width::points;
  const bool single = a.output.empty() && scene.spheres().scalar == Scalar::f32 && scene.bodies.empty();
  o.detector.scalar = single ? Scalar::f32 : Scalar::f64;
  if (a.backend.value() == BackendKind::omp) o.device = {BackendKind::omp, 0};
  return o;
}

struct Times {
  double cut, exchange, detect;
};

// Of the slowest rank.
Times longest(const RankReport& r) {
  double t[3] = {r.cut_seconds, r.exchange_seconds, r.detect_seconds};
  MPI_Allreduce(MPI_IN_PLACE, t, 3, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
  return {t[0], t[1], t[2]};
}

void print(const Arguments& a, const RankReport& r, int ranks, const Times& t, const char* backend) {
  const double total = t.cut + t.exchange + t.detect;
  const Json seconds = {{"cut", t.cut}, {"exchange", t.exchange}, {"detect", t.detect}, {"total", total}};
  const Found found{r.spheres, r.bodies, r.contacts, r.hash, r.doubtful, backend};
  Json report = report_of(a, found);
  report.update({{"ranks", ranks},
                 {"splits", r.splits},
                 {"copies", r.copies},
                 {"imbalance", r.imbalance},
                 {"seconds", seconds}});
  print_result(a, report, [&] {
    print_found(a, found, ", " + std::to_string(ranks) + " ranks", total);
    print_doubtful(a, found);
  });
}

int run_among(const Arguments& a, const Launch& launch) {
  check_rank_arguments(a);
  Scene scene;
  together(MPI_COMM_WORLD, [&] {
    if (a.backend.value() == BackendKind::cuda && !cuda_present())
      throw Error("there is no GPU that CUDA can use: choose omp");
    scene = read_input(a, LooseAs::mapped, launch.rank == 0);
  });
  const Input part = part_of(scene.input(), launch.rank, launch.ranks);
  const RankOptions options = rank_options(a, scene);
  RankDetector detector(MPI_COMM_WORLD, options);
  if (a.output.empty()) {
    detector.detect(part, {});
  } else {
    RankContactFile file(MPI_COMM_WORLD, a.output, options.detector.width, options.detector.scalar);
    detector.detect(part, file.consumer());
    file.finish();
  }
  const Times times = longest(detector.report());
  if (launch.rank == 0) print(a, detector.report(), launch.ranks, times, detector.backend());
  return 0;
}

}  // namespace

// What fails on all ranks is thrown on all of them. Anything else ends them all at once, since the others
// would wait for this one.
int run_ranks(const Arguments& a, const Launch& launch) {
  const Session session(launch);
  try {
    return run_among(a, launch);
  } catch (const Error&) {
    throw;
  } catch (const UsageError&) {
    throw;
  } catch (const std::exception& e) {
    ::dprintf(loud, "detect: rank %d: %s\n", launch.rank, e.what());
    MPI_Abort(MPI_COMM_WORLD, 1);
    throw;
  }
}

#endif

}  // namespace padder::tool
