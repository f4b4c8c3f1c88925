#pragma once

#include <span>
#include <vector>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Which voxels of a layer a picture shows, also such as are not of the lattice's box and empty,
/// and which way round: seen from above, x to the right and y upwards, so that the first row holds
/// the greatest y.
struct SliceLayout {
  openvdb::CoordBBox box;  ///< columns and rows come from its x and y, inclusive
  int padding = 0;         ///< empty voxels added on each side
  bool flip_x = false;
  bool flip_y = false;

  [[nodiscard]] std::uint32_t width() const { return box.dim().x() + 2 * padding; }
  [[nodiscard]] std::uint32_t height() const { return box.dim().y() + 2 * padding; }
  /// Whether the voxel is in its box along x and y.
  [[nodiscard]] bool shows(const openvdb::Coord& voxel) const {
    return voxel.x() >= box.min().x() && voxel.x() <= box.max().x() && voxel.y() >= box.min().y() &&
           voxel.y() <= box.max().y();
  }
  [[nodiscard]] std::uint32_t columnOf(int x) const {
    return static_cast<std::uint32_t>(padding + (flip_x ? box.max().x() - x : x - box.min().x()));
  }
  [[nodiscard]] std::uint32_t rowOf(int y) const {
    return static_cast<std::uint32_t>(padding + (flip_y ? y - box.min().y() : box.max().y() - y));
  }
};

/// The layers of `grid` as spans of its values, one picture per layer of `layers`. The tree is
/// walked once for eight layers together, in parallel; empty space and tiles cost next to nothing.
std::vector<SpanImage> sliceSpans(const openvdb::Int32Grid& grid, const SliceLayout& layout,
                                  ZRange layers);

/// The same for a set of voxels: 1 where active and true, else 0.
std::vector<SpanImage> sliceSpans(const openvdb::BoolGrid& grid, const SliceLayout& layout,
                                  ZRange layers);

/// A slice without a voxel.
SpanImage blankSlice(const SliceLayout& layout);

/// Whether no voxel of it is printed.
bool isBlank(const SpanImage& slice);

/// Expands a box of columns, rows and layers by the printed pixels of layer `z`.
void expandByPrinted(openvdb::CoordBBox& box, const SpanImage& image, int z);

/// 1 where `slice` has this value, else 0.
SpanImage onlyValue(SpanImage slice, std::uint32_t value);

/// The way back: a grid whose layers are the pictures `images`, the first one of them the layer
/// `layers.begin`; 0 is inactive. What lies outside the layout's box is left out. In canonical
/// form.
openvdb::Int32Grid::Ptr gridOfSpans(std::span<const SpanImage> images, const SliceLayout& layout,
                                    ZRange layers);

}  // namespace vdbdither
