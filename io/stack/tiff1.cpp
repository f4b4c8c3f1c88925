#include "io/image/tiff.h"
#include "io/stack/slice_format.h"

namespace vdbdither {

namespace {

class BitTiffSlices : public SliceEncoder {
 public:
  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    return forEachMaterial(layer, ".tif", [&](std::uint32_t material) {
      return encodeTiff(onlyValue(layer.image, material), {{}, pitchMm().x(), pitchMm().y()});
    });
  }
};

}  // namespace

extern const SliceFormat tiff1;
const SliceFormat tiff1{.name = "tiff1",
                        .summary = "For each material a folder of slices with 1 bit per voxel",
                        .ending = ".tif",
                        .pixel = SlicePixel::one_material,
                        .encoder = makeSliceEncoder<BitTiffSlices>,
                        .decode = decodeTiff,
                        .other_ending = ".tiff",
                        .bytes_per_leaf = 80};

}  // namespace vdbdither
