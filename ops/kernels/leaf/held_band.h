#pragma once

#include <algorithm>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Metadata of a grid of distances: every voxel nearer to the surface than so many mm is active.
/// The background may be more, where the band follows the voxels' diameters.
inline constexpr const char* held_band_key = "vdbdither:band_mm";

inline void setHeldBandMm(openvdb::GridBase& surface, double band_mm) {
  surface.insertMeta(held_band_key, openvdb::DoubleMetadata(band_mm));
}

/// Whether the grid has that metadata: those of other tools have not.
inline bool statesHeldBand(const openvdb::GridBase& surface) {
  return surface.getMetadata<openvdb::DoubleMetadata>(held_band_key) != nullptr;
}

/// What the metadata says, or the background, which is what other tools hold.
inline double heldBandMm(const openvdb::FloatGrid& surface) {
  const auto stated = surface.getMetadata<openvdb::DoubleMetadata>(held_band_key);
  return stated ? stated->value() : double{surface.background()};
}

}  // namespace vdbdither
