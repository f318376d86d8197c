// SPDX-License-Identifier: MIT
#include "padding/input/read.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <thread>

#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "padding/input/read_internal.h"
#include "tests/error_of.h"
#include "tests/padding/input/zip_writer.h"
#include "tests/padding/shapes.h"
#include "tests/temporary_folder.h"

namespace padder {
namespace {

namespace fs = std::filesystem;

std::string fault(const fs::path& path, const ReadOptions& options = {}) {
  return error_of([&] { read_mesh(path, options); });
}

void expect_fault(const fs::path& path, const std::string& words, const ReadOptions& options = {}) {
  const std::string sentence = fault(path, options);
  EXPECT_TRUE(holds(sentence, words)) << path << ": " << sentence;
  EXPECT_EQ(sentence.find('\n'), std::string::npos) << sentence;
}

using shapes::volume;
Vector size(const Mesh& mesh) { return mesh.bounds().high - mesh.bounds().low; }

const std::string kCubeVertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 1 1 1\n";
const std::string kCubeObj =
    kCubeVertices + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";

// The text with `to` in the first place of `from`.
std::string with(std::string text, const std::string& from, const std::string& to) {
  return text.replace(text.find(from), from.size(), to);
}

template <class T>
void append(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

std::string binary_stl(const Mesh& mesh, const std::string& head = "") {
  std::string bytes = head;
  bytes.resize(80, ' ');
  append(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
  for (std::size_t t = 0; t < mesh.triangles.size(); t++) {
    for (int k = 0; k < 3; k++) append(bytes, 0.f);
    for (int k = 0; k < 3; k++)
      for (int d = 0; d < 3; d++) append(bytes, static_cast<float>(mesh.corner(t, k)[d]));
    append(bytes, std::uint16_t(0));
  }
  return bytes;
}

Mesh cube() {
  const TemporaryFolder folder;
  return read_mesh(folder.put("cube.obj", kCubeObj)).mesh;
}

class Read : public ::testing::Test, protected TemporaryFolder {
 protected:
  ReadResult read(const std::string& name, const std::string& bytes, const ReadOptions& options = {}) const {
    return read_mesh(put(name, bytes), options);
  }
};
using ReadChild = Read;
using ReadShared = Read;

TEST_F(Read, ObjQuadsCommentsContinuationAndSource) {
  const ReadResult r =
      read("Cube.OBJ", "# a cube\r\nmtllib none.mtl\r\n" + kCubeVertices +
                           "vt 0 0\nvn 0 0 1\ng one\nusemtl red\ns off\nf 1/1/1 3//1 4/1 2 # below\n"
                           "f 5 6 \\\n 8 7\n  f\t-8 -7 -3 -4\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6");
  EXPECT_EQ(r.mesh.triangles.size(), 12u);
  EXPECT_EQ(r.mesh.points.size(), 8u);
  EXPECT_DOUBLE_EQ(volume(r.mesh), 1);
  EXPECT_EQ(r.source.file, "Cube.OBJ");
  EXPECT_EQ(r.source.triangles, 12u);
  EXPECT_EQ(r.source.repair, "");
  EXPECT_EQ(r.unit, "");
  EXPECT_TRUE(r.notes.empty());
}

// As programs for Windows begin a text. Without it the first vertex would be no vertex, and the faces others.
TEST_F(Read, AByteOrderMarkIsNoPartOfTheText) {
  const std::string mark = "\xEF\xBB\xBF", faces = "f -4 -2 -3\nf -4 -3 -1\nf -3 -2 -1\nf -2 -4 -1\n",
                    four = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + faces;
  EXPECT_NEAR(volume(read("t.obj", mark + obj).mesh), 1 / 6., 1e-12);
  EXPECT_EQ(read("off.off", mark + "OFF\n4 1 0\n" + four + "3 0 1 2\n").mesh.points.size(), 3u);
  EXPECT_EQ(read("t.stl", mark + "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
                                 "vertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n")
                .mesh.triangles.size(),
            1u);
}

// What a download leaves in the place of a mesh is named.
TEST_F(Read, PointersOfGitLfsAndWebPagesAreNamed) {
  for (const char* name : {"t.stl", "t.obj", "t.off", "t.ply", "t.3mf", "t.glb", "t.dae"}) {
    const auto said = [&](const std::string& bytes) { return error_of([&] { read(name, bytes); }); };
    EXPECT_TRUE(holds(said("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"),
                      "git lfs pull"))
        << name;
    EXPECT_TRUE(holds(said("<!DOCTYPE html>\n<html><body>Not Found</body></html>"), "a web page")) << name;
  }
}

TEST_F(Read, Sha256OfTheBytes) {  // of "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" as sha256sum prints it
  EXPECT_EQ(read("t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").source.sha256,
            "697b00ab13410c52a542d2e9c63711fcc04e9cbf6c0d3439a9b43cc812e6e713");
}

TEST_F(Read, ObjKeepsEveryDigitOfADouble) {
  const Mesh m = read("t.obj",
                      "v 0.1 123456.78901234567 1e-300\nv +1 4503599627370497.5 2.2250738585072014e-308\n"
                      "v 3.3333333333333335 0.30000000000000004 1e300\nf 1 2 3\n")
                     .mesh;
  EXPECT_EQ(m.points[0], Point(0.1, 123456.78901234567, 1e-300));
  EXPECT_EQ(m.points[1], Point(1, 4503599627370497.5, 2.2250738585072014e-308));
  EXPECT_EQ(m.points[2], Point(3.3333333333333335, 0.30000000000000004, 1e300));
}

TEST_F(Read, FacesThatAreNoneAndUnusedPointsAreNoted) {
  const ReadResult r =
      read("t.obj", "v 9 9 9\nv nan 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 3 4 5\nf 1\nf 1 2\nl 1 2\np 1\n");
  EXPECT_EQ(r.mesh.triangles.size(), 1u);
  EXPECT_EQ(r.mesh.points.size(), 3u);
  EXPECT_EQ(r.notes, (std::vector<std::string>{"2 lines, curves or points left out",
                                               "2 points that no face uses left out",
                                               "2 faces of fewer than three corners left out"}));
}

TEST_F(Read, ConcavePolygonKeepsItsVolume) {
  // a U; a fan from its first corner would leave it
  std::string text;
  for (int z = 0; z < 2; z++)
    for (const char* p : {"0 0", "4 0", "4 3", "3 3", "3 1", "1 1", "1 3", "0 3"})
      text += std::string("v ") + p + " " + std::to_string(z) + "\n";
  text += "f 8 7 6 5 4 3 2 1\nf 9 10 11 12 13 14 15 16\n";
  for (int k = 0; k < 8; k++) {
    text += "f";
    for (const int corner : {k, (k + 1) % 8, (k + 1) % 8 + 8, k + 8})
      text += " " + std::to_string(corner + 1);
    text += "\n";
  }
  const Mesh m = read("u.obj", text).mesh;
  EXPECT_EQ(m.triangles.size(), 28u);
  EXPECT_NEAR(volume(m), 8, 1e-12);
  EXPECT_NEAR(m.area(), 34, 1e-12);  // folds would add area
}

TEST_F(Read, FacesOfManyCorners) {  // more than 255 in OBJ, more than 9 in OFF
  std::string obj, off = "OFF 300 1 0\n", face = "300", last = "f";
  for (int k = 0; k < 300; k++) {
    const Point at = shapes::on_circle(k, 300);
    const std::string p = std::to_string(at.x()) + " " + std::to_string(at.y()) + " 0\n";
    obj += "v " + p, off += p, face += " " + std::to_string(k), last += " " + std::to_string(k + 1);
  }
  for (const auto& path : {put("n.obj", obj + last), put("n.off", off + face)}) {
    const Mesh m = read_mesh(path).mesh;
    EXPECT_EQ(m.triangles.size(), 298u);
    EXPECT_NEAR(m.area(), std::numbers::pi, 1e-3);
  }
}

TEST_F(Read, OffVariants) {
  const std::string body =
      "0 0 0 # first\n\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1 255 0 0\n3 0 1 3\n3 0 3 2\n3 1 2 3 0.5 0.5 0.5\n";
  for (const char* head :
       {"OFF\n4 4 6\n", "OFF 4 4 6\n", "OFF4 4\n", "# said before\nOFF\n# and after\n4 4 0\n"}) {
    const Mesh m = read("t.off", head + body).mesh;
    EXPECT_EQ(m.triangles.size(), 4u) << head;
    EXPECT_DOUBLE_EQ(volume(m), 1.0 / 6) << head;
  }
  const Mesh coloured =
      read("c.off", "COFF\n3 1 0\n0 0 0 1 0 0 1\n2 0 0 1 0 0 1\n0 2 0 1 0 0 1\n3 0 1 2\n").mesh;
  EXPECT_DOUBLE_EQ(coloured.area(), 2);
  expect_fault(put("b.off", "OFF BINARY\n4 4 6\n"), "binary OFF");
  expect_fault(put("4.off", "4OFF\n4 4 6\n"), "four or n coordinates");
  expect_fault(put("d.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n"), "too few corners");
  const std::string points = "OFF\n4 2 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  EXPECT_EQ(read("e.off", points + "3 0\n1 \n2\n3 0 1 3\n").mesh.triangles.size(), 2u);
  expect_fault(put("f.off", points + "3 0 1\n3 0 1 3\n"), "too few corners");
  expect_fault(put("g.off", points + "3 0 1 2\n3 0 1 3\n\n3 1 2 3\n"),
               "line 10: '3' stands behind the last face: the header says 2");
}

TEST_F(Read, StlInBothForms) {
  const Mesh m = cube();
  for (const char* head : {"", "solid but binary"}) {
    const ReadResult r = read("c.stl", binary_stl(m, head));
    EXPECT_EQ(r.mesh.triangles.size(), 12u);
    EXPECT_EQ(r.mesh.points.size(), 36u);
    EXPECT_NEAR(volume(r.mesh), 1, 1e-12);
  }
  const ReadResult trailing = read("t.stl", binary_stl(m) + "behind");
  EXPECT_EQ(trailing.mesh.triangles.size(), 12u);
  ASSERT_EQ(trailing.notes.size(), 1u);
  EXPECT_EQ(trailing.notes[0], "6 bytes behind the last facet left out");
  const std::string facet =
      "FACET normal 0 0 1\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 1 0\n endloop\n endfacet\n";
  EXPECT_EQ(read("a.stl", "solid a facet\n" + facet + facet + "endsolid a\nsolid b\n" + facet + "endsolid\n")
                .mesh.triangles.size(),
            3u);
  // The name ends with its line, or where a facet begins; else any word may follow any other on a line.
  std::string lines = "solid a facet normal\n" + facet + "endsolid a\nsolid\n" + facet + "ENDSOLID\n",
              line = lines;
  std::ranges::replace(line, '\n', ' ');
  for (const std::string& text : {lines, line, "solid a\n" + line.substr(line.find("FACET"))})
    EXPECT_EQ(read("line.stl", text).mesh.triangles.size(), 2u) << text;
  EXPECT_EQ(read("digits.stl", "solid\nfacet\nvertex 0.1 0 0\nvertex 1 0 0\nvertex 0 1 0\nendfacet\n")
                .mesh.points[0]
                .x(),
            0.1);
  EXPECT_EQ(read("cut.stl", "solid\n" + facet).notes.size(), 1u);
  EXPECT_TRUE(read("whole.stl", "solid\n" + facet + "endsolid\n").notes.empty());
  EXPECT_EQ(read("blank.stl", "\n\n \tsolid a\n" + facet + "endsolid a\n").mesh.triangles.size(), 1u);
  expect_fault(put("cut.stl", binary_stl(m).substr(0, 500)), "promises 12 facets, but has room for 8");
  expect_fault(put("few.stl", binary_stl(m).replace(80, 1, 1, '\3')), "promises 3 facets, but has 12");
  for (const char* behind : {"", "\n"})
    expect_fault(put("none.stl", binary_stl(Mesh{}) + behind), "it holds no triangle");
  expect_fault(put("word.stl", "solid\nfacet\nvertex 0 0 zero\n"), "line 3: 'zero' is not a number");
  expect_fault(put("two.stl",
                   "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n"),
               "line 7: a facet of 2 vertices");
}

std::string ply(const std::string& format, const std::string& type, const std::string& body) {
  return "ply\nformat " + format + " 1.0\ncomment none\nelement vertex 3\nproperty " + type +
         " x\nproperty " + type + " y\nproperty " + type +
         " z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n" + body;
}

TEST_F(Read, PlyInItsForms) {
  EXPECT_DOUBLE_EQ(read("a.ply", ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n")).mesh.area(), 2);
  std::string crlf = ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n"), body;
  for (std::size_t at = 0; (at = crlf.find('\n', at)) != crlf.npos; at += 2) crlf.insert(at, "\r");
  EXPECT_DOUBLE_EQ(read("crlf.ply", crlf).mesh.area(), 2);
  // Easting and northing: floats would round them to 0.03 and 0.5.
  for (const double x : {448262.1234, 448263.1234, 448262.1234})
    append(body, x), append(body, 5411945.5 + x), append(body, 0.25);
  append(body, std::uint8_t(3));
  for (const int k : {0, 1, 2}) append(body, k);
  const Mesh m = read("d.ply", ply("binary_little_endian", "double", body)).mesh;
  EXPECT_EQ(m.points[1], Point(448263.1234, 5411945.5 + 448263.1234, 0.25));
  EXPECT_EQ(m.triangles.size(), 1u);
  for (std::size_t length = 1; length < body.size(); length += 7)
    expect_fault(put("cut.ply", ply("binary_little_endian", "double", body.substr(0, length))), "cut short");
  expect_fault(put("list.ply", ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n4 0 1 2\n")), "cannot be read");
  expect_fault(put("more.ply", ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n\n3 2 1 0\n")),
               "line 16: '3' stands behind the last element");
  expect_fault(put("out.ply", ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 3\n")), "names vertex 3");
}

TEST_F(Read, PlyWithoutABodyOrAnEndOfLine) {  // found by fuzzing
  std::string text = ply("ascii", "float", "");
  ASSERT_EQ(text.back(), '\n');
  text.pop_back();
  expect_fault(put("a.ply", text), "cut short");
}

// A strip along a ribbon of squares must have the area of its triangles, and all must face +z.
TEST_F(Read, PlyStripsAreTriangles) {
  const std::string points = "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0\n2 1 0\n3 0 0\n3 1 0\n";
  const auto strips = [&](const std::string& rows, int count, const std::string& name = "vertex_indices") {
    return "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
           "element tristrips " +
           std::to_string(count) + "\nproperty list int int " + name + "\nend_header\n" + points + rows;
  };
  const std::pair<std::string, std::size_t> cases[] = {
      {strips("8 1 0 3 2 5 4 7 6\n", 1), 6},                     // one strip
      {strips("9 1 0 3 2 -1 5 4 7 6\n", 1), 4},                  // -1 ends one, and turning begins anew
      {strips("10 1 0 3 -1 3 0 2 -1 5 4\n", 1), 2},              // odd lengths; two corners are no triangle
      {strips("4 1 0 3 2\n4 3 2 5 4\n", 2, "vertex_index"), 4},  // several
      {strips("10 1 0 3 2 2 5 5 4 7 6\n", 1), 6 - 2},            // led elsewhere over triangles without area
      {strips("3 -1 -1 -1\n4 1 0 3 2\n", 2), 2}};
  for (const auto& [text, triangles] : cases) {
    const Mesh m = read("s.ply", text).mesh;
    EXPECT_EQ(m.triangles.size(), triangles) << text;
    EXPECT_DOUBLE_EQ(m.area(), 0.5 * double(triangles));
    for (std::size_t t = 0; t < m.triangles.size(); t++) EXPECT_GT(m.area_normal(t).z(), 0) << text;
  }
  expect_fault(put("o.ply", strips("4 1 0 3 8\n", 1)), "strip 1 of 1 (counted from 1) names vertex 8");
  expect_fault(put("n.ply", strips("4 1 0 3 -2\n", 1)), "names vertex -2");
  expect_fault(put("none.ply", strips("2 1 0\n", 1)), "it holds no triangle");
}

TEST_F(Read, PlyFacesUnderAnyNameAreReadOrRefused) {
  const std::string good = ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n");
  EXPECT_EQ(read("i.ply", with(good, "vertex_indices", "vertex_index")).mesh.triangles.size(), 1u);
  expect_fault(put("c.ply", with(good, "vertex_indices", "corners")), "no property vertex_indices");
  expect_fault(put("e.ply", with(good, "element face", "element polygon")), "'face' and 'tristrips' alone");
  expect_fault(put("f.ply", with(good, "uchar int", "uchar float")), "no whole numbers");
  expect_fault(put("v.ply", with(good, "element face", "element vertex")), "'vertex' twice");
  expect_fault(put("y.ply", with(good, "property float y", "property float q")), "no property y");
  // Faces before vertices, other elements and lists between them, quads, faces and strips in one file.
  const ReadResult r = read(
      "m.ply",
      "ply\nformat ascii 1.0\nelement camera 1\nproperty float x\nelement face 1\nproperty uchar flags\n"
      "property list uchar uint vertex_indices\nproperty list uchar float texcoord\nelement vertex 5\n"
      "property double z\nproperty list uchar int tags\nproperty double y\nproperty double x\nelement edge "
      "1\n"
      "property int vertex1\nproperty int vertex2\nelement tristrips 1\nproperty list int int "
      "vertex_indices\n"
      "end_header\n9\n7 4 0 1 2 3 2 0.5 0.5\n0 0 0 0.1\n0 2 8 9 0 1\n0 0 1 1\n0 0 1 0.1\n5 0 0.5 0.5\n0 1\n3 "
      "0 1 4\n");
  EXPECT_EQ(r.mesh.triangles.size(), 3u);
  EXPECT_EQ(r.mesh.points[0], Point(0.1, 0, 0));
  EXPECT_EQ(r.notes, std::vector<std::string>{"1 edges left out"});
  EXPECT_EQ(read("digits.ply", ply("ascii", "float", "0.1 0 0\n2 0 0\n0 2 0\n3 0 1 2\n")).mesh.points[0].x(),
            double(0.1f));  // it says that it is a float
}

// 3MF

const std::string kRelations =
    R"(<Relationships><Relationship Id="r" Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>)";
const std::string kTetrahedron =
    R"(<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="6" y="0" z="0"/><vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices>)"
    R"(<triangles><triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/><triangle v1="0" v2="3" v3="2"/><triangle v1="1" v2="2" v3="3"/></triangles></mesh>)";

const std::string kObject = "<object id=\"1\">" + kTetrahedron + "</object>",
                  kItem = "<item objectid=\"1\"/>";

std::string model(const std::string& resources, const std::string& items,
                  const std::string& attributes = "") {
  return "<?xml version=\"1.0\"?><model " + attributes + "><resources>" + resources + "</resources><build>" +
         items + "</build></model>";
}
std::string package(const std::string& model, bool deflated = true, const std::string& other = "") {
  return zip_bytes({{"_rels/.rels", kRelations}, {"3D/3dmodel.model", model}, {"3D/other.model", other}},
                   deflated);
}

TEST_F(Read, ThreeMfHasItsUnit) {
  const auto read_in = [&](const std::string& unit, const ReadOptions& options = {}) {
    const std::string attribute = unit.empty() ? "" : "unit=\"" + unit + "\"";
    return read("u.3mf", package(model(kObject, kItem, attribute)), options);
  };
  const std::tuple<const char*, const char*, double> units[] = {
      {"", "mm", 6},     {"millimeter", "mm", 6}, {"micron", "mm", 0.006}, {"centimeter", "cm", 6},
      {"inch", "in", 6}, {"foot", "in", 72},      {"meter", "m", 6}};
  for (const auto& [name, unit, length] : units) {
    const ReadResult r = read_in(name);
    EXPECT_EQ(r.unit, unit);
    EXPECT_DOUBLE_EQ(size(r.mesh).x(), length);
    EXPECT_EQ(r.mesh.triangles.size(), 4u);
    EXPECT_GT(volume(r.mesh), 0);
  }
  const ReadResult metres = read_in("inch", {.scale = 1, .unit = "m"});
  EXPECT_EQ(metres.unit, "m");
  EXPECT_NEAR(size(metres.mesh).x(), 6 * 0.0254, 1e-15);
  expect_fault(put("p.3mf", package(model("", "", "unit=\"parsec\""))), "'parsec' is none of 3MF's");
}

TEST_F(Read, ThreeMfBuildsComponentsAndTransforms) {
  const std::string resources =
      kObject + "<object id=\"9\" type=\"support\">" + kTetrahedron + "</object><object id=\"5\">" +
      kTetrahedron +
      "</object>"  // 5 is not built
      "<object id=\"2\"><components><component objectid=\"1\"/><component objectid=\"1\" "
      "transform=\"-1 0 0 0 1 0 0 0 1 0 0 4\"/></components></object>";
  for (const bool deflated : {false, true}) {
    const ReadResult r = read(
        "c.3mf", package(model(resources, "<item objectid=\"2\" transform=\"2 0 0 0 2 0 0 0 2 10 0 0\"/>" +
                                              kItem + "<item objectid=\"9\"/>"),
                         deflated));
    EXPECT_EQ(r.mesh.triangles.size(), 12u);
    EXPECT_NEAR(volume(r.mesh), 1 + 8 + 8, 1e-12);  // the mirrored one is turned over
    EXPECT_EQ(r.mesh.bounds().low, Point(-2, 0, 0));
    EXPECT_EQ(r.mesh.bounds().high, Point(22, 2, 10));
    EXPECT_EQ(r.notes, std::vector<std::string>{"1 supports left out"});
  }
  // The production extension: an object in a file of its own.
  const std::string p =
      "xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\" requiredextensions=\"p\"";
  EXPECT_NEAR(volume(read("p.3mf", package(model("", "<item objectid=\"1\" p:path=\"/3D/other.model\"/>", p),
                                           true, model(kObject, "")))
                         .mesh),
              1, 1e-12);
}

TEST_F(Read, ThreeMfFaults) {
  const auto fault_of = [&](const std::string& model, const std::string& words) {
    expect_fault(put("f.3mf", package(model)), words);
  };
  fault_of("<model", "not XML at byte");
  fault_of(model(kObject, ""), "nothing is to be built");
  fault_of(model(kObject, "<item objectid=\"7\"/>"), "no object '7'");
  fault_of(model(kObject + kObject, kItem), "two objects have the id '1'");
  fault_of(model("<object id=\"1\"><components><component objectid=\"1\"/></components></object>", kItem),
           "contain each other");
  fault_of(model(kObject, "<item objectid=\"1\" transform=\"1 0 0\"/>"), "twelve numbers");
  fault_of(model(kObject, kItem,
                 "xmlns:b=\"http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02\" "
                 "requiredextensions=\"b\""),
           "beamlattice/2017/02', which is not read");
  fault_of(model(with(kObject, "v3=\"1\"", "v3=\"4\""), kItem), "names vertex '4', but there are 4");
  expect_fault(put("z.3mf", zip_bytes({{"a", "b"}})), "'_rels/.rels' is missing");
  // 2^60 copies must be refused at once.
  std::string bomb = kObject;
  for (int k = 2; k < 62; k++) {
    const std::string below = "<component objectid=\"" + std::to_string(k - 1) + "\"/>";
    bomb +=
        "<object id=\"" + std::to_string(k) + "\"><components>" + below + below + "</components></object>";
  }
  fault_of(model(bomb, "<item objectid=\"61\"/>"), "triangles, more than the 4294967295");
}

TEST_F(Read, ObjSurfacesAreNotPassedOver) {
  const ReadResult r = read("l.obj", kCubeObj + "l 1 2\np 1\nl 1 2 3\n");
  EXPECT_EQ(r.notes, std::vector<std::string>{"3 lines, curves or points left out"});
  EXPECT_EQ(r.mesh.triangles.size(), 12u);
  for (const char* line : {"surf 0 1 0 1 1 2 3 4", "fo 1 2 3", "call other.obj"})
    expect_fault(put("s.obj", kCubeObj + line + "\n"),
                 "line 15: '" + std::string(line).substr(0, std::string(line).find(' ')));
}

// A square of four points, in each of the ways that glTF has to make triangles.
TEST_F(Read, GltfModesAndExtensions) {
  std::string bytes;
  for (const float x : {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}) append(bytes, x);
  put("square.bin", bytes);
  const auto gltf = [](int mode, const std::string& more = "") {
    return R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)" + more +
           R"("meshes":[{"primitives":[{"mode":)" + std::to_string(mode) +
           R"(,"attributes":{"POSITION":0}}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":4,)"
           R"("type":"VEC3","min":[0,0,0],"max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":48}],)"
           R"("buffers":[{"uri":"square.bin","byteLength":48}]})";
  };
  const Mesh strip = read("strip.gltf", gltf(5)).mesh;
  EXPECT_EQ(strip.triangles.size(), 2u);
  EXPECT_DOUBLE_EQ(strip.area(), 1);
  for (std::size_t t = 0; t < strip.triangles.size(); t++) EXPECT_GT(strip.area_normal(t).z(), 0);
  const Mesh fan = read("fan.gltf", gltf(6)).mesh;
  EXPECT_EQ(fan.triangles.size(), 2u);
  EXPECT_DOUBLE_EQ(fan.area(), 1);
  for (const int mode : {0, 1, 2, 3}) expect_fault(put("lines.gltf", gltf(mode)), "it holds no triangle");
  expect_fault(put("d.gltf", gltf(5, R"("extensionsRequired":["KHR_draco_mesh_compression"],)")),
               "'KHR_draco_mesh_compression'");
  expect_fault(put("i.gltf", gltf(5, R"("extensionsUsed":["EXT_mesh_gpu_instancing"],)")),
               "'EXT_mesh_gpu_instancing'");
  EXPECT_EQ(fault(put("m.gltf", gltf(5, R"("extensionsRequired":["KHR_materials_unlit"],)"))), "");
  expect_fault(put("t.gltf", gltf(5, R"("scene":0,)")), "the key \"scene\" stands twice");
}

// A square of two triangles, and again 2 above it. `more`: what stands before its geometry.
std::string dae(const std::string& asset, const std::string& more = "") {
  return R"(<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>)" + asset +
         "</asset>" + more +
         R"(<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 1 1 0</float_array>)"
         R"(<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>)"
         R"(<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><tristrips count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p></tristrips></mesh></geometry></library_geometries>)"
         R"(<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node><node><translate>0 0 2</translate><instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>)"
         R"(<scene><instance_visual_scene url="#s"/></scene></COLLADA>)";
}

TEST_F(Read, ColladaHasItsUnitAndItsStrips) {
  for (const auto& [unit, length] : {std::pair("", 1.0),
                                     {"<unit name=\"inch\" meter=\"0.0254\"/>", 0.0254},
                                     {"<unit name=\"foot\" meter=\"0.3048\"/>", 0.3048}}) {
    const ReadResult r = read("s.dae", dae(unit));
    EXPECT_EQ(r.unit, "m");
    EXPECT_NEAR(size(r.mesh).x(), length, 1e-7 * length);
    EXPECT_EQ(r.mesh.triangles.size(), 4u) << "two instances";
    EXPECT_NEAR(r.mesh.area(), 2 * length * length, 1e-6 * length * length);
  }
  for (const std::string metres : {"-1", "0", "abc", "0,01", "1 2", "", "nan", "1e-60"})
    expect_fault(put("u.dae", dae("<unit meter=\"" + metres + "\"/>")),
                 "its <unit> is of '" + metres + "' metres, and a number above 0 is wanted");
  // The coordinates of the file, whichever way it says is up: as ROS shows it, and as the STL beside it.
  for (const char* up :
       {"", "<up_axis>X_UP</up_axis>", "<up_axis>Y_UP</up_axis>", "<up_axis>Z_UP</up_axis>"}) {
    const Box box = read("s.dae", dae(up)).mesh.bounds();
    EXPECT_EQ(box.low, Point(0, 0, 0)) << up;
    EXPECT_EQ(box.high, Point(1, 1, 2)) << up;
  }
}

// assimp 5.2 reads no COLLADA with an image that has no file, or with a colour after a blank.
TEST_F(Read, ColladaIsReadWhateverItSaysOfImagesAndColours) {
  for (
      const std::string looks :
      {R"(<library_images><image id="i"/></library_images>)",
       R"(<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong><diffuse><color>  0.5 0.5 0.5 1 )"
       R"(</color></diffuse></phong></technique></profile_COMMON></effect></library_effects>)"})
    EXPECT_EQ(read("looks.dae", dae("", looks)).mesh.area(), 2) << looks;
}

TEST_F(Read, NodesWithoutMeshesHaveNoSurface) {
  expect_fault(
      put("bones.dae",
          R"(<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>)"
          R"(<library_visual_scenes><visual_scene id="s"><node id="a"><node id="b"><translate>0 0 2</translate>)"
          R"(</node></node></visual_scene></library_visual_scenes>)"
          R"(<scene><instance_visual_scene url="#s"/></scene></COLLADA>)"),
      "it holds no triangle");
}

TEST_F(Read, GltfOneIsNamed) {
  for (const std::string version : {"\"1.0\"", "1"})
    expect_fault(put("old.gltf", R"({"asset":{"version":)" + version + R"(},"nodes":{"a":{}},"meshes":{}})"),
                 "it is glTF 1, which is not read");
}

// A scene with two instances of one triangle, the second mirrored in x and moved up. Both must face +z.
const char* mirrored_gltf = R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0},{"mesh":0,"scale":[-2,1,1],"translation":[0,0,3]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":1},"indices":0}]}],
"accessors":[{"bufferView":0,"componentType":5123,"count":6,"type":"SCALAR"},
{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
"bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":12},{"buffer":0,"byteOffset":12,"byteLength":36}],
"buffers":[{"uri":"data.bin","byteLength":48}]})";

std::string gltf_buffer(int last = 2) {
  std::string bytes;
  for (const int k : {0, 1, 2, 0, 1, last}) append(bytes, static_cast<std::uint16_t>(k));
  for (const float x : {0, 0, 0, 1, 0, 0, 0, 1, 0}) append(bytes, x);
  return bytes;
}

// `text` as a binary glTF, with the buffer that it has beside it.
std::string glb(const std::string& text) {
  const std::string json = with(text, "\"uri\":\"data.bin\",", "");
  std::string bytes = "glTF";
  append(bytes, std::uint32_t(2));
  append(bytes, static_cast<std::uint32_t>(28 + json.size() + gltf_buffer().size()));
  append(bytes, static_cast<std::uint32_t>(json.size()));
  bytes += "JSON" + json;
  append(bytes, static_cast<std::uint32_t>(gltf_buffer().size()));
  return bytes + std::string("BIN\0", 4) + gltf_buffer();
}

TEST_F(Read, AGlbMayForgetToFillUpItsJson) {
  for (const char* blanks : {"", " ", "  ", "   "}) {
    const ReadResult r = read("s.glb", glb(mirrored_gltf + std::string(blanks)));
    EXPECT_EQ(r.mesh.triangles.size(), 4u);
    EXPECT_EQ(size(r.mesh), Vector(3, 1, 3));
  }
}

TEST_F(Read, CoordinatesOfGltfAreFloatsOrRefused) {
  put("data.bin", gltf_buffer());
  for (const auto& [old, other] : {std::pair<std::string, std::string>("5126", "5122"),
                                   {"\"count\":3,\"type\":\"VEC3\"", "\"count\":3,\"type\":\"VEC4\""}}) {
    const std::string scene = with(mirrored_gltf, old, other);
    expect_fault(put("s.gltf", scene), "coordinates are read as VEC3 of floats");
    expect_fault(put("s.glb", glb(scene)), "coordinates are read as VEC3 of floats");
  }
}

TEST_F(Read, OfAGltfWithoutASceneAllNodesAreRead) {
  put("data.bin", gltf_buffer());
  const std::string scene = R"("scene":0,"scenes":[{"nodes":[0,1]}],)",
                    nodes = R"("nodes":[{"mesh":0},{"mesh":0,"scale":[-2,1,1],"translation":[0,0,3]}],)";
  for (const char* none : {"", R"("scenes":[],)"})
    for (const bool binary : {false, true}) {
      const auto read_as = [&](const std::string& text) {
        return binary ? read("s.glb", glb(text)) : read("s.gltf", text);
      };
      const std::string bare = with(mirrored_gltf, scene, none);
      const ReadResult all = read_as(bare),
                       child = read_as(with(bare, "{\"mesh\":0},", R"({"children":[1]},)")),
                       meshes = read_as(with(bare, "\n" + nodes, ""));
      EXPECT_EQ(all.notes.at(0), "it has no scene: all its nodes are read");
      EXPECT_EQ(all.mesh.triangles.size(), 4u);
      EXPECT_EQ(size(all.mesh), Vector(3, 1, 3));
      EXPECT_EQ(child.mesh.triangles.size(), 2u);
      EXPECT_EQ(size(child.mesh), Vector(2, 1, 0));
      EXPECT_EQ(meshes.notes.at(0),
                "it has neither a scene nor nodes: its meshes are read where their coordinates say");
      EXPECT_EQ(size(meshes.mesh), Vector(1, 1, 0));
    }
}

TEST_F(Read, AMshOfMujocoIsReadOrRefused) {
  const auto msh = [](std::initializer_list<std::int32_t> counts, std::int32_t last) {
    std::string bytes;
    for (const std::int32_t n : counts) append(bytes, n);
    for (const float x : {0, 0, 0, 1, 0, 0, 0, 1, 0, /* a normal */ 0, 0, 1, /* textures */ 9, 9, 9, 9})
      append(bytes, x);
    for (const std::int32_t v : {0, 1, last}) append(bytes, v);
    return bytes;
  };
  const std::string good = msh({3, 1, 2, 1}, 2);
  const ReadResult r = read("t.msh", good);
  EXPECT_EQ(r.mesh.triangles.size(), 1u);
  EXPECT_EQ(r.mesh.points.at(1), Point(1, 0, 0));
  EXPECT_EQ(r.unit, "");
  expect_fault(put("t.msh", msh({3, 1, 2, 1}, 3)), "face 1 names vertex 3 of 3, counted from 0");
  expect_fault(put("t.msh", msh({3, 1, 2, 1}, -1)), "face 1 names vertex -1 of 3");
  for (const std::string& bad : {good + "x", good.substr(0, 30), good.substr(0, 15), msh({-1, 1, 2, 1}, 2),
                                 msh({3, 1, 2, 0x7fffffff}, 2), msh({3, 2, 2, 1}, 2)})
    expect_fault(put("t.msh", bad), "it is no .msh of MuJoCo, or cut short");
}

TEST_F(Read, PlacesThatGltfDoesNotAllowAreRefused) {
  put("data.bin", gltf_buffer());
  const auto placed = [this](const std::string& place) {
    return put("s.gltf", with(mirrored_gltf, R"("scale":[-2,1,1])", place));
  };
  expect_fault(placed(R"("rotation":[0,0,3,4])"), "nodes 1, rotation: the quaternion is not of length 1");
  expect_fault(placed(R"("rotation":[0,0,0,0])"), "nodes 1, rotation: the quaternion is not of length 1");
  expect_fault(placed(R"("matrix":[1,0,0,0.5,0,1,0,0,0,0,1,0,0,0,0,1])"), "nodes 1, matrix: its last row");
  EXPECT_EQ(fault(placed(R"("rotation":[0,0,0.707,0.707])")), "");
  expect_fault(
      put("s.gltf", with(mirrored_gltf, "\"nodes\":[{", "\"skins\":[{\"joints\":[1]}],\"nodes\":[{")),
      "skins 0: a skin without inverseBindMatrices is not read");
}

// A shape that its morph targets have changed is not the mesh that assimp gives.
TEST_F(Read, MorphTargetsThatShowAreRefused) {
  put("data.bin", gltf_buffer());
  const auto weighted = [this](const std::string& node, const std::string& mesh) {
    std::string scene = with(mirrored_gltf, "\"mesh\":0}", node + "\"mesh\":0}");
    scene = with(scene, "\"primitives\"", mesh + "\"primitives\"");
    return put("s.gltf", with(scene, "\"indices\":0", R"("targets":[{"POSITION":1}],"indices":0)"));
  };
  const std::string none = R"("weights":[0.0],)", some = R"("weights":[0.5],)";
  EXPECT_EQ(fault(weighted("", "")), "");
  EXPECT_EQ(fault(weighted("", none)), "");
  expect_fault(weighted("", some), "meshes 0, weights: a morph target that shows is not read");
  expect_fault(weighted(some, none), "nodes 0, weights: a morph target that shows is not read");
  expect_fault(weighted(none, some), "meshes 0, weights");  // the second node has no weights of its own
}

// A joint holds the triangle: it stands where the joint puts it, however its own node is placed.
TEST_F(Read, ASkinnedMeshStandsWhereItsJointsHoldIt) {
  std::string bytes;
  for (const float x : {0, 0, 0, 1, 0, 0, 0, 1, 0}) append(bytes, x);                             // positions
  for (const float x : {100, 0, 0, 0, 0, 100, 0, 0, 0, 0, 100, 0, 0, 0, 0, 1}) append(bytes, x);  // inverse
  for (int v = 0; v < 3; v++)
    for (const float x : {1, 0, 0, 0}) append(bytes, x);  // weights
  bytes += std::string(12, '\0');                         // joints
  put("skin.bin", bytes);
  const Mesh mesh = read("skin.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
"nodes":[{"mesh":0,"skin":0,"scale":[7,7,7]},{"scale":[-0.02,0.02,0.02],"translation":[0,0,3]}],
"skins":[{"joints":[1],"inverseBindMatrices":1}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0,"WEIGHTS_0":2,"JOINTS_0":3}}]}],
"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
{"bufferView":1,"componentType":5126,"count":1,"type":"MAT4"},
{"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"},
{"bufferView":3,"componentType":5121,"count":3,"type":"VEC4"}],
"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":64},
{"buffer":0,"byteOffset":100,"byteLength":48},{"buffer":0,"byteOffset":148,"byteLength":12}],
"buffers":[{"uri":"skin.bin","byteLength":160}]})")
                        .mesh;
  ASSERT_EQ(mesh.triangles.size(), 1u);
  EXPECT_NEAR(mesh.area_normal(0).z(), 2, 1e-6);  // mirrored by the joint, and turned right side out
  EXPECT_NEAR((mesh.bounds().low - Point(-2, 0, 3)).norm(), 0, 1e-6);
}

TEST_F(Read, SceneNodesArePlacedAndMirroredOnesTurned) {
  put("data.bin", gltf_buffer());
  const ReadResult r = read("s.gltf", mirrored_gltf);
  ASSERT_EQ(r.mesh.triangles.size(), 4u);
  EXPECT_EQ(r.unit, "m");
  for (std::size_t t = 0; t < 4; t++) EXPECT_GT(r.mesh.area_normal(t).z(), 0);
  EXPECT_DOUBLE_EQ(r.mesh.area(), 3);
  EXPECT_DOUBLE_EQ(r.mesh.bounds().low.x(), -2);
  EXPECT_DOUBLE_EQ(r.mesh.bounds().high.z(), 3);
}

// Reading a buffer that is a pipe would never end.
TEST_F(Read, AGltfMayOnlyReferToFiles) {
  ASSERT_EQ(::mkfifo((folder_ / "data.bin").c_str(), 0600), 0);
  expect_fault(put("s.gltf", mirrored_gltf), "assimp cannot read it");
}

TEST_F(Read, AGltfMayNotReferToFilesAboveItsFolder) {
  fs::create_directory(folder_ / "in");
  put("data.bin", gltf_buffer());
  for (const std::string& name : {std::string("../data.bin"), (folder_ / "data.bin").string()})
    expect_fault(put("in/s.gltf", with(mirrored_gltf, "data.bin", name)), "assimp cannot read it");
  EXPECT_EQ(fault(put("s.gltf", with(mirrored_gltf, "data.bin", "in/../data.bin"))), "")
      << "it does not leave the folder";
}

TEST_F(Read, AGltfNamesAFileAsUrisDo) {
  const auto of = [&](const std::string& uri) { return put("s.gltf", with(mirrored_gltf, "data.bin", uri)); };
  put("a b\u00e9.bin", gltf_buffer());
  EXPECT_EQ(fault(of("a%20b%c3%A9.bin")), "");
  EXPECT_EQ(fault(of("./a b%C3%a9.bin")), "");
  expect_fault(of("a%2b.bin"), "assimp cannot read it");
  put("50%.bin", gltf_buffer());
  EXPECT_EQ(fault(of("50%.bin")), "");
  put("a%2b.bin", gltf_buffer());
  EXPECT_EQ(fault(of("a%2b.bin")), "") << "nobody escaped it";
  put("out.bin", gltf_buffer());
  fs::create_directory(folder_ / "in");
  expect_fault(put("in/s.gltf", with(mirrored_gltf, "data.bin", "%2e%2e/out.bin")), "assimp cannot read it");
}

TEST_F(Read, SceneFaults) {
  expect_fault(put("s.gltf", mirrored_gltf), "data.bin");
  put("data.bin", gltf_buffer(9));
  expect_fault(folder_ / "s.gltf", "out of range");
  put("data.bin", std::string(12, '\11') + gltf_buffer().substr(12));
  expect_fault(folder_ / "s.gltf", "faces with an index out of range");
  expect_fault(put("x.gltf", "{\"asset\""), "not JSON at byte");
  expect_fault(put("x.glb", "glTF\2"), "no binary glTF 2");
  for (const char* name : {"x.fbx", "x.dae", "x.3ds", "x.3mf"})
    expect_fault(put(name, std::string("noise \0\1\2\3\377", 11)), name);
}

TEST_F(Read, UnitsAndScale) {
  put("data.bin", gltf_buffer());
  const fs::path gltf = put("s.gltf", mirrored_gltf), obj = put("c.obj", kCubeObj);
  const ReadResult mm = read_mesh(gltf, {.scale = 1, .unit = "mm"});
  EXPECT_EQ(mm.unit, "mm");
  EXPECT_NEAR(size(mm.mesh).z(), 3000, 1e-9);
  ASSERT_EQ(mm.notes.size(), 1u);
  EXPECT_EQ(mm.notes[0], "converted from m to mm");
  const ReadResult inch = read_mesh(gltf, {.scale = 2, .unit = "in"});
  EXPECT_NEAR(size(inch.mesh).z(), 6 / 0.0254, 1e-9);
  const ReadResult scaled = read_mesh(gltf, {.scale = 2, .unit = ""});
  EXPECT_EQ(scaled.unit, "");
  ASSERT_EQ(scaled.notes.size(), 1u);
  EXPECT_EQ(scaled.notes[0],
            "its lengths, in m, were scaled and are in no unit that is known now: --unit m keeps it");
  const ReadResult label = read_mesh(obj, {.scale = 0.5, .unit = "cm"});
  EXPECT_EQ(label.unit, "cm");
  EXPECT_DOUBLE_EQ(volume(label.mesh), 0.125);
  expect_fault(obj, "\"ft\" is no unit of length known here: use m, cm, mm or in",
               {.scale = 1, .unit = "ft"});
  for (const double scale : {0.0, -1.0, std::nan(""), HUGE_VAL})
    expect_fault(obj, "the scale must be a positive number", {.scale = scale, .unit = ""});
  expect_fault(put("h.obj", "v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n"), "overflow when they are scaled",
               {.scale = 1e10, .unit = ""});
}

TEST_F(Read, FilesThatAreNone) {
  expect_fault(folder_ / "absent.obj", "cannot open");
  expect_fault(put("robot.sdf", "x"), "robots and scenes are read from .urdf, .xacro and MJCF (.xml)");
  expect_fault(put("b.off", std::string("OFF BINARY\n\0\0", 13)), "binary OFF is not read");
  expect_fault(put("part.step", "x"), ".obj, .stl, .ply, .off, .gltf, .glb, .fbx, .dae, .3ds, .3mf, .msh");
  expect_fault(put("part", "x"), "it has no ending");
  expect_fault(put("gmsh.msh", "$MeshFormat\n4.1 0 8\n"),
               "it is a mesh of Gmsh, and a .msh is read as MuJoCo's");
  for (const std::string& ending : mesh_endings())
    expect_fault(put("empty" + ending, ""), "the file is empty");
  fs::create_directory(folder_ / "folder.obj");
  expect_fault(folder_ / "folder.obj", "is a folder");
}

TEST_F(Read, ObjFaultsNameTheirLine) {
  const std::string v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const std::pair<std::string, std::string> table[] = {
      {v + "f 1 2 4\n", "line 4: a face names vertex 4, but the file has only 3"},
      {v + "f 0 1 2\n", "line 4: a face names vertex 0"},
      {v + "f -1 -2 -4\n", "line 4: a face names vertex -4"},
      {v + "f 1 2 99999999999\n", "line 4: a face names vertex 99999999999"},
      {v + "f 1 2 99999999999999999999\n", "line 4: '99999999999999999999' is no vertex index"},
      {v + "f a b c\n", "line 4: 'a' is no vertex index"},
      {v + "f\n", "line 4: a face without corners"},
      {v + "f 1 2 3\nf 1 2", "line 5: the file ends within a face of 2 corners: it is cut short"},
      {"v 0 0\n" + v, "line 1: a vertex needs three coordinates, here are 2"},
      {"v 0,5 1 2\n" + v, "a point, not a comma"},
      {"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1: vertex 1"},
      {"v 1.#IND 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "line 1: vertex 1"},
      {"v 0 0 0\nv 1e400 0 0\nv 0 1 0\nf 1 2 3\n", "line 2: vertex 2"},
      {std::string("v 0 0 0\nv 1 0 0\0\n", 17), "line 2: a zero byte"},
      {v, "it holds no triangle, only 3 points"}};
  for (const auto& [text, words] : table) expect_fault(put("t.obj", text), words);
  const Mesh forward = read("t.obj", "f 1 2 3\n" + v).mesh;  // absolute indices may come first
  EXPECT_DOUBLE_EQ(forward.area(), 0.5);
  const Mesh tiny = read("t.obj", "v 1e-400 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").mesh;
  EXPECT_DOUBLE_EQ(tiny.area(), 0.5);
}

TEST_F(Read, FaultsOfTheOtherFormatsAreNamed) {
  const std::string off = "OFF\n3 1 0\n0 0 0\n1 0 0\n", stl = binary_stl(cube());
  const std::string text = ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 -2\n");
  std::string list(36, '\0'), nan = stl, noise = stl;
  list += "\xff" + std::string(12, '\0');
  nan.replace(96, 4, "\xff\xff\xff\xff"), noise.replace(80, 4, "\xff\xff\xff\xff");
  const std::array<std::string, 3> table[] = {
      {"t.off", "OFF\n4000000000 4000000000 0\n0 0 0\n", "4000000000 vertices"},
      {"t.off", "OFF\n-3 -1 0\n", "'-3'"},
      {"t.off", off + "0 1 0\n3 0 1 7\n", "line 6: face 1 of 1 has a corner at vertex '7'"},
      {"t.off", off + "0 1 0\n3 0 1 -1\n", "a corner at vertex '-1'"},
      {"t.off", off, "vertex 3 of 3 should stand"},
      {"t.off", noise, "zero byte"},
      {"t.ply", with(text, "vertex 3", "vertex 4000000000"), "promises 4000000000"},
      {"t.ply", text, "names vertex -2"},
      {"t.ply", "ply\nformat ascii 1.0\nelement vertex 1\n", "no end_header"},
      {"t.ply", with(text, "float x", "quux x"), "line 5: 'quux' is no type"},
      {"t.ply", ply("binary_little_endian", "float", list), "'face', but number 1 cannot be read"},
      {"t.ply", noise, "begins with the line ply"},
      {"t.stl", "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "ends inside a facet"},
      {"t.stl", stl.substr(0, 80), "too short"},
      {"t.stl", nan, "vertex 1 (counted from 1)"},
      {"t.stl", noise, "promises 4294967295 facets"},
      {"t.stl", noise.substr(3), "as a binary STL"},
      {"t.obj", stl, "zero byte"}};
  for (const auto& [name, bytes, words] : table) expect_fault(put(name, bytes), words);
  EXPECT_EQ(read("t.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n3 0 1 2\n").mesh.triangles.size(), 1u);
}

TEST_F(Read, NothingGetsThroughWhenBytesAreLostOrChanged) {  // an answer or a sentence, never a crash
  const std::string files[][2] = {{"t.obj", kCubeObj},
                                  {"t.stl", binary_stl(cube())},
                                  {"t.ply", ply("ascii", "float", "0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n")},
                                  {"t.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"}};
  for (const auto& [name, bytes] : files)
    for (std::size_t at = 0; at < bytes.size(); at += 9)
      for (const char replacement : {'-', '9', '\xff'}) {
        std::string damaged = bytes;
        damaged[at] = replacement;
        fault(put(name, damaged));
        fault(put(name, bytes.substr(0, at)));
      }
}

TEST_F(ReadChild, BringsAMeshAndNothingUnsound) {
  ReadResult sent;
  sent.mesh.points.assign(100000, Point(1, 2, 3));
  sent.mesh.triangles = {{7, 8, 9}}, sent.unit = "in", sent.notes = {"one", "two"};
  const ReadResult back = reading::mesh_from_child([&] { return sent; }, 0, "t.fbx");
  EXPECT_EQ(back.mesh.points, sent.mesh.points);
  EXPECT_EQ(back.mesh.triangles, sent.mesh.triangles);
  EXPECT_EQ(back.unit, "in");
  EXPECT_EQ(back.notes, sent.notes);
  sent.mesh.triangles = {{7, 8, 100000}};  // as a reader may say that a file has taken over
  EXPECT_EQ(error_of([&] {
              reading::mesh_from_child([&] { return sent; }, 0, "t.fbx");
            }).find("t.fbx: the reader crashed"),
            0u);
}

TEST_F(ReadChild, ManyThreadsMayRead) {
  const fs::path path = put("c.stl", binary_stl(cube()));
  std::atomic<int> right = 0;
  std::vector<std::thread> threads;
  for (int k = 0; k < 8; k++)
    threads.emplace_back([&] {
      for (int i = 0; i < 5; i++) right += read_mesh(path).mesh.triangles.size() == 12;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 40);
}

TEST_F(Read, CountsBeyond32BitsAreRefused) {
  EXPECT_NO_THROW(reading::check_counts(4294967295, 4294967295, "t.stl"));
  EXPECT_THROW(reading::check_counts(4294967296, 0, "t.stl"), Error);
  EXPECT_THROW(reading::check_counts(0, 4294967296, "t.stl"), Error);
}

// The meshes in ../shared, where they are present.

const fs::path kShared = fs::path(PADDER_SHARED) / "meshes";

// Of itself assimp aborts on nearly every damaged 3MF.
TEST_F(ReadShared, DamagedScenesEndInAnAnswerOrASentence) {  // seed 7
  if (!fs::exists(kShared)) GTEST_SKIP() << kShared << " is not here";
  std::mt19937 random(7);
  for (const char* name :
       {"cubes_mirrored_pivot.fbx", "fels.3ds", "sphere.dae", "box_interleaved.glb", "featuretype.3mf"}) {
    const std::string bytes = read_file(kShared / "formats" / name);
    for (int k = 0; k < 12; k++) {
      std::string damaged = bytes;
      if (k % 2)
        damaged.resize(random() % bytes.size());
      else
        for (int i = 0; i < k; i++)
          damaged[random() % std::min<std::size_t>(bytes.size(), 3000)] = static_cast<char>(random());
      fault(put(name, damaged));
    }
  }
}

TEST_F(ReadShared, Formats) {
  if (!fs::exists(kShared)) GTEST_SKIP() << kShared << " is not here";
  const struct {
    const char* file;
    std::size_t triangles;
    Vector size;
    double volume;
    const char* unit;
  } table[] = {{"cubes_mirrored_pivot.fbx", 420, {0.2093, 0.305, 0.3277}, 0.003476, "m"},
               {"fels.3ds", 768, {3.505, 4.682, 3.206}, 37.21, ""},
               {"sphere.dae", 760, {0.02, 0.02, 0.02}, 4.095e-6, "m"},
               {"featuretype_binary.ply", 3476, {5, 2.5, 1.375}, 11.63, ""},
               {"box_cr_newlines.ply", 12, {12.69, 12.01, 12.62}, 1923, ""},
               {"featuretype.3mf", 2208, {5, 2.5, 1.375}, 11.64, "in"},
               {"two_solids_ascii.stl", 24, {6, 1, 1}, 2, ""},
               {"negative_indices.obj", 12, {2, 2, 2}, 8, ""},
               {"off_no_space_after_magic.off", 12, {3.266, 3.266, 2.309}, 12.32, ""},
               {"spot_control_mesh_quads.obj", 372, {1.172, 1.743, 1.774}, 0.8489, ""},
               {"box_interleaved.glb", 12, {1, 1, 1}, 1, "m"},
               {"lantern.gltf", 5394, {15.49, 25.66, 4.631}, 163.3, "m"},
               {"menger_sponge_3.glb", 21598, {1, 1, 1}, 0.4064, "m"}};  // (20/27)^3
  for (const auto& row : table) {
    SCOPED_TRACE(row.file);
    const ReadResult r = read_mesh(kShared / "formats" / row.file);
    EXPECT_EQ(r.mesh.triangles.size(), row.triangles);
    EXPECT_LT((size(r.mesh) - row.size).cwiseQuotient(row.size).cwiseAbs().maxCoeff(), 5e-4);
    EXPECT_NEAR(volume(r.mesh), row.volume, 5e-4 * row.volume);  // positive: mirrored nodes are turned right
    EXPECT_EQ(r.unit, row.unit);
  }
}

// What a file must give: an error with these words, or this number of triangles where it can be read.
struct Expected {
  const char* file;
  const char* words;
  std::size_t triangles = 0;
};

void check_table(const fs::path& folder, const std::vector<Expected>& table) {
  std::size_t seen = 0;
  for (const auto& entry : fs::directory_iterator(folder)) seen += entry.path().extension() != ".bin";
  EXPECT_EQ(seen, table.size()) << "a file of " << folder << " is not in the table";
  for (const Expected& row : table) {
    SCOPED_TRACE(row.file);
    if (*row.words) {
      expect_fault(folder / row.file, row.words);
      expect_fault(folder / row.file, (folder / row.file).string());
    } else {
      EXPECT_EQ(read_mesh(folder / row.file).mesh.triangles.size(), row.triangles);
    }
  }
}

TEST_F(ReadShared, Malformed) {
  if (!fs::exists(kShared)) GTEST_SKIP() << kShared << " is not here";
  check_table(kShared / "malformed",
              {{"assimp_empty.obj", "the file is empty"},
               {"assimp_fuzz_header.ply", "line 7: '"},
               {"assimp_invalid.off", "line 6: face 1 of 4 begins with '0'"},
               {"assimp_issue623_truncated.ply", "faces are read from 'face' and 'tristrips' alone"},
               {"assimp_malformed.obj", "line 28: a face names vertex 0"},
               {"assimp_malformed2.obj", "line 23: a face without corners"},
               {"assimp_out_of_memory.off", "line 2: the header says 353535235358 vertices"},
               {"draco_one_point_triangle.obj", "", 1},  // without area: for repair to judge
               {"gltf_index_out_of_range.gltf", "faces with an index out of range"},
               {"gltf_infinities.glb", "vertex 1 (counted from 1)"},
               {"gltf_missing_bin.gltf", "BoxTextured0.bin"},
               {"gltf_recursive_nodes.gltf", "recursive reference"},
               {"tinyobj_face_of_letters.obj", "it holds no triangle"},
               {"tinyobj_index_zero.obj", "line 16: a face names vertex 0"},
               {"tinyobj_nan.obj", "line 12: vertex 1"},
               {"trimesh_not_enough_indices.obj", "", 1},
               {"trimesh_stl_no_facets.stl", "it holds no triangle"}});
}

class Analytic : public Read {
 protected:
  void SetUp() override {
    const fs::path script = kShared / "make_analytic.py";
    if (!fs::exists(script)) GTEST_SKIP() << script << " is not here";
    const std::string command =
        "/usr/bin/env python3 '" + script.string() + "' '" + folder_.string() + "' >/dev/null";
    if (std::system(command.c_str()) != 0) GTEST_SKIP() << "python3 is not here";
  }
};

TEST_F(Analytic, TrianglesAreaAndVolume) {
  const auto expected = nlohmann::json::parse(read_file(folder_ / "EXPECTED.json"));
  ASSERT_GT(expected.size(), 50u);
  for (const auto& [file, e] : expected.items()) {
    SCOPED_TRACE(file);
    const std::size_t triangles = e["triangles"];
    if (triangles == 0) {
      expect_fault(folder_ / file, "it holds no triangle");
      continue;
    }
    const Mesh m = read_mesh(folder_ / file).mesh;
    EXPECT_EQ(m.triangles.size(), triangles);
    // The script cuts polygons into fans, and a PLY or STL of floats has the digits of floats.
    const double area = e["note"].get<std::string>().starts_with("concave") ? e["area"] : e["mesh_area"];
    EXPECT_NEAR(m.area(), area, 1e-6 * area);
    if (!e["mesh_volume"].is_number()) continue;
    EXPECT_NEAR(volume(m), e["mesh_volume"],
                1e-5 * std::abs(e["mesh_volume"].get<double>()) + 1e-15 * std::pow(area, 1.5));
  }
}

}  // namespace
}  // namespace padder
