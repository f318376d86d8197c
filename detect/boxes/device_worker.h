// SPDX-License-Identifier: MIT
// One device of a BoxedDetector: its detector, which takes one box after the other. Internal.
#pragma once
#include <mutex>
#include <string>
#include <vector>

#include "detect/boxes/assignment.h"
#include "detect/boxes/boxed_detector.h"
#include "detect/boxes/numbered_hash.h"

namespace padder::detect {

// What a box gave, or several together.
struct BoxResult {
  std::uint64_t contacts = 0, hash = 0, doubtful = 0;
  std::uint32_t splits = 0;
  void add(const BoxResult& more);
};

// The consumer of one call, for one thread at a time.
struct Delivery {
  const ContactConsumer& consumer;  // may be empty
  std::mutex mutex;
};

class DeviceWorker {
 public:
  // Throws Error if the device is not available.
  explicit DeviceWorker(const DeviceChoice& device);

  bool on_host() const { return on_host_; }
  // Bytes of host memory held here: those of the detector on a GPU are not.
  std::uint64_t host_memory() const;
  std::uint64_t peak_of_splits() const { return peak_of_splits_; }  // bytes of copies, in the last run()

  // Finds the contacts that the box owns and delivers them. When the detector cannot hold the box, the box is
  // halved, again and again if need be, and its halves are detected one after the other. Throws Error, which
  // names the device and the box, when halving does not help. `threads` are for converting the contacts, and
  // options.threads for detecting.
  BoxResult run(const BoxLoad& load, std::uint32_t box, const CallOptions& options, int threads,
                Delivery& delivery);

 private:
  struct Failure {
    std::string reason;
    bool of_memory;
  };
  BoxResult find(const BoxLoad& load, std::uint64_t copied, Delivery& delivery);
  BoxResult split(const BoxLoad& load, std::uint64_t copied, const Failure& failure, Delivery& delivery);
  BoxResult deliver(const BoxLoad& load, const Contacts& contacts, Delivery& delivery);
  [[noreturn]] void fail(const Failure& failure) const;

  DeviceChoice device_;
  Detector detector_;
  NumberedHash hash_;
  bool on_host_;
  std::uint64_t peak_of_splits_ = 0;
  std::vector<WidePair> pairs_;
  // of the run
  CallOptions options_;
  std::uint32_t box_ = 0;
  int threads_ = 1;
};

}  // namespace padder::detect
