// SPDX-License-Identifier: MIT
// Which of two ways is faster for the calls of one scene, bodies first or every sphere expanded: what the
// costs foretell (body_choice.h), corrected by the clock. Only for lists in any order, since those in a
// stable order depend on the way. Internal; host code.
#pragma once
#include <cmath>

namespace padder::detect {

class WayChoice {
 public:
  WayChoice() = default;
  explicit WayChoice(bool first) : first_(first) {}

  // Do bodies go first in this call?
  bool first() const { return first_ != trying_; }
  // Is this a call of the way that was not chosen?
  bool trying() const { return trying_; }
  // Has the clock been asked, or is it in this call? Then the costs have less to say.
  bool by_clock() const { return trying_ || tried_; }
  // Does took() ask how long this call takes?
  bool times() const { return calls_ >= kUntimed; }
  // The call took so long (of no meaning unless times()). `worth_trying`: the other way may be as fast.
  void took(double seconds, bool worth_trying);
  // Bodies were to go first, and it was found that too many of their balls touch.
  void gave_up();

 private:
  // So many calls keep to the choice before both ways are timed, and twice as many each time that it turns
  // out to be right, up to kMostKept. Few enough to pay in a simulation, and so many that who measures some
  // dozens of calls sees no try.
  static constexpr int kKept = 200, kMostKept = 12'800;
  // The first calls of a way do not count: they allocate memory and record their work. Of the next ones the
  // shortest does.
  static constexpr int kUntimed = 4, kTimed = 4;
  // A try ends with the first timed call that takes so many times as long.
  static constexpr double kSlow = 1.3;

  void keep(bool was_right);

  bool first_ = false, trying_ = false, tried_ = false;
  int kept_ = kKept, calls_ = -kKept;  // calls of this way; below 0, the choice is kept
  double least_ = INFINITY, chosen_ = INFINITY;
};

}  // namespace padder::detect
