// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/pad/arguments.h"

#include <algorithm>
#include <set>

#include "padding/input/read.h"
#include "tools/arguments.h"
#include "tools/cli.h"
#include "tools/colour_option.h"

namespace padder {

// CLI11 finds this function by its argument's namespace.
bool lexical_cast(const std::string& text, Length& out) {
  const auto length =
      text == "0" ? Length::of(0) : length_of(text);  // where 0 is no length, a check refuses it
  if (length) out = *length;
  return length.has_value();
}

namespace {

using namespace cli;

// "obj stl ply …"
std::string mesh_endings_text() {
  std::string endings;
  for (const auto& e : mesh_endings()) endings += (endings.empty() ? "" : " ") + e.substr(1);
  return endings;
}

std::string format_names_text() {
  std::string names;
  for (const auto& f : formats()) names += std::string(" ") + f.name;
  return names;
}

// Of "2%,1%,0.5%"; nothing where one of them is no length.
std::optional<std::vector<Length>> lengths_of(std::string_view text) {
  std::vector<Length> lengths;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const auto length = length_of(text.substr(at, end - at));
    if (!length) return std::nullopt;
    lengths.push_back(*length), at = end + 1;
  }
  return lengths;
}

CLI::Validator mesh_ending() {
  return accepting([](auto& text) { return std::ranges::count(mesh_endings(), "." + text) > 0; },
                   "format of a mesh: write one of the endings that MESH takes, as stl");
}

// An option that takes a length.
template <class Value>
void add_length(CLI::App& app, const char* name, Value& value, const char* what,
                const CLI::Validator& check = length()) {
  app.add_option(name, value, what)->type_name("LENGTH")->check(check);
}

// What is read and what is written. --help lists options in the order in which they are declared.
void declare_files(CLI::App& app, PadArguments& a) {
  app.add_option(
      "MESH", a.meshes,
      "mesh files (" + mesh_endings_text() +
          "), robots (urdf, xacro, MuJoCo's xml), or files of spheres, which are converted. Or folders of "
          "meshes, and patterns in quotes: then as with --manifest. - reads one from stdin");
  app.add_option("-o", a.outputs,
                 "file to write, its ending tells the format (docs/formats.md), or folder for several "
                 "(default: NAME.spheres.json here). Again for each further format. - writes to stdout")
      ->allow_extra_args(false)
      ->type_name("FILE|DIR");
  app.add_option("--format", a.format,
                 "another program's format, where the ending does not tell:" + format_names_text())
      ->type_name("NAME");
  app.add_option("--input-format", a.input_format, "of MESH -, which is read from stdin: stl, obj, ply ...")
      ->check(mesh_ending())
      ->type_name("NAME");
  app.add_option("--density", a.density,
                 "for the mass that is printed, and for formats that state one (default: 1000, kg/m^3 if the "
                 "unit is known)")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
}

// How the spheres are chosen: by depth ratio, by tolerance, or by number.
void declare_spheres(CLI::App& app, PadArguments& a) {
  app.add_option("--depth", a.options.depth_ratio,
                 "one sphere a triangle: cap height over circumradius, 1e-6 to 1 (default: 0.2)")
      ->check(decimal())
      ->check(CLI::Range(1e-6, 1.));
  add_length(app, "--edge-length", a.options.edge_length,
             "of the remeshed triangles: in the mesh's unit, or a share of its diagonal as 2%");
  add_length(app, "--tolerance", a.options.tolerance,
             "the fewest spheres with protrusion and gap proved to be within it; with --depth: thin those");
  add_length(app, "--protrusion", a.options.protrusion,
             "no sphere stands out of the body by more; 0: none does at all. With --gap or --tolerance",
             length_or_zero());
  add_length(
      app, "--gap", a.options.gap,
      "no surface lies farther outside the spheres; 0: all of the body is inside them. With --protrusion "
      "or --tolerance",
      length_or_zero());
  add_whole(app, "--max-spheres", a.options.max_spheres, "the smallest error that so many spheres can keep",
            1, 0xffffffff);
  add_length(app, "--max-radius", a.options.max_radius, "no larger sphere");
  add_length(app, "--min-radius", a.options.min_radius,
             "no smaller sphere, even where the tolerance asks for it");
  app.add_option("--balance", a.options.balance,
                 "within the tolerance: none (fewest, the default), volume (of the union as the mesh's), "
                 "mean (smallest means)")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Balance>(std::begin(kBalances), std::end(kBalances))))
      ->type_name("WHAT");
  app.add_option("--smooth", a.options.smooth, "mean normal error asked for, degrees")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
  add_whole(app, "--effort", a.options.effort, "0 to 3: search longer for fewer spheres", 0, 3)
      ->capture_default_str();
  app.add_flag("--lower-bound", a.options.lower_bound,
               "also prove how few spheres could do: some seconds more");
  add_length(app, "--reach", a.options.min_grain_radius,
             "radius of the smallest grain: what it cannot touch is not padded");
  // One text, and no list of CLI11's, which leaves out what is empty and then takes the next word.
  app.add_option_function<std::string>(
         "--lod", [&a](const std::string& text) { a.options.lod = lengths_of(text).value(); },
         "a ladder of tolerances in one asset, as 2%,1%,0.5%")
      ->type_name("LENGTHS")
      ->check(accepting([](auto& text) { return lengths_of(text).has_value(); },
                        "list of lengths: write some with commas between them, as 2%,1%,0.5%"));
}

// What happens to the surface first, and what the asset says of itself.
void declare_asset(CLI::App& app, PadArguments& a) {
  app.add_option("--sharp-angle", a.options.sharp_angle, "keep edges whose faces turn by more degrees")
      ->capture_default_str()
      ->check(decimal())
      ->check(CLI::Range(1., 180.));
  app.add_option("--repair", a.options.repair, "auto (the default), union, fill, sheet, never or wrap")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, RepairMode>(std::begin(kRepairModes), std::end(kRepairModes))))
      ->type_name("MODE");
  add_length(app, "--thickness", a.options.thickness, "of sheets, half on either side (default 0)");
  add_whole(app, "--family", a.options.family, "of the asset: no contact inside a family; 0 is none")
      ->each([&a](const std::string&) { a.family_given = true; });
  app.add_option("--mask", a.options.mask, "bit k: no contact with family k + 1")
      ->check(bits())
      ->each([&a](const std::string&) { a.mask_given = true; });
  app.add_flag("--force", a.options.force,
               "take lengths that can hardly be meant, as a tolerance beyond half the thinnest extent");
}

// Of robots alone.
void declare_robot(CLI::App& app, PadArguments& a) {
  add_whole(
      app, "--robot-spheres", a.robot.max_spheres,
      "of a robot: the smallest tolerance, the same for all links, that so many spheres in all can keep", 1);
  app.add_flag("--visual", a.robot.reading.visual,
               "of a robot: pad the visual geometry, not the collision geometry");
  app.add_option("--package-path", a.robot.reading.package_folders,
                 "of a robot: a folder where package:// is looked for first; may be given again")
      ->allow_extra_args(false)
      ->type_name("DIR");
  app.add_option("--xacro", a.robot.reading.xacro,
                 "of a .xacro: an argument of the robot, as dof:=7; may be given again")
      ->allow_extra_args(false)
      ->type_name("NAME:=VALUE");
  add_whole(app, "--self-collision", a.robot.poses,
            "of a robot: random poses that are tried for links that never or always touch; 0: none", 0,
            100000000)
      ->capture_default_str();
  app.add_option("--joint", a.joints, "of a robot in --preview: where a joint stands, in radians or metres")
      ->allow_extra_args(false)
      ->type_name("NAME=VALUE");
}

// The unit of the asset, and what a part of a manifest may take.
void declare_limits(CLI::App& app, PadArguments& a) {
  app.add_option("--scale", a.scale, "factor on every coordinate")
      ->check(decimal())
      ->check(CLI::PositiveNumber);
  app.add_option("--unit", a.unit, "m, cm, mm or in: the unit of the asset")
      ->type_name("UNIT")
      ->check(CLI::IsMember({"m", "cm", "mm", "in"}));
  app.add_option("--seconds", a.seconds,
                 "that each part of a manifest may take (3600 unless given), or a call without one (any time "
                 "unless given); 0: any time")
      ->check(decimal())
      ->check(CLI::NonNegativeNumber);
  app.add_option("--memory", a.memory,
                 "that each part of a manifest may hold, or a call without one, as 2G or 512M (default: the "
                 "machine's, divided by the workers)")
      ->check(bytes())
      ->type_name("BYTES");
}

void declare_run(CLI::App& app, PadArguments& a) {
  app.add_option(
         "--manifest", a.manifest,
         "pad the parts that FILE lists, one a line with its own options; - reads the list from stdin. "
         "Each in a process of its own, into the tree below the folder -o; again: only what is missing "
         "or changed")
      ->type_name("FILE");
  app.add_option("--shard", a.shard, "only the I-th of N portions of the parts, as 3/8")->type_name("I/N");
  add_whole(app, "--workers", a.workers, "parts padded at once (default: one for each processor)", 1,
            kMostThreads);
  app.add_flag("--page", a.page,
               "write index.html into the folder: every part with a picture and its figures");
}

void declare_output(CLI::App& app, PadArguments& a) {
  app.add_option("--write-mesh", a.write_mesh,
                 "write the surface that the spheres were made on, whose faces spheres.triangle counts: .obj "
                 ".off .ply .stl, or a folder for NAME.surface.obj")
      ->type_name("FILE|DIR");
  app.add_option("--preview", a.preview,
                 "show mesh and spheres: a page (.html) or a picture (.png); or a folder for NAME.png")
      ->type_name("FILE|DIR");
  cli::add_colour(
      app, a.colour,
      "of --preview: by family (the default), radius, protrusion, gap or triangle; the errors also "
      "on the mesh");
  add_whole(app, "--threads", a.threads,
            "threads to use, 1 to 1024; with a manifest, for each part (default: all)", 1, kMostThreads);
  app.add_flag("--json", a.json, "print one JSON document on stdout");
  app.add_flag("-q", a.quiet, "print nothing but errors");
  app.add_flag("-v", a.verbose, "print the seconds of each step on stderr");
  app.set_version_flag("--version", "pad (padder) " PADDER_VERSION);
}

}  // namespace

void declare_part(CLI::App& app, PadArguments& a) {
  declare_files(app, a);
  declare_spheres(app, a);
  declare_asset(app, a);
  declare_robot(app, a);
  declare_limits(app, a);
}

void declare_all(CLI::App& app, PadArguments& a) {
  declare_part(app, a);
  declare_run(app, a);
  declare_output(app, a);
}

std::map<std::string, std::string> settings_of(const CLI::App& app) {
  // An option that is not named here counts: an asset made again for nothing is better than an old one kept.
  static const std::set<std::string> others = {
      "MESH",      "-o",           "--seconds", "--memory", "--manifest", "--shard",        "--page",
      "--workers", "--write-mesh", "--preview", "--joint",  "--colour",   "--input-format", "-v",
      "--json",    "-q",           "--threads", "--help",   "--version"};
  std::map<std::string, std::string> settings;
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0 || others.contains(option->get_name())) continue;
    std::string& value = settings[option->get_name()];
    for (const std::string& word : option->results()) value += (value.empty() ? "" : ",") + word;
  }
  return settings;
}

}  // namespace padder
