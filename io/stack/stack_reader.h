#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/stack/slice_format.h"

namespace vdbdither {

/// Reads the slices of a stack back.
class StackReader {
 public:
  /// @param path    the stack's folder, its manifest, its zip archive, or a container
  /// @param edited  whether a stack is accepted whose manifest or slices changed after they were
  ///                written; every layer must still have exactly one file of each kind
  /// @param warn    called from any thread, once for each kind of change that is accepted
  /// Throws DataError if there is no stack, if a slice is missing, or if a file is larger than a
  /// slice of the stack can be.
  StackReader(const std::filesystem::path& path, EditedStack edited,
              std::function<void(const std::string&)> warn);

  [[nodiscard]] const Manifest& manifest() const { return manifest_; }
  [[nodiscard]] const SliceFormat& format() const { return *format_; }

  /// Returns the index of the material of every voxel of layer `z`, one of the known layers; of a
  /// format that does not tell materials apart 1 for each. Safe to call from many threads. Throws
  /// DataError, also for a slice that changed and is not taken.
  [[nodiscard]] SpanImage layer(int z) const;

 private:
  void indexSlices();
  void checkFiles() const;
  void checkForOthers() const;
  /// Refuses a change of the stack, or warns of it where changes are taken.
  void tellChange(const std::string& change) const;
  [[nodiscard]] const Manifest::Slice* find(int z, const std::string& material) const;
  /// The names of the materials with files of their own, or one empty name.
  [[nodiscard]] std::vector<std::string> filesOfLayer() const;
  [[nodiscard]] SpanImage read(const Manifest::Slice& slice) const;
  void translate(SpanImage& image) const;
  [[nodiscard]] int numberOf(int z) const { return z - manifest_.lattice.box.min().z(); }

  StackInput input_;
  EditedStack edited_;
  std::function<void(const std::string&)> warn_;
  Manifest manifest_;
  const SliceFormat* format_;
  std::map<std::pair<int, std::string>, const Manifest::Slice*> slices_;
  std::map<std::uint32_t, std::uint32_t> meanings_;  ///< of a pixel: the index of a material
  mutable std::atomic<bool> warned_ = false;
};

}  // namespace vdbdither
