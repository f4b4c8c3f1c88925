#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/image/size_check.h"
#include "io/stack/findings.h"
#include "io/stack/manifest.h"
#include "io/stack/stack_files.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/slab.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// What a pixel of a slice tells.
enum class SlicePixel {
  colour,        ///< the colour of the material, or the background
  palette,       ///< the index of the material, shown in its colour
  index,         ///< the index of the material
  one_material,  ///< whether the file's material is there: a layer has a file for each material
  printed,       ///< whether any material is there
};

/// How the files of a layer are called: prefix and running number.
struct SliceNames {
  std::string prefix;
  int digits = 1;  ///< of the number, with zeros in front
  int first = 0;   ///< number of the lowest slice of a job that begins at the lattice's bottom
};

/// A layer on its way into files.
struct SliceLayer {
  int z = 0;
  std::string name;        ///< of its files, without a folder and an ending
  const SpanImage& image;  ///< the index of the material of each voxel; 0 is empty
  const Grids& grids;      ///< the slab's, which hold this layer
};

/// A file of a stack.
struct SliceFile {
  std::string name;      ///< its place in the stack, with '/' between folders
  std::string material;  ///< whose voxels it shows; empty: all
  std::vector<std::uint8_t> bytes;
};

/// What a container says of itself.
struct DescribedStack {
  std::string file;   ///< the name of its configuration
  Manifest manifest;  ///< without digests, history and printer
};

/// Makes the files of a stack in one format. A format of single images implements `encode` alone; a
/// container writes its configuration and thumbnails in `finish` in place of the manifest, and
/// finds the printer's profile in the manifest.
class SliceEncoder {
 public:
  virtual ~SliceEncoder() = default;

  /// Declares the format's own options, whose names begin with that of the format.
  virtual void declare(Options& /*options*/) {}

  /// Checks that the format can hold the stack. Throws UsageError or DataError.
  /// @param stack  all but its layers, slices and voxels, which are known only at the end
  /// @param grids  prototypes of the grids that come with the layers
  virtual void plan(const Manifest& stack, const Grids& grids);

  /// Returns the names of the grids that it reads besides the sliced one. Asked after `plan`.
  [[nodiscard]] virtual std::vector<std::string> reads() const { return {}; }

  /// Whether layers without a printed voxel say something all the same. Asked after `plan`.
  [[nodiscard]] virtual bool keepsBlank() const { return !reads().empty(); }

  /// Returns the files of a layer. Safe to call from many threads. Throws DataError.
  [[nodiscard]] virtual std::vector<SliceFile> encode(const SliceLayer& layer) const = 0;

  /// Writes what describes the whole stack: its preview and its manifest. Throws DataError.
  /// @param stack    complete
  /// @param preview  a picture of the part and its fullest slice, as colours
  virtual void finish(const Manifest& stack, const SpanImage& preview, StackOutput& output) const;

 protected:
  /// As it was planned.
  [[nodiscard]] const Manifest& stack() const { return stack_; }
  [[nodiscard]] const openvdb::Vec3d& pitchMm() const { return stack_.lattice.pitch_mm; }

  /// Returns the colour of each index of a material, as rgba() makes it; that of 0 is the
  /// background.
  [[nodiscard]] std::vector<std::uint32_t> palette() const;

  /// Returns a file for each material, in a folder of its own.
  /// @param bytes  makes the file of the material with this index
  [[nodiscard]] std::vector<SliceFile> forEachMaterial(
      const SliceLayer& layer, std::string_view ending,
      const std::function<std::vector<std::uint8_t>(std::uint32_t)>& bytes) const;

 private:
  Manifest stack_;
};

/// A format of stacks of slices: `extern const SliceFormat png8` in io/stack/png8.cpp.
struct SliceFormat {
  std::string_view name;     ///< as --format takes it
  std::string_view summary;  ///< what a slice holds, for --help
  std::string_view ending;   ///< of its files' names: lower case, with a dot
  SlicePixel pixel;

  std::unique_ptr<SliceEncoder> (*encoder)();
  /// Returns the pixels of a file: colours as rgba() makes them, or numbers. Calls `check` with the
  /// width and height before it makes a pixel. Throws DataError in words that go on from the file's
  /// name.
  SpanImage (*decode)(std::span<const std::uint8_t> bytes, const SizeCheck& check);
  bool decodes_colours = false;  ///< whether `decode` returns colours

  std::string_view other_ending = {};  ///< one that other programs give such files

  /// What a file takes for each leaf at the surface, about, in bytes.
  double bytes_per_leaf = 0;
  std::size_t most_materials = std::numeric_limits<std::size_t>::max();

  /// What the name of a container ends with, `.sl1`: a zip archive that describes itself in place
  /// of a manifest. Empty for a stack with a manifest.
  std::string_view container_ending = {};
  /// Returns what a container says of itself, or nothing if its configuration is not among `files`.
  /// Throws DataError.
  std::optional<DescribedStack> (*describe)(const StackInput& files) = nullptr;
  /// Tells where a container contradicts itself, besides its slices. Throws DataError where its
  /// configuration cannot be read.
  /// @param voxels  of each material, as the slices have them
  void (*check)(const StackInput& files, const DescribedStack& stack,
                std::span<const std::uint64_t> voxels, Findings& findings) = nullptr;
  /// The names that the format prescribes; null where the user chooses them.
  const SliceNames* names = nullptr;
  /// Whether a slice shows the whole display of the printer, mirrored as the profile says.
  bool shows_display = false;
  /// The width of a slice is a multiple of this.
  int width_multiple = 1;

  /// Returns how many files a layer has.
  [[nodiscard]] std::size_t filesOfLayer(std::size_t materials) const {
    return pixel == SlicePixel::one_material ? materials : 1;
  }
  /// Whether slices show materials in their colours, which must then not be the background's.
  [[nodiscard]] bool showsColours() const {
    return pixel == SlicePixel::colour || pixel == SlicePixel::palette;
  }
  /// Whether slices tell materials apart, even such of one colour.
  [[nodiscard]] bool keepsMaterials() const {
    return pixel != SlicePixel::colour && pixel != SlicePixel::printed;
  }
};

/// Makes an `Encoder` for `SliceFormat::encoder`.
template <class Encoder>
std::unique_ptr<SliceEncoder> makeSliceEncoder() {
  return std::make_unique<Encoder>();
}

/// Returns every format of the folder io/stack, by file name. Generated by CMake.
std::span<const SliceFormat* const> sliceFormats();

/// Returns the format called `name`, or null.
const SliceFormat* findSliceFormat(std::string_view name);

/// Returns the format whose containers end like `path`, case aside, or null.
const SliceFormat* sliceFormatOfContainer(const std::filesystem::path& path);

/// Returns what the container `files` says of itself, or nothing if it is none. Throws DataError.
std::optional<DescribedStack> describedStack(const StackInput& files);

/// Whether `path` ends like a slice of some format, case aside.
bool namesSlice(const std::filesystem::path& path);

/// Returns "png1, tiff or exr": the names of all formats, or of those that `choose` takes.
std::string sliceFormatNames(const std::function<bool(const SliceFormat&)>& choose = {});

}  // namespace vdbdither
