// SPDX-License-Identifier: MIT
#include "detect/cuda/bodies/body_arrays.h"

#include "detect/cuda/tuning.h"

namespace padder::detect::cuda {
namespace {

// Are groups small in most bodies? A scene is searched in one way.
bool goes_by_groups(const Input& input, const Pieces& pieces) {
  std::vector<double> size;
  for (std::uint32_t shape = 0; shape < input.shapes.size(); shape++)
    size.push_back(pieces.group_size(shape));
  double weighted = 0, all = 0;
  for (const Body& b : input.bodies) {
    const std::uint32_t count = pieces.shape_first[b.shape + 1] - pieces.shape_first[b.shape];
    weighted += count * size[b.shape], all += count;
  }
  return weighted < tuning::kSmallGroups * all;
}

}  // namespace

BodyArrays::BodyArrays(MemoryBook& book)
    : pieces_(book, "the pieces of bodies"),
      spheres_(book, "the shapes"),
      numbers_(book, "the shapes"),
      body_first_(book, "the bodies"),
      near_(book, "the shapes"),
      groups_(book, "the shapes"),
      boxes_(book, "the shapes") {}

BodyView BodyArrays::read(const Input& input, const Body* bodies, const Pieces& p,
                          const std::vector<std::uint32_t>& body_first, cudaStream_t stream) {
  BodyView view;
  view.bodies = bodies;
  view.pieces = copied(pieces_, p.pieces.data(), p.pieces.size(), stream);
  view.spheres = copied(spheres_, p.spheres.data(), p.spheres.size(), stream);
  view.numbers = copied(numbers_, p.numbers.data(), p.numbers.size(), stream);
  view.near = copied(near_, p.near.data(), p.near.size(), stream);
  view.groups = copied(groups_, p.groups.data(), p.groups.size(), stream);
  view.grouped = goes_by_groups(input, p);
  view.boxes = copied(boxes_, p.boxes.data(), p.boxes.size(), stream);
  view.unit_piece = static_cast<std::uint32_t>(p.pieces.size());
  view.unit_near = static_cast<std::uint32_t>(p.spheres.size());
  view.body_first = copied(body_first_, body_first.data(), body_first.size(), stream);
  view.loose_first = body_first.back();
  return view;
}

}  // namespace padder::detect::cuda
