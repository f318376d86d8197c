// SPDX-License-Identifier: MIT
// The certificate for one cover after the other.
#pragma once
#include <cstdint>
#include <vector>

#include "padding/verify/certify.h"

namespace padder {

// What was proved stays so until a ball that may have proved it is gone, so most of the surface need not be
// asked again. A triangle that is large beside the balls is asked in pieces: of it, too, only what lies
// beside a change is asked again. Of a stack of such pieces only the first is asked until nothing fails. The
// others are then asked once, and rarely fail.
class OpenPieces {
 public:
  OpenPieces(const Mesh& mesh, double gap) : mesh_(mesh), gap_(gap) {}  // keeps a reference to the mesh

  // As gap_failures() (padding/verify/certify.h): none is the proof that these balls keep the gap. Where some
  // fail, there may be more.
  std::vector<GapPart> failures(std::vector<Ball> balls, double grain);

 private:
  enum class State : std::uint8_t { proved, open, stacked };

  std::vector<GapPart> ask(const BallSet& balls, double grain);
  void cut(const BallSet& balls);
  void reopen(const std::vector<Ball>& balls);

  const Mesh& mesh_;
  const double gap_;
  Mesh pieces_;
  std::vector<std::uint32_t> triangle_;  // of the mesh, for each piece
  std::vector<State> state_;
  std::vector<Ball> last_;
};

}  // namespace padder
