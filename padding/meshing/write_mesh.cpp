// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/write_mesh.h"

#include <CGAL/IO/OBJ.h>
#include <CGAL/IO/OFF.h>
#include <CGAL/IO/PLY.h>
#include <CGAL/IO/STL.h>

#include <cmath>
#include <sstream>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/meshing/cgal_mesh.h"

namespace padder {

bool can_write_mesh(const std::filesystem::path& path) {
  const std::string ending = ending_of(path);
  return ending == ".obj" || ending == ".off" || ending == ".ply" || ending == ".stl";
}

void write_mesh(const Mesh& mesh, const std::filesystem::path& path) {
  const std::string ending = ending_of(path);
  if (!can_write_mesh(path))
    throw Error("cannot write " + path.string() + ": a mesh is written as .obj, .off, .ply or .stl");
  const Box box = mesh.bounds();
  const auto float_holds = [](double length) { return std::isnormal(static_cast<float>(length)); };
  if (ending == ".stl" && !(float_holds(box.diagonal()) &&
                            float_holds(box.low.cwiseAbs().cwiseMax(box.high.cwiseAbs()).maxCoeff())))
    throw Error("cannot write " + path.string() +
                ": a .stl holds numbers as float32, which cannot hold this mesh: name a .ply, .obj or .off");
  std::vector<CgalPoint> points;
  points.reserve(mesh.points.size());
  for (const Point& p : mesh.points) points.push_back(to_cgal(p));
  std::ostringstream out;
  const auto digits = CGAL::parameters::stream_precision(17);
  bool written = false;
  if (ending == ".obj") {
    written = CGAL::IO::write_OBJ(out, points, mesh.triangles, digits);
  } else if (ending == ".off") {
    written = CGAL::IO::write_OFF(out, points, mesh.triangles, digits);
  } else {
    CGAL::IO::set_binary_mode(out);
    written = ending == ".ply" ? CGAL::IO::write_PLY(out, points, mesh.triangles)
                               : CGAL::IO::write_STL(out, points, mesh.triangles);
  }
  if (!written) throw Error("cannot write " + path.string() + ": the mesh could not be put into that format");
  write_file(path, out.str());
}

}  // namespace padder
