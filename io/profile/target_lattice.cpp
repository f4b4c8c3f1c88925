#include "io/profile/target_lattice.h"

#include <algorithm>
#include <cmath>

#include "io/profile/printer_profile.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

/// Throws UsageError unless the printer takes layers of `layer_mm`.
void checkLayer(double layer_mm, const PrinterProfile& profile) {
  const std::string printer = "--layer: the printer '" + profile.name + "' ";
  if (!profile.layer_mm)
    throw UsageError(printer + "has layers of " + shortestText(profile.pitch_mm[2]) +
                     " mm; its profile states no range (layer_mm)");
  const openvdb::Vec2d& range = *profile.layer_mm;
  if (layer_mm < range[0] || layer_mm > range[1])
    throw UsageError(printer + "takes layers from " + shortestText(range[0]) + " to " +
                     shortestText(range[1]) + " mm");
}

}  // namespace

Vec3d targetPitchMm(const LatticeOptions& target, Schema& schema) {
  if (target.printer.empty() != target.pitch_mm.has_value())
    throw UsageError(
        "give either --printer NAME (vdbdither printers lists them) or --pitch DX,DY,DZ");
  if (target.pitch_mm && target.layer_mm)
    throw UsageError("--layer goes with --printer; --pitch states the height of a layer itself");
  if (target.pitch_mm) return *target.pitch_mm;
  PrinterProfile profile = readPrinterProfile(target.printer);
  if (target.layer_mm) {
    checkLayer(*target.layer_mm, profile);
    profile.pitch_mm[2] = *target.layer_mm;
  }
  schema.metadata[printer_key] = toJson(profile);
  return profile.pitch_mm;
}

Lattice latticeAround(const Vec3d& min_mm, const Vec3d& max_mm, double margin_mm,
                      const Vec3d& pitch_mm, int refine_y) {
  for (int axis = 0; axis < 3; ++axis) {
    const double furthest_mm = std::max(std::abs(min_mm[axis]), std::abs(max_mm[axis])) + margin_mm;
    if (!(furthest_mm / pitch_mm[axis] * refine_y < 1e8))
      throw DataError("the part reaches " + shortestText(furthest_mm) +
                      " mm from the origin, more voxels than can be counted; check --unit and "
                      "--scale");
  }
  Lattice lattice{pitch_mm, Vec3d(0, 0, 0),
                  CoordBBox(Coord::floor((min_mm - margin_mm) / pitch_mm),
                            Coord::ceil((max_mm + margin_mm) / pitch_mm))};
  if (refine_y > 1) {
    lattice.origin_mm.y() = -0.5 * pitch_mm.y() * (refine_y - 1) / refine_y;
    lattice.pitch_mm.y() = pitch_mm.y() / refine_y;
    lattice.box.min().y() *= refine_y;
    lattice.box.max().y() = lattice.box.max().y() * refine_y + refine_y - 1;
  }
  return lattice;
}

}  // namespace vdbdither
