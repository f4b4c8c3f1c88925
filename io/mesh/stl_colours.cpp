// No specification of STL has colours: these are the conventions of VisCAM and SolidView and of
// Materialise Magics in the two attribute bytes, as the programs write them.

#include "io/mesh/stl_colours.h"

#include <array>
#include <cstddef>
#include <utility>

#include "io/image/srgb.h"

namespace vdbdither {

namespace {

constexpr std::uint16_t highest_bit = 0x8000;
constexpr std::uint16_t channel_mask = 31;
/// What kind of number a key is.
constexpr std::uint64_t is_five_bits = std::uint64_t{1} << 32;
constexpr std::uint64_t is_bytes = std::uint64_t{2} << 32;

std::uint64_t keyOfFiveBits(std::uint64_t red, std::uint64_t green, std::uint64_t blue) {
  return is_five_bits | (red & channel_mask) | (green & channel_mask) << 8 |
         (blue & channel_mask) << 16;
}

openvdb::Vec4f colourOf(std::uint64_t key) {
  const auto part = [&](int i) { return static_cast<std::size_t>(key >> 8 * i & 255); };
  if ((key & is_bytes) != 0) {
    const auto& linear = linearOfSrgbBytes();
    return {linear[part(0)], linear[part(1)], linear[part(2)], static_cast<float>(part(3)) / 255};
  }
  const auto light = [&](int i) {
    return static_cast<float>(linearOfSrgb(static_cast<double>(part(i)) / channel_mask));
  };
  return {light(0), light(1), light(2), 1};
}

}  // namespace

void StlColours::begin(std::string_view header) {
  constexpr std::string_view mark = "COLOR=";
  part_ = 0;
  const std::size_t at = header.find(mark);
  if (at == header.npos || at + mark.size() + 4 > header.size()) return;
  part_ = is_bytes;
  for (std::size_t i = 0; i < 4; ++i)
    part_ |= std::uint64_t{static_cast<unsigned char>(header[at + mark.size() + i])} << 8 * i;
}

StlColours::Key StlColours::keyOf(std::uint16_t attribute) const {
  const std::uint64_t low = attribute;
  const std::uint64_t middle = low >> 5;
  const std::uint64_t high = low >> 10;
  const bool is_marked = (attribute & highest_bit) != 0;
  if (part_ != 0) return is_marked ? part_ : keyOfFiveBits(low, middle, high);
  return is_marked ? keyOfFiveBits(high, middle, low) : 0;
}

void StlColours::add(std::uint16_t attribute) {
  const Key key = keyOf(attribute);
  has_colours_ = has_colours_ || key != 0;
  const auto index = static_cast<std::uint32_t>(appearance_.materials.size());
  const auto [at, is_new] = materials_.emplace(key, index);
  if (is_new) {
    SurfaceMaterial& made = appearance_.materials.emplace_back();
    if (key != 0) made.colour = colourOf(key);
  }
  appearance_.material.push_back(at->second);
}

std::shared_ptr<const Appearance> StlColours::finish() {
  if (!has_colours_) return nullptr;
  return std::make_shared<Appearance>(std::move(appearance_));
}

}  // namespace vdbdither
