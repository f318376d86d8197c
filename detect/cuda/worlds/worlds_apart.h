// SPDX-License-Identifier: MIT
// The spheres of many worlds, loose ones and those of bodies: they are searched on the grid as if the worlds
// lay side by side, and those of kEveryWorld in a box of their own. Who meets these is found by a tree.
// Contacts are decided, and records written, by the spheres as they are given. Only .cu files include this.
#pragma once
#include "detect/cuda/call/sphere_search.h"
#include "detect/cuda/device/report.h"
#include "detect/cuda/input/device_spheres.h"
#include "detect/cuda/worlds/every_world.h"

namespace padder::detect::cuda {

class WorldsApart {
 public:
  explicit WorldsApart(MemoryBook& book);

  // All contacts into call.list; their number and that of the spheres to `contacts`. False, and nothing was
  // searched: the worlds would take so much space that float could not tell their spheres apart. Waits once
  // more for the device than without worlds, and once more each where there are spheres of kEveryWorld and
  // where the numbers of worlds have wide gaps. Throws Error.
  bool run(const DeviceSpheres& source, const Call& call, Contacts& contacts);
  // Of the last run(), the world of each sphere; null: all are of Spheres::world_of_all. The largest but
  // kEveryWorld.
  const std::uint32_t* worlds() const { return worlds_given_; }
  std::uint32_t last_world() const { return last_world_; }
  // Did the last run() match the list with its history, where one is asked for?
  bool matched() const { return matched_; }
  void forget() { search_.forget(); }

 private:
  WorldBounds bounds(const DeviceSpheres& source, cudaStream_t stream);
  void rank_worlds(DeviceSpheres& source, cudaStream_t stream);
  void add_every(const DeviceSpheres& source, const Call& call, Contacts& contacts);
  static bool lay_out(const WorldBounds& bounds, double margin, DeviceSpheres& source);

  const std::uint32_t* all_worlds(const DeviceSpheres& source, cudaStream_t stream);

  SphereSearch search_;
  EveryWorld every_;
  bool apart_ = false;  // in the last call; false: all were of one world
  bool matched_ = true;
  const std::uint32_t* worlds_given_ = nullptr;
  std::uint32_t last_world_ = 0;
  Buffer<std::uint32_t> worlds_, ranks_, sorted_worlds_;
  Buffer<unsigned char> scratch_;
  Report report_;
  Buffer<unsigned long long> words_, host_words_;
};

}  // namespace padder::detect::cuda
