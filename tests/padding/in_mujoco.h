// SPDX-License-Identifier: MIT
// An MJCF file as MuJoCo loads it.
#pragma once
#include <mujoco/mujoco.h>

#include <filesystem>
#include <string>

#include "padding/asset/error.h"

namespace padder {

struct InMujoco {
  explicit InMujoco(const std::filesystem::path& file) {
    char said[1000] = "";
    model = mj_loadXML(file.c_str(), nullptr, said, sizeof said);
    if (!model) throw Error(file.string() + ": MuJoCo says: " + said);
    warning = said;
    data = mj_makeData(model);
  }
  ~InMujoco() { mj_deleteData(data), mj_deleteModel(model); }
  InMujoco(const InMujoco&) = delete;
  InMujoco& operator=(const InMujoco&) = delete;
  mjModel* operator->() const { return model; }
  int id(mjtObj type, const std::string& name) const { return mj_name2id(model, type, name.c_str()); }

  mjModel* model;
  mjData* data;
  std::string warning;  // of the file, or ""
};

}  // namespace padder
