// SPDX-License-Identifier: MIT
// A scene: clusters, bodies with poses, and loose spheres. assets/scene.schema.json and docs/scenes.md
// describe its JSON form. Poses are in double, and all lengths in one unit. Bodies are not expanded to
// spheres; a backend does that.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "detect/detector.h"
#include "detect/scene/loose.h"
#include "detect/scene/rungs.h"
#include "detect/scene/sphere_file.h"
#include "padding/asset/cluster.h"

namespace padder::detect {

// Bodies, loose spheres, and the clusters that the bodies are made of.
struct Scene {
  std::string unit;  // empty: not known
  // A cluster under its name in the scene.
  struct Asset {
    std::string name;
    std::vector<Sphere> spheres;         // in the cluster's own frame: of the finest rung until take_rungs()
    MassProperties mass;                 // of the part, density 1, in the same frame; no volume: unknown
    std::uint32_t family = 0, mask = 0;  // of a body that names none
    std::vector<Rung> rungs;             // levels of detail of the part, the finest first
  };
  std::vector<Asset> assets;
  std::vector<Body> bodies;  // with their final families and masks
  LooseSpheres loose;
  std::shared_ptr<const SphereFile> mapped;  // instead of `loose`, if the caller asked for it
  std::vector<std::filesystem::path> files;  // those that it was read from

  // The scene as the detector takes it. It refers to the scene, which must not be moved or changed while it
  // is used.
  Input input() const;
  std::uint64_t size() const;  // the number of spheres
  Spheres spheres() const { return mapped ? mapped->spheres() : loose.view(); }

 private:
  mutable std::vector<Shape> shapes_;
};

// Reads a scene. Files that it names are relative to its folder. A body without a family gets its cluster's
// family. If that is 0, it gets a family above 32 that nothing else in the scene uses. Throws Error that
// names the file and the place in it.
Scene read_scene(const std::filesystem::path& path);
Scene scene_from_json(std::string_view text, const std::string& where, const std::filesystem::path& folder);

// The levels of detail of a cluster, the finest first. One that is not certified against the surface of a
// closed body has no proved errors.
std::vector<Rung> rungs_of(const Cluster& cluster);
RungChoice choose_rungs(const Scene& scene, const RungRule& rule, double margin = 0,
                        const DeviceChoice& device = {});
// Each body takes the rung that was chosen for it: the scene gets one more asset for each shape and rung in
// use, and one without spheres for bodies that are left out.
void take_rungs(Scene& scene, const RungChoice& choice);

// n copies of a cluster on a jittered lattice (pile() in generate.h), on which the bounding spheres of
// neighbours overlap.
Scene pile_of(const Cluster& cluster, std::uint64_t n);

// How the loose spheres of a scene are read: all into memory, or page by page from a mapped file. They are
// mapped only if they are one file, .npy or .npz, without other tags. BoxedDetector takes such a scene.
enum class LooseAs : std::uint8_t { memory, mapped };

// Reads a scene, or a cluster, which becomes a pile of `copies` bodies, or one body if `copies` is 0 (the
// user gave no number). A file of spheres (.npy, .npz) is a scene, too, and is always mapped.
Scene read_scene_or_cluster(const std::filesystem::path& path, std::uint64_t copies,
                            LooseAs loose = LooseAs::memory);
// The same from a JSON text; `where` names it in errors, and the files that it names are relative to
// `folder`.
Scene scene_or_cluster_from_json(std::string_view text, const std::string& where,
                                 const std::filesystem::path& folder, std::uint64_t copies,
                                 LooseAs loose = LooseAs::memory);

}  // namespace padder::detect
