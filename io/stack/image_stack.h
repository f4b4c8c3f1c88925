#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/image/colour_image.h"
#include "io/stack/stack_files.h"

namespace vdbdither {

/// Which pixels of images without a manifest are empty.
struct EmptyPixels {
  std::optional<std::uint32_t> background;  ///< as rgba() makes it; nothing: the transparent ones
  bool is_mask = false;  ///< images are grey; grey is split in the middle if there is a background

  [[nodiscard]] bool contains(std::uint32_t colour) const;
};

/// Reads the value of --background. Throws UsageError.
std::optional<std::uint32_t> backgroundColour(const std::string& text);

/// Slices of another program: numbered images of one size without a manifest, PNG or TIFF.
class ImageStack {
 public:
  /// Whether `path` is a folder or a zip archive without a manifest and no container, or a pattern
  /// with `*` in the name of the file. What cannot be read is none.
  static bool isAt(const std::filesystem::path& path);

  /// Finds and orders the slices, and reads the first one.
  /// @param path  for which `isAt` is true
  /// @param warn    told of files that are passed over
  /// @param faults  where given, told of numbers that are missing or there twice, and the first
  ///                slice that can be read stands for the first one
  /// Throws DataError.
  ImageStack(std::filesystem::path path, const std::function<void(const std::string&)>& warn,
             const std::function<void(const std::string&)>& faults = {});

  [[nodiscard]] int layers() const { return static_cast<int>(names_.size()); }
  [[nodiscard]] std::uint32_t width() const { return width_; }
  [[nodiscard]] std::uint32_t height() const { return height_; }
  [[nodiscard]] bool isGrey() const { return is_grey_; }
  [[nodiscard]] bool hasOpacity() const { return has_opacity_; }
  /// The path of the slice of layer `z`, for messages.
  [[nodiscard]] std::string shown(int z) const {
    return files_.shown(names_.at(static_cast<std::size_t>(z)));
  }

  /// Returns the colours of layer `z`, 0 … layers() − 1, in the size and of the kind of the first
  /// one. Safe to call from many threads. Throws DataError.
  [[nodiscard]] SpanImage layer(int z) const;

  /// Returns the image of layer `z` as it is. Safe to call from many threads. Throws DataError.
  [[nodiscard]] ColourImage read(int z, const SizeCheck& check) const;

 private:
  [[nodiscard]] std::vector<std::string> findImages(
      const std::function<void(const std::string&)>& warn,
      const std::function<void(const std::string&)>& faults) const;
  [[nodiscard]] ColourImage readFirst(bool passes_over) const;

  std::filesystem::path path_;
  StackInput files_;
  std::vector<std::string> names_;  ///< by layer
  std::uint32_t width_ = 0;
  std::uint32_t height_ = 0;
  bool is_grey_ = false;
  bool has_opacity_ = false;
};

}  // namespace vdbdither
