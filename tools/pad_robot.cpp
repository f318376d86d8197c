#include "tools/pad_robot.h"

#include <algorithm>
#include <cstdio>

#include "padding/cluster.h"

namespace padder {

using Json = nlohmann::ordered_json;

Json run_robot(const RobotJob& job, const RobotProgress& progress) {
  const PaddedRobot robot = pad_robot(job.urdf, job.options, progress);
  write_model(robot.model, job.output, *job.format, job.exporting);
  Json links = Json::array();
  for (std::size_t k = 0; k < robot.model.bodies.size(); k++) {
    const Cluster& c = robot.model.bodies[k].cluster;
    if (c.size() == 0) continue;
    if (job.clusters) {
      std::string file = c.name;
      std::replace(file.begin(), file.end(), '/', '_');
      write_cluster(c, job.output.parent_path() / (file + ".spheres.json"));
    }
    links.push_back({{"link", c.name},
                     {"spheres", c.size()},
                     {"family", c.family},
                     {"mask", c.mask},
                     {"diagonal", c.bounds.diagonal()},
                     {"repair", c.source.repair},
                     {"accuracy", Json::parse(to_json(c.accuracy))},
                     {"seconds", robot.reports[k].seconds.total()}});
  }
  return {{"input", job.urdf.string()},
          {"output", job.output.string()},
          {"robot", robot.model.name},
          {"spheres", robot.model.spheres()},
          {"links", links},
          {"notes", robot.notes}};
}

void print_robot(const Json& report) {
  std::printf("%s: robot %s, %zu links padded\n", report["input"].get<std::string>().c_str(),
              report["robot"].get<std::string>().c_str(), report["links"].size());
  for (const Json& link : report["links"]) {
    const double diagonal = link["diagonal"];
    std::printf("  %-24s %6zu spheres; protrusion at most %.3f %%, gap at most %.3f %% of %g m; family %u\n",
                link["link"].get<std::string>().c_str(), link["spheres"].get<std::size_t>(),
                100 * link["accuracy"]["protrusion_max"].get<double>() / diagonal,
                100 * link["accuracy"]["gap_max"].get<double>() / diagonal, diagonal,
                link["family"].get<unsigned>());
  }
  for (const Json& note : report["notes"]) std::printf("  note: %s\n", note.get<std::string>().c_str());
  std::printf("  %zu spheres in all; wrote %s\n", report["spheres"].get<std::size_t>(),
              report["output"].get<std::string>().c_str());
}

}  // namespace padder
