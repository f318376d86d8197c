// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/robot.h"

#include <algorithm>
#include <cstdio>

#include "padding/asset/cluster.h"

namespace padder {

using Json = nlohmann::ordered_json;

Json run_robot(const RobotJob& job, const RobotProgress& progress) {
  const PaddedRobot robot = pad_robot(job.urdf, job.options, progress);
  auto warnings = write_model(robot.model, job.output, *job.format, job.exporting);
  for (const PadReport& report : robot.reports)
    warnings.insert(warnings.end(), report.warnings.begin(), report.warnings.end());
  Json links = Json::array();
  for (std::size_t k = 0; k < robot.model.bodies.size(); k++) {
    const Cluster& c = robot.model.bodies[k].cluster;
    if (c.size() == 0) continue;
    if (job.clusters) {
      std::string file = c.name;
      std::replace(file.begin(), file.end(), '/', '_');
      write_cluster(c, job.output.parent_path() / (file + ".spheres.json"));
    }
    links.push_back(
        {{"link", c.name},
         {"spheres", c.size()},
         {"family", c.family},
         {"mask", c.mask},
         {"diagonal", c.bounds.diagonal()},
         {"repair", c.source.repair},
         {"within", robot.reports[k].within},
         {"reason", robot.reports[k].reason.empty() ? Json(nullptr) : Json(robot.reports[k].reason)},
         {"accuracy", Json::parse(to_json(c.accuracy))},
         {"seconds", robot.reports[k].seconds.total()}});
  }
  return {{"input", job.urdf.string()},
          {"output", job.output.string()},
          {"robot", robot.model.name},
          {"spheres", robot.model.spheres()},
          {"links", links},
          {"notes", robot.notes},
          {"warnings", warnings}};
}

void print_robot(const Json& report) {
  std::printf("%s: robot %s, %zu links padded\n", report["input"].get<std::string>().c_str(),
              report["robot"].get<std::string>().c_str(), report["links"].size());
  for (const Json& link : report["links"]) {
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
  std::printf("  %zu spheres in all; wrote %s\n", report["spheres"].get<std::size_t>(),
              report["output"].get<std::string>().c_str());
}

}  // namespace padder
