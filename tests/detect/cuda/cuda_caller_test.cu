// SPDX-License-Identifier: MIT
// What a caller does with CUDA beside the detector, and what it must not do to either: errors left behind,
// contexts, streams, threads, memory that is not the device's.
#include <cuda.h>
#include <cuda_runtime.h>

#include <atomic>
#include <thread>

#include "detect/cuda/device/device.h"
#include "tests/detect/oracle.h"
#include "tests/detect/some_cases.h"
#include "tests/error_of.h"

namespace padder::detect {
namespace {

using cuda::driver_function;

__global__ void nothing_kernel() {}
__global__ void fault_kernel() { *reinterpret_cast<volatile int*>(16) = 1; }

class CudaCallerTest : public GpuTest {
 protected:
  void SetUp() override {
    GpuTest::SetUp();
    if (IsSkipped()) return;
    spheres_ = generate("dense", 20'000);
    Detector reference(DeviceChoice{BackendKind::omp});
    reference.detect(input_of(spheres_));
    hash_ = reference.hash();
  }
  void expect_right(Detector& d) {
    d.detect(input_of(spheres_));
    EXPECT_EQ(d.hash(), hash_);
  }

  CallOptions options_;
  std::vector<FloatSphere> spheres_;
  std::uint64_t hash_ = 0;
};

TEST_F(CudaCallerTest, AnErrorOfTheCallersIsNotTakenForOurs) {
  Detector d({BackendKind::cuda}, options_);
  for (int call = 0; call < 4; call++) {
    void* p = nullptr;
    EXPECT_NE(cudaMalloc(&p, std::size_t(1) << 50), cudaSuccess);
    expect_right(d);
  }
}

TEST_F(CudaCallerTest, TheCallersContextStaysCurrent) {
  const auto create = driver_function<CUresult (*)(CUcontext*, unsigned, CUdevice)>("cuCtxCreate", 4000);
  const auto current = driver_function<CUresult (*)(CUcontext*)>("cuCtxGetCurrent", 4000);
  const auto destroy = driver_function<CUresult (*)(CUcontext)>("cuCtxDestroy", 4000);
  ASSERT_TRUE(create && current && destroy);
  Detector before({BackendKind::cuda}, options_);
  expect_right(before);
  CUcontext mine = nullptr, now = nullptr;
  ASSERT_EQ(create(&mine, 0, 0), CUDA_SUCCESS);
  {
    Detector d({BackendKind::cuda}, options_);
    for (int call = 0; call < 4; call++) {
      expect_right(d), expect_right(before);
      ASSERT_EQ(current(&now), CUDA_SUCCESS);
      EXPECT_EQ(now, mine);
    }
  }
  ASSERT_EQ(current(&now), CUDA_SUCCESS);
  EXPECT_EQ(now, mine);
  destroy(mine);
}

TEST_F(CudaCallerTest, AnyStreamWillDo) {
  cudaStream_t blocking, free;
  ASSERT_EQ(cudaStreamCreate(&blocking), cudaSuccess);
  ASSERT_EQ(cudaStreamCreateWithFlags(&free, cudaStreamNonBlocking), cudaSuccess);
  for (cudaStream_t stream : {cudaStream_t(nullptr), cudaStreamLegacy, cudaStreamPerThread, blocking, free}) {
    options_.stream = stream;
    Detector d({BackendKind::cuda}, options_);
    for (int call = 0; call < 6; call++) expect_right(d);
  }
  // One detector, a graph recorded on one stream and launched on others.
  Detector d({BackendKind::cuda}, options_);
  for (int call = 0; call < 12; call++) {
    d.options().stream = call % 3 == 0 ? blocking : call % 3 == 1 ? free : nullptr;
    expect_right(d);
  }
  cudaStreamDestroy(blocking), cudaStreamDestroy(free);
}

TEST_F(CudaCallerTest, TheHashNeedsNoStream) {
  cudaStream_t stream;
  ASSERT_EQ(cudaStreamCreate(&stream), cudaSuccess);
  options_.stream = stream;
  Detector d({BackendKind::cuda}, options_);
  d.detect(input_of(spheres_));
  cudaStreamDestroy(stream);
  EXPECT_EQ(d.hash(), hash_);
  // Nor does a call that is refused before it begins, nor the detector's end.
  d.options().stream = nullptr, d.options().bin_size = -1;
  EXPECT_THROW(d.detect(input_of(spheres_)), Error);
}

// Spheres that the default stream has yet to write are read when it has.
TEST_F(CudaCallerTest, TheDefaultStreamIsWaitedFor) {
  void* device = nullptr;
  const std::size_t bytes = spheres_.size() * sizeof(FloatSphere);
  ASSERT_EQ(cudaMalloc(&device, bytes), cudaSuccess);
  Input input = input_of(spheres_);
  input.spheres.centers = device, input.spheres.radii = static_cast<float*>(device) + 3;
  input.spheres.memory = Memory::device;
  Detector d({BackendKind::cuda}, options_);
  for (int call = 0; call < 5; call++) {
    cudaMemsetAsync(device, 0, bytes);
    cudaMemcpyAsync(device, spheres_.data(), bytes, cudaMemcpyHostToDevice);
    d.detect(input);
    EXPECT_EQ(d.hash(), hash_);
  }
  cudaFree(device);
}

TEST_F(CudaCallerTest, HostMemoryIsNotDeviceMemory) {
  Detector d({BackendKind::cuda}, options_);
  Input input = input_of(spheres_);
  input.spheres.memory = Memory::device;
  EXPECT_TRUE(refuses([&] { d.detect(input); }, "device memory"));
  EXPECT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  expect_right(d);
  // One array of several, and poses.
  const Sphere ball{0, 0, 0, 1};
  const Shape shape{&ball, 1};
  const Body bodies[2];
  const Pose poses[2];
  Input posed;
  posed.shapes = {&shape, 1}, posed.bodies = bodies, posed.poses = poses, posed.pose_memory = Memory::device;
  for (const std::uint64_t revision : {0, 1}) {
    posed.revision = revision;
    EXPECT_THROW(d.detect(posed), Error);
  }
  expect_right(d);
}

// A call that is limited to a box reads only the poses that it needs, where the caller has them.
TEST_F(CudaCallerTest, PosesThatWereNotReadMustBeGivenAgain) {
  const Sphere ball{0, 0, 0, 1};
  const Shape shape{&ball, 1};
  std::vector<Body> bodies(4);
  std::vector<Pose> poses(4);
  for (int k = 0; k < 4; k++) poses[k].position[0] = 1.5 * k;  // contacts at 0.75, 2.25 and 3.75
  void* device = nullptr;
  ASSERT_EQ(cudaMalloc(&device, 4 * sizeof(Pose)), cudaSuccess);
  ASSERT_EQ(cudaMemcpy(device, poses.data(), 4 * sizeof(Pose), cudaMemcpyHostToDevice), cudaSuccess);
  Input given;
  given.shapes = {&shape, 1}, given.bodies = bodies, given.revision = 1;
  given.poses = static_cast<const Pose*>(device), given.pose_memory = Memory::device;
  CallOptions o = options_;
  o.bodies = Bodies::first;
  Detector d({BackendKind::cuda}, o);
  d.options().own.high[0] = 1;
  for (int call = 0; call < 3; call++) EXPECT_EQ(d.detect(given).count, 1u);
  Input none = given;
  none.poses = nullptr, none.pose_memory = Memory::host;
  EXPECT_TRUE(refuses([&] { d.detect(none); }, "poses in device memory"));
  d.options().own = {};
  EXPECT_EQ(d.detect(given).count, 3u);
  EXPECT_TRUE(refuses([&] { d.detect(none); }, "poses in device memory"));
  // Where a body is static, poses are kept, since those of static bodies stay.
  bodies[0].is_static = true, given.revision = none.revision = 2;
  EXPECT_EQ(d.detect(given).count, 3u);
  EXPECT_EQ(d.detect(given).count, 3u);
  EXPECT_EQ(d.detect(none).count, 3u);
  bodies[0].is_static = false, given.revision = none.revision = 3;
  Input host = given;
  host.poses = poses.data(), host.pose_memory = Memory::host;
  d.options().own.high[0] = 3;
  EXPECT_EQ(d.detect(given).count, 2u);
  EXPECT_EQ(d.detect(host).count, 2u);
  // A pose that is none is found wherever the body would be.
  poses[3].position[1] = NAN;
  d.options().own.high[0] = 1;
  EXPECT_TRUE(refuses([&] { d.detect(host); }, "sphere 3"));
  ASSERT_EQ(cudaMemcpy(device, poses.data(), 4 * sizeof(Pose), cudaMemcpyHostToDevice), cudaSuccess);
  EXPECT_TRUE(refuses([&] { d.detect(given); }, "sphere 3"));
  cudaFree(device);
}

// The caller's own kernel ends the context; the next call says so, and the detector's end stays quiet.
void detect_after_a_fault(const CallOptions& options, const std::vector<FloatSphere>& spheres) {
  std::set_terminate([] { std::_Exit(3); });
  {
    Detector d({BackendKind::cuda}, options);
    d.detect(input_of(spheres));
    fault_kernel<<<1, 1>>>();
    cudaDeviceSynchronize();
    try {
      d.detect(input_of(spheres));
      std::_Exit(2);
    } catch (const Error& e) {
      std::fprintf(stderr, "%s\n", e.what());
    }
  }
  std::_Exit(0);
}
TEST_F(CudaCallerTest, AfterAFaultOfTheCallersASentence) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // in a process of its own
  EXPECT_EXIT(detect_after_a_fault(options_, spheres_), testing::ExitedWithCode(0), "CUDA failed to");
}

TEST_F(CudaCallerTest, OtherThreadsUseTheDefaultStream) {
  std::atomic<bool> stop = false;
  std::atomic<int> calls = 0, wrong = 0, refused = 0;
  std::vector<std::thread> threads;
  for (int k = 0; k < 3; k++)
    threads.emplace_back([&, k] {
      Detector d({BackendKind::cuda}, options_);
      // Another plan every third call: a graph is recorded as often.
      for (int call = 0; !stop; call++) {
        d.options().width = static_cast<Width>(call / 3 % 3);
        d.options().order = (call / 9 + k) % 2 ? Order::stable : Order::any;
        try {
          d.detect(input_of(spheres_));
          calls++, wrong += d.hash() != hash_;
        } catch (const Error&) {
          refused++;
        }
      }
    });
  int errors = 0, others = 0;
  for (; calls + refused < 600 / SomeCases::every(); others++) {
    nothing_kernel<<<1, 1>>>();
    errors += cudaGetLastError() != cudaSuccess;
    if (others % 16 == 0) errors += cudaStreamSynchronize(nullptr) != cudaSuccess;
  }
  stop = true;
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(refused, 0);
  EXPECT_EQ(errors, 0);
  EXPECT_GT(others, 10);
}

}  // namespace
}  // namespace padder::detect
