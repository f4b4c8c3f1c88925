#include "io/image/png_decoder.h"
#include "io/image/png_spans.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

namespace {

class BitPngSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    return forEachMaterial(layer, ".png", [&](std::uint32_t material) {
      std::vector<std::uint32_t> bits(stack().materials.size() + 1, 0);
      bits[material] = 1;
      return encodePng(layer.image, {PngPixels::grey1, bits, pitchMm().x(), pitchMm().y()});
    });
  }
};

}  // namespace

extern const SliceFormat png1;
const SliceFormat png1{.name = "png1",
                       .summary = "For each material a folder of slices with 1 bit per voxel",
                       .ending = ".png",
                       .pixel = SlicePixel::one_material,
                       .encoder = makeSliceEncoder<BitPngSlices>,
                       .decode = decodePng,
                       .decodes_colours = true,
                       .bytes_per_leaf = 80};

}  // namespace vdbdither
