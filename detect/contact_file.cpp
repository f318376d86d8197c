#include "detect/contact_file.h"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <string>

#include "padding/error.h"
#include "padding/file.h"
#include "padding/npz.h"
#include "padding/vtp.h"

namespace padder::detect {
namespace {

template <class T>
void append(std::string& out, T value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  out.append(text, end);
}

std::string csv(const ContactTable& t) {
  std::string out = "i,j,nx,ny,nz,depth,ix,iy,iz,jx,jy,jz\n";
  for (std::size_t k = 0; k < t.pairs.size(); k++) {
    append(out, t.pairs[k].i), out += ',', append(out, t.pairs[k].j);
    const Normal<double>& n = t.normals[k];
    const Points<double>& p = t.points[k];
    for (const double v :
         {n.x, n.y, n.z, n.depth, p.on_i[0], p.on_i[1], p.on_i[2], p.on_j[0], p.on_j[1], p.on_j[2]})
      out += ',', append(out, v);
    out += '\n';
  }
  return out;
}

std::string npz(const ContactTable& t) {
  const std::uint64_t n = t.pairs.size();
  std::vector<std::uint32_t> pairs;
  std::vector<double> normals, depths, points_i, points_j;
  for (std::size_t k = 0; k < n; k++) {
    pairs.insert(pairs.end(), {t.pairs[k].i, t.pairs[k].j});
    normals.insert(normals.end(), {t.normals[k].x, t.normals[k].y, t.normals[k].z});
    depths.push_back(t.normals[k].depth);
    points_i.insert(points_i.end(), t.points[k].on_i, t.points[k].on_i + 3);
    points_j.insert(points_j.end(), t.points[k].on_j, t.points[k].on_j + 3);
  }
  return npz_bytes({{"pairs", npy_array(pairs.data(), {n, 2})},
                    {"normals", npy_array(normals.data(), {n, 3})},
                    {"depths", npy_array(depths.data(), {n})},
                    {"points_i", npy_array(points_i.data(), {n, 3})},
                    {"points_j", npy_array(points_j.data(), {n, 3})}});
}

std::string vtp(const ContactTable& t) {
  std::vector<Point> halfway;
  std::vector<double> normals, depths;
  std::vector<std::uint32_t> i, j;
  for (std::size_t k = 0; k < t.pairs.size(); k++) {
    const Points<double>& p = t.points[k];
    halfway.push_back(0.5 *
                      (Point(p.on_i[0], p.on_i[1], p.on_i[2]) + Point(p.on_j[0], p.on_j[1], p.on_j[2])));
    normals.insert(normals.end(), {t.normals[k].x, t.normals[k].y, t.normals[k].z});
    depths.push_back(t.normals[k].depth), i.push_back(t.pairs[k].i), j.push_back(t.pairs[k].j);
  }
  VtpWriter v(std::move(halfway));
  v.add("i", i), v.add("j", j), v.add("normal", normals, 3), v.add("depth", depths);
  return v.bytes();
}

}  // namespace

ContactTable sorted_table(const Contacts& c) {
  if (c.memory != Memory::host || c.width != Width::points || c.scalar != Scalar::f64)
    throw Error("a table of contacts is made of double records with both points in host memory");
  std::vector<std::uint64_t> order(c.count);
  std::iota(order.begin(), order.end(), std::uint64_t(0));
  std::sort(order.begin(), order.end(), [&](std::uint64_t a, std::uint64_t b) {
    return c.pairs[a].i != c.pairs[b].i ? c.pairs[a].i < c.pairs[b].i : c.pairs[a].j < c.pairs[b].j;
  });
  ContactTable t;
  t.pairs.reserve(c.count), t.normals.reserve(c.count), t.points.reserve(c.count);
  for (const std::uint64_t k : order)
    t.pairs.push_back(c.pairs[k]), t.normals.push_back(c.normal_span<double>()[k]),
        t.points.push_back(c.point_span<double>()[k]);
  return t;
}

void check_contact_ending(const std::filesystem::path& path) {
  const auto ending = path.extension();
  if (ending != ".csv" && ending != ".npz" && ending != ".vtp")
    throw Error("cannot tell the format of " + path.string() +
                ": contacts are written as .csv, .npz or .vtp");
}

void write_contacts(const ContactTable& table, const std::filesystem::path& path) {
  check_contact_ending(path);
  const auto ending = path.extension();
  write_file(path, ending == ".csv" ? csv(table) : ending == ".npz" ? npz(table) : vtp(table));
}

}  // namespace padder::detect
