// SPDX-License-Identifier: MIT
// Which spheres and bodies each box is given, and the copies that its detector reads. Internal.
#pragma once
#include <functional>
#include <memory>
#include <vector>

#include "detect/boxes/distribution.h"
#include "detect/boxes/halo.h"

namespace padder::detect {

// An array that grows without copying or clearing: its memory is first touched by the thread that fills it.
template <class T>
class Scratch {
 public:
  T* at_least(std::uint64_t n) {
    if (n > capacity_ || !data_) {
      data_ = nullptr;  // before its successor is there
      capacity_ = std::max<std::uint64_t>(n, 4);
      data_ = std::make_unique_for_overwrite<T[]>(capacity_);
    }
    return data_.get();
  }
  T* data() const { return data_.get(); }
  std::uint64_t bytes() const { return capacity_ * sizeof(T); }

 private:
  std::unique_ptr<T[]> data_;
  std::uint64_t capacity_ = 0;
};

// Room in a load for what comes from elsewhere, before and behind what is filled in.
struct LoadRoom {
  std::uint64_t loose_before = 0, loose_behind = 0, bodies_before = 0, bodies_behind = 0;
};

// What the detector of one box is given: its own numbering, which keeps the order of the scene's. So i < j
// here means i < j there, and the midpoint of a pair, whose rounding depends on the order, has the same bits.
struct BoxLoad {
  Region region;
  Scalar scalar = Scalar::f32;
  bool has_family = false, has_mask = false, has_static = false, has_world = false;
  std::uint32_t world_of_all = 0;
  std::uint64_t loose = 0, body_count = 0, body_spheres = 0;
  LoadRoom room;
  Scratch<float> single;       // x, y, z, r of each loose sphere, when `scalar` is f32
  Scratch<double> twice;       // the same when it is f64
  Scratch<std::uint64_t> ids;  // numbers of the loose spheres in the scene
  Scratch<std::uint32_t> family, mask, world;
  Scratch<std::uint8_t> is_static;
  Scratch<Body> bodies;
  Scratch<std::uint64_t> body_ids;           // number of each body's first sphere in the scene
  std::vector<std::uint64_t> first_of_body;  // the same in the box, with body_spheres at the end
  std::span<const Shape> shapes;

  std::uint64_t spheres() const { return body_spheres + loose; }
  std::uint64_t bytes() const;  // held

  // Borrows the arrays of this load.
  Input input() const;

  // The number in the scene of sphere `local` of this box. `near` is where the body was found last time: a
  // list of contacts names the same bodies many times in succession.
  std::uint64_t id_of(std::uint64_t local, std::uint64_t& near) const {
    if (local >= body_spheres) return ids.data()[local - body_spheres];
    if (!(first_of_body[near] <= local && local < first_of_body[near + 1])) near = body_of(local);
    return body_ids.data()[near] + (local - first_of_body[near]);
  }

 private:
  std::uint64_t body_of(std::uint64_t local) const;
};

// Where the numbers of a part of a scene begin: those of its bodies, of their spheres, and of its loose ones.
struct Numbering {
  std::uint64_t body = 0, body_sphere = 0, loose = 0;
};

// Which boxes the spheres and bodies of one scene go to. Keeps a view of the input, which must outlive it.
// The poses of the input must stand in its bodies (Input::poses null), and everything must lie in host
// memory.
class Assignment {
 public:
  // Reads all spheres once. Throws Error for the first that is faulty; its sentence is the Detector's.
  Assignment(const Input& input, int threads);
  // Of a part of a scene, which has these numbers there.
  Assignment(const Input& input, int threads, const Numbering& numbering);

  // The halos depend on the largest radius of the whole scene; these spheres may be a part of it.
  double largest_radius() const { return largest_radius_; }
  // Pairs whose gap is at most this are contacts, too (CallOptions::margin). To be set before count().
  void set_margin(double margin) { margin_ = margin; }
  void raise_largest_radius(double radius) { largest_radius_ = std::max(largest_radius_, radius); }

  std::uint64_t spheres() const { return body_spheres_ + input_.spheres.count; }

  // At most about `most` points of either kind, drawn evenly over the numbers: loose spheres, and bodies with
  // the number of their spheres as weight. The same for the same scene.
  std::vector<WeightedPoint> sample(std::uint64_t most) const;

  void count(const BoxTree& tree, std::uint64_t table_bytes);
  std::uint64_t spheres_of(std::uint32_t box) const { return bodies_.weight_of(box) + loose_.count_of(box); }
  std::uint64_t loose_of(std::uint32_t box) const { return loose_.count_of(box); }
  std::uint64_t bodies_of(std::uint32_t box) const { return bodies_.count_of(box); }
  std::uint64_t body_spheres_of(std::uint32_t box) const { return bodies_.weight_of(box); }
  std::uint64_t load_bytes(std::uint32_t box) const;  // of its BoxLoad
  std::uint64_t table_bytes() const { return bodies_.bytes() + loose_.bytes(); }

  // Fills loads[0] for box `first`, and so on, of the tree that was counted with; each leaves its `room`.
  // Calls done(box) when the load of a box is complete, from several threads.
  using Done = std::function<void(std::uint32_t box)>;
  void fill(
      const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads,
      const Done& done = [](std::uint32_t) {}) const;

 private:
  void read();
  void read_bodies();
  [[noreturn]] void throw_fault_of_body(std::size_t body) const;
  template <class T>
  void read_loose();
  template <class T>
  void count_loose(const BoxTree& tree, std::uint64_t table_bytes);
  void prepare(BoxLoad& load, std::uint32_t box, const BoxTree& tree) const;
  template <class T>
  void fill_loose(const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads, const Done& done) const;
  void fill_bodies(const BoxTree& tree, std::uint32_t first, std::span<BoxLoad> loads) const;

  Input input_;
  int threads_;
  std::vector<ShapeExtent> extents_;          // of each shape
  std::vector<std::uint64_t> first_of_body_;  // numbers in the scene
  std::uint64_t body_spheres_ = 0;
  Numbering numbering_;
  double largest_radius_ = 0, margin_ = 0;
  Distribution loose_, bodies_;
};

}  // namespace padder::detect
