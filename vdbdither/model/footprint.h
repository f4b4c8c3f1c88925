#pragma once

namespace vdbdither {

/// The number of leaf nodes that the grids of a job hold, estimated before any voxel exists. All
/// estimates of memory, disk and time start from it. 0 means unknown.
struct Footprint {
  /// In the fullest row of leaves (8 layers). Determines memory.
  double fullest_row = 0;
  /// In all rows. Determines disk and time.
  double total = 0;
  /// Those of `total` that lie within about one voxel diameter of the surface. Equals `total`
  /// unless grids hold distances farther away.
  double at_surface = 0;

  [[nodiscard]] bool known() const { return total > 0; }

  /// The leaves on a lattice with `factor` times as many voxels in each layer.
  [[nodiscard]] Footprint scaled(double factor) const {
    return {fullest_row * factor, total * factor, at_surface * factor};
  }

  /// The leaves of two operands together. The totals are unknown if those of either are; the
  /// fullest row then counts the known leaves only.
  friend Footprint operator+(const Footprint& a, const Footprint& b) {
    const double row = a.fullest_row + b.fullest_row;
    if (!a.known() || !b.known()) return {row, 0, 0};
    return {row, a.total + b.total, a.at_surface + b.at_surface};
  }
  friend bool operator==(const Footprint&, const Footprint&) = default;
};

}  // namespace vdbdither
