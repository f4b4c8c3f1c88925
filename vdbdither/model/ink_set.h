#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/printer.h"

namespace vdbdither {

/// Coverages of inks over a grid of colours: `edge`³ nodes, red slowest, blue fastest. Node
/// (r, g, b) belongs to the linear light (r / (edge − 1))², (g / (edge − 1))², (b / (edge − 1))².
struct CoverageTable {
  int edge = 0;               ///< ≥ 2
  std::vector<float> values;  ///< of each node one for each ink, ≥ 0, of sum 1
};

/// Returns the luminance Y of linear light with the primaries of Rec. 709.
inline double luminanceOf(const openvdb::Vec3d& linear_rgb) {
  return 0.2126 * linear_rgb[0] + 0.7152 * linear_rgb[1] + 0.0722 * linear_rgb[2];
}

/// The materials that colours are made of.
struct InkSet {
  std::vector<Material> inks;              ///< at least one
  std::vector<openvdb::Vec3d> linear_rgb;  ///< of each ink, 0 … 1
  std::optional<std::size_t> clear;        ///< the ink that stands for what is not opaque
  openvdb::Vec3d yule_nielsen{2, 2, 2};    ///< factor n of red, green and blue, 1 … 16
  /// Where there is one, the inks have absorption and scattering, and mix by these.
  std::optional<SurfaceMirror> kubelka_munk;
  double black = 0.5;  ///< 0: as little black as possible; 1: as much
  /// Whether a linear light of 1 means the lightest ink and 0 the darkest; colours as they are
  /// otherwise.
  bool media_relative = false;
  std::optional<CoverageTable> table;  ///< in place of the mixing law
};

}  // namespace vdbdither
