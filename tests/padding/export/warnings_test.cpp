// SPDX-License-Identifier: MIT
#include <functional>
#include <map>

#include "padding/asset/excerpt.h"
#include "padding/export/writers.h"
#include "tests/error_of.h"
#include "tests/padding/export/samples.h"

namespace padder::samples {
namespace {

class WarningsTest : public ExportTest {
 protected:
  // All that the format writes, by the file's name.
  std::map<std::string, std::string> files(const Model& model, const Format& format,
                                           const std::string& name) {
    const fs::path at = folder_ / name;
    fs::create_directories(at);
    write_model(model, at / (std::string("a") + format.ending), format);
    std::map<std::string, std::string> out;
    for (const auto& entry : fs::recursive_directory_iterator(at))
      if (entry.is_regular_file()) out[fs::relative(entry.path(), at).string()] = read_file(entry.path());
    return out;
  }
};

// The oracle is what is written: does it change with the mass?
TEST_F(WarningsTest, WhatStatesAMassIsKnown) {
  const Model model = model_of(brick());
  Model heavier = model;
  MassProperties& mass = heavier.bodies[0].cluster.mass;
  mass.volume *= 2, mass.inertia *= 2, mass.moments *= 2;
  for (const Format& format : formats()) {
    const std::string name = format.name;
    EXPECT_EQ(exporting::states_mass(format),
              files(model, format, name) != files(heavier, format, name + "_heavier"))
        << name;
  }
}

TEST_F(WarningsTest, TheMassOfAWrapIsNotWrittenWithoutAWord) {
  Model model = model_of(brick());
  for (const Format& format : formats()) {
    const auto told = [&] {
      return write_model(model, folder_ / (std::string("a") + format.name + format.ending), format);
    };
    model.bodies[0].inertial.reset();
    for (const auto kind : {SurfaceKind::input, SurfaceKind::filled}) {
      model.bodies[0].cluster.mass_of = kind;
      EXPECT_TRUE(told().empty()) << format.name;
    }
    model.bodies[0].cluster.mass_of = SurfaceKind::wrap;
    const auto sentences = told();
    ASSERT_EQ(sentences.size(), exporting::states_mass(format) ? 1u : 0u) << format.name;
    for (const auto& sentence : sentences) EXPECT_NE(sentence.find("brick"), std::string::npos) << sentence;
    model.bodies[0].inertial = Inertial{};  // stated by the robot's own file
    EXPECT_TRUE(told().empty()) << format.name;
  }
}

TEST_F(WarningsTest, ABodyWithoutANameIsSpokenOf) {
  Model model = model_of(brick());
  model.bodies[0].name.clear(), model.bodies[0].cluster.family = 3;
  EXPECT_TRUE(refuses([&] { write(model, "a.csv"); }, "a body without a name has a family or a mask"));
}

TEST_F(WarningsTest, MassPropertiesThatNoBodyHasAreNotWritten) {
  using Spoil = std::function<void(MassProperties&)>;
  const auto told = [&](const Format& format, const Spoil& spoil) {
    Model model = model_of(brick());
    spoil(model.bodies[0].cluster.mass);
    return error_of(
        [&] { write_model(model, folder_ / (std::string("a") + format.name + format.ending), format); });
  };
  for (const Format& format : formats()) {
    EXPECT_EQ(told(format, [](MassProperties&) {}), "") << format.name;
    for (const Spoil& spoil : std::initializer_list<Spoil>{
             [](MassProperties& m) { m.moments *= -1, m.inertia *= -1; },
             [](MassProperties& m) { m.axes.setZero(); }, [](MassProperties& m) { m.axes.col(0) *= -1; },
             [](MassProperties& m) { m.inertia.setZero(); },
             [](MassProperties& m) { m.moments.setZero(), m.inertia.setZero(); }})
      EXPECT_EQ(told(format, spoil).find("no body has the mass properties of brick") != std::string::npos,
                exporting::states_mass(format))
          << format.name;
  }
}

// A part is called what its file is called, which may be in Latin-1 or hold anything else.
TEST_F(WarningsTest, NamesThatAreNoTextAreWrittenAsText) {
  Cluster c = brick();
  c.name = "t\xe4st \x01", c.source.file = "t\xe4st \x01.obj";
  for (const char* format : {"chrono", "yade", "mercury", "urdf", "mujoco", "usd", "curobo", "xrdf", "obj"}) {
    for (const auto& [name, bytes] :
         files(model_of(c), find_format({}, format), std::string("names_") + format)) {
      std::string shown = excerpt(bytes, std::string::npos), lines;  // escapes line ends and tabs alone
      for (const char b : bytes) lines += b == '\n' ? "\\n" : b == '\t' ? "\\t" : std::string(1, b);
      EXPECT_EQ(shown, lines) << name;
    }
  }
}

}  // namespace
}  // namespace padder::samples
