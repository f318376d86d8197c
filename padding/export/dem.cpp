// SPDX-License-Identifier: MIT
// Sphere lists of DEM programs: DEM-Engine, LIGGGHTS, YADE, MercuryDPM.
#include "padding/export/writers.h"

namespace padder::exporting {
namespace {

const Cluster& only(const Job& job) { return job.model.bodies[0].cluster; }

std::string unit_words(const Job& job) {
  return "unit " + (job.model.unit.empty() ? std::string("as in the mesh") : job.model.unit);
}

std::string list(const std::vector<Point>& centers, const std::vector<double>& radii, const char* between,
                 const std::string& end = "") {
  std::string out;
  for (std::size_t k = 0; k < radii.size(); k++)
    out += numbers(centers[k], between) + between + number(radii[k]) + end + '\n';
  return out;
}

}  // namespace

// DEM-Engine ignores lines that begin with #, and wants a header of exactly these four names.
Files write_csv(const Job& job) {
  const Cluster& c = only(job);
  const double density = job.options.density;
  std::string out = "# " + origin(job.model) + ", " + unit_words(job) + "\n";
  out += "# frame: centre of mass " + numbers(c.mass.center) +
         " of the mesh, axes along its principal directions\n";
  for (int k = 0; k < 3; k++)
    out += "# axis " + std::to_string(k + 1) + ": " + numbers(c.mass.axes.col(k)) + "\n";
  out += "# density " + number(density) + ": mass " + number(density * c.mass.volume) + ", moments " +
         numbers(density * c.mass.moments) + "\n";
  return {{"", out + "x,y,z,r\n" + list(centers_in_mass_frame(c), c.radii, ",")}};
}

Files write_liggghts(const Job& job) {
  const Cluster& c = only(job);
  return {{"", "# " + origin(job.model) + ", " + unit_words(job) + ": x y z r, nspheres " +
                   std::to_string(c.size()) + "\n" + list(c.centers, c.radii, " ")}};
}

// YADE stops reading at a second comment and at a blank line, so there is none.
Files write_yade(const Job& job) {
  const Cluster& c = only(job);
  return {{"", "#format x_y_z_r_clumpId\n" + list(c.centers, c.radii, " ", " 0")}};
}

// In the frame of MercuryDPM's own tool MClump: origin at the centre of mass, axes along the principal
// directions.
Files write_mercury(const Job& job) {
  const Cluster& c = only(job);
  const Vector moments = job.options.density * c.mass.moments;
  return {{"clump/clump.txt", list(centers_in_mass_frame(c), c.radii, ",")},
          {"inertia/mass.txt", number(job.options.density * c.mass.volume) + "\n"},
          {"inertia/toi.txt",
           number(moments.x()) + ",0,0\n0," + number(moments.y()) + ",0\n0,0," + number(moments.z()) + "\n"},
          {"inertia/pd.txt", "1,0,0\n0,1,0\n0,0,1\n"}};
}

}  // namespace padder::exporting
