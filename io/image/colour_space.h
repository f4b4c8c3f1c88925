#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

namespace vdbdither {

/// What an image file says of its colours. Nothing said means sRGB.
struct ColourSpace {
  /// The positions of red, green, blue and white in the CIE diagram, x and y.
  using Chromaticities = std::array<std::array<double, 2>, 4>;

  std::vector<std::uint8_t> icc_profile;
  /// Light is the sample raised to this power; 1: the samples are linear.
  std::optional<double> exponent;
  std::optional<Chromaticities> chromaticities;
};

/// Converts colours to linear light with the primaries of Rec. 709. The white of the space becomes
/// the white of Rec. 709 (relative colorimetric).
///
/// The conversion is sampled once, since LittleCMS takes several 100 ns for a colour: a sum of
/// curves where it is one, which is exact to 10⁻⁶ for usual curves, otherwise a grid, between whose
/// points it is linear (to some 10⁻⁴ for RGB, 10⁻³ for CMYK).
class ColourTransform {
 public:
  using Linear = std::array<float, 3>;  ///< red, green, blue; may be outside of 0 … 1

  /// @param channels  of the samples: 1 grey, 3 RGB, 4 CMYK
  /// @returns null where a power or the encoding of sRGB says all, and where the profile is broken
  /// or for samples of another kind
  static std::unique_ptr<ColourTransform> make(const ColourSpace& space, int channels);

  /// How many samples a colour has: a grey image may have a profile for RGB.
  [[nodiscard]] std::size_t channels() const { return channels_; }

  /// @param samples  0 … 1, `channels()` of them; of CMYK the amounts of ink
  [[nodiscard]] Linear at(const double* samples) const {
    return grid_.empty() ? sumOfCurves(samples) : interpolated(samples);
  }

 private:
  class Engine;

  explicit ColourTransform(std::size_t channels) : channels_(channels) {}
  bool sampleCurves(const Engine& engine);
  void sampleGrid(const Engine& engine);
  [[nodiscard]] Linear sumOfCurves(const double* samples) const;
  [[nodiscard]] Linear interpolated(const double* samples) const;

  std::size_t channels_;
  std::vector<Linear> curves_;  ///< one behind the other
  std::vector<Linear> grid_;    ///< the first channel varies fastest
  std::size_t edge_ = 0;        ///< of the grid, in points
};

}  // namespace vdbdither
