// SPDX-License-Identifier: MIT
// A scene: clusters, bodies with poses, loose spheres. Its JSON form is described by assets/scene.schema.json
// and docs/scenes.md. Poses in double; lengths in one unit; nothing is expanded: a body stays a pose until a
// backend places it.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/loose.h"
#include "padding/asset/cluster.h"

namespace padder::detect {

// Bodies and loose spheres, and the clusters that the bodies are made of.
struct Scene {
  std::string unit;  // "" when nobody said
  // A cluster by its name in the scene.
  struct Asset {
    std::string name;
    std::vector<Sphere> spheres;  // of the cluster, in its own frame
  };
  std::vector<Asset> assets;
  std::vector<Body> bodies;  // each with its family and mask settled
  LooseSpheres loose;

  // The scene as the detector takes it. Borrows: the scene must stay where it is and unchanged.
  Input input() const;
  std::uint64_t size() const;  // spheres

 private:
  mutable std::vector<Shape> shapes_;
};

// Reads a scene; files it names are looked up beside it. A body without a family gets its cluster's or, if
// that is 0, one of its own above 32 that nothing else in the scene uses. Throws Error that names the file
// and the place in it.
Scene read_scene(const std::filesystem::path& path);
Scene scene_from_json(std::string_view text, const std::string& where, const std::filesystem::path& folder);

// n copies of a cluster as a jittered pile (generate.h): neighbours' bounding spheres overlap.
Scene pile_of(const Cluster& cluster, std::uint64_t n);

// A scene, or a pile of `copies` of the cluster when the file is one. copies is 0 when the user said nothing:
// then a cluster is one body.
Scene read_scene_or_cluster(const std::filesystem::path& path, std::uint64_t copies);

}  // namespace padder::detect
