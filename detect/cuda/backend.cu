// SPDX-License-Identifier: MIT
// The CUDA backend: what is common to both paths. Input to the device, summary, one path or the other,
// records to where they are wanted.
#include <algorithm>
#include <chrono>
#include <optional>

#include "detect/cuda/bodies/bodies.h"
#include "detect/cuda/device.h"
#include "detect/cuda/graph.h"
#include "detect/cuda/order/bins.h"
#include "detect/cuda/output/records.h"
#include "detect/cuda/reference/nine_stages.h"
#include "detect/cuda/search/search.h"

namespace padder::detect {
namespace cuda {
namespace {

// Everything that the backend holds on its device, whose context is current in every call and at the end.
class Work {
 public:
  explicit Work(int device) : device_(device) {}
  std::uint64_t memory() const { return book_.held; }

  Contacts detect(const Input& input, const Options& options) {
    const auto first = [&] {
      return options.path == Path::grid &&
             (options.bodies == Bodies::first || (options.bodies == Bodies::automatic && automatic_first_));
    };
    const bool known = bodies_.knows(input) && first();
    check_input(input, true, known);
    if (!known) automatic_first_ = bodies_first(input, {}, sphere_count(input), 0.75);
    begin(input, options);
    Contacts c;
    c.memory = options.output, c.width = options.width, c.scalar = options.scalar;
    bool done = false;
    if (first())
      done = bodies(input, options, c);
    else
      bodies_.forget();
    if (!done) read(input);
    if (!done) c.spheres = source_.count;
    if (!done && source_.count > 0) {
      if (options.path == Path::grid)
        fast(input, options, c);
      else
        nine_stages(options, survey(input, options), c);
    }
    deliver(options, c);
    pairs_on_device_ = pairs_.data(), last_count_ = c.count;
    c.seconds = seconds_;
    c.seconds.total = std::chrono::duration<double>(Clock::now() - begun_).count();
    running_ = false;
    return c;
  }

  Arrays stages(const Input& input, const Options& options) {
    check_input(input, true);
    begin(input, options);
    bodies_.forget();
    read(input);
    if (source_.count == 0) return {};
    Contacts c;
    nine_stages(options, survey(input, options), c);
    last_count_ = 0;
    Arrays arrays = stages_->arrays(pairs_.data(), stream_);
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
    bodies_.forget();
    planned_for_ = last_count_ = 0;
  }

 private:
  using Clock = std::chrono::steady_clock;

  void begin(const Input& input, const Options& options) {
    begun_ = last_mark_ = Clock::now();
    seconds_ = {}, timings_ = options.timings, running_ = true;
    stream_ = static_cast<cudaStream_t>(options.stream);
    processors_ = processors_of(stream_, device_);
    book_.limit = options.memory_limit;
    check_memory(input);
  }
  // Asks where arrays lie that were not there in the call before.
  void check_memory(const Input& input) {
    const Spheres& s = input.spheres;
    const bool spheres = s.memory == Memory::device && s.count, poses = input.pose_memory == Memory::device;
    const std::pair<const void*, const char*> given[kGiven] = {
        {spheres ? s.centers : nullptr, "the centres of the loose spheres"},
        {spheres ? s.radii : nullptr, "the radii of the loose spheres"},
        {spheres ? s.family : nullptr, "the families of the loose spheres"},
        {spheres ? s.mask : nullptr, "the masks of the loose spheres"},
        {spheres ? s.is_static : nullptr, "the marks of static loose spheres"},
        {poses ? input.poses : nullptr, "the poses"}};
    for (int k = 0; k < kGiven; k++) {
      if (given[k].first && given[k].first != checked_[k])
        check_device_memory(given[k].first, device_, given[k].second);
      checked_[k] = given[k].first;
    }
  }
  void read(const Input& input) {
    source_ = input_.source(input, stream_);
    mark(seconds_.place);
  }

  // False: the spheres of bodies must be expanded.
  bool bodies(const Input& input, const Options& options, Contacts& c) {
    const auto room = [&](std::uint64_t count) {
      reserve_records(options, count);
      return output(options);
    };
    const auto marks = [&](int stage) { mark(stage < 0 ? seconds_.place : seconds_.stage[stage]); };
    if (!bodies_.run(input, options, room, c.count, stream_, side_, processors_, marks)) return false;
    c.spheres = bodies_.body_spheres() + input.spheres.count;
    return true;
  }

  // Adds the time since the last mark. Without `timings` the device is not waited for and nothing is known.
  void mark(double& seconds) {
    if (!timings_) return;
    cuda_check(cudaStreamSynchronize(stream_), "finish a stage");
    const auto now = Clock::now();
    seconds += std::chrono::duration<double>(now - last_mark_).count();
    last_mark_ = now;
  }

  Summary survey(const Input& input, const Options& options) {
    const Summary s = tools_.surveyor.survey(source_, stream_);
    check(s, input, options);
    return s;
  }
  void check(const Summary& s, const Input& input, const Options& options) {
    if (s.first_fault != ~std::uint64_t(0))
      throw Error(fault_sentence(
          s.first_fault, sphere_at(source_, static_cast<std::uint32_t>(s.first_fault), stream_), input));
    check_range(s, options);
  }

  void reserve_records(const Options& options, std::uint64_t count) {
    pairs_.reserve(count);
    const std::uint64_t scalar = options.scalar == Scalar::f32 ? 4 : 8;
    if (options.width != Width::pairs) normals_.reserve(count * 4 * scalar);
    if (options.width == Width::points) points_.reserve(count * 6 * scalar);
  }
  std::uint64_t capacity(const Options& options) const {
    const std::uint64_t scalar = options.scalar == Scalar::f32 ? 4 : 8;
    std::uint64_t n = pairs_.capacity();
    if (options.width != Width::pairs) n = std::min(n, normals_.capacity() / (4 * scalar));
    if (options.width == Width::points) n = std::min(n, points_.capacity() / (6 * scalar));
    return n;
  }
  Output output(const Options& options) const {
    return {pairs_.data(), normals_.data(), points_.data(), capacity(options), options.width, options.scalar};
  }

  // Everything that decides what the device does between its first kernel and its count: whatever a kernel is
  // given by value follows from it.
  struct Plan {
    Source source;
    Grid grid;
    SearchOptions search;
    Output output;
    Lent lent;
    SlotKind kind = SlotKind::equal;
    OrderMethod method = OrderMethod::automatic;
    bool octaves = false, with_survey = false;
    int top = 0, processors = 1;
    std::uint64_t moves = 0;  // allocations so far: addresses are those of the plan
    std::uint64_t kept = 0;   // Orderer::kept(), where the buckets of the call before are to be tried
    friend bool operator==(const Plan&, const Plan&) = default;

    // The bounds are gathered by the kernels that put the spheres in order.
    bool along() const { return with_survey && Surveyor::rides_along(source); }
  };
  // What a plan works with. Only addresses come from here, which stay while nothing is allocated.
  struct Tools {
    explicit Tools(MemoryBook& book) : surveyor(book), orderer(book), search(book) {}
    Surveyor surveyor;
    Report report;
    Orderer orderer;
    SearchMemory search;
  };

  static SearchOptions search_options(const Options& options, const Summary& summary) {
    SearchOptions s;
    s.exact = options.precision == Precision::exact, s.stable_order = options.order == Order::stable;
    s.own = options.own, s.radius = summary.radius_max, s.owns_all = true;
    for (int k = 0; k < 3; k++)
      s.owns_all = s.owns_all && options.own.low[k] == -INFINITY && options.own.high[k] == INFINITY;
    return s;
  }
  void make_plan(const Options& options, const Summary& summary) {
    plan_ = {};
    plan_.source = source_, plan_.grid = choose_grid(summary, options.bin_size, 8, Look::down);
    plan_.search = search_options(options, summary);
    if (plan_.search.stable_order) plan_.search.share = share_;
    const bool floats =
        !source_.wide && source_.placed == 0 && float_range(summary.extent, summary.radius_max);
    plan_.kind = !floats                                    ? SlotKind::fixed_point
                 : summary.radius_min == summary.radius_max ? SlotKind::equal
                                                            : SlotKind::unequal;
    plan_.octaves = needs_octaves(summary), plan_.top = exponent_of(summary.need_max);
    plan_.processors = processors_;
  }
  // The rest of the plan, once the list is as long as it is to be.
  void plan_output(const Options& options, bool with_survey) {
    plan_.output = output(options), plan_.with_survey = with_survey, plan_.method = method_;
    plan_.lent = {reinterpret_cast<float4*>(normals_.data()), normals_.capacity() / sizeof(float4),
                  reinterpret_cast<std::uint32_t*>(pairs_.data()), pairs_.capacity() * 2};
    plan_.moves = book_.moves, plan_.kept = tools_.orderer.kept();
  }

  static void expect_report(const Plan& plan, Tools& tools) {
    tools.report.clear();
    if (plan.with_survey)
      tools.surveyor.read(plan.source, plan.octaves, plan.along(), tools.report);
    else
      tools.surveyor.read_head(tools.report);
    tools.report.expect();
  }
  // One pass over the device: order, search, and the counters (with_survey: the summary too) to the host.
  // `ordered` is called between the first two.
  template <class Ordering>
  static void enqueue(const Plan& plan, Tools& tools, cudaStream_t stream, Ordering ordered) {
    static_assert(sizeof(Counters) <= Surveyor::kHead * 8);
    auto* const counters = reinterpret_cast<Counters*>(tools.surveyor.head());
    if (plan.with_survey && !plan.along())
      tools.surveyor.begin(plan.source, plan.octaves, plan.top, stream);
    else if (!plan.with_survey)
      cuda_check(cudaMemsetAsync(counters, 0, sizeof(Counters), stream), "clear the counters");
    const Gather gather = plan.along() ? tools.surveyor.gather(plan.octaves, plan.top) : Gather{};
    const Ordered spheres =
        tools.orderer.order(plan.source, plan.grid, plan.kind, plan.search.stable_order, plan.method, gather,
                            plan.lent, counters, plan.processors, stream, plan.with_survey);
    ordered();
    search(plan.source, plan.grid, spheres, plan.search, plan.output, counters, tools.search, plan.processors,
           stream);
    tools.report.send(stream);
  }
  // The pass of plan_, to its end.
  void pass(bool recorded) {
    expect_report(plan_, tools_);
    if (recorded)
      recording_.run(plan_, book_.moves, stream_, side_,
                     [&](cudaStream_t stream) { enqueue(plan_, tools_, stream, [] {}); });
    else
      enqueue(plan_, tools_, stream_, [&] { mark(seconds_.stage[3]); });
    tools_.report.arrived(stream_, "search for contacts");
    found_ = *reinterpret_cast<const Counters*>(tools_.surveyor.host_head());
  }

  void fast(const Input& input, const Options& options, Contacts& c) {
    // The bins of the call before are tried first, while the survey runs along: usually they still fit, and
    // the device is waited for once instead of twice. They are taken only if they are those that the survey
    // leads to, so that the result does not depend on what was detected before.
    bool done = false;
    const std::uint64_t planned_for = std::exchange(planned_for_, 0);  // until all went well
    if (hope_ > 0 && !options.timings && planned_for == source_.count) {
      const Summary before = summary_;
      make_plan(options, before);
      plan_output(options, true);
      pass(true);
      const Grid grid = plan_.grid;
      const SlotKind kind = plan_.kind;
      done = tools_.surveyor.finish(source_, plan_.octaves, plan_.top, plan_.along(), summary_);
      if (done) {
        check(summary_, input, options);
        make_plan(options, summary_);
        // Where the last octave is populated a survey may tell sizes apart in another way (Summary::above).
        done = grid == plan_.grid && kind == plan_.kind && summary_.radius_max == before.radius_max &&
               !found_.flags && summary_.octave[kOctaves - 1].count == 0;
      }
      hope_ = done ? 1 : -4;
    }
    if (!done) {
      if (hope_ <= 0) hope_++;
      summary_ = survey(input, options);
      mark(seconds_.stage[0]);
      make_plan(options, summary_);
      // The order's work space is lent by the list: the list is made long enough for that.
      if (options.width != Width::pairs && source_.count >= Orderer::kFewSpheres && capacity(options) == 0) {
        const bool words =
            plan_.kind != SlotKind::equal || !float_bins(plan_.grid, plan_.kind, source_.count).on;
        if (!words)
          normals_.reserve(Orderer::room(source_.count) * sizeof(float4));
        else
          reserve_records(options, Orderer::room(source_.count));
      }
      method_ = OrderMethod::automatic;
      plan_output(options, false);
      pass(false);
    }
    // A bin too full for the method: sort. A list too short: it was counted to its end; made longer, and
    // written again. So is a list in the order of another length.
    while (true) {
      const Counters& found = found_;
      c.count = found.contacts, c.doubtful = found.doubtful;
      const bool fixed = plan_.search.stable_order;
      const Share share = fixed ? share_for(found, source_.count, plan_.grid, plan_.kind) : Share{};
      if (found.flags & kOutside) throw Error(kChanged);
      if (found.flags & kCrowded) {
        method_ = OrderMethod::sort;
      } else if (c.count > capacity(options) || share != plan_.search.share ||
                 (fixed && found.spilled > tools_.search.spill.capacity())) {
        if (c.count > capacity(options)) reserve_records(options, c.count + c.count / 16);
        if (fixed) {
          const bool known = share == plan_.search.share;  // else: usually a twentieth of the list
          tools_.search.spill.reserve(known ? found.spilled + found.spilled / 8 : c.count / 16 + 4096);
          plan_.search.share = share_ = share;
        }
      } else {
        break;
      }
      plan_output(options, false);
      pass(false);
    }
    planned_for_ = source_.count;
    mark(seconds_.stage[8]);
  }

  void nine_stages(const Options& options, const Summary& summary, Contacts& c) {
    if (!stages_) stages_.emplace(book_);
    Stages& s = *stages_;
    const StageGrid grid = choose_stage_grid(summary, options.bin_size);
    mark(seconds_.stage[0]);
    s.count_bins(source_, grid, stream_), mark(seconds_.stage[0]);
    s.scan_bins(stream_), mark(seconds_.stage[1]);
    s.fill_bins(stream_), mark(seconds_.stage[2]);
    s.sort_by_bin(stream_), mark(seconds_.stage[3]);
    s.find_starts(stream_), mark(seconds_.stage[4]);
    s.push_inactive(stream_), mark(seconds_.stage[5]);
    s.count_contacts(options.own, stream_), mark(seconds_.stage[6]);
    c.count = s.scan_contacts(stream_), mark(seconds_.stage[7]);
    reserve_records(options, c.count);
    s.write_contacts(pairs_.data(), stream_);
    write_geometry(source_, output(options), c.count, stream_), mark(seconds_.stage[8]);
  }

  void deliver(const Options& options, Contacts& c) {
    c.pairs = pairs_.data();
    if (options.width != Width::pairs) c.normals = normals_.data();
    if (options.width == Width::points) c.points = points_.data();
    if (options.output == Memory::device) {  // the fast path has waited for the count, which comes last
      if (options.path != Path::grid) cuda_check(cudaStreamSynchronize(stream_), "finish");
      return;
    }
    const std::uint64_t scalar = options.scalar == Scalar::f32 ? 4 : 8;
    const auto copy = [&](auto& host, const void* from, std::uint64_t bytes) -> const void* {
      if (bytes > host.capacity()) host.reserve(bytes + bytes / 8);
      void* to = host.reserve(1);
      if (bytes)
        cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_), "copy the contacts");
      return to;
    };
    c.pairs = static_cast<const Pair*>(copy(host_pairs_, c.pairs, c.count * sizeof(Pair)));
    if (c.normals) c.normals = copy(host_normals_, c.normals, c.count * 4 * scalar);
    if (c.points) c.points = copy(host_points_, c.points, c.count * 6 * scalar);
    cuda_check(cudaStreamSynchronize(stream_), "copy the contacts");
  }

  static constexpr int kGiven = 6;

  int device_, processors_ = 1;
  cudaStream_t stream_ = nullptr;
  SideStream side_;
  MemoryBook book_;
  InputCopy input_{book_};
  const void* checked_[kGiven] = {};  // known to be device memory
  Source source_;
  Tools tools_{book_};
  BodySearch bodies_{book_};
  bool automatic_first_ = false;  // what Bodies::automatic means for the last input that was not known
  std::optional<Stages> stages_;
  Buffer<Pair> pairs_{book_, "the contacts"};
  Buffer<unsigned char> normals_{book_, "the contacts"}, points_{book_, "the contacts"};
  Buffer<unsigned char> host_pairs_{book_, "the contacts", true}, host_normals_{book_, "the contacts", true},
      host_points_{book_, "the contacts", true};
  Counters found_{};  // of the last search
  Buffer<unsigned long long> hash_{book_, "the hash"};
  const Pair* pairs_on_device_ = nullptr;
  std::uint64_t last_count_ = 0;
  Plan plan_;
  Recording<Plan> recording_;
  Summary summary_;
  OrderMethod method_ = OrderMethod::automatic;
  int hope_ = 1;  // above 0: try the bins of the call before; a disappointment lasts for some calls
  std::uint64_t planned_for_ = 0;  // spheres of summary_; 0: it is not to be relied on
  Share share_;                    // of the list before, for a fixed order
  Seconds seconds_;
  bool timings_ = false, running_ = false;
  Clock::time_point begun_, last_mark_;
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
  std::uint64_t memory() const override { return work_->memory(); }
  Contacts detect(const Input& input, const Options& options) override {
    const OnDevice on(device_);
    on.require();
    keep_limit(options);
    return work_->detect(input, options);
  }
  Arrays stages(const Input& input, const Options& options) override {
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
  std::vector<Pose> device_poses(const Input& input, const Options& options) override {
    const OnDevice on(device_);
    on.require();
    check_device_memory(input.poses, device_, "the poses");
    std::vector<Pose> poses(input.bodies.size());
    const auto stream = static_cast<cudaStream_t>(options.stream);
    cuda_check(cudaMemcpyAsync(poses.data(), input.poses, poses.size() * sizeof(Pose), cudaMemcpyDeviceToHost,
                               stream),
               "read the poses");
    cuda_check(cudaStreamSynchronize(stream), "read the poses");
    return poses;
  }
  void forget() noexcept override {
    const OnDevice on(device_);
    work_->forget();
  }

 private:
  // A limit that was lowered: what is held is given back, and the call takes what it needs.
  void keep_limit(const Options& options) {
    if (options.memory_limit && work_->memory() > options.memory_limit)
      work_.reset(), work_ = std::make_unique<Work>(device_);
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
  if (cuda::has_kernels()) return "";
  int major = 0, minor = 0;
  cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device);
  cudaDeviceGetAttribute(&minor, cudaDevAttrComputeCapabilityMinor, device);
  cudaGetLastError();
  const std::string of = std::to_string(major) + std::to_string(minor);
  return "this build has no code for GPU " + std::to_string(device) + ", whose compute capability is " +
         std::to_string(major) + "." + std::to_string(minor) +
         ": build it with -DCMAKE_CUDA_ARCHITECTURES=" + of + " or choose omp";
}

std::unique_ptr<Backend> make_cuda_backend(int device) {
  const std::string absence = cuda_absence(device);
  if (!absence.empty()) throw Error(absence);
  return std::make_unique<cuda::CudaBackend>(device);
}

}  // namespace padder::detect
