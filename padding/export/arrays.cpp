// SPDX-License-Identifier: MIT
// Flat arrays of spheres: NumPy's .npz and VTK's .vtp. Bodies are placed in the world, joints at 0.
#include "padding/asset/npz.h"
#include "padding/asset/vtp.h"
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

struct Arrays {
  std::vector<double> positions, radii;  // three numbers a sphere, and one
  std::vector<std::uint32_t> family, mask, body;

  explicit Arrays(const Model& model) {
    const auto poses = poses_at(model);
    for (std::size_t b = 0; b < model.bodies.size(); b++) {
      const Cluster& c = model.bodies[b].cluster;
      for (std::size_t k = 0; k < c.size(); k++) {
        // A body at the origin keeps its numbers bit for bit.
        const Point p = poses[b].matrix().isIdentity(0) ? c.centers[k] : poses[b] * c.centers[k];
        positions.insert(positions.end(), {p.x(), p.y(), p.z()});
        radii.push_back(c.radii[k]);
        family.push_back(c.family), mask.push_back(c.mask), body.push_back(static_cast<std::uint32_t>(b));
      }
    }
  }
};

}  // namespace

Files write_npz(const Job& job) {
  const Arrays a(job.model);
  const std::uint64_t n = a.radii.size();
  Npz arrays{{"centers", npy_array(a.positions.data(), {n, 3})},
             {"radii", npy_array(a.radii.data(), {n})},
             {"family", npy_array(a.family.data(), {n})},
             {"mask", npy_array(a.mask.data(), {n})}};
  if (job.model.bodies.size() > 1) arrays["body"] = npy_array(a.body.data(), {n});
  if (!job.model.unit.empty()) {
    const double unit = metres(job.model.unit);
    arrays[kUnitInMetres] = npy_array(&unit, {1});
  }
  return {{"", npz_bytes(arrays)}};
}

Files write_vtp(const Job& job) {
  const Arrays a(job.model);
  std::vector<VtpHead> heads{{"radius", 'f', 8, 1}, {"family", 'u', 4, 1}, {"mask", 'u', 4, 1}};
  if (job.model.bodies.size() > 1) heads.push_back({"body", 'u', 4, 1});
  std::string out;
  std::string fields;
  if (!job.model.unit.empty())
    fields = "<DataArray type=\"Float64\" Name=\"" + std::string(kUnitInMetres) +
             "\" NumberOfTuples=\"1\" format=\"ascii\">" + number(metres(job.model.unit)) + "</DataArray>\n";
  VtpWriter v(a.radii.size(), heads, write_into(out), fields);
  v.append(0, a.radii), v.append(1, a.family), v.append(2, a.mask);
  if (job.model.bodies.size() > 1) v.append(3, a.body);
  v.append(heads.size(), a.positions);
  v.finish();
  return {{"", std::move(out)}};
}

}  // namespace padder::exporting
