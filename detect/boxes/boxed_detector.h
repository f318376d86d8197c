// SPDX-License-Identifier: MIT
// Contacts of a scene that is too large for one detector, or that several GPUs share: space is cut into
// boxes, and every box has its contacts found by a Detector. The contacts are those of one Detector, pair for
// pair, and so is the hash. Section 2.2.4 and Fig. 5 of the paper; docs/scale.md for the whole story.
#pragma once
#include <cstdint>
#include <memory>
#include <vector>

#include "detect/boxes/contact_batch.h"
#include "detect/detector.h"

namespace padder::detect {

// Every GPU of this machine that this build can use; the CPU where there is none.
std::vector<DeviceChoice> all_devices();

// How to cut, and where to detect; the defaults make one box on one device.
struct BoxOptions {
  // How each box is detected. `own` limits the contacts of the whole scene, `memory_limit` is for each
  // detector, `threads` are those of all detectors on the CPU together, and `stream` and `output` are not
  // read.
  CallOptions detector;
  // One detector and one thread each; the same one may be named more than once. Empty: one device, the first
  // GPU when there is one.
  std::vector<DeviceChoice> devices;
  // How many boxes at least; 0: one for each device. More are made where memory asks for it.
  std::uint32_t boxes = 0;
  // Bytes of host memory that this object may hold: copies of the spheres of the boxes in work, tables, and
  // detectors on the CPU. The scene itself and the list of detect(input) are not counted. 0: no limit.
  std::uint64_t memory_limit = 0;
};

// What a call did.
struct BoxReport {
  std::uint64_t contacts = 0, spheres = 0;
  std::uint64_t copies = 0;        // spheres given to boxes; those above `spheres` are halo
  std::uint64_t hash = 0;          // order-free, as Detector::hash()
  std::uint64_t doubtful = 0;      // sum of Contacts::doubtful; a pair may be counted in several boxes
  std::uint32_t boxes = 0;         // of the cut
  std::uint32_t memory_boxes = 0;  // boxes beyond those asked for, because memory is limited
  std::uint32_t splits = 0;        // boxes halved after their detector had run out of memory
  std::uint32_t rounds = 0;        // passes over the scene to copy spheres
  bool cut = false;                // space was cut anew in this call
  double imbalance = 0;            // work of the box with the most over the mean; work: spheres plus contacts
  std::uint64_t memory = 0;        // bytes held at most, where BoxOptions::memory_limit counts
  // Wall time of the three parts. GPUs detect while other boxes are copied, so `detect_seconds` counts only
  // what detection takes beyond the copying.
  double cut_seconds = 0, copy_seconds = 0, detect_seconds = 0;
};

// Keeps its cut, its detectors and their memory from call to call: spheres may move in between. Boxes are cut
// anew when the work of the heaviest exceeds the mean by a tenth. Not for two threads at once.
//
// Spheres, shapes, bodies and poses must lie in host memory; a mapped file is host memory
// (scene/sphere_file.h). The arrays of the loose spheres may begin at any address. There may be more than
// 2^32 - 2 spheres. Input::revision, `moved` and `poses` mean what they mean to a Detector.
//
// If the input is at fault, every function throws the Error that a Detector would throw. If a detector fails,
// the Error names its device. The object stays usable. One that was moved from may only be assigned to or
// destroyed.
class BoxedDetector {
 public:
  // Throws Error if a device is not available.
  explicit BoxedDetector(const BoxOptions& options = {});
  ~BoxedDetector();
  BoxedDetector(BoxedDetector&&) noexcept;
  BoxedDetector& operator=(BoxedDetector&&) noexcept;

  // Every contact, none twice, in host memory: box by box, and in CallOptions::order inside a box. For scenes
  // below 2^32 - 1 spheres. Valid until the next call or the end of this object.
  const Contacts& detect(const Input& input);

  // Hands every contact to `consumer`, each once, a batch at a time: for lists that memory does not hold, and
  // for scenes of any size. Within a box the order is CallOptions::order; boxes come as they are done. An
  // empty consumer only counts. A call that throws may have delivered some contacts.
  const BoxReport& detect(const Input& input, const ContactConsumer& consumer);

  const BoxReport& report() const;  // of the last call
  std::uint64_t hash() const { return report().hash; }

  // "omp" or "cuda"; "cuda and omp" where the devices are of both kinds.
  const char* backend() const;

  CallOptions& options();  // BoxOptions::detector

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

}  // namespace padder::detect
