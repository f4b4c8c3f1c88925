#include "ops/kernels/contour/grid_surface.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/number_text.h"

namespace vdbdither {

using openvdb::BoolGrid;
using openvdb::FloatGrid;

std::string chosenSurfaceGrid(std::span<const std::string> there,
                              const std::optional<std::string>& wanted) {
  const auto isThere = [&](std::string_view name) {
    return std::find(there.begin(), there.end(), name) != there.end();
  };
  if (wanted && isThere(*wanted)) return *wanted;
  if (!wanted) {
    for (const std::string_view name : surface_grids) {
      if (isThere(name)) return std::string(name);
    }
  }
  std::string message =
      "no grid " + (wanted ? "'" + *wanted + "'" : "'printed', 'solid', 'displaced' or 'surface'") +
      "; there is";
  for (const std::string& name : there) message += " '" + name + "'";
  throw DataError(there.empty() ? message + " none" : message);
}

GridSurface::GridSurface(const Lattice& lattice, const openvdb::GridBase& prototype,
                         std::optional<double> level)
    : surface_(surfaceOf(lattice, prototype, level)) {}

IsoSurface GridSurface::surfaceOf(const Lattice& lattice, const openvdb::GridBase& prototype,
                                  std::optional<double> level) {
  const std::string name = "grid '" + prototype.getName() + "'";
  if (prototype.isType<BoolGrid>()) {
    if (level) throw UsageError("--level: " + name + " holds voxels, which have no level");
    return IsoSurface(lattice);
  }
  if (!prototype.isType<FloatGrid>())
    throw DataError(name + " is of " + prototype.valueType() +
                    ", which has no surface; voxels, distances and occupancies have");
  const float background = static_cast<const FloatGrid&>(prototype).background();
  if (prototype.getGridClass() == openvdb::GRID_FOG_VOLUME) {
    const double at = level.value_or(0.5);
    if (!(at > background && at < 1))
      throw UsageError("--level: " + name + " holds occupancies; " + numberText(at) +
                       " is not between " + numberText(background) + " and 1");
    return {lattice, Inside::above, static_cast<float>(at), background,
            IsoSurface::Between::probit};
  }
  const double at = level.value_or(0);
  if (!(std::abs(at) < background))
    throw UsageError("--level: " + name + " holds distances up to " + numberText(background) +
                     " mm; " + numberText(at) + " mm is not among them");
  return {lattice, Inside::below, static_cast<float>(at), background};
}

SurfacePiece GridSurface::add(const GridConstPtr& grid, ZRange layers) {
  if (const auto voxels = openvdb::gridConstPtrCast<BoolGrid>(grid))
    return surface_.add(voxels, layers);
  return surface_.add(openvdb::gridConstPtrCast<FloatGrid>(grid), layers);
}

std::vector<BitLayer> GridSurface::insideOf(const GridConstPtr& grid, ZRange layers) const {
  if (const auto voxels = openvdb::gridConstPtrCast<BoolGrid>(grid))
    return surface_.insideOf(*voxels, layers);
  return surface_.insideOf(*openvdb::gridConstPtrCast<FloatGrid>(grid), layers);
}

}  // namespace vdbdither
