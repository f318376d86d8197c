// SPDX-License-Identifier: GPL-3.0-or-later
// detect with --devices or --memory: contacts are found box by box.
#include <cstdio>
#include <filesystem>

#include "detect/boxes/boxed_detector.h"
#include "detect/boxes/contact_writer.h"
#include "detect/scene/contact_file.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "tools/detect/arguments.h"

namespace padder::tool {
namespace {

bool ends_in(const std::string& file, const char* ending) {
  return std::filesystem::path(file).extension() == ending;
}

std::vector<DeviceChoice> devices_of(const Arguments& a) {
  const BackendKind backend = a.backend.value();
  if (a.devices == "all" && backend == BackendKind::omp) return {{BackendKind::omp, 0}};
  if (a.devices == "all") {
    const std::vector<DeviceChoice> all = all_devices();
    if (backend == BackendKind::cuda && all[0].backend != BackendKind::cuda)
      throw Error("--devices all: there is no GPU that CUDA can use: choose omp");
    return all;
  }
  const int count = a.devices.empty() ? 1 : std::stoi(a.devices);
  if (count == 1) return {{backend, 0}};
  std::vector<DeviceChoice> devices;
  for (int k = 0; k < count; k++)
    devices.push_back(
        {backend == BackendKind::omp ? backend : BackendKind::cuda, backend == BackendKind::omp ? 0 : k});
  return devices;
}

BoxOptions box_options(const Arguments& a, const Scene& scene) {
  BoxOptions o;
  o.detector = a.options;
  o.detector.path = a.path.value(), o.detector.precision = a.precision.value();
  o.detector.width = ends_in(a.output, ".npy") ? Width::points : Width::pairs;
  o.detector.scalar = Scalar::f64;
  if (a.output.empty() && scene.spheres().scalar == Scalar::f32 && scene.bodies.empty())
    o.detector.scalar = Scalar::f32;
  o.detector.memory_limit = a.memory, o.memory_limit = a.memory;
  o.devices = devices_of(a);
  return o;
}

void check_box_arguments(const Arguments& a) {
  if (a.stages && (ends_in(a.scene, ".npy") || ends_in(a.scene, ".npz")))
    throw UsageError("--stages takes a scene (.json) or a cluster, and " + a.scene + " is a file of spheres");
  if (a.stages)
    throw UsageError("--stages is for one detector: leave out " +
                     std::string(!a.devices.empty() ? "--devices"
                                 : a.memory         ? "--memory"
                                                    : "-o " + a.output + ", or write .csv, .npz or .vtp"));
  if (a.memory && !a.output.empty() && !ends_in(a.output, ".npy"))
    throw UsageError("-o " + a.output +
                     ": a sorted file needs the whole list in memory: with --memory, write a .npy");
}

Json box_report(const BoxOptions& options, const BoxReport& r) {
  return {{"devices", options.devices.size()},
          {"boxes", r.boxes},
          {"memory_boxes", r.memory_boxes},
          {"splits", r.splits},
          {"rounds", r.rounds},
          {"copies", r.copies},
          {"memory", r.memory},
          {"seconds",
           {{"cut", r.cut_seconds},
            {"copy", r.copy_seconds},
            {"detect", r.detect_seconds},
            {"total", r.cut_seconds + r.copy_seconds + r.detect_seconds}}}};
}

}  // namespace

bool wants_boxes(const Arguments& a) {
  return !a.devices.empty() || a.memory || ends_in(a.scene, ".npy") || ends_in(a.scene, ".npz") ||
         ends_in(a.output, ".npy");
}

int run_boxes(const Arguments& a) {
  check_box_arguments(a);
  const Scene scene = read_input(a, LooseAs::mapped);
  const Input input = scene.input();
  const BoxOptions options = box_options(a, scene);
  BoxedDetector boxed(options);
  if (ends_in(a.output, ".npy")) {
    ContactWriter writer(a.output, options.detector.width, options.detector.scalar);
    boxed.detect(input, writer.consumer());
    writer.finish();
  } else if (!a.output.empty()) {
    write_contacts(boxed.detect(input), input, a.output, a.options.threads);
  } else {
    boxed.detect(input, {});
  }
  const BoxReport& r = boxed.report();
  const Found found{r.spheres, scene.bodies.size(), r.contacts, r.hash, r.doubtful, boxed.backend()};
  Json report = report_of(a, found);
  report.update(box_report(options, r));
  print_result(a, report, [&] {
    using padder::counted;
    const std::string place =
        ", " + counted(r.boxes, "box", "boxes") + " on " + counted(options.devices.size(), "device");
    print_found(a, found, place, report["seconds"]["total"].get<double>());
    if (r.memory_boxes)
      std::printf("%u of the boxes were made because memory is limited, and %u split\n", r.memory_boxes,
                  r.splits);
    print_doubtful(a, found);
  });
  return 0;
}

}  // namespace padder::tool
