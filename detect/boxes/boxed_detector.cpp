// SPDX-License-Identifier: MIT
#include "detect/boxes/boxed_detector.h"

#include <omp.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "detect/boxes/assignment.h"
#include "detect/boxes/device_worker.h"
#include "detect/core/backend.h"
#include "detect/core/revision.h"
#include "padding/asset/error.h"

namespace padder::detect {
namespace {

constexpr double kMostImbalance = 1.1;  // of the heaviest box's work over the mean, before boxes are cut anew
constexpr std::uint64_t kSamplePerBox = 4096, kLeastSample = 1 << 16, kMostSample = 1 << 22;
constexpr int kCutAttempts = 6;
constexpr std::uint64_t kMostLocal = 0xfffffffe;  // spheres that one detector numbers
constexpr double kFirstGuess = 160;  // bytes that a detector on the CPU takes for a sphere and its contacts

double now() { return omp_get_wtime(); }

// The contacts of one box, copied out of its detector.
struct BoxList {
  std::vector<Pair> pairs;
  std::vector<char> normals, points;
};

void append(std::vector<char>& to, const void* from, std::uint64_t bytes) {
  if (from) to.insert(to.end(), static_cast<const char*>(from), static_cast<const char*>(from) + bytes);
}

// The boxes of a round. Each is taken when its load is complete, while others are still being copied.
class ReadyBoxes {
 public:
  // Device d begins with box d of the round, so that a stepping scene finds it with the plans of the call
  // before; whoever is done takes any other box.
  ReadyBoxes(std::uint32_t boxes, std::uint32_t devices) : first_ready_(devices), left_(boxes - devices) {}

  void add(std::uint32_t box) {
    const std::lock_guard lock(mutex_);
    if (box < first_ready_.size())
      first_ready_[box] = true;
    else
      others_.push_back(box);
    changed_.notify_all();
  }
  // These wait. False or none: there is no further box, or somebody failed.
  bool first_of(std::uint32_t device) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || first_ready_[device]; });
    return !failure_;
  }
  std::optional<std::uint32_t> next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return failure_ || left_ == 0 || !others_.empty(); });
    if (failure_ || left_ == 0) return {};
    const std::uint32_t box = others_.front();
    others_.pop_front();
    if (--left_ == 0) changed_.notify_all();
    return box;
  }
  // Keeps the exception in flight if it is the first.
  void fail() {
    const std::lock_guard lock(mutex_);
    if (!failure_) failure_ = std::current_exception();
    changed_.notify_all();
  }
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<bool> first_ready_;  // of each device
  std::deque<std::uint32_t> others_;
  std::uint32_t left_;  // of the others, not taken
  std::exception_ptr failure_;
};

}  // namespace

class BoxedDetector::Work {
 public:
  explicit Work(const BoxOptions& options) : options_(options) {
    std::vector<DeviceChoice> devices = options.devices;
    if (devices.empty()) devices.emplace_back();
    workers_.reserve(devices.size());
    for (const DeviceChoice& d : devices) workers_.emplace_back(std::make_unique<DeviceWorker>(d));
    for (const auto& w : workers_) on_host_ += w->on_host();
  }

  CallOptions& options() { return options_.detector; }
  const BoxReport& report() const { return report_; }
  const char* backend() const {
    return on_host_ == workers_.size() ? "omp" : on_host_ == 0 ? "cuda" : "cuda and omp";
  }
  // Throws Error if there are more than `most` spheres.
  const BoxReport& run(const Input& input, const ContactConsumer& consumer, std::uint64_t most);
  const Contacts& list(const Input& input);

 private:
  // Shares of BoxOptions::memory_limit; without one, no limit.
  std::uint64_t share(double part) const {
    if (options_.memory_limit == 0) return ~std::uint64_t(0);
    return static_cast<std::uint64_t>(part * static_cast<double>(options_.memory_limit));
  }
  std::uint64_t copies_limit() const { return share(on_host_ ? 0.25 : 0.75); }
  std::uint64_t table_limit() const { return std::min<std::uint64_t>(share(1. / 16), 256 << 20); }
  // Points of a sample: cut() holds two copies of them and their weights, when no copies of spheres are held.
  std::uint64_t sample_limit() const {
    return std::max<std::uint64_t>(1024, copies_limit() / (3 * sizeof(WeightedPoint)));
  }
  // More boxes than this the sample could not tell apart.
  std::uint32_t boxes_limit() const {
    return static_cast<std::uint32_t>(std::min(sample_limit(), kMostSample) / 8);
  }
  std::uint64_t detector_limit() const;
  std::uint64_t spheres_limit() const;
  int threads() const {
    return options_.detector.threads ? options_.detector.threads : omp_get_max_threads();
  }

  void plan(Assignment& assignment);
  void cut(const Assignment& assignment, std::uint32_t boxes);
  double excess(const Assignment& assignment) const;
  double expected_imbalance(const Assignment& assignment) const;
  void rounds(const Assignment& assignment, const ContactConsumer& consumer);
  void run_round(const Assignment& assignment, std::uint32_t first, std::uint32_t count, Delivery& delivery);
  CallOptions options_of(const DeviceWorker& worker) const;
  void note_memory(const Assignment& assignment);
  void finish(const Assignment& assignment);

  BoxOptions options_;
  std::vector<std::unique_ptr<DeviceWorker>> workers_;
  std::uint64_t on_host_ = 0;  // workers on the CPU
  RevisionKeeper bodies_;
  BoxTree tree_;
  std::vector<double>
      density_;            // work for each sphere given to a box, in the call before; empty: not cut yet
  bool informed_ = false;  // the cut knew the density
  double settled_imbalance_ = 1;  // what the last cut could reach
  double bytes_per_sphere_ = kFirstGuess;
  std::vector<BoxLoad> loads_;      // of a round
  std::vector<BoxResult> results_;  // of each box
  BoxReport report_;
  BoxList all_;
  Contacts contacts_;
};

std::uint64_t BoxedDetector::Work::detector_limit() const {
  const std::uint64_t mine = on_host_ ? share(0.5) / on_host_ : share(1),
                      asked = options_.detector.memory_limit;
  return asked ? std::min(mine, asked) : mine;
}

// Spheres that one box may be given.
std::uint64_t BoxedDetector::Work::spheres_limit() const {
  const double fit = static_cast<double>(detector_limit()) / bytes_per_sphere_;
  const bool limited = on_host_ ? detector_limit() != ~std::uint64_t(0) : options_.detector.memory_limit != 0;
  return limited && fit < static_cast<double>(kMostLocal) ? static_cast<std::uint64_t>(fit) + 1 : kMostLocal;
}

// Counts the spheres of each box, and cuts anew where that is needed: when there is no cut yet, when a box is
// too large for memory, or when the boxes' work has become uneven.
void BoxedDetector::Work::plan(Assignment& assignment) {
  const auto asked =
      std::max(options_.boxes, static_cast<std::uint32_t>(options_.boxes ? 1 : workers_.size()));
  const double fit = static_cast<double>(assignment.spheres()) / static_cast<double>(spheres_limit());
  const double least = std::min(1.2 * fit, static_cast<double>(boxes_limit()));
  std::uint32_t wanted = std::max(asked, static_cast<std::uint32_t>(least));
  bool fresh = density_.empty() || tree_.boxes() < wanted || tree_.boxes() > 2 * std::uint64_t(wanted);
  if (!fresh) {
    wanted = tree_.boxes();
    assignment.count(tree_, table_limit());
    const double uneven = workers_.size() > 1 ? expected_imbalance(assignment) : 1;
    fresh = uneven > std::max(kMostImbalance, 1.05 * settled_imbalance_);
  }
  for (int attempt = 0; attempt < kCutAttempts; attempt++) {
    if (fresh) {
      cut(assignment, wanted);
      assignment.count(tree_, table_limit());
    }
    const double more = excess(assignment);
    if (more <= 1 || wanted >= boxes_limit()) break;
    fresh = attempt + 1 < kCutAttempts;
    wanted = std::min(boxes_limit(), static_cast<std::uint32_t>(wanted * std::min(more, 2.)) + 1);
  }
  report_.boxes = tree_.boxes();
  report_.memory_boxes = tree_.boxes() > asked ? tree_.boxes() - asked : 0;
}

// Each sphere weighs what spheres of its box cost in the call before: itself, and its contacts.
void BoxedDetector::Work::cut(const Assignment& assignment, std::uint32_t boxes) {
  std::vector<WeightedPoint> points = assignment.sample(
      std::min(std::clamp(kSamplePerBox * boxes, kLeastSample, kMostSample), sample_limit()));
  const std::vector<double> before = density_;
  std::vector<double> plain;
  for (WeightedPoint& p : points) {
    plain.push_back(p.weight);
    if (!before.empty()) p.weight *= before[tree_.box_of(p.at)];
  }
  tree_ = cut_space(points, boxes, {}, threads());
  // What the new boxes are expected to cost.
  density_.assign(boxes, 1);
  std::vector<double> work(boxes, 0), weight(boxes, 0);
  for (std::size_t k = 0; k < points.size(); k++) {
    const std::uint32_t box = tree_.box_of(points[k].at);
    work[box] += points[k].weight, weight[box] += plain[k];
  }
  for (std::uint32_t b = 0; b < boxes; b++)
    if (weight[b] > 0) density_[b] = work[b] / weight[b];
  informed_ = !before.empty();
  report_.cut = true;
}

// How many times too large the largest box is for the memory it may take.
double BoxedDetector::Work::excess(const Assignment& assignment) const {
  double worst = 0;
  for (std::uint32_t b = 0; b < tree_.boxes(); b++)
    worst =
        std::max({worst, static_cast<double>(assignment.spheres_of(b)) / static_cast<double>(spheres_limit()),
                  static_cast<double>(assignment.load_bytes(b)) / static_cast<double>(copies_limit())});
  return worst;
}

double BoxedDetector::Work::expected_imbalance(const Assignment& assignment) const {
  std::vector<double> work;
  for (std::uint32_t b = 0; b < tree_.boxes(); b++)
    work.push_back(density_[b] * static_cast<double>(assignment.spheres_of(b)));
  return imbalance_of(work);
}

// As many boxes at a time as their copies find room, in one pass over the scene for each such round.
void BoxedDetector::Work::rounds(const Assignment& assignment, const ContactConsumer& consumer) {
  Delivery delivery{consumer, {}};
  results_.assign(tree_.boxes(), {});
  for (std::uint32_t first = 0; first < tree_.boxes();) {
    std::uint64_t bytes = 0;
    std::uint32_t last = first;
    while (last < tree_.boxes() && (last == first || bytes + assignment.load_bytes(last) <= copies_limit()))
      bytes += assignment.load_bytes(last++);
    if (bytes > copies_limit())
      throw Error(
          "box " + std::to_string(first) + " holds " + std::to_string(assignment.spheres_of(first)) +
          " spheres, and the " + std::to_string(bytes) +
          " bytes of their copies do not fit into the memory limit: many spheres meet at one place, so "
          "raise the limit");
    if (options_.memory_limit) loads_.clear();  // gives back what the round before held
    loads_.resize(std::max<std::size_t>(loads_.size(), last - first));
    run_round(assignment, first, last - first, delivery);
    note_memory(assignment);
    report_.rounds++, first = last;
  }
}

CallOptions BoxedDetector::Work::options_of(const DeviceWorker& worker) const {
  CallOptions o = options_.detector;
  if (worker.on_host()) {
    const std::uint64_t limit = detector_limit();
    o.memory_limit = limit == ~std::uint64_t(0) ? 0 : limit;
    if (on_host_ > 1) o.threads = std::max(1, threads() / static_cast<int>(on_host_));
  }
  return o;
}

// Copies the boxes of a round and detects them. GPUs begin while others are still being copied; detectors on
// the CPU would only take the processors from the copying.
void BoxedDetector::Work::run_round(const Assignment& assignment, std::uint32_t first, std::uint32_t count,
                                    Delivery& delivery) {
  const auto devices = static_cast<std::uint32_t>(std::min<std::size_t>(workers_.size(), count));
  ReadyBoxes ready(count, devices);
  const double start = now();
  double copied = start;
  const auto copy = [&] {
    try {
      assignment.fill(tree_, first, {loads_.data(), count},
                      [&](std::uint32_t box) { ready.add(box - first); });
    } catch (...) {
      ready.fail();
    }
    copied = now();
  };
  const int converting = std::max(1, threads() / static_cast<int>(workers_.size()));
  const auto work = [&](std::uint32_t d) {
    try {
      const CallOptions options = options_of(*workers_[d]);
      std::optional<std::uint32_t> k;
      if (ready.first_of(d)) k = d;
      for (; k; k = ready.next())
        results_[first + *k] = workers_[d]->run(loads_[*k], first + *k, options, converting, delivery);
    } catch (...) {
      ready.fail();
    }
  };
  std::vector<std::jthread> others;
  if (on_host_ > 0)
    copy();
  else
    others.emplace_back(copy);
  for (std::uint32_t d = 1; d < devices; d++) others.emplace_back(work, d);
  work(0);
  others.clear();  // waits for them
  ready.rethrow();
  report_.copy_seconds += copied - start, report_.detect_seconds += now() - copied;
}

void BoxedDetector::Work::note_memory(const Assignment& assignment) {
  std::uint64_t bytes = assignment.table_bytes() + tree_.bytes() + density_.capacity() * sizeof(double) +
                        results_.capacity() * sizeof(BoxResult);
  for (const BoxLoad& load : loads_) bytes += load.bytes();
  for (const auto& w : workers_) bytes += w->host_memory() + w->peak_of_splits();
  report_.memory = std::max(report_.memory, bytes);
}

void BoxedDetector::Work::finish(const Assignment& assignment) {
  BoxResult sum;
  std::vector<double> work;
  for (std::uint32_t b = 0; b < tree_.boxes(); b++) {
    const double spheres = static_cast<double>(assignment.spheres_of(b));
    work.push_back(spheres + static_cast<double>(results_[b].contacts));
    density_[b] = spheres > 0 ? work.back() / spheres : 1;
    report_.copies += assignment.spheres_of(b);
    sum.add(results_[b]);
  }
  report_.imbalance = imbalance_of(work);
  if (report_.cut) settled_imbalance_ = informed_ ? report_.imbalance : 1;
  report_.spheres = assignment.spheres(), report_.contacts = sum.contacts, report_.hash = sum.hash;
  report_.doubtful = sum.doubtful, report_.splits = sum.splits;
  if (sum.splits) bytes_per_sphere_ *= 1.5;  // so that the next call begins with smaller boxes
}

const BoxReport& BoxedDetector::Work::run(const Input& input, const ContactConsumer& consumer,
                                          std::uint64_t most) {
  report_ = {};
  contacts_ = {}, all_ = {};
  try {
    const double start = now();
    check_boxed_options(options_.detector), check_options(options_.detector);
    check_boxed_input(input);
    const Input settled = bodies_.settle(input);
    if (const std::uint64_t spheres = sphere_count(settled); spheres > most)
      throw Error(std::to_string(spheres) +
                  " spheres are more than 32-bit numbers can name: give detect() a consumer");
    Assignment assignment(settled, threads());
    assignment.set_margin(options_.detector.margin);
    plan(assignment);
    report_.cut_seconds = now() - start;
    rounds(assignment, consumer);
    finish(assignment);
  } catch (...) {
    bodies_.forget();
    report_ = {};
    throw;
  }
  return report_;
}

const Contacts& BoxedDetector::Work::list(const Input& input) {
  std::vector<BoxList> lists;
  const auto keep = [&](const ContactBatch& batch) {
    if (lists.size() <= batch.box) lists.resize(batch.box + 1);
    BoxList& to = lists[batch.box];
    for (const WidePair& p : batch.pairs)
      to.pairs.push_back({static_cast<std::uint32_t>(p.i), static_cast<std::uint32_t>(p.j)});
    const std::uint64_t wide = batch.scalar == Scalar::f32 ? 1 : 2;
    append(to.normals, batch.normals, batch.pairs.size() * sizeof(Normal<float>) * wide);
    append(to.points, batch.points, batch.pairs.size() * sizeof(Points<float>) * wide);
  };
  run(input, keep, kMostLocal);
  if (lists.size() == 1) {
    all_ = std::move(lists[0]);
  } else {
    std::size_t pairs = 0, normals = 0, points = 0;
    for (const BoxList& l : lists)
      pairs += l.pairs.size(), normals += l.normals.size(), points += l.points.size();
    all_.pairs.reserve(pairs), all_.normals.reserve(normals), all_.points.reserve(points);
    for (BoxList& l : lists) {
      all_.pairs.insert(all_.pairs.end(), l.pairs.begin(), l.pairs.end());
      append(all_.normals, l.normals.data(), l.normals.size());
      append(all_.points, l.points.data(), l.points.size());
      l = {};
    }
  }
  Contacts c;
  c.count = report_.contacts, c.spheres = report_.spheres, c.doubtful = report_.doubtful;
  c.width = options_.detector.width, c.scalar = options_.detector.scalar;
  c.pairs = all_.pairs.data();
  if (c.width != Width::pairs) c.normals = all_.normals.data();
  if (c.width == Width::points) c.points = all_.points.data();
  c.seconds.place = report_.cut_seconds + report_.copy_seconds;
  c.seconds.total = c.seconds.place + report_.detect_seconds;
  contacts_ = c;
  return contacts_;
}

std::vector<DeviceChoice> all_devices() {
  std::vector<DeviceChoice> devices;
  for (int k = 0; k < cuda_device_count(); k++)
    if (cuda_absence(k).empty()) devices.push_back({BackendKind::cuda, k});
  if (devices.empty()) devices.push_back({BackendKind::omp, 0});
  return devices;
}

BoxedDetector::BoxedDetector(const BoxOptions& options) : work_(std::make_unique<Work>(options)) {}
BoxedDetector::~BoxedDetector() = default;
BoxedDetector::BoxedDetector(BoxedDetector&&) noexcept = default;
BoxedDetector& BoxedDetector::operator=(BoxedDetector&&) noexcept = default;
const Contacts& BoxedDetector::detect(const Input& input) { return work_->list(input); }
const BoxReport& BoxedDetector::detect(const Input& input, const ContactConsumer& consumer) {
  return work_->run(input, consumer, ~std::uint64_t(0));
}
const BoxReport& BoxedDetector::report() const { return work_->report(); }
const char* BoxedDetector::backend() const { return work_->backend(); }
CallOptions& BoxedDetector::options() { return work_->options(); }

}  // namespace padder::detect
