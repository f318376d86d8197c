// Bodies first on the GPU: balls about pieces of bodies and loose spheres go through order and search like
// any spheres; then one warp looks at the spheres of each two that met, and a last pass writes the records.
// Static elements wait in a table that is built once. Internal; only .cu files include this.
#pragma once
#include <functional>

#include "detect/assembly.h"
#include "detect/cuda/graph.h"
#include "detect/cuda/record.h"
#include "detect/cuda/search.h"

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
  bool run(const Input& input, const Options& options, const Room& output, std::uint64_t& contacts,
           cudaStream_t stream, const Mark& mark);

 private:
  // Everything that decides what the device does between its first kernel and its count.
  struct Plan {
    BodyView view;
    Source balls, loose;
    Grid grid;
    Output output;
    Region own;
    OrderMethod method = OrderMethod::automatic;
    bool octaves = false, with_survey = false, fixed_order = true;
    Share share;
    int top = 0;
    std::uint64_t moves = 0;
    friend bool operator==(const Plan&, const Plan&) = default;
  };

  void read_all(const Input& input, cudaStream_t stream);
  void read_moved(const Input& input, cudaStream_t stream);
  void read_loose(const Input& input, bool known, cudaStream_t stream);
  bool build_table(cudaStream_t stream);
  void place(std::uint32_t first, std::uint32_t end, cudaStream_t stream);
  void make_plan(const Options& options, const Output& output);
  void expect_report();
  void enqueue(cudaStream_t stream, const Mark& mark);
  void meet_static(cudaStream_t stream);
  bool ordinary(const Options& options) const;

  MemoryBook& book_;
  InputCopy input_;
  Surveyor surveyor_;
  Orderer orderer_;
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
  Buffer<uint2> ranks_;
  Buffer<std::uint32_t> batch_counts_, query_counts_;
  Buffer<unsigned long long> batch_places_, query_places_;
  Buffer<unsigned char> scratch_;
  Buffer<BodyCounters> counters_, host_counters_;
  Report report_;
  SearchMemory search_memory_;
  Share share_;  // of the pairs found before
};

}  // namespace padder::detect::cuda
