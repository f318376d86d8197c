// SPDX-License-Identifier: MIT
// The public class of the detector: spheres in, contacts out. It follows sections 2.1 and 2.2 of the paper;
// docs/detector/use.md describes it.
#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "detect/body.h"
#include "detect/contact.h"
#include "detect/filter.h"

namespace padder::detect {

// The memory in which an array lies.
enum class Memory : std::uint8_t { host, device };
// The type of the numbers in an array: float or double.
enum class Scalar : std::uint8_t { f32, f64 };
template <class T>
concept RealNumber = std::is_same_v<T, float> || std::is_same_v<T, double>;
template <RealNumber T>
inline constexpr Scalar kScalarOf = std::is_same_v<T, float> ? Scalar::f32 : Scalar::f64;

// N spheres in the caller's memory. The detector reads them only while detect() runs. A stride counts
// numbers, not bytes.
struct Spheres {
  std::uint64_t count = 0;  // together with the spheres of the bodies below 2^32 - 1
  Scalar scalar = Scalar::f32;
  Memory memory = Memory::host;
  const void* centers = nullptr;  // x, y, z of sphere k begin at k * center_stride
  const void* radii = nullptr;    // that of sphere k is at k * radius_stride; stride 0: one radius for all
  std::uint32_t center_stride = 3, radius_stride = 1;
  const std::uint32_t* family = nullptr;  // null: family 0 for all
  const std::uint32_t* mask = nullptr;    // null: mask 0 for all
  // Not 0: the sphere is static. Two static spheres are never a contact. null: no sphere is static.
  const std::uint8_t* is_static = nullptr;
  // The world of each sphere. null: all are in the world `world_of_all`. See Body::world.
  const std::uint32_t* world = nullptr;
  std::uint32_t world_of_all = 0;
};
template <RealNumber T>
Spheres spheres_of(std::uint64_t count, const T* centers, const T* radii, Memory memory = Memory::host) {
  Spheres s;
  s.count = count, s.scalar = kScalarOf<T>, s.memory = memory, s.centers = centers, s.radii = radii;
  return s;
}

struct SpheresAround;  // detect/core/input.h
struct PosesAround;

// What detect() tests. All spheres are numbered in one sequence: first those of bodies[0], then those of
// bodies[1], and so on, at last the loose ones. Shapes and bodies lie in host memory; a GPU gets only the
// shapes and the poses, and places the spheres itself, in double. Two spheres of one body are never a
// contact, whatever the body's family.
struct Input {
  Spheres spheres;  // the loose ones
  // Further loose spheres, numbered before and behind these. Only a ResidentDetector sets it.
  const SpheresAround* around = nullptr;
  std::span<const Shape> shapes;
  std::span<const Body> bodies;

  // Names a version of the shapes, the bodies and the static spheres, for scenes in which most of them stay
  // from call to call. If it equals the revision of the previous call, the detector assumes that only the
  // poses of bodies that are not static have changed. With `poses`, each such body takes its pose from there.
  // Without, the bodies that `moved` lists take their poses from `bodies`, and all others stay where they
  // were. A static body stays where it was, even if `moved` lists it.
  //
  // Nothing else is compared with the previous call, so a change there may or may not be seen. Give a new
  // revision when anything else changes: a shape, a family, a mask, a static pose or sphere, the number of
  // bodies. A revision of 0 equals none, not even another 0. After a call that threw, the next call reads
  // everything. The rule is the same on every path and backend.
  std::uint64_t revision = 0;
  // The bodies that have moved since the previous call; read only if the revision is that of the previous
  // call. In host memory.
  std::span<const std::uint32_t> moved;

  // Poses of all bodies, instead of those in `bodies`. A static body takes its pose from here only when the
  // revision is new. null: the poses in `bodies` count.
  const Pose* poses = nullptr;
  // The CUDA backend also takes poses in device memory. Then every call of the same revision must give them
  // there.
  Memory pose_memory = Memory::host;
  // Poses of all bodies that lie on several GPUs, instead of `poses`. Only a ResidentDetector sets it.
  const PosesAround* poses_around = nullptr;
};

// The numbers of the two spheres of a contact, i < j.
struct Pair {
  std::uint32_t i, j;
  friend bool operator==(const Pair&, const Pair&) = default;
};
// Normal and penetration of a contact.
template <class T>
struct alignas(16) Normal {
  T x, y, z;  // unit vector from sphere i to sphere j
  T depth;    // the penetration: ri + rj - distance
};
// The two deepest points of a contact.
template <class T>
struct Points {
  T on_i[3], on_j[3];  // the deepest point of each sphere inside the other
};

// The backend that detects. `automatic` takes the GPU if there is one that this build can use, else the CPU.
enum class BackendKind : std::uint8_t { automatic, omp, cuda };
using Choice [[deprecated("use BackendKind")]] = BackendKind;
// The algorithm that finds the contacts. Both find the same ones.
enum class Path : std::uint8_t {
  grid,         // sorts the spheres by bin once and searches neighbouring bins
  nine_stages,  // the nine stages of the paper, as a reference
  fast [[deprecated("use Path::grid")]] = grid
};
// The arithmetic that decides whether two spheres touch.
enum class Precision : std::uint8_t {
  exact,    // double where float cannot decide
  float32,  // float alone
  fast [[deprecated("use Precision::float32")]] = float32
};
// The order of the list of contacts.
enum class Order : std::uint8_t {
  stable,  // the same in every run
  any,     // whichever is fastest
  fixed [[deprecated("use Order::stable")]] = stable
};
// What the grid path searches for scenes with bodies: first balls around parts of bodies and then the spheres
// of the parts whose balls touch, or every sphere at once. `automatic`: the faster, by estimates and tries.
enum class Bodies : std::uint8_t { automatic, first, expanded };
// What is written for each contact: the pair; also normal and penetration; also both points.
enum class Width : std::uint8_t { pairs, normals, points };

// The most threads that CallOptions::threads can ask for. Each thread takes a stack and 128 KiB.
inline constexpr int kMostThreads = 1024;

// Where a detector works, for its whole life.
struct DeviceChoice {
  BackendKind backend = BackendKind::automatic;
  int device = 0;  // the GPU's number; the OpenMP backend does not read it
};

// How a call detects. These may change between calls. The defaults suit most callers. A call refuses options
// that have no meaning.
struct CallOptions {
  // The cudaStream_t to work on; it belongs to the primary context of the device. null: the default stream. A
  // call begins when the work that was given to the stream before is done, and its own work is done when it
  // returns.
  void* stream = nullptr;
  // Threads of the OpenMP backend, up to kMostThreads. 0: as many as OpenMP would use and the scene is large
  // enough for; after a call in which other programs took processors away, one thread for a while.
  int threads = 0;
  Path path = Path::grid;
  Precision precision = Precision::exact;  // float32 may err in both directions: see Contacts::doubtful
  Order order = Order::stable;             // stable: for one backend and path, whatever the number of threads
  Width width = Width::normals;
  // The type of the numbers in the records. They are computed in double and rounded once. One exception: the
  // grid path of a GPU computes f32 records in float, with a relative error of up to 4e-7: from float
  // spheres, or from differences of other spheres that are taken in double.
  Scalar scalar = Scalar::f32;
  Memory output = Memory::host;  // where the list of contacts is to lie; device: of the CUDA backend alone
  double bin_size = 0;           // edge of the (finest) bins; 0: chosen by the detector
  Bodies bodies = Bodies::automatic;  // the contacts are the same either way
  Region own;                         // only contacts whose midpoint lies inside are reported
  // All pairs whose gap is at most this are contacts, not only those that touch; the depth of a pair that
  // does not touch is negative. A length from 0 to 1e100.
  double margin = 0;
  // Fill Contacts::history. It costs memory for the pairs of two lists and for a table of one of them.
  bool history = false;
  std::uint64_t memory_limit = 0;  // bytes that the detector may hold; 0: all that there are
  bool timings = false;            // fill Contacts::seconds; the host then waits for the GPU after each stage
};

#if defined(__GNUC__)
#pragma GCC diagnostic push  // the constructors that the compiler writes name the deprecated members
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
#endif
// CallOptions and DeviceChoice in one, as the detector's constructor took them before DeviceChoice existed.
struct Options : CallOptions {
  [[deprecated("use DeviceChoice: Detector({backend, device}, options)")]] BackendKind backend =
      BackendKind::automatic;
  [[deprecated("use DeviceChoice: Detector({backend, device}, options)")]] int device = 0;
};
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

// How long each part of a call took, in seconds.
struct Seconds {
  double place = 0;      // placing the spheres of the bodies, and copying from the host to the device
  double stage[9] = {};  // stages 1 to 9; on the grid path, what corresponds to them
  double total = 0;
  double history = 0;  // finding the pairs of this call in the list of the call before; part of the total
};

// In Contacts::history: the list of the call before does not have the pair.
inline constexpr std::uint32_t kNoContact = 0xffffffffu;

// The contacts of a call, none of them twice. The arrays lie in the detector's memory and stay valid until
// its next call or its end. Each array that was asked for has one entry for each contact.
struct Contacts {
  std::uint64_t count = 0, spheres = 0;
  Memory memory = Memory::host;
  Width width = Width::pairs;
  Scalar scalar = Scalar::f32;
  const Pair* pairs = nullptr;
  const void* normals = nullptr;  // Normal<float> or Normal<double> by `scalar`; null for Width::pairs
  const void* points = nullptr;   // Points<float> or Points<double> by `scalar`; null unless Width::points
  // For each contact the index of the same pair of numbers in the list of the call before, or kNoContact.
  // That list is empty for the first call, and after a call that left no contacts: one that threw, stages()
  // and detect_worlds(). So the caller can carry the data of a contact, such as the stretch of a friction
  // spring, from list to list, whatever their orders. Only the two numbers count: if the caller gives a
  // sphere another number, its pairs are other pairs. The call before need not have asked for a history. Null
  // unless CallOptions::history.
  const std::uint32_t* history = nullptr;
  // Pairs that float arithmetic cannot decide. With Precision::float32, each of these may be missing from the
  // list or be in it wrongly, and no other pair may: the list differs from that of Precision::exact by at
  // most this many.
  std::uint64_t doubtful = 0;
  Seconds seconds;

  std::span<const Pair> pair_span() const { return {pairs, count}; }
  std::span<const std::uint32_t> history_span() const { return {history, history ? count : 0}; }
  // The normals; empty for Width::pairs. T must be the type of the records. Throws Error if it is not:
  // records in float cannot be read as double.
  template <RealNumber T>
  std::span<const Normal<T>> normal_span() const {
    if (width == Width::pairs) return {};
    check_scalar(kScalarOf<T>);
    return {static_cast<const Normal<T>*>(normals), normals ? count : 0};
  }
  // The points; empty unless Width::points. T as for normal_span().
  template <RealNumber T>
  std::span<const Points<T>> point_span() const {
    if (width != Width::points) return {};
    check_scalar(kScalarOf<T>);
    return {static_cast<const Points<T>*>(points), points ? count : 0};
  }

 private:
  void check_scalar(Scalar wanted) const {
    if (wanted != scalar) refuse_scalar(wanted);
  }
  [[noreturn]] void refuse_scalar(Scalar wanted) const;
};

// What detect_worlds() answers for each world. It speaks of the contacts that detect() would list for the
// same input and options. Those between two spheres of kEveryWorld belong to no world.
enum class Answer : std::uint8_t {
  any,      // is there a contact? The search of a world ends at the first one
  count,    // how many are there?
  distance  // the smallest signed distance of two spheres of a contact, -depth in double, and the pair
};
// The answers of a call, one for each world. The arrays lie in the detector's memory (CallOptions::output),
// and stay valid until its next call or its end. Arrays that were not asked for are null.
struct WorldAnswers {
  std::uint32_t worlds = 0;
  Memory memory = Memory::host;
  const std::uint8_t* any = nullptr;     // 1: there is a contact; 0: there is none
  const std::uint64_t* count = nullptr;  // of contacts
  const double* distance = nullptr;      // infinity if there is no contact
  const Pair* pair = nullptr;  // with that distance; of several the first; ~0u, ~0u if there is none
  double seconds = 0;          // of the call
};

struct Arrays;         // T, S, B, C, D, E, F of a small scene: detect/core/nine_stages.h
class Backend;         // detect/core/backend.h
class RevisionKeeper;  // detect/core/revision.h

// Finds contacts on one device, and keeps its memory from call to call. One detector must not be used by two
// threads at once; two detectors may. A detector that was moved from holds no memory: memory() is 0,
// options() may be used, a detector may be assigned to it, and everything else throws Error.
class Detector {
 public:
  // Throws Error if the backend that is asked for is not available.
  explicit Detector(const DeviceChoice& device, const CallOptions& options = {});
  explicit Detector(const CallOptions& options = {});
  explicit Detector(const Options& options);  // the device is that of the deprecated members
  ~Detector();
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;

  // Finds every contact, and none twice. Throws Error for a sphere that is not finite, has a negative radius
  // or is beyond 1e100 (the message names it), for options that have no meaning, and if there is not enough
  // memory (the message says how many bytes are needed). The detector can be used after that: a call that
  // threw leaves no contacts (hash() is 0), and the next call reads everything, whatever its revision.
  const Contacts& detect(const Input& input);

  // For each of the worlds 0 to `worlds` - 1, an answer that needs no list. Throws Error as detect() does,
  // and for a body or sphere whose world is neither below `worlds` nor kEveryWorld. It leaves no contacts. Of
  // the options it reads own, margin, threads, stream, output and memory_limit.
  WorldAnswers detect_worlds(const Input& input, std::uint32_t worlds, Answer answer);

  // A hash of the pairs of the last call that does not depend on their order. It is the same for both
  // backends, every path and every number of threads. 0 if there are no contacts: before the first call,
  // after stages(), and after a call that threw.
  std::uint64_t hash() const;

  // The arrays of the nine stages, whatever the path, for looking at small scenes. Takes the same options and
  // throws the same errors as detect(), and leaves no contacts.
  Arrays stages(const Input& input);

  const char* backend() const;  // "omp" or "cuda"
  // Bytes that the detector holds for spheres, bins, pairs, contacts and answers, in all threads. After a
  // call this is at most CallOptions::memory_limit. Not counted: what describes shapes, bodies and static
  // spheres on the host, and, with the CUDA backend, lists that were copied to the host.
  std::uint64_t memory() const;
  // The options of the next call. Backend and device are not among them: they stay as they are.
  CallOptions& options() { return options_; }
  const CallOptions& options() const { return options_; }

 private:
  Backend& own_backend() const;
  template <class Work>
  auto call(Work work);
  CallOptions options_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<RevisionKeeper> revision_;
  Contacts contacts_;
};

bool cuda_present();  // is there a GPU that this build can use?

}  // namespace padder::detect
