// SPDX-License-Identifier: MIT
// Linked into the tests of the detector, whose calls of Detector::detect() come here (the linker's --wrap,
// set in CMakeLists.txt): a call that hangs on a GPU ends the test with a sentence after a minute. On the CPU
// the limit is that of a whole test under ctest, which slow machines and sanitizers stay below.
#include <cstring>

#include "detect/detector.h"
#include "tools/watchdog.h"

using padder::detect::Contacts, padder::detect::Detector, padder::detect::Input;

extern "C" {
// A member function takes `this` as its first argument. Weak: a test that makes no Detector must not be given
// the whole library for the sake of this file.
[[gnu::weak]] const char* _ZNK6padder6detect8Detector7backendEv(const Detector*);  // Detector::backend()
// A reference is returned as a pointer is; clang warns of a reference to a class in C.
[[gnu::weak]] const Contacts* __real__ZN6padder6detect8Detector6detectERKNS0_5InputE(Detector*, const Input&);
const Contacts* __wrap__ZN6padder6detect8Detector6detectERKNS0_5InputE(Detector*, const Input&);
}

const Contacts* __wrap__ZN6padder6detect8Detector6detectERKNS0_5InputE(Detector* self, const Input& input) {
  const bool cpu = std::strcmp(_ZNK6padder6detect8Detector7backendEv(self), "omp") == 0;
  const padder::Watchdog limit("detect", cpu ? 600 : 60);
  return __real__ZN6padder6detect8Detector6detectERKNS0_5InputE(self, input);
}
