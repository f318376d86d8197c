// SPDX-License-Identifier: GPL-3.0-or-later
#include "padding/meshing/write_mesh.h"

#include <gtest/gtest.h>

#include "padding/asset/error.h"
#include "padding/input/read.h"
#include "tests/error_of.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

class WriteMesh : public ::testing::Test, protected TemporaryFolder {};

TEST_F(WriteMesh, IsReadBackFaceByFace) {
  const Mesh mesh = shapes::moved(shapes::scaled(shapes::torus(1, 0.3, 20, 10), 1 / 3.), {100, -7, 1e-3});
  for (const char* ending : {".obj", ".off", ".ply", ".stl"}) {
    SCOPED_TRACE(ending);
    const auto path = folder_ / (std::string("m") + ending);
    write_mesh(mesh, path);
    const Mesh back = read_mesh(path).mesh;
    ASSERT_EQ(back.triangles.size(), mesh.triangles.size());
    // OBJ and OFF are read in double precision. The others lose digits to float32.
    const bool whole = path.extension() == ".obj" || path.extension() == ".off";
    for (std::size_t t = 0; t < mesh.triangles.size(); t++)
      for (int k = 0; k < 3; k++) {
        if (whole)
          ASSERT_EQ(back.corner(t, k), mesh.corner(t, k)) << t;
        else
          ASSERT_LT((back.corner(t, k) - mesh.corner(t, k)).norm(), 1e-5) << t;
      }
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 4);
}

TEST_F(WriteMesh, RefusesWhatItCannotWrite) {
  const Mesh mesh = shapes::sphere(1);
  EXPECT_THROW(write_mesh(mesh, folder_ / "m.glb"), Error);
  EXPECT_THROW(write_mesh(mesh, folder_ / "m"), Error);
  EXPECT_THROW(write_mesh(mesh, folder_ / "absent" / "m.obj"), Error);
  for (const double scale : {1e-50, 1e40})
    EXPECT_TRUE(refuses([&] { write_mesh(shapes::scaled(mesh, scale), folder_ / "m.stl"); },
                        "a .stl holds numbers as float32, which cannot hold this mesh"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  EXPECT_NO_THROW(write_mesh(shapes::scaled(mesh, 1e40), folder_ / "m.ply"));
}

}  // namespace
}  // namespace padder
