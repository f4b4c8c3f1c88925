#include "io/image/png_decoder.h"
#include "io/image/png_spans.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

namespace {

class PngSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    const std::vector<std::uint32_t> colours = palette();
    return {{layer.name + ".png", "",
             encodePng(layer.image, {PngPixels::rgba8, colours, pitchMm().x(), pitchMm().y()})}};
  }
};

}  // namespace

extern const SliceFormat png;
const SliceFormat png{.name = "png",
                      .summary = "32-bit RGBA in the colours of the materials",
                      .ending = ".png",
                      .pixel = SlicePixel::colour,
                      .encoder = makeSliceEncoder<PngSlices>,
                      .decode = decodePng,
                      .decodes_colours = true,
                      .bytes_per_leaf = 125};

}  // namespace vdbdither
