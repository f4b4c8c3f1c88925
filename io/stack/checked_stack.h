#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/stack/findings.h"
#include "io/stack/manifest.h"
#include "vdbdither/model/printer.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Pixels of one kind, and where the first one is.
struct PixelTally {
  std::uint64_t pixels = 0;
  std::uint64_t slices = 0;
  int layer = 0;
  std::string file;                      ///< as messages show it
  std::array<std::uint32_t, 2> first{};  ///< column and row

  /// Adds what comes after it.
  void add(const PixelTally& later);
};

/// A layer as it is, whatever is wrong with it.
struct CheckedLayer {
  int z = 0;
  /// 0 where empty, else a key of `StackTotals::voxels` or `stray_value`; nothing where it cannot
  /// be read.
  std::optional<SpanImage> image;
  std::vector<Finding> findings;
  std::map<std::uint32_t, std::uint64_t> voxels;  ///< by value
  std::map<std::uint32_t, PixelTally> strays;     ///< by colour, or value
  PixelTally other_strays;                        ///< of more colours than are told
  PixelTally grey;                                ///< between black and white
};

/// What a layer has where no material has its colour. It counts as printed.
inline constexpr std::uint32_t stray_value = 0xfffffffe;

/// What all layers have.
struct StackTotals {
  std::map<std::uint32_t, std::uint64_t> voxels;  ///< by value: material, or colour of images
  std::map<std::uint32_t, PixelTally> strays;
  PixelTally other_strays;
  PixelTally grey;
  std::map<std::uint32_t, PixelTally> first_of;  ///< the first slices with each value
  openvdb::CoordBBox printed;                    ///< column, row and layer
  int layers = 0;                                ///< with or without a readable slice

  static constexpr std::size_t most_strays = 1024;
  /// Adds the next layer, whose findings go to `findings`.
  void add(CheckedLayer& layer, const std::string& file, Findings& findings);
};

/// A stack of any kind, opened to check it and not to use it: faults are found, not refused.
class CheckedStack {
 public:
  virtual ~CheckedStack() = default;

  /// What is known of the stack. A manifest of images of another program has no materials: their
  /// values are colours.
  [[nodiscard]] const Manifest& manifest() const { return manifest_; }
  /// Whether voxels have the indices of the lattice of a job, not just those of pixels.
  [[nodiscard]] virtual bool hasLattice() const { return false; }
  /// Whether values tell materials apart.
  [[nodiscard]] virtual bool tellsMaterials() const = 0;
  /// Whether a slice shows the whole display of a resin printer.
  [[nodiscard]] virtual bool showsDisplay() const { return false; }
  /// Whether values are colours, not indices of materials.
  [[nodiscard]] virtual bool hasColours() const { return false; }
  /// The name of a file of layer `z` for messages.
  [[nodiscard]] virtual std::string shown(int z) const = 0;

  /// Reads a layer. Safe to call from many threads.
  [[nodiscard]] virtual CheckedLayer layer(int z) const = 0;

  /// Tells what only the whole stack shows.
  virtual void finish(const StackTotals& totals, Findings& findings) const = 0;

  /// The number of a layer in messages.
  [[nodiscard]] int numberOf(int z) const { return z - manifest_.lattice.box.min().z(); }

 protected:
  Manifest manifest_;
};

/// Opens a stack with a manifest, or a container. Faults of its files go to `findings`. Throws
/// DataError where it cannot be known what the stack should be.
std::unique_ptr<CheckedStack> openDescribedStack(const std::filesystem::path& path,
                                                 Findings& findings);

/// How to read images of another program.
struct CheckedImagesOptions {
  openvdb::Vec3d pitch_mm{1.0};
  std::optional<std::uint32_t> background;  ///< as rgba() makes it
  bool flip_x = false;
  bool flip_y = false;
  bool wants_rgba = false;  ///< whether the printer takes PNG of 32 bits alone
};

/// Opens images of another program. Throws DataError where there are none.
/// @param path  for which ImageStack::isAt is true
std::unique_ptr<CheckedStack> openImages(const std::filesystem::path& path,
                                         const CheckedImagesOptions& options, Findings& findings);

/// Tells what the printer does not take.
/// @param printer  one that says nothing where there is none
void checkPrinter(const CheckedStack& stack, const StackTotals& totals,
                  const PrinterProfile& printer, Findings& findings);

/// The fault of a PNG that is not of 32 bits, where only such are taken.
Finding pixelKindFinding(const std::string& file, int number);

}  // namespace vdbdither
