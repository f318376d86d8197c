// SPDX-License-Identifier: MIT
// The CUDA backend: brings the input to the device, chooses among the three ways of finding contacts (bodies
// first, all spheres, the nine stages), and delivers the list.
#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "detect/core/bodies/way_choice.h"
#include "detect/cuda/bodies/bodies.h"
#include "detect/cuda/call/sphere_search.h"
#include "detect/cuda/device/device.h"
#include "detect/cuda/device/profile_range.h"
#include "detect/cuda/device/stream_timer.h"
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
    const bool grid = options.path == Path::grid, automatic = options.bodies == Bodies::automatic;
    read_facts(input);
    const bool worlds = grid && has_worlds(facts_.tally, input);
    if (grid && automatic && !worlds) judge(input, options);
    const bool first = grid && !worlds && (automatic ? way_.first() : options.bodies == Bodies::first);
    // Most pairs then stay near their place. The search of spheres sees to that itself.
    if (options.history && (worlds || first)) options.order = Order::stable;
    const bool may_try = automatic && !worlds && judged_.tries, timed = may_try && way_.times();
    const Call call = begin(input, options);
    if (timed) timer_.begin(stream_);
    if (options.history) history_.begin({list_.keep_pairs(), last_count_}, stream_);
    Contacts c;
    c.memory = options.output, c.width = options.width, c.scalar = options.scalar;
    // Has the search matched its list itself?
    bool matched = false;
    const bool went_first = first && search_bodies(call, c);
    if (worlds) {
      matched = search_worlds(call, c);
    } else if (!went_first) {
      try {
        search_spheres(call, c), matched = grid;
      } catch (const MemoryError&) {
        if (!may_try || !way_.trying()) throw;
        forget(), expanded_fits_ = false;
        return detect(input, given);
      }
    }
    forget_unseen();
    if (options.history && !matched) match(call, c);
    const std::uint32_t* const history = options.history ? history_.end(c.count) : nullptr;
    {
      const ProfileRange delivery("padder: deliver the contacts");
      list_.deliver(options, c, history, call.stream);
    }
    pairs_on_device_ = list_.pairs(), last_count_ = c.count;
    if (may_try && went_first == first)
      way_.took(timed ? timer_.seconds(stream_) : 0, is_worth_trying(!went_first));
    c.seconds = clock_.seconds();
    running_ = false;
    return c;
  }

  WorldAnswers detect_worlds(const Input& input, const CallOptions& options, std::uint32_t worlds,
                             Answer answer) {
    const ProfileRange range("padder: detect worlds");
    const auto begun = std::chrono::steady_clock::now();
    read_facts(input);
    CallOptions listed = options;
    listed.order = Order::any, listed.width = Width::pairs, listed.output = Memory::device;
    listed.history = false, listed.precision = Precision::exact;
    // Distances are first those of spheres that touch.
    if (answer == Answer::distance) listed.margin = 0;
    const Call call = begin(input, options), list_call = begin(input, listed);
    last_count_ = 0;
    answers_.begin(worlds, answer, stream_);
    answer_worlds(call, list_call);
    WorldAnswers answers = answers_.deliver(options.output, stream_);
    cuda_check(cudaStreamSynchronize(stream_), "answer for the worlds");
    forget_unseen();
    running_ = false;
    answers.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    return answers;
  }

  Arrays stages(const Input& input, const CallOptions& options) {
    read_facts(input);
    const Call call = begin(input, options);
    const DeviceSpheres source = read(call);
    forget_unseen(), forget_revision(), last_count_ = 0;
    Arrays arrays;
    if (source.count > 0) {
      Contacts c;
      nine_stages(source, call, c);
      arrays = stages_->arrays(list_.pairs(), call.stream);
    }
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
    bodies_.forget(), input_.forget(), spheres_.forget(), forget_revision();
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
  Call begin(const Input& input, const CallOptions& options) {
    stream_ = static_cast<cudaStream_t>(options.stream);
    clock_.begin(stream_, options.timings), running_ = true;
    const int processors = processors_of(stream_, device_);
    book_.limit = options.memory_limit;
    // A region's share changes by up to a tenth before space is cut anew.
    book_.roomy = options.memory_limit == 0 && !(options.own == Region{});
    check_memory(input);
    posed_.begin_call(facts_.tally.moving);
    return {input, options, stream_, side_, processors, clock_, list_, options.history ? &history_ : nullptr};
  }
  const BodyCensus& census(const Input& input) {
    if (!facts_.census) facts_.census = census_of(input.shapes, facts_.tally, bodies_.pieces());
    return *facts_.census;
  }
  // Which way does Bodies::automatic go? In any order the calls of one scene keep to what they found, and try
  // the other way; a sample tells the first of them, if poses lie in host memory. A stable order depends on
  // nothing but the number of pairs of balls that touch.
  void judge(const Input& input, const CallOptions& options) {
    const bool any_order = options.order == Order::any, new_bodies = any_order && input.revision == 0;
    Judged scene{options.order, options.margin, input.revision, facts_.bodies, facts_.loose, spheres()};
    scene.tries = any_order && options.precision == Precision::exact && !options.history &&
                  options.memory_limit == 0 && options.own == Region{};
    if (scene == judged_ && (any_order || input.revision != 0)) return;
    judged_ = scene;
    const BodyCensus bodies = census(input);
    // Without a revision the table of what is static would be made in each call, which takes far longer.
    const std::uint64_t moving = any_order && !new_bodies
                                     ? moving_loose(input, static_cast<cudaStream_t>(options.stream))
                                     : facts_.loose;
    const auto most = [&](double times) {
      return most_touching_balls(bodies, scene.spheres, scene.loose, moving,
                                 new_bodies ? tuning::kNewBodies : tuning::kKnownBodies, times);
    };
    most_pairs_ = most(1), few_pairs_ = most(1 / tuning::kTried), tried_pairs_ = most(tuning::kTried);
    if (facts_.bodies == 0 && moving == facts_.loose) tried_pairs_ = 0;  // nothing that could be faster
    hollow_ = bodies.filled < tuning::kHollow;
    bool first = most_pairs_ > 0;
    if (first && any_order) first = touching_balls(input, options.margin, bodies_.pieces()) < most_pairs_;
    way_ = WayChoice(first);
  }
  // May the other way be as fast as that of this call?
  bool is_worth_trying(bool first) const {
    if (first) return tried_pairs_ > 0;
    return expanded_fits_ && judged_.spheres <= tuning::kTriedSpheres && bodies_.pairs() >= few_pairs_;
  }
  bool search_bodies(const Call& call, Contacts& c) {
    const bool automatic = call.options.bodies == Bodies::automatic;
    bodies_seen_ = true;
    BodySearch::PairLimit limit;
    if (automatic) limit = {way_.by_clock() ? tried_pairs_ : most_pairs_, hollow_};
    const bool done = bodies_.run(call, limit, c);
    if (!done && automatic && call.options.order == Order::any) way_.gave_up();
    return done;
  }
  // What does not change within a revision, since bodies may be many. Throws Error for an input that cannot
  // be read.
  void read_facts(const Input& input) {
    const bool known = has_facts(input);
    BodyTally tally = check_input(input, true, known);
    if (!known) facts_.tally = std::move(tally), facts_.census.reset();
    facts_.revision = input.revision, facts_.bodies = input.bodies.size(), facts_.loose = loose_count(input);
  }
  bool has_facts(const Input& input) const {
    return input.revision != 0 && input.revision == facts_.revision && input.bodies.size() == facts_.bodies &&
           loose_count(input) == facts_.loose;
  }
  std::uint64_t spheres() const { return sphere_count(facts_.tally, facts_.loose); }
  bool has_small_bodies() const { return spheres() <= tuning::kSmallBody * (facts_.bodies + facts_.loose); }
  WorldAllowance allowance(bool of_list) const {
    const double ns = tuning::kApartOfCall + tuning::kApartOfSphere * static_cast<double>(spheres());
    WorldAllowance a;
    a.pairs = static_cast<unsigned long long>(ns / tuning::kTreePair);
    a.steps_of_warp = static_cast<std::uint32_t>(std::min(ns / tuning::kTreeStepOfWarp, 1e9));
    a.elements_of_world = of_list ? tuning::kMostElementsOfList : tuning::kMostElementsOfAnswer;
    return a;
  }
  // True: the list is matched with its history.
  bool search_worlds(const Call& call, Contacts& c) {
    const Input& input = call.input;
    const bool automatic = call.options.bodies == Bodies::automatic,
               tree_first = !input.bodies.empty() &&
                            (call.options.bodies == Bodies::first || (automatic && !has_small_bodies()));
    // In any order further calls of a revision in which the tree has given up begin without it.
    const bool gave_up =
        automatic && call.options.order == Order::any && input.revision != 0 && input.revision == gave_up_;
    if (tree_first && !gave_up) {
      worlds_seen_ = true;
      if (worlds_.run(call, automatic ? allowance(true) : WorldAllowance{}, c)) return false;
      gave_up_ = input.revision;
    }
    if (worlds_apart_.run(read(call), call, c)) return worlds_apart_.matched();
    worlds_seen_ = true;
    worlds_.run(call, {}, c);
    return false;
  }
  void answer_worlds(const Call& call, const Call& list_call) {
    const bool counts = answers_.answer() == Answer::count;
    if (!counts || !has_small_bodies()) {
      worlds_seen_ = true;
      if (worlds_.answer(call, allowance(counts), answers_)) return;
      answers_.begin(answers_.keys().worlds, answers_.answer(), stream_);
    }
    if (answer_from_list(list_call, call.options.margin)) return;
    worlds_seen_ = true;
    worlds_.answer(call, {}, answers_);
  }
  // False: some are missing.
  bool answer_from_list(const Call& call, double margin) {
    // The tree alone looks at the world of a body that has no spheres.
    const bool some_empty = std::any_of(call.input.shapes.begin(), call.input.shapes.end(),
                                        [](const Shape& s) { return s.count == 0; });
    if (some_empty) return false;
    Contacts c;
    try {
      const DeviceSpheres source = read(call);
      if (!worlds_apart_.run(source, call, c)) return false;
      // Their sentence comes from the tree.
      if (c.spheres > 0 && worlds_apart_.last_world() >= answers_.keys().worlds) return false;
      answers_.add(source, worlds_apart_.worlds(), source.world_of_all, list_.pairs(), c.count, stream_);
    } catch (const MemoryError&) {  // answers need no list
      worlds_apart_.forget();
      return false;
    }
    return answers_.settle(stream_) || margin == call.options.margin;
  }
  void forget_revision() { judged_ = {}, gave_up_ = 0, facts_ = {}; }
  // Of bodies a search knows only what it saw in the call before.
  void forget_unseen() {
    if (!std::exchange(bodies_seen_, false)) bodies_.forget();
    if (!std::exchange(worlds_seen_, false)) worlds_.forget();
    if (!std::exchange(input_seen_, false)) input_.forget();
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
    input_seen_ = true;
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
  PosedBodies posed_{book_};
  InputCopy input_{book_, posed_};
  const void* checked_[kGiven] = {};  // known to be device memory
  SphereSearch spheres_{book_};
  BodySearch bodies_{book_, posed_};
  WorldSearch worlds_{book_, posed_};
  WorldsApart worlds_apart_{book_};
  AnswerArrays answers_{book_};
  // What Bodies::automatic means for calls of one scene.
  struct Judged {
    Order order = Order::stable;
    double margin = -1;  // of no scene
    std::uint64_t revision = 0, bodies = 0, loose = 0, spheres = 0;
    bool tries = false;  // the way that is not chosen
    friend bool operator==(const Judged&, const Judged&) = default;
  } judged_;
  WayChoice way_;
  // Of balls that touch: with more, bodies first are slower by the costs; with fewer than few_pairs_ they are
  // kTried times as fast, with more than tried_pairs_ kTried times as slow.
  double most_pairs_ = INFINITY, few_pairs_ = 0, tried_pairs_ = INFINITY;
  bool hollow_ = false;        // PairLimit::hollow
  bool expanded_fits_ = true;  // no try has failed for want of memory
  StreamTimer timer_;
  // Of this call. Also of the next ones with the revision, if nothing else here differs.
  struct Facts {
    std::uint64_t revision = 0, bodies = 0, loose = 0;
    BodyTally tally;
    std::optional<BodyCensus> census;
  } facts_;
  std::uint64_t gave_up_ = 0;  // the last revision of whose worlds the tree gave up
  // What has seen the bodies of this call.
  bool bodies_seen_ = false, worlds_seen_ = false, input_seen_ = false;
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
