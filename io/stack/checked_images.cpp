// Checks slices of another program, which no manifest describes.

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "io/image/png_spans.h"
#include "io/stack/checked_stack.h"
#include "io/stack/image_stack.h"
#include "io/stack/pixel_meanings.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

namespace fs = std::filesystem;

class ImageLayers : public CheckedStack {
 public:
  ImageLayers(const fs::path& path, const CheckedImagesOptions& options, Findings& findings)
      : options_(options),
        stack_(
            path, [&](const std::string& text) { findings.warning("other-file", text); },
            [&](const std::string& text) { findings.error("numbering", text); }) {
    manifest_.lattice.pitch_mm = options.pitch_mm;
    manifest_.lattice.box = {{0, 0, 0},
                             {static_cast<int>(stack_.width()) - 1,
                              static_cast<int>(stack_.height()) - 1, stack_.layers() - 1}};
    manifest_.layout = {manifest_.lattice.box, 0, options.flip_x, options.flip_y};
    manifest_.layers = manifest_.lattice.layers();
    empty_ = {options.background, stack_.isGrey()};
    if (!empty_.background && !stack_.hasOpacity()) empty_.background = rgba(0, 0, 0);
  }

  [[nodiscard]] bool tellsMaterials() const override { return !stack_.isGrey(); }
  [[nodiscard]] bool hasColours() const override { return true; }
  [[nodiscard]] std::string shown(int z) const override { return stack_.shown(z); }

  [[nodiscard]] CheckedLayer layer(int z) const override {
    CheckedLayer layer;
    layer.z = z;
    ColourImage image;
    if (!read(z, image, layer)) return layer;
    if (options_.wants_rgba && !image.is_rgba8)
      layer.findings.push_back(pixelKindFinding(shown(z), z));
    translate(image.pixels, layer);
    layer.image = std::move(image.pixels);
    return layer;
  }

  void finish(const StackTotals& totals, Findings& findings) const override {
    std::uint64_t printed = 0;
    for (const auto& [colour, count] : totals.voxels) printed += count;
    if (printed > 0 && printed == std::uint64_t{stack_.width()} * stack_.height() *
                                      static_cast<std::uint64_t>(totals.layers)) {
      findings.warning("no-background",
                       "no pixel is empty; give the --background of the images if they have one");
    }
    if (totals.grey.pixels > 0) {
      findings.add({"grey-pixels", Finding::Severity::warning,
                    counted(totals.grey.pixels, "pixel") + " of " +
                        counted(totals.grey.slices, "slice") +
                        (stack_.isGrey()
                             ? " are grey, as of antialiasing; they are split in the middle here: "
                               "turn antialiasing off for exact voxels"
                             : " are neither opaque nor transparent; save them opaque"),
                    totals.grey.file, totals.grey.layer, totals.grey.first, totals.grey.pixels});
    }
  }

 private:
  /// Reads an image, or tells why not.
  bool read(int z, ColourImage& image, CheckedLayer& layer) const {
    const auto tell = [&](const std::string& id, const std::string& text) {
      layer.findings.push_back({id, Finding::Severity::error, text, shown(z), z});
    };
    const auto pixels = [](std::uint32_t width, std::uint32_t height) {
      return std::to_string(width) + " x " + std::to_string(height) + " pixels";
    };
    bool has_other_size = false;
    try {
      image = stack_.read(z, [&](std::uint32_t width, std::uint32_t height) {
        if (width == stack_.width() && height == stack_.height()) return;
        has_other_size = true;
        tell("slice-size", "the slice has " + pixels(width, height) + ", and the first one " +
                               pixels(stack_.width(), stack_.height()) + "; save all slices alike");
        throw DataError("");
      });
    } catch (const DataError& error) {
      if (!has_other_size) tell("unreadable-slice", error.what());
      return false;
    }
    if (image.is_grey != stack_.isGrey()) {
      tell("slice-kind", std::string("the slice has ") +
                             (image.is_grey ? "grey pixels, and the first one colours"
                                            : "colours, and the first one grey pixels") +
                             "; save all slices alike");
      return false;
    }
    if (image.has_opacity != stack_.hasOpacity()) {
      tell("slice-kind", std::string("the slice has ") +
                             (image.has_opacity ? "opacity, and the first one none"
                                                : "no opacity, and the first one some") +
                             "; save all slices alike");
    }
    return true;
  }

  /// From colours to what is printed, and counts.
  void translate(SpanImage& image, CheckedLayer& layer) const {
    std::unordered_map<std::uint32_t, std::uint64_t> voxels;
    for (std::uint32_t y = 0; y < image.height; ++y) {
      std::uint32_t begin = 0;
      for (std::size_t i = image.row_begin[y]; i < image.row_begin[y + 1]; ++i) {
        Span& span = image.spans[i];
        const std::uint32_t level = stack_.isGrey() ? span.value & 255 : span.value >> 24;
        if (level > 0 && level < 255) {
          if (layer.grey.pixels == 0) layer.grey = {0, 1, layer.z, shown(layer.z), {begin, y}};
          layer.grey.pixels += span.end - begin;
        }
        if (empty_.contains(span.value)) {
          span.value = 0;
        } else {
          if (stack_.isGrey()) span.value = rgba(255, 255, 255);
          // What has many colours is a picture: the rest counts as one more.
          const bool is_told =
              voxels.size() < StackTotals::most_strays || voxels.contains(span.value);
          if (!is_told) span.value = stray_value;
          voxels[span.value] += span.end - begin;
        }
        begin = span.end;
      }
    }
    layer.voxels = {voxels.begin(), voxels.end()};
  }

  CheckedImagesOptions options_;
  ImageStack stack_;
  EmptyPixels empty_;
};

}  // namespace

std::unique_ptr<CheckedStack> openImages(const fs::path& path, const CheckedImagesOptions& options,
                                         Findings& findings) {
  return std::make_unique<ImageLayers>(path, options, findings);
}

}  // namespace vdbdither
