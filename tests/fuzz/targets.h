// SPDX-License-Identifier: MIT
// What is fuzzed: functions that take any bytes and must come back. A target aborts, with a sentence on
// stderr, when an answer is wrong; a crash, a hang or a sanitizer's report is a finding, too. padder::Error
// is an answer.
#pragma once
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace padder::fuzz {

// One entry point.
struct Target {
  const char* name;
  void (*run)(std::string_view bytes);
  // Seeds from these files: endings, as ".obj .off"; "" where any bytes will do.
  const char* endings;
};

std::span<const Target> targets();
const Target* find_target(std::string_view name);  // null when there is none

// Ends the program because an answer is wrong.
[[noreturn]] void wrong(const std::string& what);

// Turns bytes into numbers. At the end it gives zeros.
class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : left_(bytes) {}
  bool empty() const { return left_.empty(); }
  template <class T>
  T take() {
    static_assert(std::is_trivially_copyable_v<T>);
    T value{};
    const std::size_t n = std::min(sizeof value, left_.size());
    std::memcpy(&value, left_.data(), n);
    left_.remove_prefix(n);
    return value;
  }
  std::uint32_t below(std::uint32_t most) { return take<std::uint8_t>() % most; }

 private:
  std::string_view left_;
};

// In readers.cpp, detector.cpp and fit.cpp.
std::span<const Target> readers();
void detector(std::string_view bytes);
void fit_balls(std::string_view bytes);

}  // namespace padder::fuzz
