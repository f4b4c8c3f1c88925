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
class ColourTransform {
 public:
  /// @param channels  of the samples: 1 grey, 3 RGB, 4 CMYK
  /// @returns null where a power or the encoding of sRGB says all, and where the profile is broken
  /// or for samples of another kind
  static std::unique_ptr<ColourTransform> make(const ColourSpace& space, int channels);

  ColourTransform(const ColourTransform&) = delete;
  ColourTransform& operator=(const ColourTransform&) = delete;
  ~ColourTransform();

  /// How many samples a colour has: a grey image may have a profile for RGB.
  [[nodiscard]] int channels() const { return channels_; }

  /// @param samples  0 … 1, `channels()` a colour; of CMYK the ink, 0 … 100
  /// @param linear   red, green, blue; may be outside of 0 … 1 and not finite
  void run(const float* samples, float* linear, std::size_t colours) const;

 private:
  struct Handles;
  ColourTransform(std::unique_ptr<Handles> handles, int channels);

  std::unique_ptr<Handles> handles_;
  int channels_;
};

}  // namespace vdbdither
