#include "io/stack/resin_slices.h"

#include "io/image/png_spans.h"
#include "io/stack/grey_slice.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

void ResinSlices::declare(Options& options) {
  constexpr int longest_s = 3600;
  options.number(format_ + "-exposure", exposure_s_, {0.01, longest_s},
                 "Seconds that a layer of " + format_ + " is lit");
  options.number(format_ + "-bottom-exposure", bottom_exposure_s_, {0.01, longest_s},
                 "The same of the lowest layers");
  options.integer(format_ + "-bottom-layers", bottom_layers_, {0, 1000},
                  "How many layers these are");
  options.flag(format_ + "-grey", grey_,
               "Writes the share of each voxel that lies within the surface as a grey level, in "
               "place of the dither; needs normals");
  options.number(
      format_ + "-dose", dose_, {1.01, 1000},
      "Ratio of the dose of a full pixel to the minimum dose that hardens the resin. Grey "
      "levels then follow the working curve of the resin. Without it they are "
      "proportional to the shares");
  options.onlyIf([this] { return grey_; });
}

void ResinSlices::plan(const Manifest& stack, const Grids& grids) {
  SliceEncoder::plan(stack, grids);
  printer_ = printerOf(stack);
  checkPitch(format_, stack, printer_);
  if (grey_ && (!grids.contains(surface_grid) || !grids.contains(normal_grid))) {
    throw UsageError("--" + format_ +
                     "-grey: needs the grids 'surface' and 'N'; put normals before");
  }
}

std::vector<std::string> ResinSlices::reads() const {
  return grey_ ? std::vector<std::string>{surface_grid, normal_grid} : std::vector<std::string>{};
}

std::vector<SliceFile> ResinSlices::encode(const SliceLayer& layer) const {
  const std::string name = folder_ + layer.name + ".png";
  if (grey_) {
    const SpanImage levels = greySlice(layer, stack().layout, pitchMm(), dose_);
    return {{name, "", encodePng(levels, {PngPixels::grey8, {}})}};
  }
  std::vector<std::uint32_t> grey(stack().materials.size() + 1, 255);
  grey[0] = 0;
  return {{name, "", encodePng(layer.image, {PngPixels::grey8, grey})}};
}

void tellMissingPictures(const StackInput& files, std::span<const char* const> names,
                         Findings& findings) {
  for (const char* name : names) {
    if (files.contains(name)) continue;
    findings.warning("missing-picture",
                     "the picture is missing, which some printers show in their list of jobs; make "
                     "the stack again",
                     files.shown(name));
  }
}

}  // namespace vdbdither
