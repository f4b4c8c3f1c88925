// Checks a stack against its manifest, or a container against its own description.

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include "io/file/digest.h"
#include "io/image/png_spans.h"
#include "io/stack/checked_stack.h"
#include "io/stack/pixel_meanings.h"
#include "io/stack/slice_format.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

namespace fs = std::filesystem;

/// Whether the pixel of a colour is grey, and neither black nor white.
bool isBetween(std::uint32_t colour) {
  const std::uint32_t grey = colour & 255;
  return colour >> 24 == 255 && grey == (colour >> 8 & 255) && grey == (colour >> 16 & 255) &&
         grey > 0 && grey < 255;
}

/// Whether a PNG has 32 bits a pixel, by its bit depth and colour type (PNG, third
/// edition, 11.2.1).
bool isRgba8(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t depth_at = 24;
  constexpr std::size_t kind_at = 25;
  constexpr int colour_and_opacity = 6;
  return bytes.size() > kind_at && bytes[depth_at] == 8 && bytes[kind_at] == colour_and_opacity;
}

/// Tallies pixels from left to right, row by row.
class PixelCounter {
 public:
  PixelCounter(PixelTally& tally, int z, const std::string& file) : tally_(tally) {
    if (tally_.pixels > 0) return;
    tally_ = {0, 1, z, file, {}};
  }
  void add(std::uint32_t begin, std::uint32_t end, std::uint32_t row) {
    if (tally_.pixels == 0) tally_.first = {begin, row};
    tally_.pixels += end - begin;
  }

 private:
  PixelTally& tally_;
};

class DescribedLayers : public CheckedStack {
 public:
  DescribedLayers(const fs::path& path, Findings& findings)
      : input_(StackInput::putBack(
            path, [&](const std::string& text) { findings.warning("put-back", text); })) {
    const auto tell = [&](const std::string& text) { findings.error("manifest-changed", text); };
    manifest_ = input_.described() ? input_.described()->manifest
                                   : readManifest(input_, EditedStack::taken, tell);
    const std::string shown = input_.shownManifest();
    format_ = findSliceFormat(manifest_.format);
    if (format_ == nullptr)
      throw DataError("'" + shown + "': there is no format '" + manifest_.format + "'");
    if (format_->pixel == SlicePixel::one_material) {
      for (const Material& material : manifest_.materials) kinds_.push_back(material.name);
    } else {
      kinds_ = {""};
    }
    checkNames(findings);
    indexSlices(findings);
    checkFiles(findings);
    checkForOthers(findings);
    for (const auto& [pixel, meaning] :
         meaningsOfPixels(manifest_, [&](std::uint32_t material, std::uint32_t other) {
           findings.error("same-colour",
                          sameColourText(manifest_, material, other) +
                              "; the printer cannot tell them apart: give one another colour",
                          shown);
         }))
      meanings_.emplace_back(pixel, meaning);
  }

  [[nodiscard]] bool hasLattice() const override { return !input_.described(); }
  [[nodiscard]] bool tellsMaterials() const override {
    return manifest_.grid == material_grid &&
           (format_->pixel != SlicePixel::printed ||
            (!input_.described() && manifest_.materials.size() == 1));
  }
  [[nodiscard]] bool showsDisplay() const override { return format_->shows_display; }
  [[nodiscard]] std::string shown(int z) const override {
    for (const std::string& kind : kinds_) {
      if (const Manifest::Slice* slice = find(z, kind)) return input_.shown(slice->file);
    }
    return "";
  }

  [[nodiscard]] CheckedLayer layer(int z) const override;

  void finish(const StackTotals& totals, Findings& findings) const override {
    tellStrays(totals, findings);
    if (!input_.described() || format_->check == nullptr) return;
    std::vector<std::uint64_t> voxels;
    for (std::uint32_t i = 1; i <= manifest_.materials.size(); ++i) {
      const auto found = totals.voxels.find(i);
      voxels.push_back(found == totals.voxels.end() ? 0 : found->second);
    }
    try {
      format_->check(input_, *input_.described(), voxels, findings);
    } catch (const DataError& error) {
      findings.error("configuration", error.what());
    }
  }

 private:
  [[nodiscard]] const Manifest::Slice* find(int z, const std::string& material) const {
    const auto slice = slices_.find({z, material});
    return slice == slices_.end() ? nullptr : slice->second;
  }

  void checkNames(Findings& findings) const {
    std::set<std::string> names;
    for (const Material& material : manifest_.materials) {
      if (!names.insert(material.name).second) {
        findings.error("same-name",
                       "two materials are called '" + material.name + "'; give one another name",
                       input_.shownManifest());
      }
    }
  }

  void indexSlices(Findings& findings) {
    const std::set<std::string> known(kinds_.begin(), kinds_.end());
    for (const Manifest::Slice& slice : manifest_.slices) {
      const auto extra = [&](const std::string& text) {
        findings.add({"extra-slice", Finding::Severity::error, text, input_.shown(slice.file),
                      numberOf(slice.layer)});
      };
      if (!manifest_.layers.contains(slice.layer) || !known.contains(slice.material)) {
        extra(
            "the manifest names a slice of a layer or material that the stack does not have; "
            "make the stack again");
      } else if (const auto [place, is_new] =
                     slices_.try_emplace({slice.layer, slice.material}, &slice);
                 !is_new) {
        extra("the manifest names another slice of this layer, '" + place->second->file +
              "'; remove one of them");
      }
    }
  }

  void checkFiles(Findings& findings) const {
    for (int z = manifest_.layers.begin; z < manifest_.layers.end; ++z) {
      for (const std::string& kind : kinds_) {
        const Manifest::Slice* slice = find(z, kind);
        if (slice != nullptr && input_.contains(slice->file)) continue;
        findings.add(
            {"missing-slice", Finding::Severity::error,
             slice == nullptr
                 ? "the manifest names no slice of this layer" +
                       (kind.empty() ? "" : " for '" + kind + "'") + "; make the stack again"
                 : "the slice is missing; copy it again, or make the stack again",
             slice == nullptr ? input_.shownManifest() : input_.shown(slice->file), numberOf(z)});
      }
    }
  }

  /// Whoever adds a slice may believe that it is printed.
  void checkForOthers(Findings& findings) const {
    std::set<std::string> named{preview_name};
    std::set<fs::path> folders;
    for (const Manifest::Slice& slice : manifest_.slices) {
      named.insert(slice.file);
      folders.insert(fs::path(slice.file).parent_path());
    }
    for (const std::string& name : input_.names()) {
      const fs::path file(name);
      if (named.contains(name) || !equalsIgnoringCase(file.extension().string(), format_->ending) ||
          file.filename().string().starts_with('.'))
        continue;
      // A container has pictures of other kinds in other folders.
      if (input_.described() && !folders.contains(file.parent_path())) continue;
      findings.error("extra-slice",
                     "the stack does not name this slice; remove it, or make the stack again",
                     input_.shown(name));
    }
  }

  [[nodiscard]] std::optional<SpanImage> read(const Manifest::Slice& slice,
                                              CheckedLayer& layer) const;
  void translate(SpanImage& image, const std::string& file, CheckedLayer& layer) const;
  void overlay(SpanImage& image, const SpanImage& mask, std::uint32_t value,
               const std::string& file, CheckedLayer& layer) const;
  void tellStrays(const StackTotals& totals, Findings& findings) const;

  StackInput input_;
  const SliceFormat* format_ = nullptr;
  std::vector<std::string> kinds_;  ///< the materials with files of their own, or one empty name
  std::map<std::pair<int, std::string>, const Manifest::Slice*> slices_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> meanings_;  ///< of pixels, in rising order
};

CheckedLayer DescribedLayers::layer(int z) const {
  CheckedLayer layer;
  layer.z = z;
  if (format_->pixel != SlicePixel::one_material) {
    if (const Manifest::Slice* slice = find(z, "")) layer.image = read(*slice, layer);
  } else {
    // A slice that is there confirms the size of the layout before memory is taken for it.
    std::optional<SpanImage> all;
    bool is_whole = true;
    for (std::uint32_t i = 1; i <= kinds_.size(); ++i) {
      const Manifest::Slice* slice = find(z, kinds_[i - 1]);
      const std::optional<SpanImage> mask = slice ? read(*slice, layer) : std::nullopt;
      is_whole = is_whole && mask;
      if (mask && !all) all = blankSlice(manifest_.layout);
      if (mask) overlay(*all, *mask, i, input_.shown(slice->file), layer);
    }
    if (kinds_.empty()) all = blankSlice(manifest_.layout);
    if (is_whole) layer.image = std::move(all);
  }
  if (!layer.image) return layer;
  std::vector<std::uint64_t> voxels(manifest_.materials.size() + 1);
  std::uint64_t strays = 0;
  for (std::uint32_t y = 0; y < layer.image->height; ++y) {
    std::uint32_t begin = 0;
    for (const Span& span : layer.image->row(y)) {
      (span.value == stray_value ? strays : voxels[span.value]) += span.end - begin;
      begin = span.end;
    }
  }
  for (std::uint32_t i = 1; i < voxels.size(); ++i) {
    if (voxels[i] > 0) layer.voxels[i] = voxels[i];
  }
  if (strays > 0) layer.voxels[stray_value] = strays;
  return layer;
}

/// Reads a slice, or tells why not.
std::optional<SpanImage> DescribedLayers::read(const Manifest::Slice& slice,
                                               CheckedLayer& layer) const {
  const SliceLayout& layout = manifest_.layout;
  const std::string file = input_.shown(slice.file);
  const int number = numberOf(slice.layer);
  const auto tell = [&](const std::string& id, const std::string& text) {
    layer.findings.push_back({id, Finding::Severity::error, text, file, number});
  };
  // What is missing was told before.
  if (!input_.contains(slice.file)) return std::nullopt;
  std::optional<std::array<std::uint32_t, 2>> other_size;
  try {
    input_.check(slice.file, manifest_.mostBytesOfSlice());
    const std::vector<std::uint8_t> bytes = input_.read(slice.file, manifest_.mostBytesOfSlice());
    if (!input_.described() && sha256Of(bytes) != slice.sha256) {
      tell("slice-changed",
           "the slice was changed after it was written: its digest differs; make the stack again, "
           "or import the stack with --edited and export it");
    }
    SpanImage image = format_->decode(bytes, [&](std::uint32_t width, std::uint32_t height) {
      if (width == layout.width() && height == layout.height()) return;
      other_size = {width, height};
      throw DataError("");
    });
    if (format_->pixel == SlicePixel::colour && !isRgba8(bytes))
      layer.findings.push_back(pixelKindFinding(file, number));
    translate(image, file, layer);
    return image;
  } catch (const DataError& error) {
    if (other_size) {
      tell("slice-size", "the slice has " + std::to_string((*other_size)[0]) + " x " +
                             std::to_string((*other_size)[1]) + " pixels, not " +
                             std::to_string(layout.width()) + " x " +
                             std::to_string(layout.height()) + "; make the stack again");
    } else {
      tell("unreadable-slice", "the slice " + std::string(error.what()));
    }
    return std::nullopt;
  }
}

/// From pixels to materials.
void DescribedLayers::translate(SpanImage& image, const std::string& file,
                                CheckedLayer& layer) const {
  const bool may_be_grey = format_->pixel == SlicePixel::printed && input_.described() != nullptr;
  std::uint32_t last_pixel = meanings_.front().first;
  std::uint32_t last_meaning = meanings_.front().second;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t begin = 0;
    for (std::size_t i = image.row_begin[y]; i < image.row_begin[y + 1]; ++i) {
      Span& span = image.spans[i];
      if (span.value != last_pixel || last_meaning == stray_value) {
        last_pixel = span.value;
        const auto found = std::lower_bound(
            meanings_.begin(), meanings_.end(), last_pixel,
            [](const auto& entry, std::uint32_t pixel) { return entry.first < pixel; });
        if (found != meanings_.end() && found->first == last_pixel) {
          last_meaning = found->second;
        } else if (may_be_grey && isBetween(last_pixel)) {
          PixelCounter(layer.grey, layer.z, file).add(begin, span.end, y);
          constexpr std::uint32_t threshold = 127;
          span.value = (last_pixel & 255) > threshold ? 1 : 0;
          begin = span.end;
          last_meaning = stray_value;
          continue;
        } else {
          last_meaning = stray_value;
          const bool is_told =
              layer.strays.size() < StackTotals::most_strays || layer.strays.contains(last_pixel);
          PixelCounter(is_told ? layer.strays[last_pixel] : layer.other_strays, layer.z, file)
              .add(begin, span.end, y);
        }
      }
      span.value = last_meaning;
      begin = span.end;
    }
  }
}

/// Puts `value` where `mask` is printed, and tells what is there already.
void DescribedLayers::overlay(SpanImage& image, const SpanImage& mask, std::uint32_t value,
                              const std::string& file, CheckedLayer& layer) const {
  SpansBuilder merged(image.width);
  std::uint64_t shared = 0;
  std::array<std::uint32_t, 2> first{};
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const auto below = image.row(y);
    const auto above = mask.row(y);
    std::uint32_t begin = 0;
    for (std::size_t i = 0, j = 0; i < below.size() && j < above.size();) {
      const std::uint32_t end = std::min(below[i].end, above[j].end);
      if (below[i].value && above[j].value) {
        if (shared == 0) first = {begin, y};
        shared += end - begin;
      }
      merged.pixel(begin, below[i].value || !above[j].value ? below[i].value
                          : above[j].value == stray_value   ? stray_value
                                                            : value);
      begin = end;
      if (below[i].end == end) ++i;
      if (above[j].end == end) ++j;
    }
    merged.endRow();
  }
  image = merged.finish();
  if (shared == 0) return;
  layer.findings.push_back({"two-materials", Finding::Severity::error,
                            counted(shared, "voxel") +
                                " of this material have another one already; take them out of one "
                                "of the two",
                            file, numberOf(layer.z), first, shared});
}

void DescribedLayers::tellStrays(const StackTotals& totals, Findings& findings) const {
  const bool colours = format_->decodes_colours;
  const auto tell = [&](const std::string& what, const PixelTally& tally) {
    findings.add({"stray-colour", Finding::Severity::error,
                  what + " in " + counted(tally.pixels, "pixel") + " of " +
                      counted(tally.slices, "slice") + "; give them one of a material" +
                      (colours ? ", and mind that smoothing makes new colours" : ""),
                  tally.file, numberOf(tally.layer), tally.first, tally.pixels});
  };
  for (const auto& [pixel, tally] : totals.strays) {
    tell(colours ? "no material has the colour " + colourText(pixel) + ", which is"
                 : "no material has the value " + std::to_string(pixel) + ", which is",
         tally);
  }
  if (totals.other_strays.pixels > 0)
    tell("no material has the colours of even more kinds, which are", totals.other_strays);
  if (totals.grey.pixels > 0) {
    findings.add(
        {"grey-pixels", Finding::Severity::warning,
         counted(totals.grey.pixels, "pixel") + " of " + counted(totals.grey.slices, "slice") +
             " are grey, as of antialiasing; above 127 they count as printed here, and the "
             "printer may light them in part: turn antialiasing off for exact voxels",
         totals.grey.file, numberOf(totals.grey.layer), totals.grey.first, totals.grey.pixels});
  }
}

}  // namespace

std::unique_ptr<CheckedStack> openDescribedStack(const fs::path& path, Findings& findings) {
  return std::make_unique<DescribedLayers>(path, findings);
}

}  // namespace vdbdither
