// The CUDA backend: what is common to both paths. Input to the device, summary, one path or the other,
// records to where they are wanted.
#include <algorithm>
#include <chrono>
#include <optional>

#include "detect/cuda/bins.h"
#include "detect/cuda/bodies.h"
#include "detect/cuda/graph.h"
#include "detect/cuda/record.h"
#include "detect/cuda/search.h"
#include "detect/cuda/stages.h"

namespace padder::detect {
namespace cuda {
namespace {

// Work on the backend's device, then back to the caller's.
class OnDevice {
 public:
  explicit OnDevice(int device) {
    cuda_check(cudaGetDevice(&before_), "ask for the device");
    if (device != before_) cuda_check(cudaSetDevice(device), "choose the device");
  }
  ~OnDevice() { cudaSetDevice(before_); }

 private:
  int before_ = 0;
};

class CudaBackend : public Backend {
 public:
  explicit CudaBackend(int device) : device_(device) {}
  ~CudaBackend() override {
    const OnDevice on(device_);
    if (own_stream_) cudaStreamDestroy(own_stream_);
  }
  const char* name() const override { return "cuda"; }
  std::uint64_t memory() const override { return book_.held; }

  Contacts detect(const Input& input, const Options& options) override {
    const bool known =
        options.path == Path::fast && options.bodies != Bodies::expanded && bodies_.knows(input);
    check_input(input, true, known);
    const OnDevice on(device_);
    begin(options);
    Contacts c;
    c.memory = options.output, c.width = options.width, c.scalar = options.scalar;
    stream_of_hash_ = stream_;
    bool done = false;
    if (known || bodies_first(input, options, sphere_count(input), 0.75))
      done = bodies(input, options, c);
    else
      bodies_.forget();
    if (!done) read(input);
    if (!done) c.spheres = source_.count;
    if (!done && source_.count > 0) {
      if (options.path == Path::fast)
        fast(input, options, c);
      else
        nine_stages(options, survey(input, options), c);
    }
    pairs_on_device_ = pairs_.data(), last_count_ = c.count;
    deliver(options, c);
    c.seconds = seconds_;
    c.seconds.total = std::chrono::duration<double>(Clock::now() - begun_).count();
    return c;
  }

  Arrays stages(const Input& input, const Options& options) override {
    check_input(input, true);
    const OnDevice on(device_);
    begin(options);
    bodies_.forget();
    read(input);
    if (source_.count == 0) return {};
    Contacts c;
    nine_stages(options, survey(input, options), c);
    last_count_ = 0;
    return stages_->arrays(pairs_.data(), stream_);
  }

  std::uint64_t hash() const override {
    const OnDevice on(device_);
    return hash_of_pairs(pairs_on_device_, last_count_, hash_, stream_of_hash_);
  }

 private:
  using Clock = std::chrono::steady_clock;

  void begin(const Options& options) {
    begun_ = last_mark_ = Clock::now();
    seconds_ = {}, timings_ = options.timings;
    stream_ = static_cast<cudaStream_t>(options.stream);
    if (!stream_) {  // a stream of our own that waits for the default stream: that one cannot be recorded as
                     // a graph
      if (!own_stream_) cuda_check(cudaStreamCreate(&own_stream_), "make a stream");
      stream_ = own_stream_;
    }
    book_.limit = options.memory_limit;
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
    if (!bodies_.run(input, options, room, c.count, stream_, marks)) return false;
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
    const Summary s = surveyor_.survey(source_, stream_);
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

  // Everything that decides what the device does between its first kernel and its count.
  struct Plan {
    Source source;
    Grid grid;
    SearchOptions search;
    Output output;
    SlotKind kind = SlotKind::equal;
    OrderMethod method = OrderMethod::automatic;
    bool octaves = false, with_survey = false;
    int top = 0;
    std::uint64_t moves = 0;  // allocations so far: addresses are those of the plan
    std::uint64_t kept = 0;   // Orderer::kept(), where the buckets of the call before are to be tried
    friend bool operator==(const Plan&, const Plan&) = default;
  };
  static SearchOptions search_options(const Options& options, const Summary& summary) {
    SearchOptions s;
    s.exact = options.precision == Precision::exact, s.fixed_order = options.order == Order::fixed;
    s.own = options.own, s.radius = summary.radius_max, s.owns_all = true;
    for (int k = 0; k < 3; k++)
      s.owns_all = s.owns_all && options.own.low[k] == -INFINITY && options.own.high[k] == INFINITY;
    return s;
  }
  void make_plan(const Options& options, const Summary& summary) {
    plan_ = {};
    plan_.source = source_, plan_.grid = choose_grid(summary, options.bin_size, 8, Look::down);
    plan_.search = search_options(options, summary);
    if (plan_.search.fixed_order) plan_.search.share = share_;
    const bool floats =
        !source_.wide && source_.placed == 0 && float_range(summary.extent, summary.radius_max);
    plan_.kind = !floats                                    ? SlotKind::fixed
                 : summary.radius_min == summary.radius_max ? SlotKind::equal
                                                            : SlotKind::unequal;
    plan_.octaves = needs_octaves(summary), plan_.top = exponent_of(summary.need_max);
  }

  // The bounds are gathered by the kernels that put the spheres in order.
  bool along() const { return plan_.with_survey && Surveyor::rides_along(source_); }

  void expect_report() {
    report_.clear();
    if (plan_.with_survey)
      surveyor_.read(source_, plan_.octaves, along(), report_);
    else
      surveyor_.read_head(report_);
    report_.expect();
  }
  // One pass over the device: order, search, and the counters (with_survey: the summary too) to the host.
  void enqueue() {
    static_assert(sizeof(Counters) <= Surveyor::kHead * 8);
    auto* const counters = reinterpret_cast<Counters*>(surveyor_.head());
    found_ = reinterpret_cast<const Counters*>(surveyor_.host_head());
    if (plan_.with_survey && !along())
      surveyor_.begin(source_, plan_.octaves, plan_.top, stream_);
    else if (!plan_.with_survey)
      cuda_check(cudaMemsetAsync(counters, 0, sizeof(Counters), stream_), "clear the counters");
    orderer_.lend(reinterpret_cast<float4*>(normals_.data()), normals_.capacity() / sizeof(float4),
                  reinterpret_cast<std::uint32_t*>(pairs_.data()), pairs_.capacity() * 2);
    const Ordered ordered =
        orderer_.order(source_, plan_.grid, plan_.kind, plan_.search.fixed_order, plan_.method,
                       along() ? surveyor_.gather(plan_.octaves, plan_.top) : Gather{}, counters, stream_,
                       plan_.with_survey);
    mark(seconds_.stage[3]);
    search(source_, plan_.grid, ordered, plan_.search, plan_.output, counters, search_memory_, stream_);
    report_.send(stream_);
  }

  void fast(const Input& input, const Options& options, Contacts& c) {
    // The bins of the call before are tried first, while the survey runs along: usually they still fit, and
    // the device is waited for once instead of twice. They are taken only if they are those that the survey
    // leads to, so that the result does not depend on what was detected before.
    bool done = false;
    if (hope_ > 0 && !options.timings && planned_for_ == source_.count) {
      const Summary before = summary_;
      make_plan(options, before);
      plan_.output = output(options), plan_.with_survey = true, plan_.method = method_,
      plan_.moves = book_.moves, plan_.kept = orderer_.kept();
      expect_report();
      recording_.run(plan_, book_.moves, stream_, [&] { enqueue(); });
      report_.arrived(stream_, "search for contacts");
      const Grid grid = plan_.grid;
      const SlotKind kind = plan_.kind;
      done = surveyor_.finish(source_, plan_.octaves, plan_.top, along(), summary_);
      if (done) {
        check(summary_, input, options);
        make_plan(options, summary_);
        done = grid == plan_.grid && kind == plan_.kind && summary_.radius_max == before.radius_max &&
               !found_->flags;
      }
      hope_ = done ? 1 : -4;
    }
    if (!done) {
      if (hope_ <= 0) hope_++;
      planned_for_ = 0;
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
      plan_.output = output(options), plan_.method = method_ = OrderMethod::automatic;
      expect_report();
      enqueue();
      report_.arrived(stream_, "search for contacts");
    }
    planned_for_ = source_.count;
    // A bin too full for the method: sort. A list too short: it was counted to its end; made longer, and
    // written again. So is a list in the order of another length.
    while (true) {
      const Counters found = *found_;
      c.count = found.contacts, c.doubtful = found.doubtful;
      const bool fixed = plan_.search.fixed_order;
      const Share share = fixed ? share_for(found, source_.count, plan_.grid, plan_.kind) : Share{};
      if (found.flags & kCrowded) {
        plan_.method = method_ = OrderMethod::sort;
      } else if (c.count > capacity(options) || share != plan_.search.share ||
                 (fixed && found.spilled > search_memory_.spill.capacity())) {
        if (c.count > capacity(options)) reserve_records(options, c.count + c.count / 16);
        if (fixed) {
          const bool known = share == plan_.search.share;  // else: usually a twentieth of the list
          search_memory_.spill.reserve(known ? found.spilled + found.spilled / 8 : c.count / 16 + 4096);
          plan_.search.share = share_ = share;
        }
      } else {
        break;
      }
      plan_.output = output(options), plan_.with_survey = false;
      expect_report();
      enqueue();
      report_.arrived(stream_, "search for contacts");
    }
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
      if (options.path != Path::fast) cuda_check(cudaStreamSynchronize(stream_), "finish");
      return;
    }
    const std::uint64_t scalar = options.scalar == Scalar::f32 ? 4 : 8;
    const auto copy = [&](auto& host, const void* from, std::uint64_t bytes) -> const void* {
      void* to = host.reserve(bytes);
      if (bytes)
        cuda_check(cudaMemcpyAsync(to, from, bytes, cudaMemcpyDeviceToHost, stream_), "copy the contacts");
      return to;
    };
    c.pairs = static_cast<const Pair*>(copy(host_pairs_, c.pairs, c.count * sizeof(Pair)));
    if (c.normals) c.normals = copy(host_normals_, c.normals, c.count * 4 * scalar);
    if (c.points) c.points = copy(host_points_, c.points, c.count * 6 * scalar);
    cuda_check(cudaStreamSynchronize(stream_), "copy the contacts");
  }

  int device_;
  cudaStream_t stream_ = nullptr, stream_of_hash_ = nullptr;
  MemoryBook book_;
  InputCopy input_{book_};
  Source source_;
  Surveyor surveyor_{book_};
  Report report_;
  Orderer orderer_{book_};
  BodySearch bodies_{book_};
  std::optional<Stages> stages_;
  Buffer<Pair> pairs_{book_, "the contacts"};
  Buffer<unsigned char> normals_{book_, "the contacts"}, points_{book_, "the contacts"};
  Buffer<unsigned char> host_pairs_{book_, "the contacts", true}, host_normals_{book_, "the contacts", true},
      host_points_{book_, "the contacts", true};
  const Counters* found_ = nullptr;  // of the last search, on the host
  SearchMemory search_memory_{book_};
  mutable Buffer<unsigned long long> hash_{book_, "the hash"};
  const Pair* pairs_on_device_ = nullptr;
  std::uint64_t last_count_ = 0;
  Plan plan_;
  Recording<Plan> recording_;
  cudaStream_t own_stream_ = nullptr;
  Summary summary_;
  OrderMethod method_ = OrderMethod::automatic;
  int hope_ = 1;  // above 0: try the bins of the call before; a disappointment lasts for some calls
  std::uint64_t planned_for_ = 0;  // spheres of summary_
  Share share_;                    // of the list before, for a fixed order
  Seconds seconds_;
  bool timings_ = false;
  Clock::time_point begun_, last_mark_;
};

}  // namespace
}  // namespace cuda

std::string cuda_absence() {
  int devices = 0;
  const cudaError_t e = cudaGetDeviceCount(&devices);
  if (e == cudaSuccess && devices > 0) return "";
  cudaGetLastError();
  return e == cudaSuccess || e == cudaErrorNoDevice
             ? "there is no GPU that CUDA can use: choose omp"
             : std::string("CUDA cannot be used (") + cudaGetErrorString(e) + "): choose omp";
}

std::unique_ptr<Backend> make_cuda_backend(int device) {
  const std::string absence = cuda_absence();
  if (!absence.empty()) throw Error(absence);
  int devices = 0;
  cuda::cuda_check(cudaGetDeviceCount(&devices), "count the GPUs");
  if (device < 0 || device >= devices)
    throw Error("there is no GPU " + std::to_string(device) + ": this machine has " +
                std::to_string(devices) + ", numbered from 0");
  return std::make_unique<cuda::CudaBackend>(device);
}

}  // namespace padder::detect
