#include "io/stack/resin_slices.h"

#include "io/image/png_spans.h"

namespace vdbdither {

void ResinSlices::declare(Options& options) {
  constexpr int longest_s = 3600;
  options.number(format_ + "-exposure", exposure_s_, {0.01, longest_s},
                 "Seconds that a layer of " + format_ + " is lit");
  options.number(format_ + "-bottom-exposure", bottom_exposure_s_, {0.01, longest_s},
                 "The same of the lowest layers");
  options.integer(format_ + "-bottom-layers", bottom_layers_, {0, 1000},
                  "How many layers these are");
}

void ResinSlices::plan(const Manifest& stack, const Grids& grids) {
  SliceEncoder::plan(stack, grids);
  printer_ = printerOf(stack);
  checkPitch(format_, stack, printer_);
}

std::vector<SliceFile> ResinSlices::encode(const SliceLayer& layer) const {
  std::vector<std::uint32_t> grey(stack().materials.size() + 1, 255);
  grey[0] = 0;
  return {{folder_ + layer.name + ".png", "", encodePng(layer.image, {PngPixels::grey8, grey})}};
}

}  // namespace vdbdither
