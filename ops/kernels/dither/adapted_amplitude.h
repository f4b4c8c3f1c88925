#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <openvdb/openvdb.h>

namespace vdbdither {

/// The dither of a facet: f = k_D·(checker·χ/2 + amplitude·(M − ½)), where χ is +1 on voxels whose
/// indices add up to an odd number and −1 on the others. |f| never exceeds k_D.
struct FacetDither {
  float checker = 0;    ///< 0 … 1: the height of the checkerboard, in half quantization steps
  float amplitude = 0;  ///< the constant of eq. (5), 0 … 2
};

/// Chooses the best dither for a facet by its normal: a compromise between the remaining stairs and
/// the grain of the thresholds, after a printing process that blurs.
///
/// The stairs of a facet with normal n are the projections of the lattice's reciprocal vectors G
/// onto it: waves of |G − (G·n) n| cycles per mm and the height 1/(π·G·n), which a Gaussian of
/// standard deviation σ multiplies by exp(−2π²σ²|G − (G·n) n|²). Displacements multiply them by
/// their characteristic function at G·n, which is sinc(amplitude·k_D·G·n) for the thresholds and
/// cos(π·checker·k_D·G·n) for the checkerboard; the latter adds the waves of half-odd G. All G near
/// the normal count, also high ones: on a slope of 1 in 6 the sixth is a long wave. The grain has
/// the variance of a random choice between two voxels, averaged over the voxels within the blur,
/// times the share that the default mask keeps of it. This share was measured: it is smallest on
/// facets in the lattice planes, rises with the slope, and is nearly 1 on the checkerboard. Lines
/// are more visible than grain, so the variance of the stairs counts three times. Of the
/// combinations tried, the one is chosen whose sum exceeds the minimum by the smallest factor, at σ
/// and at 2σ, so that it suits processes about as sharp as stated and blunter ones. A combination
/// that is worse than plain voxels, with stairs and grain weighted equally, is never chosen. On a
/// lattice that is coarse compared with σ, where the blur hides nothing, these are plain voxels.
/// For the measurements see docs/evaluation.md.
///
/// Normals are divided into cells, and the choice for each is made when a normal first falls into
/// it: about 2000 waves are added up at most, on any lattice. Safe to use from many threads.
class AdaptedAmplitude {
 public:
  /// `spread_mm` is σ, the point spread of the process.
  AdaptedAmplitude(const openvdb::Vec3d& pitch_mm, double spread_mm);

  /// Returns the dither for a unit normal; it is the same for the opposite one.
  [[nodiscard]] FacetDither operator()(const openvdb::Vec3s& normal) const;

 private:
  openvdb::Vec3d pitch_mm_;
  double spread_mm_;
  /// By dominant axis and the two other slopes: 0 while unknown, or 1 + the number of the choice.
  mutable std::vector<std::atomic<std::uint8_t>> cells_;
};

/// Returns the same for one facet, without the table.
FacetDither bestFacetDither(const openvdb::Vec3d& normal, const openvdb::Vec3d& pitch_mm,
                            double spread_mm);

}  // namespace vdbdither
