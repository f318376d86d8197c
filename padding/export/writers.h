// SPDX-License-Identifier: MIT
// Private to padding/export: one function for each format, and what these functions share.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "padding/asset/excerpt.h"
#include "padding/export/export.h"
#include "padding/export/families.h"

namespace padder::exporting {

// What a writer gets: the model in the format's unit, checked against the format's limits.
struct Job {
  const Model& model;
  const ExportOptions& options;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  // of bodies that may not touch, i < j, ascending
};

// Path below the target ("" the target itself, "*.srdf" beside it with another ending) and bytes.
using Files = std::vector<std::pair<std::string, std::string>>;

Files write_csv(const Job& job);
Files write_liggghts(const Job& job);
Files write_yade(const Job& job);
Files write_mercury(const Job& job);
Files write_chrono(const Job& job);
Files write_npz(const Job& job);
Files write_vtp(const Job& job);
Files write_glb(const Job& job);
Files write_glb_instanced(const Job& job);
Files write_stl(const Job& job);
Files write_ply(const Job& job);
Files write_obj(const Job& job);
Files write_usda(const Job& job);
Files write_urdf(const Job& job);
Files write_srdf(const Job& job);
Files write_mujoco(const Job& job);
Files write_curobo(const Job& job);
Files write_xrdf(const Job& job);

// Does a file of this format carry mass, centre of mass or moments of inertia?
bool states_mass(const Format& format);

// The joints of which the URDF that is written states a speed or a force that nobody stated.
std::vector<std::string> joints_with_unknown_limits(const Model& model);

// The URDF that goes with cuRobo's file: the one that was read, the one that is written, or one of that name.
std::string urdf_of(const Model& model, const ExportOptions& options);

// Is it the root of a robot that stands for the world, where all bodies stand, and no body itself? MuJoCo has
// one of this name already, and URDFs that hang a robot up call it so.
bool is_world(const Model& model, int body);

// Are the coordinates those of a glTF file, whose Y is up? Elsewhere Z is.
bool is_of_gltf(const Model& model);

// Spheres about the centre of mass along the principal axes.
std::vector<Point> centers_in_mass_frame(const Cluster& cluster);

// Throws Error if a file of floats with this ending cannot hold the spheres of the body, which stands at
// `pose`: they reach too far, or are too small.
void check_floats(const Body& body, const Eigen::Isometry3d& pose, const char* ending);

// Shortest text that reads back as the same double; whole numbers without a point.
std::string number(double value);
std::string numbers(const Vector& v, const char* between = " ");
std::string quoted(const std::string& text);      // a double-quoted YAML, USD or C++ string
std::string one_line(std::string text);           // line ends become blanks: for comments
std::string identifier(const std::string& name);  // letters, digits, _: for USD prims and C++

std::vector<CollisionFilter> filters_of(const Model& model);  // a body each

// An identifier for each body, no two alike.
std::vector<std::string> identifiers(const Model& model);

// "track_shoe (padder X.Y.Z, track_shoe.obj)": for a comment at the head of a file.
std::string origin(const Model& model);

}  // namespace padder::exporting
