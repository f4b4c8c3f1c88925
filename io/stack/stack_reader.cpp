#include "io/stack/stack_reader.h"

#include <algorithm>
#include <set>
#include <span>
#include <utility>

#include "io/file/digest.h"
#include "io/stack/pixel_meanings.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

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

StackReader::StackReader(const std::filesystem::path& path, EditedStack edited,
                         std::function<void(const std::string&)> warn)
    : input_(StackInput::putBack(path, warn)),
      edited_(edited),
      warn_(std::move(warn)),
      manifest_(input_.described() ? input_.described()->manifest
                                   : readManifest(input_, edited, warn_)),
      format_(findSliceFormat(manifest_.format)) {
  if (format_ == nullptr) {
    throw DataError("'" + input_.shownManifest() + "': there is no format '" + manifest_.format +
                    "'" + make_stack_again);
  }
  indexSlices();
  checkFiles();
  if (!input_.described()) checkForOthers();
  // Of other stacks the manifest has the digests.
  if (edited_ == EditedStack::taken) {
    for (const Manifest::Slice& slice : manifest_.slices) input_.noteRead(slice.file);
  }
  meanings_ = meaningsOfPixels(manifest_, [&](std::uint32_t material, std::uint32_t other) {
    throw DataError(
        sameColourText(manifest_, material, other) +
        "; make the stack with slice-export --format " +
        sliceFormatNames([](const SliceFormat& format) { return format.keepsMaterials(); }));
  });
}

void StackReader::tellChange(const std::string& change) const {
  if (edited_ == EditedStack::refused) throw DataError(change + make_stack_again_or_take_edited);
  warn_(change + "; it is taken as it is");
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

/// Finds the slice of each layer. A layer with two slices could be either of them.
void StackReader::indexSlices() {
  const std::vector<std::string> kinds = filesOfLayer();
  const std::set<std::string> known(kinds.begin(), kinds.end());
  const std::string shown = "'" + input_.shownManifest() + "'";
  if (known.size() != kinds.size())
    throw DataError(shown + " names two materials alike" + make_stack_again);
  std::string change;
  for (const Manifest::Slice& slice : manifest_.slices) {
    const std::string layer = std::to_string(numberOf(slice.layer));
    if (!manifest_.layers.contains(slice.layer) || !known.contains(slice.material)) {
      change = shown + " names the slice '" + slice.file + "' of layer " + layer +
               ", which the stack does not have";
      continue;
    }
    const auto [place, is_new] = slices_.try_emplace({slice.layer, slice.material}, &slice);
    if (is_new) continue;
    if (place->second->file != slice.file) {
      throw DataError(shown + " names two slices of layer " + layer + ", '" + place->second->file +
                      "' and '" + slice.file + "'; remove one of them");
    }
    change = shown + " names the slice of layer " + layer + " twice";
  }
  if (!change.empty()) tellChange(change);
}

/// Checks that the manifest lists every slice, that each file exists, and that none is too large.
void StackReader::checkFiles() const {
  for (int z = manifest_.layers.begin; z < manifest_.layers.end; ++z) {
    for (const std::string& material : filesOfLayer()) {
      const Manifest::Slice* slice = find(z, material);
      if (slice == nullptr) {
        throw DataError("'" + input_.shownManifest() + "' names no slice of layer " +
                        std::to_string(numberOf(z)) +
                        (material.empty() ? "" : " for '" + material + "'") + make_stack_again);
      }
      if (!input_.contains(slice->file)) {
        throw DataError("the slice '" + input_.shown(slice->file) + "' of layer " +
                        std::to_string(numberOf(z)) + " is missing" + make_stack_again);
      }
      input_.check(slice->file, manifest_.mostBytesOfSlice());
    }
  }
}

/// Whoever adds a slice may believe that it is read.
void StackReader::checkForOthers() const {
  std::set<std::string> named{preview_name};
  for (const Manifest::Slice& slice : manifest_.slices) named.insert(slice.file);
  for (const std::string& name : input_.names()) {
    const std::filesystem::path file = std::filesystem::path(name).filename();
    // File managers keep hidden files beside others of the same name.
    const bool is_slice = equalsIgnoringCase(file.extension().string(), format_->ending) &&
                          !file.string().starts_with('.');
    if (is_slice && !named.contains(name)) {
      const std::string change =
          "the slice '" + input_.shown(name) + "' is not one that the manifest names";
      if (edited_ == EditedStack::refused)
        throw DataError(change + make_stack_again_or_take_edited);
      warn_(change + "; it is left out, and so are others like it");
      return;
    }
  }
}

SpanImage StackReader::layer(int z) const {
  if (!manifest_.layers.contains(z)) return blankSlice(manifest_.layout);
  if (format_->pixel != SlicePixel::one_material) return read(*find(z, ""));
  // A slice that is there confirms the size of the layout before memory is taken for it.
  SpanImage all;
  for (std::uint32_t i = 1; i <= manifest_.materials.size(); ++i) {
    const Manifest::Slice& slice = *find(z, manifest_.materials[i - 1].name);
    const SpanImage mask = read(slice);
    if (i == 1) all = blankSlice(manifest_.layout);
    const int row = overlay(all, mask, i);
    if (row >= 0) {
      throw DataError("the slice '" + input_.shown(slice.file) + "' has voxels in row " +
                      std::to_string(row) +
                      " that another material has already; take them out of one of the two");
    }
  }
  return manifest_.materials.empty() ? blankSlice(manifest_.layout) : all;
}

SpanImage StackReader::read(const Manifest::Slice& slice) const {
  const std::vector<std::uint8_t> bytes = input_.read(slice.file, manifest_.mostBytesOfSlice());
  const SliceLayout& layout = manifest_.layout;
  const auto check = [&](std::uint32_t width, std::uint32_t height) {
    if (width == layout.width() && height == layout.height()) return;
    throw DataError("has " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels, not " + std::to_string(layout.width()) + " x " +
                    std::to_string(layout.height()) + " as the stack" + make_stack_again);
  };
  const std::string name = "the slice '" + input_.shown(slice.file) + "' of layer " +
                           std::to_string(numberOf(slice.layer));
  if (!input_.described() && sha256Of(bytes) != slice.sha256 &&
      (edited_ == EditedStack::refused || !warned_.exchange(true))) {
    tellChange(name + " was changed after slice-export wrote it: its digest differs");
  }
  try {
    SpanImage image = format_->decode(bytes, check);
    translate(image);
    return image;
  } catch (const DataError& error) {
    throw DataError(name + " " + error.what());
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
