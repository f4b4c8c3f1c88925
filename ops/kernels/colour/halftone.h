#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "ops/kernels/colour/coverage_reader.h"
#include "ops/kernels/colour/surface_columns.h"
#include "ops/kernels/mask/threshold_mask.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// One material for every printed voxel. The coverages of the materials, one after another, divide
/// the interval from 0 to 1; the material is the one whose part holds the threshold of the voxel.
/// So every voxel has exactly one, and in a tile of the mask each has its coverage to one voxel.
///
/// Dark materials come first: the voxels of the darkest are those below a threshold, and so are
/// those of the two darkest together. Both are as blue as the mask.
class Halftone {
 public:
  /// @param order  every material once: the indices in the coverages, the darkest first
  Halftone(std::vector<std::size_t> order, ThresholdMask mask)
      : order_(std::move(order)), mask_(std::move(mask)) {}

  /// Returns the material, counted from 1, of every voxel of `solid` in the layers `core`; 0
  /// elsewhere.
  /// @param source   of the coverages
  /// @param bare     the material of voxels without coverages, counted from 1
  /// @param columns  whose voxels have the thresholds of their places in them, or null: the mask
  ///                 then repeats with the lattice alone
  [[nodiscard]] openvdb::Int32Tree::Ptr run(const openvdb::BoolTree& solid,
                                            const CoverageSource& source, std::int32_t bare,
                                            ZRange core,
                                            const SurfaceColumns* columns = nullptr) const;

  [[nodiscard]] double memoryBytes() const { return static_cast<double>(mask_.bytes()); }

 private:
  std::vector<std::size_t> order_;
  ThresholdMask mask_;
};

/// Returns an order of the inks for Halftone: by rising luminance, the clear one before the last.
std::vector<std::size_t> darkestFirst(const InkSet& set);

/// Returns an empty grid of coverages without a name.
openvdb::FloatGrid::Ptr makeCoverageGrid(const openvdb::math::Transform& transform);

/// Returns a grid for each ink of the set: its coverage at the active voxels of `colour` in the
/// layers `core`.
std::vector<openvdb::FloatGrid::Ptr> coverageGrids(const openvdb::Vec3SGrid& colour,
                                                   const CoverageSource& source, std::size_t inks,
                                                   ZRange core);

}  // namespace vdbdither
