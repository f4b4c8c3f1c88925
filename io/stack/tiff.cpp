#include "io/image/tiff.h"

#include "io/stack/slice_format.h"

namespace vdbdither {

namespace {

class TiffSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    const std::vector<std::uint32_t> colours = palette();
    return {{layer.name + ".tif", "",
             encodeTiff(layer.image, {colours, pitchMm().x(), pitchMm().y()})}};
  }
};

}  // namespace

extern const SliceFormat tiff;
const SliceFormat tiff{.name = "tiff",
                       .summary = "A palette of the colours of the materials",
                       .ending = ".tif",
                       .pixel = SlicePixel::palette,
                       .encoder = makeSliceEncoder<TiffSlices>,
                       .decode = decodeTiff,
                       .other_ending = ".tiff",
                       .bytes_per_leaf = 250,
                       .most_materials = 255};

}  // namespace vdbdither
