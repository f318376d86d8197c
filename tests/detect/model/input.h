// SPDX-License-Identifier: MIT
// The scene of the model test as a caller hands it over: in float or double, in arrays of several layouts, in
// host or device memory; and what may be wrong with it.
#pragma once
#include <string>
#include <vector>

#include "tests/detect/device_memory.h"
#include "tests/detect/model/world.h"

namespace padder::detect {

// How the arrays lie.
struct ModelForm {
  Scalar scalar = Scalar::f32;
  Memory memory = Memory::host, pose_memory = Memory::host;
  bool poses = false;  // given apart from the bodies
  int layout = 0;      // x, y, z, r; radii behind all centres; with gaps; one radius where they are alike
};

// What is wrong with a call.
struct ModelFault {
  enum class Kind {
    none,
    bin_size,
    stages_bin_size,
    sphere,
    pose,
    shape_sphere,
    shape_index,
    moved,
    own,
    limit,
    pointer,
    stride,
    device_memory,
    too_many,
    margin,
    world,  // one that detect_worlds() does not answer for; not drawn beside the others
  };
  Kind kind = Kind::none;
  std::size_t at = 0;  // of the sphere, the body, the shape
  std::size_t in = 0;  // which of its numbers
  double value = 0;    // that is written there
  std::string says;    // must stand in the error's sentence
};
inline const char* name_of(ModelFault::Kind k) {
  static const char* const names[] = {"none",          "bin size", "bin size of stages",
                                      "sphere",        "pose",     "sphere of a shape",
                                      "shape index",   "moved",    "own",
                                      "limit",         "pointer",  "stride",
                                      "device memory", "too many", "margin",
                                      "world"};
  return names[static_cast<int>(k)];
}

// The arrays of one call. They end with it: the detector must not look at them later.
class ModelInput {
 public:
  Input input;

  ModelInput(const ModelWorld& w, const ModelForm& form, Dice dice)
      : bodies_(w.bodies),
        shapes_(w.shapes),
        family_(w.family),
        mask_(w.mask),
        world_(w.world),
        still_(w.still) {
    if (form.scalar == Scalar::f32)
      fill(f32_, w.loose, form);
    else
      fill(f64_, w.loose, form);
    for (const Body& b : bodies_) poses_.push_back(pose_of(b));
    with_poses_ = form.poses;
    if (form.poses)
      for (Body& b : bodies_)  // not to be read
        for (double& p : b.position) p = dice.between(-1, 1) * w.edge;
    form_ = form;
  }
  ModelInput(const ModelInput&) = delete;

  void apply(const ModelFault& f) {
    using K = ModelFault::Kind;
    if (f.kind == K::sphere) {
      if (form_.scalar == Scalar::f32)
        f32_[index_of(f)] = static_cast<float>(f.value);
      else
        f64_[index_of(f)] = f.value;
    }
    if (f.kind == K::pose) {
      if (!std::isfinite(f.value))  // what is too large could cancel out
        (with_poses_ ? poses_[f.at].rotation : bodies_[f.at].rotation)[f.in % 9] = f.value;
      (with_poses_ ? poses_[f.at].position : bodies_[f.at].position)[f.in % 3] = f.value;
    }
    if (f.kind == K::shape_sphere) shapes_[bodies_[f.at].shape][f.in].y = f.value;
    if (f.kind == K::shape_index) bodies_[f.at].shape = static_cast<std::uint32_t>(shapes_.size() + f.in);
  }

  // To be called once, when all is as it is to be.
  void arrange(const std::vector<std::uint32_t>& moved, std::uint64_t revision, const ModelFault& f) {
    using K = ModelFault::Kind;
    moved_ = moved;
    if (f.kind == K::moved) moved_.push_back(static_cast<std::uint32_t>(bodies_.size() + f.in));
    for (const auto& s : shapes_) given_shapes_.push_back({s.data(), s.size()});
    Spheres& s = input.spheres;
    s = form_.scalar == Scalar::f32 ? arranged(f32_) : arranged(f64_);
    s.memory = form_.memory;
    s.family = placed(family_), s.mask = placed(mask_), s.world = placed(world_),
    s.is_static = placed(still_);
    input.shapes = given_shapes_, input.bodies = bodies_;
    input.revision = revision, input.moved = moved_;
    if (with_poses_ && !poses_.empty()) {
      input.pose_memory = form_.pose_memory;
      input.poses = form_.pose_memory == Memory::device ? on_device(poses_) : poses_.data();
    }
    if (f.kind == K::pointer) (f.in % 2 ? s.centers : s.radii) = nullptr;
    if (f.kind == K::stride) s.center_stride = static_cast<std::uint32_t>(f.in % 3);
    if (f.kind == K::device_memory) (f.in % 2 && input.poses ? input.pose_memory : s.memory) = Memory::device;
    if (f.kind == K::too_many) s.count = f.in % 2 ? ~std::uint64_t(0) - f.in / 2 : 0xffffffffull + f.in;
  }

 private:
  struct Layout {
    std::size_t center_stride, radius_stride, center_first, radius_first, size;
  };
  Layout layout(std::size_t n) const {
    switch (form_.layout) {
      case 1:
        return {3, 1, 0, 3 * n, 4 * n};
      case 2:
        return {7, 3, 1, 7 * n + 3, 10 * n + 5};
      case 3:
        return {3, 0, 0, 3 * n, 3 * n + 1};
      default:
        return {4, 4, 0, 3, 4 * n};
    }
  }
  template <class T>
  void fill(std::vector<T>& to, const std::vector<Sphere>& loose, ModelForm form) {
    form_ = form, count_ = loose.size();
    bool alike = count_ > 0;
    for (const Sphere& s : loose) alike = alike && s.r == loose[0].r;
    if (form_.layout == 3 && !alike) form_.layout = 1;
    layout_ = layout(count_);
    to.assign(layout_.size, static_cast<T>(NAN));
    for (std::size_t k = 0; k < count_; k++) {
      T* c = &to[layout_.center_first + k * layout_.center_stride];
      c[0] = static_cast<T>(loose[k].x), c[1] = static_cast<T>(loose[k].y), c[2] = static_cast<T>(loose[k].z);
      to[layout_.radius_first + k * layout_.radius_stride] = static_cast<T>(loose[k].r);
    }
  }
  std::size_t index_of(const ModelFault& f) const {
    return f.in < 3 ? layout_.center_first + f.at * layout_.center_stride + f.in
                    : layout_.radius_first + f.at * layout_.radius_stride;
  }
  template <class T>
  const T* on_device(const std::vector<T>& v) {
    device_.emplace_back(v.data(), v.size() * sizeof(T));
    return static_cast<const T*>(device_.back().data());
  }
  template <class T>
  const T* placed(const std::vector<T>& v) {
    if (v.empty()) return nullptr;
    return form_.memory == Memory::device ? on_device(v) : v.data();
  }
  template <class T>
  Spheres arranged(const std::vector<T>& v) {
    const T* p = placed(v);
    Spheres s =
        spheres_of<T>(count_, p ? p + layout_.center_first : nullptr, p ? p + layout_.radius_first : nullptr);
    s.center_stride = static_cast<std::uint32_t>(layout_.center_stride);
    s.radius_stride = static_cast<std::uint32_t>(layout_.radius_stride);
    return s;
  }

  ModelForm form_;
  Layout layout_{};
  std::size_t count_ = 0;
  bool with_poses_ = false;
  std::vector<float> f32_;
  std::vector<double> f64_;
  std::vector<Body> bodies_;
  std::vector<Pose> poses_;
  std::vector<std::vector<Sphere>> shapes_;
  std::vector<Shape> given_shapes_;
  std::vector<std::uint32_t> family_, mask_, world_, moved_;
  std::vector<std::uint8_t> still_;
  std::vector<DeviceCopy> device_;
};

}  // namespace padder::detect
