// SPDX-License-Identifier: MIT
#include "detect/detector.h"

#include "detect/core/backend.h"
#include "detect/core/revision.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

std::unique_ptr<Backend> make_backend(const DeviceChoice& choice) {
  check_enum("DeviceChoice::backend", choice.backend, BackendKind::cuda);
  if (choice.backend == BackendKind::cuda ||
      (choice.backend == BackendKind::automatic && cuda_absence(choice.device).empty()))
    return make_cuda_backend(choice.device);
  return make_omp_backend();
}

DeviceChoice choice_of(const Options& options) {
#if defined(__GNUC__)
#pragma GCC diagnostic push  // this is where the deprecated members are still read
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
#endif
  return {options.backend, options.device};
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
}

const char* name_of(Scalar scalar) { return scalar == Scalar::f32 ? "float" : "double"; }

}  // namespace

void Contacts::refuse_scalar(Scalar wanted) const {
  throw Error(std::string("the contact records hold numbers of type ") + name_of(scalar) +
              " and cannot be read as " + name_of(wanted) + ": ask for spans of " + name_of(scalar) +
              ", or set CallOptions::scalar before detect()");
}

Detector::Detector(const DeviceChoice& device, const CallOptions& options)
    : options_{options}, backend_(make_backend(device)), revision_(std::make_unique<RevisionKeeper>()) {}
Detector::Detector(const CallOptions& options) : Detector(DeviceChoice{}, options) {}
Detector::Detector(const Options& options) : Detector(choice_of(options), options) {}
Detector::~Detector() = default;
Detector::Detector(Detector&&) noexcept = default;
Detector& Detector::operator=(Detector&&) noexcept = default;

Backend& Detector::own_backend() const {
  if (!backend_) throw Error("this detector was moved to another: use that one, or assign a new one");
  return *backend_;
}

// Every call into a backend goes through here. One that throws leaves no contacts, and no revision that the
// next call could rely on.
template <class Work>
auto Detector::call(Work work) {
  Backend& backend = own_backend();
  contacts_ = {};
  try {
    check_options(options_);
    return work(backend);
  } catch (...) {
    backend.forget(), revision_->forget();
    throw;
  }
}

const Contacts& Detector::detect(const Input& input) {
  contacts_ = call([&](Backend& backend) {
    if (options_.history && !backend.has_history())
      throw Error(std::string("the backend ") + backend.name() +
                  " gives no history of contacts (CallOptions::history): choose omp, or match the lists "
                  "yourself");
    const auto read_poses = [&] { return backend.device_poses(input, options_); };
    return backend.detect(revision_->resolve(input, read_poses), options_);
  });
  return contacts_;
}

WorldAnswers Detector::detect_worlds(const Input& input, std::uint32_t worlds, Answer answer) {
  return call([&](Backend& backend) {
    check_enum("Answer", answer, Answer::distance);
    const auto read_poses = [&] { return backend.device_poses(input, options_); };
    return backend.detect_worlds(revision_->resolve(input, read_poses), options_, worlds, answer);
  });
}

Arrays Detector::stages(const Input& input) {
  if (revision_) revision_->forget();
  Input all = input;
  all.revision = 0;  // the backend reads everything
  return call([&](Backend& backend) { return backend.stages(all, options_); });
}

std::uint64_t Detector::hash() const {
  const Backend& backend = own_backend();
  return contacts_.count > 0 ? backend.hash() : 0;
}
const char* Detector::backend() const { return own_backend().name(); }
std::uint64_t Detector::memory() const { return backend_ ? backend_->memory() : 0; }
bool cuda_present() { return cuda_absence(0).empty(); }

}  // namespace padder::detect
