// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/robot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "padding/asset/cluster.h"
#include "padding/asset/error.h"
#include "padding/asset/excerpt.h"
#include "padding/view/page.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/streams.h"

namespace padder {

using Json = nlohmann::ordered_json;

namespace {

// Which pairs are kept apart, counted by the reason.
Json pairs_json(const Model& model) {
  std::map<std::string, std::size_t> counts{{"Adjacent", 0}, {"Default", 0}, {"Always", 0}, {"Never", 0}};
  for (const Apart& p : model.apart) counts[p.reason]++;
  return counts;
}

// Throws Error, which begins with `where`, if the joint cannot be placed there.
void check_place(const std::string& where, const Model& model, const std::string& name, double value) {
  const Joint& joint =
      std::ranges::find(model.bodies, name, [](const Body& b) { return b.joint.name; })->joint;
  if (!joint.mimic.empty()) throw Error(where + "it follows the joint " + joint.mimic + ": place that one");
  if (!joint.moves_one_way())
    throw Error(where + "it moves in more than one way, and one number does not place it");
  if (joint.limited() && (value < joint.lower || value > joint.upper))
    throw Error(where + "its limits are from " + short_number(joint.lower, 9) + " to " +
                short_number(joint.upper, 9) + (joint.turns() ? " radians" : " metres"));
}

// Where joints stand, in radians or metres; 0 where not named.
using Places = std::map<std::string, double>;

// Of --joint.
Places places_of(const std::string& file, const Model& model, const std::vector<std::string>& joints) {
  std::vector<std::string> names;
  for (const Body& b : model.bodies)
    if (b.joint.type != Joint::Type::fixed) names.push_back(b.joint.name);
  Places places;
  for (const std::string& joint : joints) {
    const std::size_t at = std::min(joint.rfind('='), joint.size());
    const auto value = cli::number_of<double>(std::string_view(joint).substr(std::min(at + 1, joint.size())));
    if (!value || !std::isfinite(*value))
      throw cli::UsageError("--joint takes NAME=VALUE, as elbow=1.57, not \"" + joint + '"');
    const std::string name = joint.substr(0, at);
    if (!std::ranges::count(names, name))
      throw Error(file + ": --joint: it has no joint " + name + " that moves; " +
                  (names.empty() ? "none does" : "its joints are " + cli::listed(names)));
    check_place(file + ": --joint " + name + ": ", model, name, *value);
    places[name] = *value;
  }
  return places;
}

// The robot's spheres and meshes as one body, where its joints stand.
View view_of(const PaddedRobot& robot, Places& places) {
  std::vector<double> values;
  for (const Body& b : robot.model.bodies) values.push_back(places[b.joint.name]);
  const auto poses = poses_at(robot.model, values);
  Cluster all;
  Mesh mesh;
  std::vector<std::uint32_t> family;
  all.name = robot.model.name, all.unit = robot.model.unit;
  for (std::size_t k = 0; k < poses.size(); k++) {
    const Cluster& c = robot.model.bodies[k].cluster;
    for (std::size_t s = 0; s < c.size(); s++) {
      all.centers.push_back(poses[k] * c.centers[s]), all.radii.push_back(c.radii[s]);
      all.triangle.push_back(-1), family.push_back(c.family);
      all.bounds.add_ball(all.centers.back(), c.radii[s]);
    }
    Mesh link = robot.meshes[k];
    for (Point& p : link.points) p = poses[k] * p;
    mesh.add(link);
  }
  View view = view_of(all, mesh);
  view.family = std::move(family);
  return view;
}

}  // namespace

std::filesystem::path link_file(const std::filesystem::path& folder, const std::string& link) {
  std::string file = link;
  std::replace(file.begin(), file.end(), '/', '_');
  return folder / (file + ".spheres.json");
}

Json run_robot(const PadArguments& a, const std::string& file, const PadTarget& target,
               const PadProgress& progress) {
  if (a.scale != 1 || (!a.unit.empty() && a.unit != "m"))
    throw Error(file + ": the file of a robot is in metres: leave out --scale and --unit");
  RobotTree read = target.robot.get();
  // What could not be done once the links are padded is refused before.
  Places places = places_of(file, read.model, a.joints);
  keep_neighbours_apart(read);
  for (const OutputFile& output : target.outputs) check_filters(read.model, *output.format);
  const PaddedRobot robot = pad_robot(file, target.robot.get(), a.options, a.robot, progress);
  std::vector<std::string> warnings;
  ExportOptions exported{.density = a.density};
  for (const OutputFile& output : target.outputs)
    if (output.is("urdf")) exported.urdf = output.path.filename().string();
  NewFolders folders;
  target.make(folders);
  for (const OutputFile& output : target.in_writing_order())
    for (auto& sentence : write_model(robot.model, output.path, *output.format, exported))
      warnings.push_back(std::move(sentence));
  for (const PadReport& report : robot.reports)
    warnings.insert(warnings.end(), report.warnings.begin(), report.warnings.end());
  const auto has_levels = [](const Body& body) { return !body.cluster.lods.empty(); };
  target.tell_levels_left_out(!target.in_folder && std::ranges::any_of(robot.model.bodies, has_levels),
                              warnings);
  if (!target.preview.empty()) write_preview(view_of(robot, places), target.preview, a.colour);
  Json links = Json::array();
  for (std::size_t k = 0; k < robot.model.bodies.size(); k++) {
    const Cluster& c = robot.model.bodies[k].cluster;
    if (c.size() == 0) continue;
    if (target.in_folder) write_cluster(c, link_file(target.outputs[0].path.parent_path(), c.name));
    const bool kept = robot.kept[k] != 0;  // nothing was padded, so that there is nothing to measure against
    links.push_back(
        {{"link", c.name},
         {"spheres", c.size()},
         {"family", c.family},
         {"mask", c.mask},
         {"diagonal", c.bounds.diagonal()},
         {"kept", kept},
         {"repair", c.source.repair},
         {"within", kept ? Json(nullptr) : Json(robot.reports[k].within)},
         {"reason", robot.reports[k].reason.empty() ? Json(nullptr) : Json(robot.reports[k].reason)},
         {"accuracy", kept ? Json(nullptr) : Json::parse(to_json(c.accuracy))},
         {"seconds", robot.reports[k].seconds.total()}});
  }
  Json outputs = Json::array();
  for (const OutputFile& output : target.outputs) outputs.push_back(output.path.string());
  return {{"input", cli::StreamFiles::spoken(file)},
          {"output", outputs[0]},
          {"outputs", outputs},
          {"robot", robot.model.name},
          {"spheres", robot.model.spheres()},
          {"tolerance", robot.tolerance > 0 ? Json(robot.tolerance) : Json(nullptr)},
          {"pairs_apart", pairs_json(robot.model)},
          {"links", links},
          {"notes", robot.notes},
          {"warnings", warnings}};
}

void print_robot(const Json& report) {
  std::printf("%s: robot %s, links padded: %zu\n", report["input"].get<std::string>().c_str(),
              report["robot"].get<std::string>().c_str(), report["links"].size());
  for (const Json& link : report["links"]) {
    if (link["kept"]) {
      std::printf("  %-24s %6zu spheres, as they were in the file: not measured; family %u\n",
                  link["link"].get<std::string>().c_str(), link["spheres"].get<std::size_t>(),
                  link["family"].get<unsigned>());
      continue;
    }
    const double diagonal = link["diagonal"];
    const Json& accuracy = link["accuracy"];
    const Json& against = accuracy["proved_against"];
    const std::string basis = against == "input"    ? "proved"
                              : against == "filled" ? "proved with its holes filled"
                              : against == "wrap"   ? "the largest samples, proved against a wrap only"
                                                    : "not proved";
    std::printf("  %-24s %6zu spheres; protrusion %.3f %%, gap %.3f %% of %g m at most (%s); family %u%s\n",
                link["link"].get<std::string>().c_str(), link["spheres"].get<std::size_t>(),
                100 * accuracy["protrusion_max"].get<double>() / diagonal,
                100 * accuracy["gap_max"].get<double>() / diagonal, diagonal, basis.c_str(),
                link["family"].get<unsigned>(), link["within"] ? "" : "; beyond the tolerance");
  }
  for (const Json& note : report["notes"]) std::printf("  note: %s\n", note.get<std::string>().c_str());
  const Json& apart = report["pairs_apart"];
  std::printf(
      "  pairs of links that are not tested: %zu adjacent, %zu touch at first, %zu always, %zu never\n",
      apart["Adjacent"].get<std::size_t>(), apart["Default"].get<std::size_t>(),
      apart["Always"].get<std::size_t>(), apart["Never"].get<std::size_t>());
  if (!report["tolerance"].is_null())
    std::printf("  tolerance of all links: %g m\n", report["tolerance"].get<double>());
  std::printf("  %zu spheres in all\n", report["spheres"].get<std::size_t>());
  for (const Json& output : report["outputs"]) std::printf("  wrote %s\n", output.get<std::string>().c_str());
}

}  // namespace padder
