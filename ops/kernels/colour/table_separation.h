#pragma once

#include "ops/kernels/colour/separation.h"

namespace vdbdither {

/// Separation by the table of an ink set. Between the nodes, coverages are interpolated in
/// tetrahedra, so that a grey depends on the nodes of greys alone.
///
/// Source: Kasson, Plouffe, Nin: A tetrahedral interpolation technique for color space conversion,
/// SPIE 1909 (1993).
class TableSeparation : public Separation {
 public:
  /// @param set  has a table of values ≥ 0, of sum 1
  explicit TableSeparation(const InkSet& set);

  void run(const openvdb::Vec3s& linear_rgb, std::span<float> coverages) const override;
  [[nodiscard]] double memoryBytes() const override;

 private:
  CoverageTable table_;
  std::size_t inks_;
};

}  // namespace vdbdither
