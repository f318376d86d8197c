// SPDX-License-Identifier: MIT
// On a part of the device's processors, as a MIG slice, MPS or a green context gives: blocks that wait for
// each other must all run at once there, too, and the list is the same.
#include <cuda.h>
#include <cuda_runtime.h>

#include "detect/cuda/device/device.h"
#include "detect/scene/generate.h"
#include "tests/detect/oracle.h"

namespace padder::detect {
namespace {

using cuda::driver_function;

// A stream of a context with some processors.
class GreenStream {
 public:
  explicit GreenStream(unsigned processors) {
    const auto all_of = driver_function<CUresult (*)(CUdevice, CUdevResource*, CUdevResourceType)>(
        "cuDeviceGetDevResource", 12050);
    const auto split =
        driver_function<CUresult (*)(CUdevResource*, unsigned*, const CUdevResource*, CUdevResource*,
                                     unsigned, unsigned)>("cuDevSmResourceSplitByCount", 12050);
    const auto describe = driver_function<CUresult (*)(CUdevResourceDesc*, CUdevResource*, unsigned)>(
        "cuDevResourceGenerateDesc", 12050);
    const auto make = driver_function<CUresult (*)(CUgreenCtx*, CUdevResourceDesc, CUdevice, unsigned)>(
        "cuGreenCtxCreate", 12050);
    const auto stream_of =
        driver_function<CUresult (*)(CUstream*, CUgreenCtx, unsigned, int)>("cuGreenCtxStreamCreate", 12050);
    if (!all_of || !split || !describe || !make || !stream_of) return;
    CUdevResource all{}, part{}, rest{};
    CUdevResourceDesc description;
    unsigned parts = 1;
    cudaFree(nullptr);
    if (all_of(0, &all, CU_DEV_RESOURCE_TYPE_SM) || split(&part, &parts, &all, &rest, 0, processors) ||
        describe(&description, &part, 1) || make(&context_, description, 0, CU_GREEN_CTX_DEFAULT_STREAM) ||
        stream_of(&stream, context_, CU_STREAM_NON_BLOCKING, 0))
      stream = nullptr;
    count = part.sm.smCount;
  }
  ~GreenStream() {
    if (stream) cudaStreamDestroy(stream);
    const auto destroy = driver_function<CUresult (*)(CUgreenCtx)>("cuGreenCtxDestroy", 12050);
    if (context_ && destroy) destroy(context_);
  }
  CUstream stream = nullptr;
  unsigned count = 0;

 private:
  CUgreenCtx context_ = nullptr;
};

class CudaProcessorsTest : public testing::TestWithParam<unsigned> {
 protected:
  void SetUp() override { skip_without(BackendKind::cuda); }
  // The same list as on the whole device, call by call: alone, with the bins of the call before, recorded.
  void expect_same(const char* scene, std::uint64_t n, bool wide, Order order) {
    SCOPED_TRACE(testing::Message() << scene << " " << n << (wide ? " in double" : " in float")
                                    << (order == Order::stable ? ", stable order" : ", any order"));
    GreenStream green(GetParam());
    if (!green.stream) GTEST_SKIP() << "needs a driver that makes green contexts (CUDA 12.5 or newer)";
    EXPECT_EQ(cuda::processors_of(green.stream, 0), static_cast<int>(green.count));
    const auto spheres = generate(scene, n);
    const std::vector<Sphere> doubles = in_double_of(spheres);
    const Input input = wide ? input_of(doubles) : input_of(spheres);
    CallOptions options;
    options.order = order;
    Detector whole({BackendKind::cuda}, options);
    options.stream = green.stream;
    Detector part({BackendKind::cuda}, options);
    const Contacts& a = whole.detect(input);
    for (int call = 0; call < 4; call++) {
      const Contacts& b = part.detect(input);
      ASSERT_EQ(a.count, b.count) << "call " << call;
      ASSERT_EQ(whole.hash(), part.hash()) << "call " << call;
      if (order == Order::stable) {
        ASSERT_EQ(std::memcmp(a.pairs, b.pairs, a.count * sizeof(Pair)), 0) << "call " << call;
      }
    }
  }
};

TEST_P(CudaProcessorsTest, TheSameList) {
  for (const Order order : {Order::stable, Order::any}) {
    expect_same("dense", 20'000, false, order);     // tiles that wait for each other
    expect_same("dense", 100'000, false, order);    // blocks that put in order together
    expect_same("poly100", 30'000, true, order);    // levels
    expect_same("poly100", 150'000, false, order);  // shares, in one flow
  }
}
TEST_P(CudaProcessorsTest, TheSameLargeList) {
  expect_same("poly100", 400'000, true, Order::stable);
  expect_same("poly100", 3'000'000, true, Order::stable);
  expect_same("poly100", 3'000'000, false, Order::stable);
  expect_same("dense", 1'000'000, false, Order::any);
}
INSTANTIATE_TEST_SUITE_P(Parts, CudaProcessorsTest, testing::Values(8, 16, 64),
                         testing::PrintToStringParamName());

}  // namespace
}  // namespace padder::detect
