// SPDX-License-Identifier: MIT
// What the types of the public headers promise: what cannot be said, what is refused, and what older sources
// may still say.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <regex>
#include <type_traits>

#include "detect/core/nine_stages.h"
#include "tests/detect/oracle.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

template <class T>
concept NamesABackend = requires(T& options) {
  options.backend;
};
template <class T>
concept NamesADevice = requires(T& options) {
  options.device;
};

// Backend and device are arguments of the constructor. The options that a detector hands out do not have
// them.
using Handed = std::remove_reference_t<decltype(std::declval<Detector&>().options())>;
static_assert(std::is_same_v<Handed, CallOptions>);
static_assert(!NamesABackend<Handed> && !NamesADevice<Handed>);
static_assert(std::is_constructible_v<Detector, DeviceChoice> &&
              std::is_constructible_v<Detector, DeviceChoice, CallOptions>);

// Spans of whole numbers do not exist.
template <class T>
concept HasSpansOf = requires(const Contacts& c) {
  c.normal_span<T>();
};
static_assert(HasSpansOf<float> && HasSpansOf<double> && !HasSpansOf<int> && !HasSpansOf<long double>);

const FloatSphere two_spheres[] = {{0, 0, 0, 1}, {1.5f, 0, 0, 1}};

void expect_refusal(const std::function<void()>& call, const std::string& part) {
  EXPECT_TRUE(refuses(call, part));
}

TEST(Api, SpansAreOfTheScalarOfTheRecords) {
  Detector d(DeviceChoice{BackendKind::omp});
  d.options().width = Width::points;
  const Contacts& c = d.detect(input_of(two_spheres));
  ASSERT_EQ(c.count, 1u);
  EXPECT_EQ(c.normal_span<float>()[0].depth, 0.5f);
  EXPECT_EQ(c.point_span<float>()[0].on_i[0], 1);
  expect_refusal([&] { c.normal_span<double>(); }, "of type float and cannot be read as double");
  expect_refusal([&] { c.point_span<double>(); }, "of type float and cannot be read as double");
  d.options().scalar = Scalar::f64;
  d.detect(input_of(two_spheres));
  EXPECT_EQ(c.normal_span<double>()[0].depth, 0.5);
  EXPECT_EQ(c.point_span<double>()[0].on_j[0], 0.5);
  expect_refusal([&] { c.normal_span<float>(); }, "of type double and cannot be read as float");
}

TEST(Api, SpansOfRecordsThatWereNotAskedForAreEmpty) {
  Detector d(DeviceChoice{BackendKind::omp});
  d.options().width = Width::normals;
  const Contacts& c = d.detect(input_of(two_spheres));
  EXPECT_EQ(c.normal_span<float>().size(), 1u);
  EXPECT_TRUE(c.point_span<double>().empty());
  d.options().width = Width::pairs;
  d.detect(input_of(two_spheres));
  EXPECT_EQ(c.pair_span().size(), 1u);
  EXPECT_TRUE(c.normal_span<double>().empty());
  EXPECT_TRUE(Contacts().normal_span<double>().empty());
}

// A scene without contacts is refused like one with contacts.
TEST(Api, SpansAreCheckedWithoutContactsToo) {
  Detector d(DeviceChoice{BackendKind::omp});
  const Contacts& c = d.detect({});
  EXPECT_TRUE(c.normal_span<float>().empty());
  expect_refusal([&] { c.normal_span<double>(); }, "cannot be read as double");
}

TEST(Api, TheBackendIsThatOfTheConstructor) {
  Detector d({BackendKind::omp, 0});
  EXPECT_STREQ(d.backend(), "omp");
  d.options() = CallOptions();
  d.detect(input_of(two_spheres));
  EXPECT_STREQ(d.backend(), "omp");
  CallOptions pairs;
  pairs.width = Width::pairs;
  EXPECT_EQ(Detector({BackendKind::omp}, pairs).options().width, Width::pairs);
  EXPECT_EQ(Detector(pairs).options().width, Width::pairs);
  if (!cuda_present()) {
    EXPECT_STREQ(Detector().backend(), "omp");
    EXPECT_THROW(Detector(DeviceChoice{BackendKind::cuda}), Error);
  }
}

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdeprecated-declarations"
static_assert(Path::fast == Path::grid && Precision::fast == Precision::float32 &&
              Order::fixed == Order::stable);
static_assert(std::is_same_v<Choice, BackendKind> && std::is_same_v<Random, SplitMix64>);

// A binding of another language may hand over any number.
TEST(Api, ValuesThatNoEnumerationHasAreRefused) {
  const auto refused = [&](const char* part, const std::function<void(CallOptions&, Input&)>& spoil) {
    Detector d(DeviceChoice{BackendKind::omp});
    Input in = input_of(two_spheres);
    spoil(d.options(), in);
    expect_refusal([&] { d.detect(in); }, part);
    d.options() = {};
    EXPECT_EQ(d.detect(input_of(two_spheres)).count, 1u);
  };
  refused("CallOptions::path is 2, and its values are 0 to 1: use one of their names",
          [](CallOptions& o, Input&) { o.path = static_cast<Path>(2); });
  refused("CallOptions::precision is 7",
          [](CallOptions& o, Input&) { o.precision = static_cast<Precision>(7); });
  refused("CallOptions::order is 2", [](CallOptions& o, Input&) { o.order = static_cast<Order>(2); });
  refused("CallOptions::width is 3", [](CallOptions& o, Input&) { o.width = static_cast<Width>(3); });
  refused("CallOptions::scalar is 255", [](CallOptions& o, Input&) { o.scalar = static_cast<Scalar>(255); });
  refused("CallOptions::output is 2", [](CallOptions& o, Input&) { o.output = static_cast<Memory>(2); });
  refused("CallOptions::bodies is 3", [](CallOptions& o, Input&) { o.bodies = static_cast<Bodies>(3); });
  refused("Spheres::scalar is 2",
          [](CallOptions&, Input& in) { in.spheres.scalar = static_cast<Scalar>(2); });
  refused("Spheres::memory is 2",
          [](CallOptions&, Input& in) { in.spheres.memory = static_cast<Memory>(2); });
  refused("Input::pose_memory is 2",
          [](CallOptions&, Input& in) { in.pose_memory = static_cast<Memory>(2); });
  expect_refusal([] { Detector d(DeviceChoice{static_cast<BackendKind>(3)}); },
                 "DeviceChoice::backend is 3, and its values are 0 to 2");
  Detector d(DeviceChoice{BackendKind::omp});
  expect_refusal([&] { d.detect_worlds(input_of(two_spheres), 1, static_cast<Answer>(3)); }, "Answer is 3");
}

TEST(Api, TheOpenMpBackendHasNoDeviceMemory) {
  Detector d(DeviceChoice{BackendKind::omp});
  d.options().output = Memory::device;
  const std::string part = "which the OpenMP backend has not: ask for host memory or choose cuda";
  expect_refusal([&] { d.detect(input_of(two_spheres)); }, part);
  expect_refusal([&] { d.detect_worlds(input_of(two_spheres), 1, Answer::any); }, part);
  expect_refusal([&] { d.stages(input_of(two_spheres)); }, part);
}

TEST(Api, ALimitOfMemoryIsNamedByItsRefusal) {
  Detector d(DeviceChoice{BackendKind::omp});
  d.options().memory_limit = 100;
  expect_refusal([&] { d.detect(input_of(two_spheres)); },
                 ", but CallOptions::memory_limit is 100: raise it, divide");
  d.options().memory_limit = 0;
  EXPECT_EQ(d.detect(input_of(two_spheres)).count, 1u);
}

TEST(Api, OlderSourcesStillChooseByOptions) {
  Options options;
  options.backend = BackendKind::omp, options.device = 0, options.width = Width::pairs;
  Detector d(options);
  EXPECT_STREQ(d.backend(), "omp");
  d.options().threads = 1;
  d.options() = options;  // the device stays
  EXPECT_EQ(d.detect(input_of(two_spheres)).count, 1u);
  if (!cuda_present()) {
    options.backend = BackendKind::cuda;
    EXPECT_THROW(Detector{options}, Error);
  }
}
#pragma GCC diagnostic pop

// Whoever meets a deprecated name is told what to write instead.
TEST(Api, DeprecatedNamesSayWhatReplacesThem) {
  const std::filesystem::path folder = std::filesystem::path(PADDER_ASSETS) / "../detect";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "the sources are not on this machine: " << folder;
  const std::regex deprecated("\\[\\[deprecated(\\(\"([^\"]*)\"\\))?");
  int found = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".h") continue;
    std::ifstream file(entry.path());
    const std::string text((std::istreambuf_iterator<char>(file)), {});
    for (std::sregex_iterator it(text.begin(), text.end(), deprecated), end; it != end; ++it, found++)
      EXPECT_TRUE((*it)[2].str().starts_with("use ")) << entry.path() << ": " << it->str();
  }
  EXPECT_GE(found, 6);
}

}  // namespace
}  // namespace padder::detect
