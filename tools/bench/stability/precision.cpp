// SPDX-License-Identifier: GPL-3.0-or-later
// Error against time of float, exact and double on the hard scenes of precision_cases.h.
//   float   numbers rounded to float, float alone decides (Precision::float32), records in float
//   exact   numbers rounded to float, decided as in double, records in float
//   double  numbers as they are, decided as in double, records in double
// A pair is wrong if the list and the formula disagree about it for the numbers that the detector was given.
// What rounding the numbers to float changes is counted apart, against the contacts of the doubles. Normals
// and depths are compared with extended precision (64 bits) on the numbers given.
#include <algorithm>
#include <cmath>
#include <limits>

#include "padding/asset/error.h"
#include "tools/bench/bench.h"
#include "tools/bench/device.h"
#include "tools/bench/stability/precision_cases.h"

namespace padder::bench {
namespace {

using detect::Pair;
using detect::Sphere;

struct Mode {
  const char* name;
  detect::Scalar scalar;
  detect::Precision precision;
};
constexpr Mode kModes[] = {{"float", detect::Scalar::f32, detect::Precision::float32},
                           {"exact", detect::Scalar::f32, detect::Precision::exact},
                           {"double", detect::Scalar::f64, detect::Precision::exact}};

// A scene as the numbers of one mode, and its contacts.
struct Given {
  std::vector<Sphere> spheres;
  std::vector<Pair> pairs;
  std::vector<detect::FloatSphere> floats;
};

struct Row {
  std::string scene, hard, backend, mode, refused;
  std::uint64_t spheres = 0, contacts = 0, wrong = 0, by_rounding = 0, doubtful = 0;
  double depth_error = 0, normal_error = 0, seconds = 0;
  std::string hash;
};

bool before(const Pair& a, const Pair& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; }

// Pairs that are in one of the lists only; both are sorted.
std::uint64_t differing(const std::vector<Pair>& a, const std::vector<Pair>& b) {
  std::vector<Pair> only;
  std::set_symmetric_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(only), before);
  return only.size();
}

// The largest errors of the records: of the depth over the sum of the radii, and of the normal. A depth may
// be off by the distance of neighbouring denormal numbers, whatever that is to the radii.
template <class T>
void judge_records(const detect::Contacts& c, const std::vector<Sphere>& s, Row& row) {
  const auto normals = c.normal_span<T>();
  for (std::size_t k = 0; k < c.count; k++) {
    const Sphere &a = s[c.pairs[k].i], &b = s[c.pairs[k].j];
    const long double v[3] = {static_cast<long double>(b.x) - a.x, static_cast<long double>(b.y) - a.y,
                              static_cast<long double>(b.z) - a.z},
                      sum = static_cast<long double>(a.r) + b.r,
                      length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const long double wrong_by = std::abs(normals[k].depth - (sum - length));
    if (wrong_by > std::numeric_limits<T>::denorm_min())
      row.depth_error = std::max(row.depth_error, static_cast<double>(wrong_by / sum));
    const long double found[3] = {normals[k].x, normals[k].y, normals[k].z};
    long double off = 0;
    for (int axis = 0; axis < 3; axis++) {
      const long double right = length > 0 ? v[axis] / length : axis == 0;
      off += (found[axis] - right) * (found[axis] - right);
    }
    row.normal_error = std::max(row.normal_error, static_cast<double>(std::sqrt(off)));
  }
}

Row measure(const Settings& s, const PrecisionCase& c, const Given& given, const std::vector<Pair>& meant,
            detect::BackendKind backend, const Mode& mode) {
  Row row;
  row.scene = c.name, row.hard = c.hard, row.backend = name_of(backend);
  row.mode = mode.name;
  row.spheres = given.spheres.size();
  detect::Input input = input_of(given.floats);
  if (mode.scalar == detect::Scalar::f64) {
    input.spheres =
        detect::spheres_of<double>(given.spheres.size(), &given.spheres[0].x, &given.spheres[0].r);
    input.spheres.center_stride = input.spheres.radius_stride = 4;
  }
  detect::CallOptions o;
  o.threads = s.threads, o.precision = mode.precision, o.scalar = mode.scalar, o.bin_size = c.bin_size;
  detect::Detector detector({backend}, o);
  try {
    const detect::Contacts& found = detect_watched(detector, input);
    std::vector<Pair> pairs(found.pairs, found.pairs + found.count);
    std::sort(pairs.begin(), pairs.end(), before);
    row.contacts = found.count, row.doubtful = found.doubtful, row.hash = std::to_string(hash_of(pairs));
    row.wrong = differing(pairs, given.pairs), row.by_rounding = differing(given.pairs, meant);
    mode.scalar == detect::Scalar::f64 ? judge_records<double>(found, given.spheres, row)
                                       : judge_records<float>(found, given.spheres, row);
    row.seconds = median_seconds(s.repeat, [&] { detect_watched(detector, input); });
  } catch (const Error& e) {
    row.refused = e.what();
  }
  return row;
}

// Float alone may err about pairs that it names as doubtful, and nothing else may err. What does not fit into
// floats is refused.
bool right(const Row& r) {
  if (!r.refused.empty()) return r.mode != "double";
  const bool records = r.mode == "double" ? r.depth_error < 1e-14 && r.normal_error < 1e-14
                                          : r.depth_error < 1e-6 && r.normal_error < 1e-6;
  return records && r.wrong <= (r.mode == "float" ? r.doubtful : 0);
}

Json json_of(const Row& r) {
  return {{"scene", r.scene},
          {"hard", r.hard},
          {"backend", r.backend},
          {"mode", r.mode},
          {"spheres", r.spheres},
          {"contacts", r.contacts},
          {"wrong", r.wrong},
          {"doubtful", r.doubtful},
          {"by_rounding", r.by_rounding},
          {"depth_error", r.depth_error},
          {"normal_error", r.normal_error},
          {"seconds", r.seconds},
          {"refused", r.refused},
          {"hash", r.hash},
          {"right", right(r)}};
}

// One row of the table: the three modes of a scene side by side.
Json cells_of(const std::vector<Row>& modes) {
  const auto joined = [&](const std::function<std::string(const Row&)>& cell) {
    std::string out;
    for (const Row& r : modes)
      out += (out.empty() ? "" : " / ") + (r.refused.empty() ? cell(r) : std::string("refused"));
    return out;
  };
  const auto wrong = [](const Row& r) { return std::to_string(r.wrong) + (right(r) ? "" : " **wrong**"); };
  return {modes[0].scene,
          modes[0].hard,
          modes[0].backend,
          joined([](const Row& r) { return std::to_string(r.contacts); }),
          joined(wrong),
          std::to_string(modes[0].by_rounding),
          joined([](const Row& r) { return number(r.depth_error, "%.0e"); }),
          joined([](const Row& r) { return number(r.normal_error, "%.0e"); }),
          joined([](const Row& r) { return number(r.seconds * 1e3, "%.3g"); })};
}

}  // namespace

Json precision(const Settings& s) {
  const std::uint64_t spheres = size_or(s, 1000000);
  Json rows = Json::array(),
       table = Json::array({{"scene", "what is hard", "backend", "contacts: float / exact / double", "wrong",
                             "by rounding", "depth error", "normal error", "ms"}});
  bool passed = true;
  for (PrecisionCase& c : precision_cases(static_cast<std::uint32_t>(std::lround(std::cbrt(spheres))))) {
    if (!s.scene.empty() && s.scene != c.name) continue;
    say(s, c.name);
    Given floats{rounded(c.spheres), {}, {}}, doubles{c.spheres, {}, {}};
    for (const Sphere& p : floats.spheres)
      floats.floats.push_back({static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z),
                               static_cast<float>(p.r)});
    floats.pairs = all_contacts(floats.spheres, c.lattice);
    doubles.pairs = all_contacts(doubles.spheres, c.lattice);
    for (const detect::BackendKind backend : backends(s)) {
      std::vector<Row> modes;
      for (const Mode& mode : kModes) {
        modes.push_back(measure(s, c, mode.scalar == detect::Scalar::f32 ? floats : doubles, doubles.pairs,
                                backend, mode));
        passed = passed && right(modes.back());
        rows.push_back(json_of(modes.back()));
      }
      table.push_back(cells_of(modes));
    }
  }
  if (rows.empty()) wrong_usage("no scene of bench precision is called '" + s.scene + "'");
  return {{"bench", "precision"}, {"machine", machine()}, {"device", device_name()}, {"threads", s.threads},
          {"passed", passed},     {"rows", rows},         {"table", table}};
}

}  // namespace padder::bench
