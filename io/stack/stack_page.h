#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/file/staged_output.h"
#include "io/stack/coarse_volume.h"
#include "io/stack/manifest.h"
#include "io/stack/slice_group.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// A stack that a page shows.
struct PageStack {
  std::string name;   ///< as the user calls it
  Manifest manifest;  ///< its slices, layers and voxels are not read
};

/// Names a stack by the path of its folder, its manifest or its archive.
PageStack pageStack(const std::filesystem::path& path, const Manifest& manifest);

/// One HTML page that shows the slices of a stack and needs no other file, server or network. Same
/// slices, same bytes. Memory is the page and a few dozen slices.
class StackPage {
 public:
  /// A page that would be larger shows every second slice, or every fourth, and so on, and says so.
  static constexpr std::uint64_t default_most_bytes = 30'000'000;

  /// Checks that a page can be written: its name ends in .html, and nothing is lost. Throws
  /// UsageError.
  static void check(const std::filesystem::path& target, bool overwrite);

  /// @param layers  those that can come
  /// @param other   one to compare with, on the same lattice
  /// Throws DataError where the stacks have other pitches, or too many materials.
  StackPage(ZRange layers, PageStack shown, std::optional<PageStack> other = {},
            std::uint64_t most_bytes = default_most_bytes);

  /// Adds layer `z`. Layers come in rising order; missing ones are empty.
  /// @param images  of each stack, in its own layout, with the index of the material of each voxel
  void add(int z, std::vector<SpanImage> images);

  /// Writes the page. It exists under its name once it is committed. Throws DataError.
  void finish(const std::filesystem::path& target);
  /// Gives the page that `finish` wrote its name. Throws DataError.
  void commit() { output_->commit(); }

  /// Of how many slices one is shown. Asked after `finish`.
  [[nodiscard]] int stride() const { return stride_; }

  /// What users are told where the stride is not 1, or an empty text.
  [[nodiscard]] std::string warning() const;

 private:
  /// A slice of each stack.
  using Slices = std::vector<SpanImage>;
  /// A group of each stack.
  using Groups = std::vector<SliceGroup>;

  void addMaterials(const MaterialTable& materials);
  [[nodiscard]] std::uint32_t values() const {
    return static_cast<std::uint32_t>(materials_.size());
  }
  [[nodiscard]] Groups packed(std::span<const Slices> all) const;
  [[nodiscard]] std::vector<Slices> unpacked(const Groups& groups) const;
  void append(Groups groups);
  /// Packs whole groups of the slices that wait, or all of them.
  void packPending(bool last);
  void thinOut();
  [[nodiscard]] std::string description() const;

  ZRange layers_;
  std::uint64_t most_bytes_;
  std::vector<PageStack> stacks_;
  openvdb::CoordBBox frame_;                         ///< the voxels of a slice, of all stacks
  MaterialTable materials_;                          ///< of all stacks
  std::vector<std::vector<std::uint32_t>> meaning_;  ///< of the values of each stack
  std::vector<std::vector<std::uint64_t>> voxels_;   ///< of each stack and value
  CoarseVolume volume_;                              ///< of the first stack
  int stride_ = 1;
  int next_;                     ///< the layer that is to come
  std::vector<Slices> pending_;  ///< of the layers that are shown, those that are not packed
  std::vector<Groups> groups_;
  std::uint64_t bytes_ = 0;  ///< of the groups, as they stand in the page
  std::optional<StagedOutput> output_;
};

}  // namespace vdbdither
