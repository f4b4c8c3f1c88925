#include "io/stack/stack_reader.h"

#include <algorithm>
#include <span>
#include <utility>

#include "io/file/digest.h"
#include "io/image/png_spans.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

std::string colourText(std::uint32_t colour) {
  std::string text;
  for (int channel = 0; channel < 4; ++channel)
    text += (channel ? "," : "") + std::to_string(colour >> 8 * channel & 255);
  return text;
}

/// Puts `value` where `mask` is not 0. Returns where something else is already: the row, or -1.
int overlay(SpanImage& image, const SpanImage& mask, std::uint32_t value) {
  SpansBuilder merged(image.width);
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const auto below = image.row(y);
    const auto above = mask.row(y);
    std::uint32_t begin = 0;
    for (std::size_t i = 0, j = 0; i < below.size() && j < above.size();) {
      if (above[j].value && below[i].value) return static_cast<int>(y);
      merged.pixel(begin, above[j].value ? value : below[i].value);
      const std::uint32_t end = std::min(below[i].end, above[j].end);
      begin = end;
      if (below[i].end == end) ++i;
      if (above[j].end == end) ++j;
    }
    merged.endRow();
  }
  image = merged.finish();
  return -1;
}

}  // namespace

StackReader::StackReader(const std::filesystem::path& path,
                         std::function<void(const std::string&)> warn)
    : input_(path),
      warn_(std::move(warn)),
      manifest_(readManifest(input_)),
      format_(findSliceFormat(manifest_.format)) {
  if (format_ == nullptr) {
    throw DataError("'" + input_.shown(manifest_name) + "': there is no format '" +
                    manifest_.format + "'" + make_stack_again);
  }
  for (const Manifest::Slice& slice : manifest_.slices)
    slices_[{slice.layer, slice.material}] = &slice;
  checkFiles();
  meanings_ = meaningsOfPixels();
}

std::vector<std::string> StackReader::filesOfLayer() const {
  if (format_->pixel != SlicePixel::one_material) return {""};
  std::vector<std::string> names;
  for (const Material& material : manifest_.materials) names.push_back(material.name);
  return names;
}

const Manifest::Slice* StackReader::find(int z, const std::string& material) const {
  const auto slice = slices_.find({z, material});
  return slice == slices_.end() ? nullptr : slice->second;
}

/// Checks that the manifest lists every slice and that each file exists.
void StackReader::checkFiles() const {
  for (int z = manifest_.layers.begin; z < manifest_.layers.end; ++z) {
    for (const std::string& material : filesOfLayer()) {
      const Manifest::Slice* slice = find(z, material);
      if (slice == nullptr) {
        throw DataError("'" + input_.shown(manifest_name) + "' names no slice of layer " +
                        std::to_string(numberOf(z)) +
                        (material.empty() ? "" : " for '" + material + "'") + make_stack_again);
      }
      if (!input_.contains(slice->file)) {
        throw DataError("the slice '" + input_.shown(slice->file) + "' of layer " +
                        std::to_string(numberOf(z)) + " is missing" + make_stack_again);
      }
    }
  }
}

std::map<std::uint32_t, std::uint32_t> StackReader::meaningsOfPixels() const {
  const MaterialTable& materials = manifest_.materials;
  std::map<std::uint32_t, std::uint32_t> meanings;
  switch (format_->pixel) {
    case SlicePixel::colour:
      meanings[rgba(manifest_.background)] = 0;
      for (std::uint32_t i = 1; i <= materials.size(); ++i) {
        const Material& material = materials[i - 1];
        const auto [place, is_new] = meanings.try_emplace(rgba(material.rgba), i);
        if (!is_new) {
          throw DataError(
              "the material '" + material.name + "' has the colour of " +
              (place->second == 0 ? "the background"
                                  : "'" + materials[place->second - 1].name + "'") +
              "; make the stack with slice-export --format " +
              sliceFormatNames([](const SliceFormat& other) { return other.keepsMaterials(); }));
        }
      }
      break;
    case SlicePixel::palette:
    case SlicePixel::index:
      for (std::uint32_t i = 0; i <= materials.size(); ++i) meanings[i] = i;
      break;
    case SlicePixel::one_material:
    case SlicePixel::printed:
      if (format_->decodes_colours) {
        meanings = {{rgba(0, 0, 0), 0}, {rgba(255, 255, 255), 1}};
      } else {
        meanings = {{0, 0}, {1, 1}};
      }
      break;
  }
  return meanings;
}

SpanImage StackReader::layer(int z) const {
  if (!manifest_.layers.contains(z)) return blankSlice(manifest_.layout);
  if (format_->pixel != SlicePixel::one_material) return read(*find(z, ""));
  SpanImage all = blankSlice(manifest_.layout);
  for (std::uint32_t i = 1; i <= manifest_.materials.size(); ++i) {
    const Manifest::Slice& slice = *find(z, manifest_.materials[i - 1].name);
    const int row = overlay(all, read(slice), i);
    if (row >= 0) {
      throw DataError("the slice '" + input_.shown(slice.file) + "' has voxels in row " +
                      std::to_string(row) +
                      " that another material has already; take them out of one of the two");
    }
  }
  return all;
}

SpanImage StackReader::read(const Manifest::Slice& slice) const {
  const std::vector<std::uint8_t> bytes = input_.read(slice.file);
  if (sha256Of(bytes) != slice.sha256 && !warned_.exchange(true)) {
    warn_("'" + input_.shown(slice.file) +
          "' is not as its manifest describes it; it is taken as it is, and so are others like it");
  }
  try {
    SpanImage image = format_->decode(bytes);
    const SliceLayout& layout = manifest_.layout;
    if (image.width != layout.width() || image.height != layout.height()) {
      throw DataError("has " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                      " pixels, not " + std::to_string(layout.width()) + " x " +
                      std::to_string(layout.height()) + " as the stack" + make_stack_again);
    }
    translate(image);
    return image;
  } catch (const DataError& error) {
    throw DataError("the slice '" + input_.shown(slice.file) + "' of layer " +
                    std::to_string(numberOf(slice.layer)) + " " + error.what());
  }
}

/// From pixels to indices of materials.
void StackReader::translate(SpanImage& image) const {
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t begin = 0;
    for (std::size_t i = image.row_begin[y]; i < image.row_begin[y + 1]; ++i) {
      Span& span = image.spans[i];
      const auto meaning = meanings_.find(span.value);
      if (meaning == meanings_.end()) {
        const bool colours = format_->decodes_colours;
        throw DataError(
            "has the " +
            (colours ? "colour " + colourText(span.value) : "value " + std::to_string(span.value)) +
            " in column " + std::to_string(begin) + " of row " + std::to_string(y) +
            ", which no material of the manifest has; give it one of theirs" +
            (colours ? ", and mind that smoothing makes new colours" : ""));
      }
      span.value = meaning->second;
      begin = span.end;
    }
  }
}

}  // namespace vdbdither
