#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/stack/slice_format.h"
#include "io/stack/stack_preview.h"

namespace vdbdither {

/// Which of the blank layers next to the lattice's bottom and top a stack holds.
struct BlankLayers {
  bool keep = false;       ///< all of them
  int minimum_layers = 0;  ///< those at the top without which there are fewer layers in all
};

/// Writes a stack of slices, layer by layer. It exists under its name once it is complete.
class StackWriter {
 public:
  /// @param stack    all but its layers, slices and voxels
  /// @param encoder  planned with the same; must outlive the writer
  /// @param blank    all are kept also where no layer has a voxel or the encoder keeps them
  /// Throws DataError.
  StackWriter(const std::filesystem::path& target, Manifest stack, SliceNames names,
              const SliceEncoder& encoder, BlankLayers blank);

  /// Adds layers, which follow on those before.
  /// @param images  of each of the layers, the index of the material of each voxel
  /// @param grids   the slab's
  /// Throws DataError where a layer is missing, where a voxel's material is not in the table, and
  /// where the disk is full.
  void add(ZRange layers, std::vector<SpanImage> images, const Grids& grids);

  /// Completes the stack and gives it its name. Returns what its manifest says.
  const Manifest& finish();

 private:
  struct Layer;

  [[nodiscard]] std::string nameOf(int z) const;
  [[nodiscard]] bool beginsAtBottom() const {
    return known_.begin == stack_.lattice.layers().begin;
  }
  /// Moves the blank layers that wait, which end at `end`, to `layers`.
  void release(int end, std::vector<Layer>& layers);
  void encodeAll(std::vector<Layer> layers, const Grids& grids);
  void encode(Layer& layer, const Grids& grids) const;
  [[nodiscard]] std::vector<std::uint64_t> countedVoxels(const Layer& layer) const;
  void store(Layer& layer);

  Manifest stack_;
  SliceNames names_;
  const SliceEncoder& encoder_;
  BlankLayers blank_;
  ZRange known_;     ///< the layers that came
  int waiting_ = 0;  ///< the last blank ones of these
  int lowest_;       ///< the layer that is number `first`
  StackOutput output_;
  StackPreview preview_;
};

}  // namespace vdbdither
