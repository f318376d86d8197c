// SPDX-License-Identifier: MIT
// The CUDA backend: brings the input to the device, chooses among the three ways of finding contacts (bodies
// first, all spheres, the nine stages), and delivers the list.
#include <optional>

#include "detect/cuda/bodies/bodies.h"
#include "detect/cuda/call/sphere_search.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/device/profile_range.h"
#include "detect/cuda/input/input_copy.h"
#include "detect/cuda/output/records.h"
#include "detect/cuda/reference/nine_stages.h"
#include "detect/cuda/tuning.h"
#include "detect/cuda/worlds/world_search.h"
#include "detect/cuda/worlds/worlds_apart.h"

namespace padder::detect {
namespace cuda {
namespace {

// Everything that the backend holds on its device, whose context is current in every call and at the end.
class Work {
 public:
  explicit Work(int device) : device_(device) {}
  std::uint64_t memory() const { return book_.held; }

  Contacts detect(const Input& input, const CallOptions& given) {
    CallOptions options = given;
    const ProfileRange range("padder: detect");
    const bool may_go_first = options.path == Path::grid && options.bodies != Bodies::expanded;
    const auto goes_first = [&] {
      return may_go_first && (options.bodies == Bodies::first || automatic_first_);
    };
    const bool known = bodies_.knows(input) && goes_first();
    check_input(input, true, known || worlds_.counted(input));
    const bool worlds = options.path == Path::grid && !known && have_worlds(input);
    if (input.revision != decided_) decided_ = 0;
    if (may_go_first && !known && !worlds && (decided_ == 0 || options.order == Order::stable))
      automatic_first_ = first_is_faster(input, options),
      decided_ = options.order == Order::any ? input.revision : 0;
    const bool first = !worlds && goes_first();
    // Most pairs then stay near their place. The search of spheres sees to that itself.
    if (options.history && (worlds || first)) options.order = Order::stable;
    const Call call = begin(input, options);
    if (options.history) history_.begin({list_.keep_pairs(), last_count_}, stream_);
    Contacts c;
    c.memory = options.output, c.width = options.width, c.scalar = options.scalar;
    if (!worlds) worlds_.forget();
    const bool done = first && bodies_.run(call, c);
    if (!first) bodies_.forget();
    const bool tree = worlds && !worlds_apart_.run(call, c);
    if (tree)
      worlds_.run(call, c);
    else if (!worlds && !done)
      search_spheres(call, c);
    // The search of spheres has matched its list itself, if it has found all of it.
    const bool matched = worlds ? !tree && worlds_apart_.matched() : !done && options.path == Path::grid;
    if (options.history && !matched) match(call, c);
    const std::uint32_t* const history = options.history ? history_.end(c.count) : nullptr;
    {
      const ProfileRange delivery("padder: deliver the contacts");
      list_.deliver(options, c, history, call.stream);
    }
    pairs_on_device_ = list_.pairs(), last_count_ = c.count;
    c.seconds = clock_.seconds();
    running_ = false;
    return c;
  }

  WorldAnswers detect_worlds(const Input& input, const CallOptions& options, std::uint32_t worlds,
                             Answer answer) {
    const ProfileRange range("padder: detect worlds");
    check_input(input, true, worlds_.counted(input));
    const Call call = begin(input, options);
    bodies_.forget(), decided_ = 0;
    last_count_ = 0;
    const WorldAnswers answers = worlds_.answer(input, options, worlds, answer, call.processors, call.stream);
    running_ = false;
    return answers;
  }

  Arrays stages(const Input& input, const CallOptions& options) {
    check_input(input, true);
    const Call call = begin(input, options);
    bodies_.forget(), worlds_.forget(), decided_ = 0;
    const DeviceSpheres source = read(call);
    if (source.count == 0) return {};
    Contacts c;
    nine_stages(source, call, c);
    last_count_ = 0;
    Arrays arrays = stages_->arrays(list_.pairs(), call.stream);
    running_ = false;
    return arrays;
  }

  // Whatever the last call did is over when it returns, so that this needs no stream of the caller's.
  std::uint64_t hash() { return hash_of_pairs(pairs_on_device_, last_count_, hash_, side_.get()); }

  // After a call that failed: nothing of it runs on, and nothing of it is taken for granted.
  void forget() noexcept {
    if (running_) cudaStreamSynchronize(stream_);
    cudaGetLastError();
    running_ = false;
    bodies_.forget(), spheres_.forget(), decided_ = 0;
    worlds_.forget(), worlds_apart_.forget();
    last_count_ = 0;
  }

  // The pairs of the last list, for another Work that is to find them in its first list.
  std::vector<Pair> last_pairs() const {
    std::vector<Pair> pairs(last_count_);
    if (last_count_)
      cuda_check(
          cudaMemcpy(pairs.data(), pairs_on_device_, last_count_ * sizeof(Pair), cudaMemcpyDeviceToHost),
          "read the contacts");
    return pairs;
  }
  // Throws MemoryError if they are more than the limit allows.
  void take_last_pairs(const std::vector<Pair>& pairs, std::uint64_t limit) {
    CallOptions options;
    options.width = Width::pairs, book_.limit = limit;
    list_.reserve(options, pairs.size());
    if (!pairs.empty())
      cuda_check(cudaMemcpy(list_.pairs(), pairs.data(), pairs.size() * sizeof(Pair), cudaMemcpyHostToDevice),
                 "copy the contacts");
    pairs_on_device_ = list_.pairs(), last_count_ = pairs.size();
  }

 private:
  void match(const Call& call, const Contacts& c) {
    const ProfileRange range("padder: history");
    history_.match({list_.pairs(), c.count}, call.processors, call.stream);
    clock_.mark(StageClock::kHistory);
  }
  bool have_worlds(const Input& input) const {
    return worlds_.counted(input) ? worlds_.has_worlds() : has_worlds(input);
  }
  Call begin(const Input& input, const CallOptions& options) {
    stream_ = static_cast<cudaStream_t>(options.stream);
    clock_.begin(stream_, options.timings), running_ = true;
    const int processors = processors_of(stream_, device_);
    book_.limit = options.memory_limit;
    // A region's share changes by up to a tenth before space is cut anew.
    book_.roomy = options.memory_limit == 0 && !(options.own == Region{});
    check_memory(input);
    return {input, options, stream_, side_, processors, clock_, list_, options.history ? &history_ : nullptr};
  }
  // With a stable order it does not depend on poses.
  bool first_is_faster(const Input& input, const CallOptions& options) {
    BodyCosts costs = tuning::kKnownBodies;
    Input seen = input;
    std::vector<Pose> poses;
    if (options.order == Order::stable) {
      costs.pair = 0;
    } else {
      if (input.revision == 0) costs = tuning::kNewBodies;
      if (input.poses && input.pose_memory == Memory::device) {
        check_memory(input);
        poses.resize(input.bodies.size());
        const auto stream = static_cast<cudaStream_t>(options.stream);
        cuda_check(cudaMemcpyAsync(poses.data(), input.poses, poses.size() * sizeof(Pose),
                                   cudaMemcpyDeviceToHost, stream),
                   "read the poses");
        cuda_check(cudaStreamSynchronize(stream), "read the poses");
        seen.poses = poses.data(), seen.pose_memory = Memory::host;
      }
    }
    bodies_.pieces().update(input.shapes);
    // Without a revision the table of what is static would be made in each call, which takes far longer.
    const bool keeps_table = options.order == Order::any && input.revision != 0;
    const std::uint64_t moving =
        keeps_table ? moving_loose(input, static_cast<cudaStream_t>(options.stream)) : loose_count(input);
    return bodies_first(seen, options.margin, sphere_count(input), moving, costs, bodies_.pieces());
  }
  // Asks where arrays lie that were not there in the previous call.
  void check_memory(const Input& input) {
    const Spheres& s = input.spheres;
    const bool spheres = s.memory == Memory::device && s.count, poses = input.pose_memory == Memory::device;
    const std::pair<const void*, const char*> given[kGiven] = {
        {spheres ? s.centers : nullptr, "the centres of the loose spheres"},
        {spheres ? s.radii : nullptr, "the radii of the loose spheres"},
        {spheres ? s.family : nullptr, "the families of the loose spheres"},
        {spheres ? s.mask : nullptr, "the masks of the loose spheres"},
        {spheres ? s.world : nullptr, "the worlds of the loose spheres"},
        {spheres ? s.is_static : nullptr, "the marks of static loose spheres"},
        {poses ? input.poses : nullptr, "the poses"}};
    for (int k = 0; k < kGiven; k++) {
      if (given[k].first && given[k].first != checked_[k])
        check_device_memory(given[k].first, device_, given[k].second);
      checked_[k] = given[k].first;
    }
  }
  DeviceSpheres read(const Call& call) {
    const ProfileRange range("padder: read the input");
    const DeviceSpheres source = input_.source(call.input, call.stream);
    clock_.mark(StageClock::kPlace);
    return source;
  }

  void search_spheres(const Call& call, Contacts& c) {
    const DeviceSpheres source = read(call);
    c.spheres = source.count;
    if (source.count == 0) return;
    if (call.options.path == Path::grid)
      spheres_.run(source, call, c);
    else
      nine_stages(source, call, c);
  }

  void nine_stages(const DeviceSpheres& source, const Call& call, Contacts& c) {
    const Summary summary = spheres_.survey(source, call);
    if (!stages_) stages_.emplace(book_);
    Stages& s = *stages_;
    const cudaStream_t stream = call.stream;
    const StageGrid grid = choose_stage_grid(summary, call.options.bin_size, call.options.margin);
    clock_.mark(0);
    const auto stage = [&](int number, const char* name, auto work) {
      const ProfileRange range(name);
      work(), clock_.mark(number - 1);
    };
    stage(1, "padder: stage 1, count bins", [&] { s.count_bins(source, grid, stream); });
    stage(2, "padder: stage 2, sum counts of bins", [&] { s.scan_bins(stream); });
    stage(3, "padder: stage 3, fill bins", [&] { s.fill_bins(stream); });
    stage(4, "padder: stage 4, sort by bin", [&] { s.sort_by_bin(stream); });
    stage(5, "padder: stage 5, find starts of bins", [&] { s.find_starts(stream); });
    stage(6, "padder: stage 6, push inactive bins to the end", [&] { s.push_inactive(stream); });
    stage(7, "padder: stage 7, count contacts", [&] { s.count_contacts(call.options.own, stream); });
    stage(8, "padder: stage 8, sum counts of contacts", [&] { c.count = s.scan_contacts(stream); });
    list_.reserve(call.options, c.count);
    stage(9, "padder: stage 9, write contacts", [&] {
      s.write_contacts(list_.pairs(), stream);
      write_geometry(source, list_.output(call.options), c.count, stream);
    });
  }

  static constexpr int kGiven = 7;

  int device_;
  cudaStream_t stream_ = nullptr;  // of the last call
  SideStream side_;
  MemoryBook book_;
  InputCopy input_{book_};
  const void* checked_[kGiven] = {};  // known to be device memory
  SphereSearch spheres_{book_};
  BodySearch bodies_{book_};
  WorldSearch worlds_{book_};
  WorldsApart worlds_apart_{book_};
  // What Bodies::automatic meant in the last call. In any order, further calls of the revision `decided_`
  // keep to it; 0: no revision does.
  bool automatic_first_ = false;
  std::uint64_t decided_ = 0;
  std::optional<Stages> stages_;
  ContactList list_{book_};
  History history_{book_};
  Buffer<unsigned long long> hash_{book_, "the hash"};
  const Pair* pairs_on_device_ = nullptr;
  std::uint64_t last_count_ = 0;
  StageClock clock_;
  bool running_ = false;
};

// The device's context is current while anything is done with what lies there, its end included.
class CudaBackend : public Backend {
 public:
  explicit CudaBackend(int device) : device_(device), work_(std::make_unique<Work>(device)) {}
  ~CudaBackend() override {
    const OnDevice on(device_);
    work_.reset();
  }
  const char* name() const override { return "cuda"; }
  bool has_history() const override { return true; }
  std::uint64_t memory() const override { return work_->memory(); }
  Contacts detect(const Input& input, const CallOptions& options) override {
    const OnDevice on(device_);
    on.require();
    keep_limit(options);
    return work_->detect(input, options);
  }
  Arrays stages(const Input& input, const CallOptions& options) override {
    const OnDevice on(device_);
    on.require();
    keep_limit(options);
    return work_->stages(input, options);
  }
  std::uint64_t hash() const override {
    const OnDevice on(device_);
    on.require();
    return work_->hash();
  }
  WorldAnswers detect_worlds(const Input& input, const CallOptions& options, std::uint32_t worlds,
                             Answer answer) override {
    const OnDevice on(device_);
    on.require();
    keep_limit(options);
    return work_->detect_worlds(input, options, worlds, answer);
  }
  std::vector<Pose> device_poses(const Input& input, const CallOptions& options) override {
    const OnDevice on(device_);
    on.require();
    if (input.poses) check_device_memory(input.poses, device_, "the poses");
    std::vector<Pose> poses(input.bodies.size());
    const auto stream = static_cast<cudaStream_t>(options.stream);
    copy_poses(input, poses.data(), stream);
    cuda_check(cudaStreamSynchronize(stream), "read the poses");
    return poses;
  }
  void forget() noexcept override {
    const OnDevice on(device_);
    work_->forget();
  }

 private:
  // A limit that was lowered: what is held is given back, and the call takes what it needs.
  void keep_limit(const CallOptions& options) {
    if (!options.memory_limit || work_->memory() <= options.memory_limit) return;
    const std::vector<Pair> last = options.history ? work_->last_pairs() : std::vector<Pair>();
    work_.reset(), work_ = std::make_unique<Work>(device_);
    work_->take_last_pairs(last, options.memory_limit);
  }

  int device_;
  std::unique_ptr<Work> work_;
};

}  // namespace
}  // namespace cuda

std::string cuda_absence(int device) {
  int devices = 0;
  const cudaError_t counted = cudaGetDeviceCount(&devices);
  if (counted != cudaSuccess || devices == 0) {
    cudaGetLastError();
    return counted == cudaSuccess || counted == cudaErrorNoDevice
               ? "there is no GPU that CUDA can use: choose omp"
               : std::string("CUDA cannot be used (") + cudaGetErrorString(counted) + "): choose omp";
  }
  if (device < 0 || device >= devices)
    return "there is no GPU " + std::to_string(device) + ": this machine has " + std::to_string(devices) +
           ", numbered from 0";
  const cuda::OnDevice on(device);
  int major = 0, minor = 0;
  cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device);
  cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, device);
  const std::string unfit = cuda::unfit_sentence(device, major, minor, cuda::has_kernels());
  cudaGetLastError();
  return unfit;
}

int cuda_device_count() {
  int count = 0;
  if (cudaGetDeviceCount(&count) == cudaSuccess) return count;
  cudaGetLastError();
  return 0;
}

std::unique_ptr<Backend> make_cuda_backend(int device) {
  const std::string absence = cuda_absence(device);
  if (!absence.empty()) throw Error(absence);
  return std::make_unique<cuda::CudaBackend>(device);
}

}  // namespace padder::detect
