#pragma once

#include <memory>

#include <openvdb/Types.h>

namespace openvdb {
OPENVDB_USE_VERSION_NAMESPACE
namespace OPENVDB_VERSION_NAME::math {
class Transform;
}
}  // namespace openvdb

namespace vdbdither {

/// Layers of voxels, half open: begin, begin + 1, …, end − 1 are absolute z indices of the lattice.
struct ZRange {
  int begin = 0;
  int end = 0;

  [[nodiscard]] int size() const { return end - begin; }
  [[nodiscard]] bool empty() const { return end <= begin; }
  [[nodiscard]] bool contains(int z) const { return z >= begin && z < end; }
  friend bool operator==(const ZRange&, const ZRange&) = default;
};

/// Edge of an OpenVDB leaf; slabs are cut at multiples of it.
inline constexpr int leaf_layers = 8;

/// `range` grown outwards to multiples of `leaf_layers`.
ZRange alignedToLeaves(ZRange range);

/// The part that `a` and `b` share; empty ranges come back as {begin, begin}.
ZRange intersection(ZRange a, ZRange b);

/// The printer's lattice: index (i, j, k) is the centre of a voxel at origin_mm + (i·dx, j·dy,
/// k·dz) mm.
struct Lattice {
  openvdb::Vec3d pitch_mm{1.0, 1.0, 1.0};
  /// Where index (0, 0, 0) lies. Zero but on a lattice refined for interlacing.
  openvdb::Vec3d origin_mm{0.0, 0.0, 0.0};
  /// The voxels a job may touch, inclusive. Empty (min > max) where there are none.
  openvdb::CoordBBox box;

  [[nodiscard]] openvdb::Vec3d position(const openvdb::Coord& ijk) const {
    return origin_mm + ijk.asVec3d() * pitch_mm;
  }
  [[nodiscard]] ZRange layers() const {
    // The empty box of OpenVDB has the least and the greatest integers as its corners.
    return box.min().z() > box.max().z() ? ZRange{} : ZRange{box.min().z(), box.max().z() + 1};
  }
  /// Length of a voxel's diagonal, mm: the largest voxel diameter along any direction.
  [[nodiscard]] double diagonalMm() const { return pitch_mm.length(); }
  friend bool operator==(const Lattice&, const Lattice&) = default;
};

/// The transform of a grid on the lattice, one of its own: a pure scale, and a shift where the
/// origin is not zero.
std::shared_ptr<openvdb::math::Transform> transformOf(const Lattice& lattice);

}  // namespace vdbdither
