#pragma once

#include <array>
#include <optional>

#include "ops/kernels/measure/surface_error.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The dependence of the error on one axis of the printer, weighted by area.
struct AxisError {
  /// Pearson's correlation of the error with the coordinate along the axis, over the whole surface.
  double correlation = 0;

  /// The area, and the bias, mean and RMS of the error, of the points where the reference faces
  /// along this axis more than along the others.
  double area_mm2 = 0;
  double bias_mm = 0;
  double mean_mm = 0;
  double rms_mm = 0;

  /// The effect of the lattice on the error of the same points, from its mean and deviation for
  /// each of 16 phases of the reference's position within a voxel along the axis.
  struct Phase {
    double staircase_mm = 0;   ///< RMS of the means about the mean of all
    double explained = 0;      ///< the share of the means in the error's variance
    double modulation_mm = 0;  ///< RMS variation of the deviation with the phase
  };
  std::optional<Phase> phase;  ///< set if there are a lattice and such points
};

/// Returns the errors for x, y and z. `lattice` is that of the voxelized surface, or null if it is
/// unknown.
std::array<AxisError, 3> axisErrors(const SurfaceErrors& errors, const ClosestPoints& reference,
                                    const Lattice* lattice);

}  // namespace vdbdither
