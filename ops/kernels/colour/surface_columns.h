#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "ops/kernels/leaf/leaf_bits.h"
#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// The printed voxels next to the surface, counted from it on in columns.
///
/// A column runs along the axis that the normal of the surface is closest to. It begins with a
/// printed voxel whose neighbour along this axis, on the outer side, is empty, and ends before the
/// first empty voxel or at a depth. If a voxel lies in several columns, it belongs to the one whose
/// beginning is nearest. Voxels deeper down, and those beside an edge of the part, may lie in none.
class SurfaceColumns {
 public:
  /// @param surface   distances in mm, < 0 inside
  /// @param solid     the printed voxels
  /// @param pitch_mm  of the voxels
  /// @param depth_mm  of the columns
  /// @param valid     the layers that can be read; others are empty
  SurfaceColumns(const openvdb::FloatTree& surface, const openvdb::BoolTree& solid,
                 const openvdb::Vec3d& pitch_mm, double depth_mm, ZRange valid);

  /// Returns how many layers below and above a voxel its column depends on.
  static int reachLayers(const openvdb::Vec3d& pitch_mm, double depth_mm);

  class Reader;

 private:
  /// Two for each axis: outwards along it, and against it.
  static constexpr unsigned directions = 6;

  const openvdb::BoolTree& solid_;
  openvdb::Vec3d pitch_mm_;
  std::array<int, 3> lengths_{};  ///< of columns along each axis, in voxels
  ZRange valid_;
  std::array<openvdb::MaskTree, directions> beginnings_;
};

/// The columns in one leaf.
class SurfaceColumns::Reader {
 public:
  explicit Reader(const SurfaceColumns& columns);

  /// Reads the leaf at `origin`. Returns whether one of its voxels lies in a column.
  bool visit(const openvdb::Coord& origin);

  /// Returns whether one of the eight voxels from `offset` on, a row along z, lies in a column.
  [[nodiscard]] bool rowHasColumns(unsigned offset) const {
    std::uint64_t codes = 0;
    std::memcpy(&codes, &codes_[offset], sizeof codes);
    return codes != 0;
  }

  [[nodiscard]] bool isInColumn(unsigned offset) const { return codes_[offset] != 0; }

  /// Returns the index of the voxel at `offset`, which lies in a column, with its place in the
  /// column instead of the index along the column: 0 where it begins, and from there on in the
  /// direction of the column.
  [[nodiscard]] openvdb::Coord place(unsigned offset) const;

 private:
  using Bits = openvdb::tree::ValueAccessor<const openvdb::MaskTree, false>;

  [[nodiscard]] LeafBits beginnings(unsigned direction, const openvdb::Coord& origin) const;
  void follow(unsigned direction);

  const SurfaceColumns& columns_;
  openvdb::tree::ValueAccessor<const openvdb::BoolTree, false> solid_;
  std::array<Bits, directions> beginnings_;
  openvdb::Coord origin_;
  std::array<std::uint8_t, 512> codes_{};  ///< 0, or 1 + direction + 6 · place
  std::array<double, 512> depths_mm_{};    ///< from the voxel where the column begins
  bool has_depths_ = false;                ///< whether depths_mm_ are those of this leaf
};

}  // namespace vdbdither
