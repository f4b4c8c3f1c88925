#pragma once

#include <functional>
#include <optional>

#include "ops/kernels/dither/error_diffusion.h"
#include "ops/kernels/dither/shape_dither.h"
#include "tests/support/volumes.h"

namespace vdbdither::test {

/// A second implementation of the equations of the paper, in double precision over dense arrays,
/// as simple as possible.

/// V = { v : d(v) < 0 }.
Voxels plainVoxels(const Volume<float>& d);

/// ∂V: the voxels of V with a 6-neighbour outside V. Voxels outside the box are outside V.
Voxels surfaceVoxels(const Voxels& V);

/// (4): returns the voxel of ∂V closest to `v` in mm within `radius_mm`, if any. Ties go to the
/// smallest (k, j, i).
std::optional<openvdb::Coord> closestSurfaceVoxel(const std::vector<openvdb::Coord>& surface_voxels,
                                                  const openvdb::Coord& v,
                                                  const openvdb::Vec3d& pitch_mm, double radius_mm);

std::vector<openvdb::Coord> listed(const Voxels& voxels);

/// The unit gradient: central differences, one-sided beside an inactive voxel, zero between two.
openvdb::Vec3d gradientNormal(const openvdb::FloatGrid& surface, const openvdb::Coord& v,
                              const openvdb::Vec3d& pitch_mm);

/// (6).
double halfDiameter(const openvdb::Vec3d& n, const openvdb::Vec3d& pitch_mm);

/// A mask of `size`³ thresholds (rank + ½) / n in random order, each of them once.
ThresholdMask permutationMask(int size);

/// The band that a dither needs of `sampled`, mm.
double bandFor(const ShapeDither& dither);

/// The default dither: error diffusion for a spread of 0.05 mm, guarded.
ErrorDiffusion defaultDither(const openvdb::Vec3d& pitch_mm, bool guarded = true);

/// The voxels printed of a shape, without dithering and with it.
struct Printed {
  Voxels plain;
  Voxels dithered;
};
Printed printed(const ShapeDither& dither, const TestShape& shape);
Printed printedByDefault(const openvdb::Vec3d& pitch_mm, const TestShape& shape,
                         bool guarded = true);

/// Shapes that are thick everywhere.
const TestShape& ballShape();
const TestShape& ringShape();

}  // namespace vdbdither::test
