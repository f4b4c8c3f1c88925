#include "io/mesh/encoded_colours.h"

#include <algorithm>
#include <cmath>

#include "io/image/srgb.h"

namespace vdbdither {

using openvdb::Vec4f;

namespace {

constexpr double byte_unit = 255;
constexpr double word_unit = 65535;
constexpr float opaque = 1e30F;  // whatever the unit

float valueOrZero(double value) {
  return value > 0 ? static_cast<float>(std::min(value, 1e30)) : 0;
}

}  // namespace

void EncodedColours::padTo(std::size_t count) {
  if (count > colours_.size()) colours_.resize(count, Vec4f(0, 0, 0, -1));
}

void EncodedColours::add(const std::array<double, 3>& colour) { add(colour, double{opaque}); }

void EncodedColours::add(const std::array<double, 3>& colour, double opacity) {
  Vec4f& added = colours_.emplace_back(0, 0, 0, valueOrZero(opacity));
  for (std::size_t i = 0; i < 3; ++i) {
    added[static_cast<int>(i)] = valueOrZero(colour[i]);
    if (std::isfinite(colour[i])) greatest_ = std::max(greatest_, colour[i]);
  }
}

void EncodedColours::decode(const MeshFile& file, const std::string& what) {
  if (unit_ == 1 && greatest_ > 1) {
    file.warn("colours of " + what + " go beyond 1; they are read as 0 to 255");
    unit_ = byte_unit;
  } else if (unit_ == byte_unit && greatest_ > byte_unit) {
    file.warn("colours of " + what + " go beyond 255; they are read as 0 to 65535");
    unit_ = word_unit;
  } else if (unit_ == word_unit && greatest_ > 0 && greatest_ <= byte_unit) {
    file.warn("colours of " + what + " do not go beyond 255; they are read as 0 to 255");
    unit_ = byte_unit;
  } else if (unit_ == byte_unit) {
    for (Vec4f& colour : colours_) {
      if (colour[3] < 0) continue;
      for (int i = 0; i < 3; ++i) {
        const auto byte = static_cast<std::size_t>(std::min(colour[i], 255.0F));
        colour[i] = linearOfSrgbBytes()[byte];
      }
      colour[3] = std::min(colour[3] / 255, 1.0F);
    }
    return;
  }
  for (Vec4f& colour : colours_) {
    if (colour[3] < 0) continue;
    for (int i = 0; i < 3; ++i) colour[i] = static_cast<float>(linearOfSrgb(colour[i] / unit_));
    colour[3] = std::min(static_cast<float>(colour[3] / unit_), 1.0F);
  }
}

}  // namespace vdbdither
