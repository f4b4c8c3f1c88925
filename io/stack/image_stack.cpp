#include "io/stack/image_stack.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <string_view>
#include <utility>

#include "io/image/png_spans.h"
#include "io/profile/material_table.h"
#include "io/stack/image_order.h"
#include "io/stack/slice_format.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

namespace {

constexpr std::uint64_t most_file_bytes = std::uint64_t{1} << 28;
constexpr std::uint64_t most_pixels = std::uint64_t{1} << 28;

constexpr std::array image_endings{".png", ".tif", ".tiff"};
/// Images that are not read, for the refusal of a stack of them.
constexpr std::array other_endings{".bmp", ".jpg", ".jpeg", ".gif", ".webp", ".exr",
                                   ".svg", ".tga", ".pbm",  ".pgm", ".ppm"};

template <typename Endings>
bool endsWithAny(const std::string& name, const Endings& endings) {
  const std::string ending = fs::path(name).extension().string();
  return std::any_of(endings.begin(), endings.end(),
                     [&](const char* known) { return equalsIgnoringCase(ending, known); });
}

bool isPng(const std::string& name) {
  return equalsIgnoringCase(fs::path(name).extension().string(), ".png");
}

/// Whether `name` is `pattern` with any text in place of each `*`.
bool matches(std::string_view name, std::string_view pattern) {
  std::size_t star = pattern.find('*');
  if (star == pattern.npos) return name == pattern;
  if (!name.starts_with(pattern.substr(0, star))) return false;
  name.remove_prefix(star);
  pattern.remove_prefix(star + 1);
  while ((star = pattern.find('*')) != pattern.npos) {
    const std::size_t at = name.find(pattern.substr(0, star));
    if (at == name.npos) return false;
    name.remove_prefix(at + star);
    pattern.remove_prefix(star + 1);
  }
  return name.ends_with(pattern);
}

bool isPattern(const fs::path& path) {
  std::error_code none;
  return path.filename().string().find('*') != std::string::npos &&
         fs::symlink_status(path, none).type() == fs::file_type::not_found;
}

/// The images by the folder they lie in; hidden files, which file managers keep, are none.
using ImagesByFolder = std::map<std::string, std::vector<std::string>>;

/// Slices lie in the stack itself or, as some programs pack them, in its only folder with images.
const std::vector<std::string>& slicesIn(const ImagesByFolder& images, const std::string& shown) {
  const auto top = images.find("");
  if (top != images.end()) return top->second;
  if (images.size() > 1) {
    throw DataError("'" + shown + "' has images in several folders, such as '" +
                    images.begin()->first + "' and '" + std::next(images.begin())->first +
                    "'; give the folder of the slices");
  }
  return images.begin()->second;
}

[[noreturn]] void refuseWithoutImages(const std::string& shown, bool is_pattern,
                                      const std::vector<std::string>& passed_over) {
  const auto other = std::find_if(passed_over.begin(), passed_over.end(), [](const auto& name) {
    return endsWithAny(name, other_endings);
  });
  throw DataError(
      (is_pattern ? "no PNG or TIFF image matches '" + shown + "'"
                  : "'" + shown + "' holds no " + manifest_name + " and no PNG or TIFF images") +
      (other == passed_over.end() ? "; give the folder of the slices"
                                  : "; save images like '" + *other + "' as PNG"));
}

void tellLeftOut(const std::vector<std::string>& all, std::vector<std::string> slices,
                 const std::string& shown, const std::function<void(const std::string&)>& warn) {
  std::sort(slices.begin(), slices.end());
  std::vector<std::string> others;
  std::set_difference(all.begin(), all.end(), slices.begin(), slices.end(),
                      std::back_inserter(others));
  if (others.empty()) return;
  warn("'" + shown + "': " +
       (others.size() == 1 ? "a file is passed over, which is not a slice: '"
                           : std::to_string(others.size()) +
                                 " files are passed over, which are not slices, such as '") +
       others.front() + "'");
}

}  // namespace

bool EmptyPixels::contains(std::uint32_t colour) const {
  if (colour >> 24 == 0) return true;
  if (is_mask && background) return ((colour & 255) > 127) == (background == rgba(255, 255, 255));
  return colour == background;
}

std::optional<std::uint32_t> backgroundColour(const std::string& text) {
  if (text.empty()) return std::nullopt;
  if (text == "black") return rgba(0, 0, 0);
  if (text == "white") return rgba(255, 255, 255);
  try {
    return rgba(parseColour(text));
  } catch (const UsageError& error) {
    throw UsageError(std::string("--background: ") + error.what());
  }
}

bool ImageStack::isAt(const fs::path& path) {
  if (isPattern(path)) return true;
  std::error_code none;
  const fs::file_status status = fs::status(path, none);
  if (!fs::is_directory(status) &&
      (!fs::is_regular_file(status) || equalsIgnoringCase(path.extension().string(), ".json")))
    return false;
  try {
    const StackInput files = StackInput::withoutManifest(path);
    return !files.contains(manifest_name) && !describedStack(files);
  } catch (const DataError&) {
    return false;
  }
}

ImageStack::ImageStack(fs::path path, const std::function<void(const std::string&)>& warn,
                       const std::function<void(const std::string&)>& faults)
    : path_(std::move(path)),
      files_(StackInput::withoutManifest(isPattern(path_) ? path_.parent_path() : path_)),
      names_(findImages(warn, faults)) {
  if (names_.size() > std::size_t{1} << 24)
    throw DataError("'" + path_.string() + "' has more slices than can be counted");
  for (const std::string& name : names_) files_.noteRead(name);
  const ColourImage first = readFirst(static_cast<bool>(faults));
  width_ = first.pixels.width;
  height_ = first.pixels.height;
  is_grey_ = first.is_grey;
  has_opacity_ = first.has_opacity;
}

ColourImage ImageStack::readFirst(bool passes_over) const {
  for (int z = 0;; ++z) {
    try {
      return read(z, [](std::uint32_t width, std::uint32_t height) {
        if (std::uint64_t{width} * height <= most_pixels) return;
        throw DataError("has " + std::to_string(width) + " x " + std::to_string(height) +
                        " pixels; at most " + std::to_string(most_pixels) + " are read");
      });
    } catch (const DataError&) {
      if (!passes_over || z + 1 == layers()) throw;
    }
  }
}

std::vector<std::string> ImageStack::findImages(
    const std::function<void(const std::string&)>& warn,
    const std::function<void(const std::string&)>& faults) const {
  const bool is_pattern = isPattern(path_);
  const std::string pattern = path_.filename().string();
  ImagesByFolder images;
  std::vector<std::string> all;
  std::vector<std::string> passed_over;
  for (const std::string& name : files_.names()) {
    const fs::path file(name);
    const std::string folder = file.parent_path().string();
    if (is_pattern && (!folder.empty() || !matches(name, pattern))) continue;
    all.push_back(name);
    if (endsWithAny(name, image_endings) && !file.filename().string().starts_with('.')) {
      images[folder].push_back(name);
    } else {
      passed_over.push_back(name);
    }
  }
  if (images.empty()) refuseWithoutImages(path_.string(), is_pattern, passed_over);
  std::vector<std::string> slices =
      inOrderOfNumbers(slicesIn(images, path_.string()), path_.string(), faults);
  const auto other_kind = std::find_if(slices.begin(), slices.end(), [&](const std::string& name) {
    return isPng(name) != isPng(slices.front());
  });
  if (other_kind != slices.end()) {
    throw DataError("'" + path_.string() + "': '" + slices.front() + "' and '" + *other_kind +
                    "' are files of different kinds; save all slices alike");
  }
  tellLeftOut(all, slices, path_.string(), warn);
  return slices;
}

ColourImage ImageStack::read(int z, const SizeCheck& check) const {
  const std::string& name = names_.at(static_cast<std::size_t>(z));
  files_.check(name, most_file_bytes);
  const std::vector<std::uint8_t> bytes = files_.read(name, most_file_bytes);
  try {
    return isPng(name) ? decodePngImage(bytes, check) : decodeTiffImage(bytes, check);
  } catch (const DataError& error) {
    throw DataError("the slice '" + files_.shown(name) + "' " + error.what());
  }
}

SpanImage ImageStack::layer(int z) const {
  const auto unlike = [&](const std::string& has, const std::string& first_has) {
    return "has " + has + ", but the first slice '" + shown(0) + "' has " + first_has +
           "; save all slices alike";
  };
  ColourImage image = read(z, [&](std::uint32_t width, std::uint32_t height) {
    if (width == width_ && height == height_) return;
    const auto pixels = [](std::uint32_t columns, std::uint32_t rows) {
      return std::to_string(columns) + " x " + std::to_string(rows) + " pixels";
    };
    throw DataError(unlike(pixels(width, height), pixels(width_, height_)));
  });
  const std::string slice = "the slice '" + shown(z) + "' ";
  const auto colours = [](bool is_grey) { return is_grey ? "grey pixels" : "colours"; };
  if (image.is_grey != is_grey_)
    throw DataError(slice + unlike(colours(image.is_grey), colours(is_grey_)));
  if (image.has_opacity != has_opacity_) {
    throw DataError(slice +
                    (has_opacity_ ? unlike("no opacity", "some") : unlike("opacity", "none")));
  }
  return std::move(image.pixels);
}

}  // namespace vdbdither
