// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/convert.h"

#include <cstdio>

#include "padding/asset/error.h"
#include "padding/import/import.h"
#include "tools/streams.h"

namespace padder {

using Json = nlohmann::ordered_json;

namespace {

// Formats that list the spheres of each link in the link's own frame, and place no link.
bool places_no_link(const OutputFile& file) {
  return file.is("curobo") || file.is("xrdf") || file.is("srdf");
}

void write(const SphereModel& spheres, const std::string& input, const OutputFile& file, double density,
           std::vector<std::string>& warnings) {
  const Model& model = spheres.model;
  if (!file.format) {
    if (model.bodies.size() > 1)
      throw Error(input + " holds " + std::to_string(model.bodies.size()) +
                  " parts, and a .spheres.json is one: write .npz, .vtp or .yaml");
    write_cluster(model.bodies[0].cluster, file.path);
    return;
  }
  if (spheres.links && !places_no_link(file))
    throw Error("of " + input + " the spheres of its " + std::to_string(model.bodies.size()) +
                " links are read, but not where the links are, which " + file.path.string() +
                " must say: convert the robot's URDF with the spheres, or write .yaml, .xrdf or .srdf");
  if (spheres.links && !file.is("srdf"))  // which holds no joints
    warnings.push_back("the joints, the base and the tool of " + input + " are not read: set them in " +
                       file.path.string() + ", or convert the robot's URDF");
  if (file.format->in_metres && model.unit.empty())
    warnings.push_back(input + " does not say its unit, so " + file.path.string() +
                       " takes its lengths for metres: name the unit with --unit");
  for (auto& sentence : write_model(model, file.path, *file.format, {density}))
    warnings.push_back(std::move(sentence));
}

// What --scale, --unit, --family and --mask ask for. Lengths whose unit is not known are taken to be in
// --unit.
void change(Model& model, const PadArguments& a) {
  const std::string unit = a.unit.empty() ? model.unit : a.unit;
  const double to_unit = model.unit.empty() || unit == model.unit ? 1 : metres(model.unit) / metres(unit);
  if (a.scale != 1 || unit != model.unit) model = scaled(std::move(model), a.scale * to_unit, unit);
  for (Body& body : model.bodies) {
    if (a.family_given) body.cluster.family = a.options.family;
    if (a.mask_given) body.cluster.mask = a.options.mask;
  }
}

}  // namespace

Json run_convert(const PadArguments& a, const std::string& input, const PadTarget& target) {
  SphereModel spheres = read_sphere_model(input);
  Model& model = spheres.model;
  change(model, a);
  NewFolders folders;
  target.make(folders);
  std::vector<std::string> warnings;
  if (spheres.switched_off > 0)
    warnings.push_back(counted(spheres.switched_off, "sphere") + " of " + input +
                       " without a radius, which cuRobo switches off so, left out");
  Json outputs = Json::array();
  for (const OutputFile& file : target.in_writing_order()) write(spheres, input, file, a.density, warnings);
  const auto has_levels = [](const Body& body) { return !body.cluster.lods.empty(); };
  target.tell_levels_left_out(std::ranges::any_of(model.bodies, has_levels), warnings);
  for (const OutputFile& file : target.outputs) outputs.push_back(file.path.string());
  return {{"input", cli::StreamFiles::spoken(input)},
          {"output", outputs[0]},
          {"outputs", outputs},
          {"parts", model.bodies.size()},
          {"spheres", model.spheres()},
          {"warnings", warnings}};
}

void print_convert(const Json& report) {
  std::printf("%s: %s, not padded again\n", report["input"].get<std::string>().c_str(),
              counted(report["spheres"], "sphere").c_str());
  for (const Json& output : report["outputs"]) std::printf("  wrote %s\n", output.get<std::string>().c_str());
}

}  // namespace padder
