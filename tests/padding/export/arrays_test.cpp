// SPDX-License-Identifier: MIT
// Flat arrays: padding/export/arrays.cpp, read_vtp.cpp.
#include "padding/asset/error.h"
#include "padding/asset/npz.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class ArraysTest : public ExportTest {};

Cluster filtered_brick() {
  Cluster c = brick();
  c.family = 0xfffffffe, c.mask = 0x80000001;
  return c;
}

TEST_F(ArraysTest, NpzAndVtpGiveTheSameBitsBack) {
  for (const char* file : {"b.npz", "b.vtp"}) {
    SCOPED_TRACE(file);
    const Cluster back = read_spheres(write(model_of(filtered_brick()), file));
    expect_same_spheres(back, brick());
    EXPECT_EQ(back.family, 0xfffffffeu);
    EXPECT_EQ(back.mask, 0x80000001u);
  }
}

TEST_F(ArraysTest, BodiesArePlacedInTheWorld) {
  const Model m = arm();
  const Npz z = npz_from_bytes(text(m, "arm.npz"), "arm.npz");
  const auto body = z.at("body").as<std::uint32_t>();
  EXPECT_EQ(body, (std::vector<std::uint32_t>{0, 0, 0, 1, 1, 1, 3, 3, 3, 4, 4, 4}));
  const auto xyz = z.at("centers").as<double>();
  const Eigen::Isometry3d upper = m.bodies[0].pose * m.bodies[1].pose;
  const Point expected = upper * m.bodies[1].cluster.centers[2];
  EXPECT_LT((Point(xyz[15], xyz[16], xyz[17]) - expected).norm(), 1e-14);
  EXPECT_EQ(read_spheres(folder_ / "arm.npz", "3").family, 2u);
}

TEST_F(ArraysTest, TheUnitComesBack) {
  for (const char* file : {"b.npz", "b.vtp"})
    for (const char* unit : {"m", "cm", "mm", "in", ""}) {
      SCOPED_TRACE(std::string(file) + " " + unit);
      Model m = model_of(brick());
      m.unit = unit;
      write(m, file);
      EXPECT_EQ(read_spheres(folder_ / file).unit, unit);
      EXPECT_EQ(read_sphere_model(folder_ / file).model.unit, unit);
    }
  const double furlong = 201.168;
  Npz arrays = npz_from_bytes(text(model_of(brick()), "b.npz"), "b.npz");
  arrays["unit_in_metres"] = npy_array(&furlong, {1});
  write_file(folder_ / "f.npz", npz_bytes(arrays));
  EXPECT_TRUE(refuses([&] { read_spheres(folder_ / "f.npz"); }, "unit_in_metres must be one number"));
}

TEST_F(ArraysTest, BodiesComeBack) {
  for (const char* file : {"arm.npz", "arm.vtp"}) {
    const Model back = read_sphere_model(write(arm(), file)).model;
    ASSERT_EQ(back.bodies.size(), 4u) << file;
    EXPECT_EQ(back.bodies[1].cluster.family, 2u) << file;
    EXPECT_EQ(back.bodies[1].cluster.mask, 0b101u) << file;
    EXPECT_EQ(read_spheres(folder_ / file, "4").size(), 3u) << file;
  }
}

TEST_F(ArraysTest, NumpyLoadsIt) {
  if (!python_has("numpy")) GTEST_SKIP() << "python3-numpy is not installed";
  write(model_of(filtered_brick()), "b.npz");
  EXPECT_EQ(python(R"(
import numpy
z = numpy.load("b.npz")
print(sorted(z.files), z["centers"].shape, z["centers"].dtype, z["radii"].shape, z["family"].dtype, z["family"][2], z["mask"][0])
numpy.savez("back.npz", centers=z["centers"][1:].astype("f4"), radii=z["radii"][1:])
)"),
            "['centers', 'family', 'mask', 'radii', 'unit_in_metres'] (3, 3) float64 (3,) uint32 4294967294 "
            "2147483649");
  EXPECT_EQ(read_spheres(folder_ / "back.npz").size(), 2u);
  EXPECT_NEAR(read_spheres(folder_ / "back.npz").centers[0].x(), brick().centers[1].x(), 1e-6);
}

TEST_F(ArraysTest, VtkReadsItAndWeReadWhatVtkWrites) {
  if (!python_has("vtkmodules.vtkIOXML")) GTEST_SKIP() << "python3-vtk9 is not installed";
  write(model_of(filtered_brick()), "b.vtp");
  const std::string said = python(R"(
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLPolyDataWriter
r = vtkXMLPolyDataReader()
r.SetFileName("b.vtp")
r.Update()
p = r.GetOutput()
d = p.GetPointData()
print(p.GetNumberOfPoints(), p.GetNumberOfVerts(), "%.17g" % p.GetPoint(1)[0], "%.17g" % d.GetArray("radius").GetValue(1),
      d.GetArray("family").GetValue(0), d.GetArray("mask").GetValue(2))
for mode in ("Ascii", "Binary", "Appended"):
    for packed in (False, True):
        for encoded in (False, True):
            w = vtkXMLPolyDataWriter()
            w.SetInputData(p)
            getattr(w, "SetDataModeTo" + mode)()
            if encoded: w.EncodeAppendedDataOn()
            else: w.EncodeAppendedDataOff()
            if packed: w.SetCompressorTypeToZLib()
            else: w.SetCompressorTypeToNone()
            w.SetFileName("%s%d%d.vtp" % (mode, packed, encoded))
            w.Write()
)");
  char expected[200];
  std::snprintf(expected, sizeof expected, "3 3 %.17g %.17g 4294967294 2147483649", brick().centers[1].x(),
                brick().radii[1]);
  EXPECT_EQ(said, expected);
  for (const char* mode : {"Ascii", "Binary", "Appended"})
    for (const char* how : {"00", "01", "10", "11"}) {
      SCOPED_TRACE(std::string(mode) + how);
      const Cluster back = read_spheres(folder_ / (std::string(mode) + how + ".vtp"));
      // VTK writes eleven digits as ASCII.
      expect_same_spheres(back, brick(), std::string(mode) == "Ascii" ? 1e-10 : 0);
      EXPECT_EQ(back.family, 0xfffffffeu);
    }
}

TEST_F(ArraysTest, DamagedFilesAreSentences) {
  for (const char* file : {"b.npz", "b.vtp"}) {
    const std::string good = text(model_of(brick()), file);
    for (std::size_t cut = 0; cut + 12 < good.size(); cut += 7) {  // a .vtp is whole without its last line
      write_file(folder_ / file, good.substr(0, cut));
      EXPECT_THROW(read_spheres(folder_ / file), Error) << file << " " << cut;
    }
    for (std::size_t k = 0; k < good.size(); k++) {
      std::string bad = good;
      bad[k] = static_cast<char>(bad[k] ^ 0x55);
      write_file(folder_ / file, bad);
      try {
        read_spheres(folder_ / file);  // a changed number may pass; nothing may crash
      } catch (const Error&) {
      }
    }
  }
}

TEST_F(ArraysTest, AnArrayThatStandsTwiceIsRefused) {
  const double centers[] = {0, 0, 0}, radii[] = {1};
  std::string bytes = npz_bytes({{"centers", npy_array(centers, {1, 3})},
                                 {"radii", npy_array(radii, {1})},
                                 {"radio", npy_array(radii, {1})}});
  EXPECT_EQ(npz_from_bytes(bytes, "f").size(), 3u);
  for (std::size_t at; (at = bytes.find("radio")) != std::string::npos;) bytes.replace(at, 5, "radii");
  EXPECT_EQ(error_of([&] { npz_from_bytes(bytes, "f"); }),
            "f: radii stands twice in the archive: remove one");
}

TEST_F(ArraysTest, SeveralFamiliesAreNoCluster) {
  const double centers[] = {0, 0, 0, 1, 1, 1}, radii[] = {1, 1};
  const std::uint32_t family[] = {1, 2};
  write_file(folder_ / "f.npz", npz_bytes({{"centers", npy_array(centers, {2, 3})},
                                           {"radii", npy_array(radii, {2})},
                                           {"family", npy_array(family, {2})}}));
  EXPECT_THROW(read_spheres(folder_ / "f.npz"), Error);
  write_file(folder_ / "f.npz", npz_bytes({{"centers", npy_array(centers, {2, 3})}}));
  EXPECT_THROW(read_spheres(folder_ / "f.npz"), Error);
  write_file(folder_ / "f.npz",
             npz_bytes({{"centers", npy_array(centers, {3, 2})}, {"radii", npy_array(radii, {2})}}));
  EXPECT_THROW(read_spheres(folder_ / "f.npz"), Error);
}

}  // namespace
}  // namespace padder::samples
