#include "io/image/png_decoder.h"
#include "io/image/png_spans.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

namespace {

class GreyPngSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    std::vector<std::uint32_t> grey(stack().materials.size() + 1, 255);
    grey[0] = 0;
    return {{layer.name + ".png", "",
             encodePng(layer.image, {PngPixels::grey8, grey, pitchMm().x(), pitchMm().y()})}};
  }
};

}  // namespace

extern const SliceFormat png8;
const SliceFormat png8{.name = "png8",
                       .summary = "Grey: 255 where printed, else 0",
                       .ending = ".png",
                       .pixel = SlicePixel::printed,
                       .encoder = makeSliceEncoder<GreyPngSlices>,
                       .decode = decodePng,
                       .decodes_colours = true,
                       .bytes_per_leaf = 80};

}  // namespace vdbdither
