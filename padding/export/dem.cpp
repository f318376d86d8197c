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

namespace {

// YADE sums the masses of a clump's spheres, and so counts overlaps twice. Here the spheres have no mass. Six
// small ones, which touch nothing, have all of it: two on each principal axis, so far from the centre of mass
// that the moments of inertia are those of the body.
std::string yade_script(const Job& job) {
  const Cluster& c = only(job);
  std::string axes;
  for (int k = 0; k < 3; k++) axes += (k ? ", (" : "(") + numbers(c.mass.axes.col(k), ", ") + ")";
  std::string out = "# " + origin(job.model) + ", " + unit_words(job) +
                    R"(
# In a script of YADE's: from runpy import run_path; append = run_path("THIS FILE")["append"]; append()
from math import pi

from yade import O, Quaternion, Vector3, utils


def append(shift=(0, 0, 0), orientation=Quaternion((0, 1, 0), 0), density=None, **kw):
    """Appends the clump with its true mass, centre of mass and moments of inertia.

    density: of the body; that of the material by default. **kw goes to utils.sphere.
    Returns the id of the clump and those of its members. The last six carry the mass and touch nothing.
    """
    place = lambda point: Vector3(*shift) + orientation * Vector3(*point)
    members = [utils.sphere(place(s[:3]), s[3], **kw) for s in SPHERES]
    material = members[0].material
    if density is None:
        density = material.density
    for member in members:
        member.material = with_density(material, 0)
    r = min(s[3] for s in SPHERES) / 100
    mass = density * VOLUME
    own = 0.4 * mass * r**2  # the moment of the six spheres about their own centres
    x, y, z = (density * m - own for m in MOMENTS)
    for axis, square in zip(AXES, (y + z - x, z + x - y, x + y - z)):
        arm = (max(square, 0) * 1.5 / mass) ** 0.5
        for side in (-arm, arm):
            carrier = utils.sphere(place(c + side * a for c, a in zip(CENTER, axis)), r, **kw)
            carrier.material = with_density(material, mass / 6 / (4 / 3 * pi * r**3))
            carrier.mask = 0
            members.append(carrier)
    return O.bodies.appendClumped(members, discretization=0)


def with_density(material, density):
    other = type(material)(**material.dict())
    other.density = density
    return other


)";
  out += "VOLUME = " + number(c.mass.volume) + "\nCENTER = (" + numbers(c.mass.center, ", ") + ")\nAXES = (" +
         axes + ")  # the principal directions\nMOMENTS = (" + numbers(c.mass.moments, ", ") +
         ")  # at density 1\nSPHERES = [\n";
  for (std::size_t k = 0; k < c.size(); k++)
    out += "    (" + numbers(c.centers[k], ", ") + ", " + number(c.radii[k]) + "),\n";
  return out + "]\n";
}

}  // namespace

// YADE stops reading at a second comment and at a blank line, so there is none.
Files write_yade(const Job& job) {
  const Cluster& c = only(job);
  Files files{{"", "#format x_y_z_r_clumpId\n" + list(c.centers, c.radii, " ", " 0")}};
  if (c.mass.volume > 0) files.emplace_back("*.py", yade_script(job));
  return files;
}

// In the frame of MercuryDPM's own tool MClump: origin at the centre of mass, axes along the principal
// directions.
Files write_mercury(const Job& job) {
  const Cluster& c = only(job);
  const Vector moments = job.options.density * c.mass.moments;
  return {{"Clump/Clump.txt", list(centers_in_mass_frame(c), c.radii, ",")},
          {"Inertia/Mass.txt", number(job.options.density * c.mass.volume) + "\n"},
          {"Inertia/TOI.txt",
           number(moments.x()) + ",0,0\n0," + number(moments.y()) + ",0\n0,0," + number(moments.z()) + "\n"},
          {"Inertia/PD.txt", "1,0,0\n0,1,0\n0,0,1\n"}};
}

}  // namespace padder::exporting
