// SPDX-License-Identifier: MIT
// The public class: spheres in, contacts out. Sections 2.1 and 2.2 of the paper; docs/detector.md for the
// whole story.
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

// Where an array lies.
enum class Memory : std::uint8_t { host, device };
// Of what numbers an array is made.
enum class Scalar : std::uint8_t { f32, f64 };

// N spheres in the caller's memory, read only while detect() runs. Strides count scalars, not bytes.
struct Spheres {
  std::uint64_t count = 0;  // below 2^32 - 1 with those of the bodies
  Scalar scalar = Scalar::f32;
  Memory memory = Memory::host;
  const void* centers = nullptr;  // x, y, z of sphere k at k * center_stride
  const void* radii = nullptr;    // of sphere k at k * radius_stride; stride 0: one radius for all
  std::uint32_t center_stride = 3, radius_stride = 1;
  const std::uint32_t* family = nullptr;    // null: 0 for all
  const std::uint32_t* mask = nullptr;      // null: 0 for all
  const std::uint8_t* is_static = nullptr;  // not 0: stands still; two static ones are no contact. null: none
};
template <class T>
Spheres spheres_of(std::uint64_t count, const T* centers, const T* radii, Memory memory = Memory::host) {
  static_assert(std::is_same_v<T, float> || std::is_same_v<T, double>,
                "spheres are given in float or double");
  return {count, sizeof(T) == 4 ? Scalar::f32 : Scalar::f64, memory, centers, radii};
}

// What is to be tested. Spheres are numbered through: those of bodies[0], those of bodies[1], …, then the
// loose ones. Shapes and bodies lie in host memory; only these few bytes travel to a GPU, and the spheres are
// placed there, in double. Spheres of one body are no contact, whatever its family.
struct Input {
  Spheres spheres;
  std::span<const Shape> shapes;
  std::span<const Body> bodies;

  // For scenes that stay from call to call: it names a version of the shapes, the bodies and the static
  // spheres. With the revision of the call before (0: with none) a body stands where `poses` says, or
  // `bodies` if `moved` names it; any other body, and every static one, even if named, stands where it did
  // in that call, whatever `bodies` says of it now. This holds on every path. Whoever changes anything else,
  // a static pose, shape, family, mask or sphere among them, gives a new revision: static spheres and shapes
  // are not compared, and a change of theirs may be seen or not. A call that threw counts as none.
  std::uint64_t revision = 0;
  std::span<const std::uint32_t> moved;  // read with the revision of the call before; in host memory

  // Poses of all bodies, in the place of those in `bodies`. Of static bodies they are read with a new
  // revision only. Host memory, or with the CUDA backend its device memory: then in every call of the
  // revision.
  const Pose* poses = nullptr;  // null: those in `bodies`
  Memory pose_memory = Memory::host;
};

// Contacts, i < j always. Pairs, and as many of the other arrays as were asked for, one entry a contact each.
struct Pair {
  std::uint32_t i, j;
  friend bool operator==(const Pair&, const Pair&) = default;
};
// Normal and depth of a contact.
template <class T>
struct alignas(16) Normal {
  T x, y, z;  // unit, from i to j
  T depth;    // penetration: ri + rj - distance
};
// Both points of a contact.
template <class T>
struct Points {
  T on_i[3], on_j[3];  // the deepest point of each sphere in the other
};

// Which backend detects.
enum class BackendKind : std::uint8_t { automatic, omp, cuda };
using Choice [[deprecated("BackendKind")]] = BackendKind;
// Which algorithm finds the contacts. Both find the same ones.
enum class Path : std::uint8_t {
  grid,         // one sort by cell and one search of neighbouring cells
  nine_stages,  // the nine stages of the paper, as a reference
  fast [[deprecated("Path::grid")]] = grid
};
// Which arithmetic decides whether two spheres touch.
enum class Precision : std::uint8_t {
  exact,    // double where float is not sure
  float32,  // float alone
  fast [[deprecated("Precision::float32")]] = float32
};
// The order of the list of contacts.
enum class Order : std::uint8_t {
  stable,  // the same in every run
  any,     // whatever is quickest
  fixed [[deprecated("Order::stable")]] = stable
};
// What is searched on the grid path: balls about bodies first, or every sphere; `automatic` guesses which is
// quicker.
enum class Bodies : std::uint8_t { automatic, first, expanded };
// What is written of a contact.
enum class Width : std::uint8_t { pairs, normals, points };

inline constexpr int kMostThreads = 1024;  // that can be asked for: each takes a stack and 128 KiB

// How to detect; the defaults are right for most. What cannot be meant is refused by the next call.
struct Options {
  BackendKind backend = BackendKind::automatic;  // the GPU when there is one; fixed when the detector is made
  int device = 0;                                // which GPU; fixed when the detector is made
  // A cudaStream_t of the device's primary context to work on; null: the default stream. The call begins when
  // what the stream was given before is done, and has ended when detect() returns.
  void* stream = nullptr;
  // OpenMP. 0: as many as OpenMP would use and the work is worth, one for a while after other programs took
  // processors away in a call. Else exactly so many, up to kMostThreads.
  int threads = 0;
  Path path = Path::grid;
  Precision precision = Precision::exact;  // float32 may err both ways, see Contacts::doubtful
  Order order = Order::stable;   // the same list from every run and thread count of one backend and path
  Width width = Width::normals;  // what is written: pairs only, + normal and depth, + both contact points
  // Of the record. It is computed in double and rounded once; f32 of float spheres on a GPU's grid path in
  // float (4e-7 relative).
  Scalar scalar = Scalar::f32;
  Memory output = Memory::host;       // where the contacts are to lie
  double bin_size = 0;                // edge of a (finest) bin; 0: chosen (section 2.2.1)
  Bodies bodies = Bodies::automatic;  // the same contacts by either way
  Region own;                         // report only contacts whose midpoint lies inside
  std::uint64_t memory_limit = 0;     // bytes this detector may hold; 0: what there is
  bool timings = false;               // fill Contacts::seconds (a GPU is then waited for after each stage)
};

// Where the time went.
struct Seconds {
  double place = 0;      // bodies to spheres, host to device
  double stage[9] = {};  // stages 1 to 9; the grid path has the same names for what remains of them
  double total = 0;
};

// Lies in the detector's memory and stays valid until its next call or its end.
struct Contacts {
  std::uint64_t count = 0, spheres = 0;
  Memory memory = Memory::host;
  Width width = Width::pairs;
  Scalar scalar = Scalar::f32;
  const Pair* pairs = nullptr;
  const void* normals = nullptr;  // Normal<float> or Normal<double>, null for Width::pairs
  const void* points = nullptr;   // Points<float> or Points<double>, null but for Width::points
  // Pairs inside the float band. With Precision::float32 each of them may be wrongly in the list or wrongly
  // missing, and no other: at most so many pairs differ from those of Precision::exact.
  std::uint64_t doubtful = 0;
  Seconds seconds;
  std::span<const Pair> pair_span() const { return {pairs, count}; }
  template <class T>
  std::span<const Normal<T>> normal_span() const {
    return {static_cast<const Normal<T>*>(normals), normals ? count : 0};
  }
  template <class T>
  std::span<const Points<T>> point_span() const {
    return {static_cast<const Points<T>*>(points), points ? count : 0};
  }
};

struct Arrays;         // T, S, B, C, D, E, F of a small scene: detect/core/nine_stages.h
class Backend;         // detect/core/backend.h
class RevisionKeeper;  // detect/core/revision.h

// Bound to a device and a stream; keeps its memory from call to call. Not for two threads at once; two
// detectors are. A detector that was moved from holds nothing: memory() is 0, options() may be read, a
// detector may be assigned to it, and all else throws Error.
class Detector {
 public:
  // Throws Error when the backend asked for is not to be had.
  explicit Detector(const Options& options = {});
  ~Detector();
  Detector(Detector&&) noexcept;
  Detector& operator=(Detector&&) noexcept;

  // Every contact, none twice, none dropped. Throws Error for a sphere that is not finite, negative or above
  // 1e100 (its number is named), for options that cannot be meant, and when memory is short (the bytes needed
  // are named). The detector stays usable: a call that threw leaves no contacts (hash() is 0), and the next
  // one reads everything anew, whatever its revision.
  const Contacts& detect(const Input& input);

  // Order-free hash of the last contacts' pairs: equal for both backends, any thread count, any path. 0 when
  // there are none: before the first call, and after one that threw or stages().
  std::uint64_t hash() const;

  // The arrays of the nine stages, whatever the path: for small scenes, to look at. Takes the same options,
  // throws the same errors, and leaves no contacts.
  Arrays stages(const Input& input);

  const char* backend() const;  // "omp" or "cuda"
  // Bytes held for spheres, bins, pairs and contacts, those of every thread among them: after a call no more
  // than Options::memory_limit. What describes shapes, bodies and static spheres on the host is not in it,
  // nor with the CUDA backend are lists that were brought to the host.
  std::uint64_t memory() const;
  Options& options() { return options_; }  // may be changed between calls, but for backend and device

 private:
  Backend& own_backend() const;
  template <class Work>
  auto call(Work work);
  Options options_;
  std::unique_ptr<Backend> backend_;
  std::unique_ptr<RevisionKeeper> revision_;
  Contacts contacts_;
};

bool cuda_present();  // is there a GPU that this build can use?

}  // namespace padder::detect
