// SPDX-License-Identifier: MIT
// Bodies first on the GPU: balls about pieces of bodies and loose spheres go through order and search like
// any spheres; then one warp looks at the spheres of each two that met, and a last pass writes the records.
// Static elements wait in a table that is built once. Internal; only .cu files include this.
#pragma once
#include <functional>

#include "detect/core/assembly.h"
#include "detect/cuda/graph.h"
#include "detect/cuda/output/records.h"
#include "detect/cuda/search/search.h"

namespace padder::detect::cuda {

// A loose sphere on its way to the device, where only those that move are sent.
struct LooseRecord {
  Sphere sphere;
  Filter filter;
  std::uint32_t number = 0;
};
struct MovedBody {
  Pose pose;
  std::uint64_t body = 0;
};

// The scene as the kernels read it.
struct BodyView {
  const Body* bodies = nullptr;
  const Element* elements = nullptr;
  const Piece* pieces = nullptr;
  const Sphere* spheres = nullptr;
  const std::uint32_t* numbers = nullptr;
  const float4* near = nullptr;
  const std::uint32_t* body_first = nullptr;
  Sphere* balls = nullptr;
  std::uint32_t *family = nullptr, *mask = nullptr, *owner = nullptr;
  std::uint32_t moving = 0, count = 0, loose_first = 0;
  friend bool operator==(const BodyView&, const BodyView&) = default;
};

struct BodyCounters {
  Counters broad;                                   // pairs of elements
  unsigned long long static_pairs, contacts, next;  // next: pair to be looked at
};

struct MeetTask;  // meet.h

class BodySearch {
 public:
  explicit BodySearch(MemoryBook& book);

  bool knows(const Input& input) const;  // by its revision
  void forget() { revision_ = 0; }       // a call went another way: what moved in it was not seen
  std::uint64_t body_spheres() const { return assembly_.body_first.back(); }

  // All contacts to what `output` gives; it is asked with the number of contacts when there is too little
  // room. False: something is out of the ordinary (a pose that is none, coordinates beyond what a record
  // holds); then the spheres must be expanded and each be asked. `mark` is called after each stage.
  using Room = std::function<Output(std::uint64_t count)>;
  using Mark = std::function<void(int stage)>;  // -1: place
  // `side` records what is enqueued, `processors`: processors_of(stream).
  bool run(const Input& input, const Options& options, const Room& output, std::uint64_t& contacts,
           cudaStream_t stream, SideStream& side, int processors, const Mark& mark);

 private:
  // Everything that decides what the device does between its first kernel and its count: whatever a kernel is
  // given by value follows from it.
  struct Plan {
    BodyView view;
    Source balls, loose;
    Grid grid;
    Output output, pairs;  // of contacts, of elements that met
    Region own;
    StaticView statics;
    Grid static_grid;
    std::uint32_t static_count = 0;
    uint4* hits = nullptr;
    std::uint64_t hit_room = 0;
    OrderMethod method = OrderMethod::automatic;
    bool octaves = false, with_survey = false, stable_order = true;
    Share share;
    int top = 0, processors = 1;
    std::uint64_t moves = 0;
    friend bool operator==(const Plan&, const Plan&) = default;
  };
  // What a plan works with. Only addresses come from here, which stay while nothing is allocated.
  struct Tools {
    explicit Tools(MemoryBook& book);
    Surveyor surveyor;
    Orderer orderer;
    SearchMemory search;
    Report report;
    Buffer<uint2> ranks;
    Buffer<std::uint32_t> batch_counts, query_counts;
    Buffer<unsigned long long> batch_places, query_places;
    Buffer<unsigned char> scratch;
    Buffer<BodyCounters> counters, host_counters;
  };

  void read_all(const Input& input, cudaStream_t stream);
  void read_moved(const Input& input, cudaStream_t stream);
  void read_loose(const Input& input, bool known, cudaStream_t stream);
  bool build_table(cudaStream_t stream);
  void place(std::uint32_t first, std::uint32_t end, cudaStream_t stream);
  void make_plan(const Options& options, const Output& output, int processors);
  void pass(cudaStream_t stream, SideStream* side, const Mark& mark);
  static void expect_report(const Plan& plan, Tools& tools);
  static void enqueue(const Plan& plan, Tools& tools, cudaStream_t stream, const Mark& mark);
  static void meet_static(const Plan& plan, Tools& tools, cudaStream_t stream);
  static void meet_all(const Plan& plan, Tools& tools, MeetTask& task, cudaStream_t stream);
  bool ordinary(const Options& options) const;

  MemoryBook& book_;
  InputCopy input_;
  Tools tools_;
  Assembly assembly_;
  StaticTable table_;
  double static_extent_ = 0;
  std::uint64_t revision_ = 0, known_bodies_ = 0, known_loose_ = 0;
  std::vector<std::uint32_t> moving_bodies_, moving_loose_;
  BodyView view_;
  StaticView static_view_;
  Source loose_;
  Summary summary_;
  Plan plan_;
  Recording<Plan> recording_;
  int hope_ = 0;  // above 0: the bins of the call before are tried first
  OrderMethod method_ = OrderMethod::automatic;

  Buffer<Body> bodies_;
  Buffer<Pose> poses_;
  Buffer<Element> elements_;
  Buffer<Piece> pieces_;
  Buffer<Sphere> spheres_, balls_, loose_spheres_, static_balls_;
  Buffer<float4> near_;
  Buffer<std::uint32_t> numbers_, body_first_, tags_, loose_tags_, moving_list_, static_starts_,
      static_elements_;
  Buffer<LooseRecord> records_, host_records_;
  Buffer<MovedBody> moved_, host_moved_;
  Buffer<Pair> pairs_;
  Buffer<uint4> hits_;
  BodyCounters found_{};  // of the last pass
  Share share_;           // of the pairs found before
};

}  // namespace padder::detect::cuda
