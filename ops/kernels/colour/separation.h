#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include <openvdb/Types.h>

#include "vdbdither/model/ink_set.h"

namespace vdbdither {

/// A colour that the inks cannot mix moves towards an aim: a grey of its lightness, and from there
/// towards the mean of all inks by this share of the way for each unit of saturation.
/// docs/halftone.md compares values.
inline constexpr double aim_pull = 0.5;

/// Returns the colour that is wanted of inks for linear light of 0 … 1, between the colours of the
/// darkest and of the lightest ink (the scaling of black point compensation).
inline openvdb::Vec3d betweenInks(const openvdb::Vec3d& linear_rgb, const openvdb::Vec3d& dark,
                                  const openvdb::Vec3d& light) {
  return dark + linear_rgb * (light - dark);
}

/// Inks for colours: how large a share of the voxels each ink of a set gets.
class Separation {
 public:
  virtual ~Separation() = default;

  /// Sets `coverages`, one for each ink of the set: ≥ 0, of sum 1 to 1e-6, and 0 for the clear ink.
  /// Depends continuously on the colour. Safe to call from many threads.
  /// @param linear_rgb  finite; values outside 0 … 1 are clipped
  virtual void run(const openvdb::Vec3s& linear_rgb, std::span<float> coverages) const = 0;

  [[nodiscard]] virtual double memoryBytes() const = 0;
};

/// Returns the separation into the inks of `set`: by its table if it has one, otherwise by the law
/// of Kubelka and Munk for four to six inks that colour and have coefficients, otherwise by that
/// of Yule and Nielsen (ops/kernels/colour/ink_separation.h). Throws UsageError for a set that has
/// no ink but the clear one.
std::unique_ptr<Separation> separationInto(const InkSet& set);

}  // namespace vdbdither
