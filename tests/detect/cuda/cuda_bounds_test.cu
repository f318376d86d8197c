// SPDX-License-Identifier: MIT
// The summary of the spheres: exponents by bits against those of double, and the float way of telling octaves
// apart against the one for every input.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

#include "detect/cuda/device/device.h"
#include "detect/cuda/input/survey.h"
#include "tests/detect/backends.h"

namespace padder::detect::cuda {
namespace {

TEST(CudaSurvey, ExponentsByBits) {
  std::mt19937 random(20261121);
  std::uniform_real_distribution<float> unit(0, 1);
  const auto check = [](float x, float y, float z, float r) {
    ASSERT_EQ(need_exponent(x, y, z, r), exponent_of(need_of({x, y, z, r})))
        << x << ' ' << y << ' ' << z << ' ' << r;
  };
  for (int k = 0; k < 100'000; k++)
    check(std::ldexp(unit(random) - 0.5f, static_cast<int>(unit(random) * 140) - 60),
          std::ldexp(unit(random), static_cast<int>(unit(random) * 60) - 30), unit(random),
          std::ldexp(unit(random), static_cast<int>(unit(random) * 160) - 150));
  // Around a mantissa of 2 - 2^-19, where rounding up makes an exponent more; nothing; denormals.
  for (const float power : {1.0f, 0x1p-30f, 0x1p40f, 0x1p-126f})
    for (int ulp = -40; ulp < 20; ulp++) check(1, 2, 3, power * (2 + ulp * 0x1p-23f));
  for (const float r : {0.0f, 0x1p-149f, 0x1p-127f, 0x1p-126f})
    for (const float m : {0.0f, 0x1p-149f, 0x1p-140f, 1.0f, 0x1p40f, 0x1p42f, 0x1p43f, 0x1p120f})
      check(m, -m, m, r);
  for (int e = 30; e < 50; e++)
    check(std::ldexp(1.0f, e), 0, 0, 0.5f), check(std::ldexp(1.9f, e), 0, 0, 0.5f);
}

using SurveyOnAGpu = GpuTest;
TEST_F(SurveyOnAGpu, OfPackedFloatsIsThatOfAnyOthers) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(0, 1);
  for (const std::uint32_t count : {1u, 100u, 40'000u})
    for (const float largest : {1.0f, 100.0f, 1e7f}) {
      std::vector<float4> spheres(count);
      for (float4& s : spheres)
        s = {unit(random) * 100 - 50, unit(random) * 1000, unit(random) * 1e-3f,
             std::pow(largest, unit(random)) * 0.01f};
      MemoryBook book;
      Buffer<float4> given(book, "the test");
      cuda_check(cudaMemcpy(given.reserve(count), spheres.data(), 16ull * count, cudaMemcpyHostToDevice),
                 "copy");
      DeviceSpheres source;
      source.centers = given.data(), source.radii = &given.data()->w;
      source.center_stride = source.radius_stride = 4, source.count = count;
      const int processors = processors_of(nullptr, 0);
      Surveyor one(book), other(book);
      const Summary any = one.survey(source, processors, nullptr);
      source.packed = true;
      const Summary packed = other.survey(source, processors, nullptr);
      ASSERT_EQ(packed.octaves_known, any.octaves_known);
      ASSERT_EQ(packed.octaves_known, count > 1 && largest > 1);
      ASSERT_EQ(packed.need_max, any.need_max);
      for (int o = 0; o < kOctaves; o++) {
        const Summary::Octave &a = any.octave[o], &p = packed.octave[o];
        ASSERT_EQ(p.count, a.count) << o;
        ASSERT_EQ(p.need_max, a.need_max) << o;
        ASSERT_EQ(p.radius_max, a.radius_max) << o;
        for (int k = 0; k < 3; k++) ASSERT_TRUE(p.low[k] == a.low[k] && p.high[k] == a.high[k]) << o;
      }
      if (!packed.octaves_known) continue;
      const auto sphere = [&](std::uint32_t k) {
        return Sphere{spheres[k].x, spheres[k].y, spheres[k].z, spheres[k].w};
      };
      for (const Draw draw : {Draw::few, Draw::many, Draw::few}) {  // each finds the counts before cleared
        const auto near = probe_neighbourhood(packed, sphere, draw);
        const auto of_gpu = other.neighbourhood(source, packed, draw, nullptr);
        ASSERT_EQ(of_gpu->targets, near->targets);
        ASSERT_TRUE(of_gpu->groups == near->groups);
        ASSERT_EQ(std::memcmp(of_gpu->probes, near->probes, sizeof near->probes), 0);
        ASSERT_EQ(std::memcmp(of_gpu->pairs, near->pairs, sizeof near->pairs), 0);
      }
    }
}

}  // namespace
}  // namespace padder::detect::cuda
