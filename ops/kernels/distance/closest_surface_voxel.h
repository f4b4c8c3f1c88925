#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// Finds ∂V one leaf at a time: the voxels of V = { d < 0 } that have a 6-neighbour outside V.
class SurfaceVoxels {
 public:
  /// `surface` holds d in mm; of inactive voxels and tiles only the sign counts. Layers outside
  /// `valid` are outside V.
  SurfaceVoxels(const openvdb::FloatTree& surface, ZRange valid)
      : surface_(surface), valid_(valid) {}

  /// Returns ∂V among the voxels of `leaf`, a leaf of the tree.
  [[nodiscard]] LeafBits operator()(const FloatLeaf& leaf);

 private:
  const float* valuesAt(const openvdb::Coord& origin);

  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> surface_;
  ZRange valid_;
};

/// Eq. (4), v̄ = argmin over u in ∂V of ‖c(v) − c(u)‖₂, within a radius: the part of the search
/// that depends on the lattice alone.
///
/// The squared distance of voxels (di, dj, dk) apart is (di·dx)² + (dj·dy)² + (dk·dz)² in double
/// precision, summed in this order; of equally near voxels the one with the smallest (k, j, i) is
/// found. Voxels farther than the radius are not found.
class SearchDisk {
 public:
  SearchDisk(const openvdb::Vec3d& pitch_mm, double radius_mm);

  /// The maximum number of voxels along each axis to a voxel that can be found.
  [[nodiscard]] const openvdb::Coord& halo() const { return halo_; }

 private:
  friend class ClosestSurfaceVoxel;
  struct Column {
    double lateral2;  ///< (di·dx)² + (dj·dy)²
    int i, j;
    int offset;  ///< in words of a tile
  };

  double radius2_;
  openvdb::Coord halo_;
  openvdb::Coord leaves_;        ///< leaves that the halo reaches into, on either side
  int words_;                    ///< 64-bit words per column of a tile
  std::vector<Column> columns_;  ///< by rising lateral distance
  std::vector<double> height2_;  ///< (dk·dz)² by dk
};

/// Finds v̄ for the voxels of one leaf at a time.
class ClosestSurfaceVoxel {
 public:
  /// The active voxels of `surface_voxels` are ∂V; the search returns the values that they hold.
  /// Both arguments must outlive the search.
  ClosestSurfaceVoxel(const openvdb::FloatTree& surface_voxels, const SearchDisk& disk);

  struct Found {
    openvdb::Coord ijk;
    float value;
  };

  /// Moves the search to the leaf at `origin`. Returns false if no leaf within the radius holds a
  /// surface voxel.
  bool visit(const openvdb::Coord& origin);

  /// The leaves within the radius of the visited one, null where there are no surface voxels.
  [[nodiscard]] const std::vector<const FloatLeaf*>& leaves() const { return leaves_; }

  /// Returns v̄ of the voxel at `offset` in the leaf, or nothing if none is within the radius.
  [[nodiscard]] std::optional<Found> operator()(unsigned offset);

 private:
  void gather();

  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> surface_voxels_;
  const SearchDisk& disk_;
  openvdb::Coord origin_;
  std::vector<const FloatLeaf*> leaves_;
  bool gathered_ = false;
  std::vector<std::uint64_t> tile_;  ///< ∂V in the leaf and its halo: a column along z per (x, y)
};

}  // namespace vdbdither
