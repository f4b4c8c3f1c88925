#pragma once

#include <vector>

#include <openvdb/openvdb.h>

namespace vdbdither {

/// How a facet is dithered: f = k_D·(checker·χ/2 + amplitude·(M − ½)), where χ is +1 on voxels
/// whose indices add up to an odd number and −1 on the others. No |f| is greater than k_D.
struct FacetDither {
  float checker = 0;    ///< 0 … 1: how much of half a quantization step the checkerboard carries
  float amplitude = 0;  ///< the constant of eq. (5), 0 … 2
};

/// The dither that is best for a facet, by its normal: a compromise between the stairs that are
/// left and the grain that the thresholds bring, after a printing process that blurs.
///
/// The stairs of a facet with normal n are the projections of the lattice's reciprocal vectors G
/// onto it: waves of |G − (G·n) n| cycles per mm and the height 1/(π·G·n), which a Gaussian of
/// standard deviation σ lowers to exp(−2π²σ²|G − (G·n) n|²). Displacements lower them by their
/// characteristic function at G·n: sinc(amplitude·k_D·G·n) for the thresholds and
/// cos(π·checker·k_D·G·n) for the checkerboard, which in turn brings the waves of half-odd G. All G
/// near the normal count, high ones too: on a slope of 1 in 6 the sixth is a long wave. The grain
/// has the variance of a random choice between two voxels, averaged over the voxels within the
/// blur, times the share that the default mask keeps of it. That was measured: least on facets in
/// the lattice planes, rising with the slope, and nearly all on the checkerboard. Lines are seen
/// sooner than grain, so the variance of the stairs counts threefold. Of the combinations tried,
/// the one is taken whose sum of both exceeds the least possible by the smallest factor, at σ and
/// at 2σ: so it holds for processes about as sharp as stated and for blunter ones. None is taken
/// that is worse than plain voxels, stairs and grain counted alike. docs/evaluation.md has the
/// measurements.
class AdaptedAmplitude {
 public:
  /// `spread_mm`: σ, the process's point spread.
  AdaptedAmplitude(const openvdb::Vec3d& pitch_mm, double spread_mm);

  /// For a unit normal; of opposite signs alike.
  [[nodiscard]] FacetDither operator()(const openvdb::Vec3s& normal) const;

 private:
  std::vector<FacetDither> cells_;  ///< by dominant axis and the two other slopes
};

/// The same for one facet, computed afresh.
FacetDither bestFacetDither(const openvdb::Vec3d& normal, const openvdb::Vec3d& pitch_mm,
                            double spread_mm);

}  // namespace vdbdither
