// SPDX-License-Identifier: GPL-3.0-or-later
// Writes the parts in assets/, or the same with other dimensions.
#include <iostream>

#include "assets/parts.h"
#include "assets/solid.h"
#include "padding/asset/error.h"
#include "padding/asset/file.h"
#include "tools/arguments.h"
#include "tools/cli.h"

namespace {

// Dimensions that make no part are wrong usage.
template <class Make>
padder::Mesh made(const CLI::App* part, const Make& make) {
  try {
    return make();
  } catch (const padder::Error& e) {
    throw padder::cli::UsageError(part->get_name() + ": " + e.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  using namespace padder;
  using cli::add_whole;
  CLI::App app(
      "Examples:\n"
      "  make_assets                                           the four parts, as assets/ holds them\n"
      "  make_assets -o parts track_shoe --pitch 0.2 --lugs 9  one of them, with other dimensions\n\n"
      "Writes NAME.obj; lengths in metres. PART --help lists its dimensions.\n",
      "make_assets");
  app.set_version_flag("--version", "make_assets (padder) " PADDER_VERSION);
  app.option_defaults()->always_capture_default();
  std::string folder = ".";
  app.add_option("-o,--out", folder, "folder to write to")->type_name("DIR");
  app.require_subcommand(0);
  app.fallthrough();

  assets::TrackShoe shoe;
  auto* track_shoe = app.add_subcommand("track_shoe", "a single-pin track shoe");
  track_shoe->add_option("--pitch", shoe.pitch, "from pin to pin");
  track_shoe->add_option("--width", shoe.width, "along the pins");
  track_shoe->add_option("--bore", shoe.bore, "diameter of the pin's hole");
  track_shoe->add_option("--boss", shoe.boss, "outer diameter of a lug");
  track_shoe->add_option("--plate", shoe.plate, "thickness of the body");
  track_shoe->add_option("--grouser", shoe.grouser, "height of the grousers");
  track_shoe->add_option("--horn", shoe.horn, "height of the guide horn");
  add_whole(*track_shoe, "--lugs", shoe.lugs, "front and rear together", 2, 25);
  add_whole(*track_shoe, "--segments", shoe.segments, "of a full circle", 12, 360);

  assets::RoadWheel wheel;
  auto* road_wheel = app.add_subcommand("road_wheel", "a rubber-tyred disc wheel");
  road_wheel->add_option("--radius", wheel.radius, "of the tyre");
  road_wheel->add_option("--width", wheel.width, "of the rim");
  road_wheel->add_option("--bore", wheel.bore, "diameter of the hub's hole");
  add_whole(*road_wheel, "--bolts", wheel.bolts, "holes in the hub", 0, 12);
  add_whole(*road_wheel, "--windows", wheel.windows, "holes in the disc", 0, 8);
  add_whole(*road_wheel, "--segments", wheel.segments, "of a full circle", 24, 720);

  assets::Grain grain;
  auto* one_grain = app.add_subcommand("grain", "a convex, rounded particle");
  one_grain->add_option("--size", grain.size, "about its diameter");
  add_whole(*one_grain, "--planes", grain.planes, "that cut it", 8, 1000);
  one_grain->add_option("--roundness", grain.roundness, "0 to 1");
  add_whole(*one_grain, "--frequency", grain.frequency, "20 of its square are the triangles", 1, 100);
  add_whole(*one_grain, "--seed", grain.seed, "another seed, another grain");

  assets::Hopper bunker;
  auto* hopper = app.add_subcommand("hopper", "a funnel from a square to a round opening");
  hopper->add_option("--inlet", bunker.inlet, "outer side of the square");
  hopper->add_option("--outlet", bunker.outlet, "outer diameter");
  hopper->add_option("--height", bunker.height, "");
  hopper->add_option("--wall", bunker.wall, "thickness");
  add_whole(*hopper, "--bolts", bunker.bolts, "at each side of the flange", 0, 20);
  add_whole(*hopper, "--segments", bunker.segments, "a multiple of 8", 16, 720);

  return cli::run(app, argc, argv, [&] {
    const auto write = [&](CLI::App* part, const char* what, int decimals, const auto& make) {
      if (!app.get_subcommands().empty() && !*part) return;  // another one is asked for
      const Mesh mesh = made(part, make);
      const std::string path = folder + "/" + part->get_name() + ".obj";
      write_file(
          path, assets::to_obj(
                    mesh, std::string(what) + ", in metres\nmade by padder's make_assets " + part->get_name(),
                    decimals));
      std::cerr << path << ": " << mesh.triangles.size() << " triangles\n";
    };
    write(track_shoe, "Single-pin track shoe", 7, [&] { return assets::make_track_shoe(shoe); });
    write(road_wheel, "Road wheel", 7, [&] { return assets::make_road_wheel(wheel); });
    write(one_grain, "Grain", 9, [&] { return assets::make_grain(grain); });
    write(hopper, "Hopper", 7, [&] { return assets::make_hopper(bunker); });
    return 0;
  });
}
