#pragma once

#include <algorithm>
#include <string>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The metadata key of a grid of distances: every voxel nearer to the surface than this many mm is
/// active. The background can be larger, where the band depends on the voxels' diameters.
inline constexpr const char* held_band_key = "vdbdither:band_mm";

inline void setHeldBandMm(openvdb::GridBase& surface, double band_mm) {
  surface.insertMeta(held_band_key, openvdb::DoubleMetadata(band_mm));
}

/// Whether the grid has this metadata; grids of other tools do not.
inline bool statesHeldBand(const openvdb::GridBase& surface) {
  return surface.getMetadata<openvdb::DoubleMetadata>(held_band_key) != nullptr;
}

/// Returns the value of the metadata, or without it the background, which is the band of other
/// tools.
inline double heldBandMm(const openvdb::FloatGrid& surface) {
  const auto stated = surface.getMetadata<openvdb::DoubleMetadata>(held_band_key);
  return stated ? stated->value() : double{surface.background()};
}

/// Throws a DataError with the missing width, unless distances up to `held_mm` reach as far as
/// `needed_mm`. `who_needs` goes before the width: "a shell of 0.2 mm needs".
void checkHolds(double held_mm, double needed_mm, const std::string& who_needs);

}  // namespace vdbdither
