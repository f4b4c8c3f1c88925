#pragma once

#include <array>
#include <optional>

#include "ops/kernels/measure/surface_error.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// What the error has to do with one axis of the printer. All by area.
struct AxisError {
  /// Pearson's correlation of the error with the coordinate along the axis, over the whole surface.
  double correlation = 0;

  /// Of the points where the reference faces along this axis more than along the others: their
  /// area, bias, mean and RMS of the error.
  double area_mm2 = 0;
  double bias_mm = 0;
  double mean_mm = 0;
  double rms_mm = 0;

  /// The trace that the lattice leaves in the error of the same points: the error's mean and
  /// deviation for each of 16 phases of the reference's position within a voxel along the axis.
  struct Phase {
    double staircase_mm = 0;   ///< RMS of the means about the mean of all
    double explained = 0;      ///< their share of the error's variance
    double modulation_mm = 0;  ///< how much the deviation varies with the phase, RMS
  };
  std::optional<Phase> phase;  ///< where there is a lattice and such points
};

/// For x, y and z. `lattice`: what the surface was voxelized on, if that is known.
std::array<AxisError, 3> axisErrors(const SurfaceErrors& errors, const ClosestPoints& reference,
                                    const Lattice* lattice);

}  // namespace vdbdither
