#include "io/stack/pixel_meanings.h"

#include "io/image/png_spans.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

std::map<std::uint32_t, std::uint32_t> meaningsOfPixels(
    const Manifest& stack,
    const std::function<void(std::uint32_t material, std::uint32_t other)>& clash) {
  const SliceFormat& format = *findSliceFormat(stack.format);
  const auto count = static_cast<std::uint32_t>(stack.materials.size());
  std::map<std::uint32_t, std::uint32_t> meanings;
  switch (format.pixel) {
    case SlicePixel::colour:
      meanings[rgba(stack.background)] = 0;
      for (std::uint32_t i = 1; i <= count; ++i) {
        const auto [place, is_new] = meanings.try_emplace(rgba(stack.materials[i - 1].rgba), i);
        if (!is_new) clash(i, place->second);
      }
      break;
    case SlicePixel::palette:
    case SlicePixel::index:
      for (std::uint32_t i = 0; i <= count; ++i) meanings[i] = i;
      break;
    case SlicePixel::one_material:
    case SlicePixel::printed:
      if (format.decodes_colours) {
        meanings = {{rgba(0, 0, 0), 0}, {rgba(255, 255, 255), 1}};
      } else {
        meanings = {{0, 0}, {1, 1}};
      }
      break;
  }
  return meanings;
}

std::string sameColourText(const Manifest& stack, std::uint32_t material, std::uint32_t other) {
  return "the material '" + stack.materials[material - 1].name + "' has the colour of " +
         (other == 0 ? "the background" : "'" + stack.materials[other - 1].name + "'");
}

std::string colourText(std::uint32_t colour) {
  std::string text;
  for (int channel = 0; channel < 4; ++channel)
    text += (channel ? "," : "") + std::to_string(colour >> 8 * channel & 255);
  return text;
}

}  // namespace vdbdither
