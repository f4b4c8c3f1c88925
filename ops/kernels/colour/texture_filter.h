#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <openvdb/math/Vec2.h>
#include <openvdb/math/Vec4.h>

#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// The part of a texture that is averaged for one point of a surface: samples in a parallelogram
/// around it.
struct TextureFootprint {
  std::uint8_t level = 0;                     ///< of the pyramid
  std::array<std::uint8_t, 2> samples{1, 1};  ///< along each side
  // In texels of the level.
  std::array<openvdb::Vec2f, 2> step{};  ///< to the next sample
  openvdb::Vec2f reach{0, 0};            ///< from the middle to the samples farthest from it
  float covariance = 0;                  ///< of the places of the samples along u and v
};

/// A texture with smaller copies of itself, each half as wide and as high, for averages.
///
/// Texels of a copy are the exact averages, by area, of the texels that they cover. Averages of
/// transparent and opaque texels are right, because texels are multiplied by their opacity.
class FilteredTexture {
 public:
  /// @param texture  must outlive the object
  /// @param shown    see TextureCoverage; averages of texels that are shown leave out the others.
  ///                 Empty if all are shown
  explicit FilteredTexture(const Texture& texture, const std::vector<std::uint8_t>& shown = {});

  /// Returns how to average over the box that `edges` span, seen on the surface: `edges` are the
  /// changes of (u, v) along its three edges. The parallelogram has the same extent and direction
  /// (variances) as the box.
  [[nodiscard]] TextureFootprint footprint(const std::array<openvdb::Vec2d, 3>& edges) const;

  /// Returns the average around (u, v): red, green and blue in linear light, multiplied by the
  /// opacity, and the opacity.
  /// @param is_smooth  texels are interpolated; see SurfaceMaterial
  [[nodiscard]] openvdb::Vec4f sample(const openvdb::Vec2f& at, const TextureFootprint& footprint,
                                      const std::array<TextureWrap, 2>& wrap, bool is_smooth) const;

  /// Returns the bytes that the copies take.
  [[nodiscard]] double memoryBytes() const;

 private:
  [[nodiscard]] const Texture& level(std::size_t n) const {
    return n == 0 ? *texture_ : smaller_[n - 1];
  }

  const Texture* texture_;
  std::vector<Texture> smaller_;
};

}  // namespace vdbdither
