// SPDX-License-Identifier: MIT
// A length as a user gives it: absolute, or relative to the size of the part.
#pragma once
#include <optional>
#include <string_view>

namespace padder {

// Length::of(0.5) is 0.5 in the mesh's unit. Length::share(0.01) is 1 % of the diagonal of the mesh's
// bounding box. Length() says that no length was given.
class Length {
 public:
  constexpr Length() = default;
  [[deprecated("use Length::share(value) for a share of the diagonal, else Length::of(value)")]]  //
  constexpr Length(double value, bool share)
      : value_(value), is_share_(share) {}

  static constexpr Length of(double value) {
    Length length;
    length.value_ = value;
    return length;
  }
  static constexpr Length share(double of_diagonal) {
    Length length = of(of_diagonal);
    length.is_share_ = true;
    return length;
  }

  constexpr bool given() const { return value_ != 0; }
  constexpr double value() const { return value_; }  // as it was given
  constexpr bool is_share() const { return is_share_; }
  // In the mesh's unit; 0 when no length was given.
  constexpr double absolute(double diagonal) const { return is_share_ ? value_ * diagonal : value_; }
  constexpr double in_unit_frame(double diagonal) const { return absolute(diagonal) / diagonal; }

 private:
  double value_ = 0;
  bool is_share_ = false;
};

// Reads "0.01" as a length in the mesh's unit and "1%" or "1 %" as a share of its diagonal. Returns nothing
// for any other text: the number must be decimal, finite and above 0, and no other character may stand before
// or after it.
std::optional<Length> length_of(std::string_view text);

}  // namespace padder
