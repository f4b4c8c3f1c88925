#pragma once

#include <cstdint>
#include <vector>

#include <openvdb/openvdb.h>

#include "ops/kernels/leaf/floats.h"

namespace vdbdither {

/// How much the errors of two voxels near a facet have in common once the printing process has
/// blurred them.
///
/// A voxel that is printed by the share q more than it should be raises the printed surface around
/// it by q·exp(−r²/2σ²), where r is the distance along the facet. The integral of the product of
/// two such hills, at voxels that lie Δ apart and d_v and d_w above the facet, is proportional to
/// w = exp(−x/4), where x = (|Δ|² − (d_v − d_w)²) / σ². The kernel uses (1 − x/32)⁸, which differs
/// from w by 0.04 at most and is the same on every machine.
class HeightKernel {
 public:
  /// One hill: its width as a multiple of σ, and its factor.
  struct Term {
    double width = 1;
    double factor = 1;
  };

  /// The voxels of one column along z within the reach, around the one in the middle.
  struct Column {
    int x, y;
    int z;                 ///< the column holds −z … z
    std::uint32_t apart2;  ///< the index of that of −z
  };

  /// \param pitch_mm  edges of the voxels
  /// \param spread_mm  σ along each axis
  /// \param terms  hills that are added up
  /// \param reach  the maximum |Δ|, in σ; it is also limited to `maximum_reach` voxels
  HeightKernel(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& spread_mm,
               const std::vector<Term>& terms, double reach);

  /// The maximum |Δ| along each axis, in voxels.
  static constexpr int maximum_reach = 16;
  [[nodiscard]] const openvdb::Coord& reach() const { return reach_; }

  [[nodiscard]] const std::vector<Column>& columns() const { return columns_; }

  /// (|Δ|/σ)² of the voxels of all columns. Those of a column are followed by values of weight
  /// zero, for reading by eight.
  [[nodiscard]] const std::vector<float>& apart2() const { return apart2_; }

  /// The weights of one hill by x = |Δ|² − (d_v − d_w)² in units of σ². Negative x, which distances
  /// from different facets can give, count as zero.
  struct Hill {
    float slope;
    float factor;

    /// Sets `w` to the weights; `Lanes` is Floats or EightFloats.
    template <typename Lanes>
    [[gnu::always_inline]] void weigh(const Lanes& x, Lanes& w) const {
      w = 1.0F - (x > 0.0F ? x : Lanes{}) * slope;
      w = w > 0.0F ? w : Lanes{};
      w *= w;
      w *= w;
      w *= w;
      w *= factor;
    }
  };
  [[nodiscard]] const std::vector<Hill>& hills() const { return hills_; }

 private:
  void addColumn(int x, int y, int z, double across2, double step);

  openvdb::Coord reach_;
  std::vector<Column> columns_;
  std::vector<float> apart2_;
  std::vector<Hill> hills_;
};

}  // namespace vdbdither
