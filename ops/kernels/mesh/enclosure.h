#pragma once

#include <cstddef>
#include <string>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Returns why triangles cannot bound a volume, in the words of a message: fewer than four have an
/// area, or all their corners lie in one plane, to the rounding of single precision. Empty where
/// they may.
std::string whyFlat(const Mesh& mesh);

/// What fillings of holes are to the solid that they close.
struct Enclosure {
  double given_mm2 = 0;       ///< area of the triangles that were given
  double filling_mm2 = 0;     ///< area of those that fill holes
  bool is_one_sided = false;  ///< like a Möbius strip: neighbours cannot be turned to agree
  /// How much of the winding number inside comes from the triangles given, on average: 1 for a
  /// closed mesh, about 0.7 for a hemisphere or a tube as long as wide, ½ and less for sheets.
  double share = 1;

  /// Whether the triangles given bound a volume, rather than their fillings.
  [[nodiscard]] bool boundsVolume() const { return share >= 0.6; }

  /// "2 holes would be filled with 8.1 mm2 beside 12 mm2 of surface", one-sided or not.
  [[nodiscard]] std::string text(std::size_t holes) const;
};

/// Examines a closed mesh, in mm, of which the last `fillings` triangles fill holes. Takes no time
/// where fillings are small. Deterministic.
Enclosure enclosureOf(const Mesh& mesh, std::size_t fillings);

}  // namespace vdbdither
