#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/stack/slice_format.h"
#include "io/stack/stack_piece.h"
#include "io/stack/stack_preview.h"

namespace vdbdither {

/// Which of the blank layers next to the lattice's bottom and top a stack holds.
struct BlankLayers {
  bool keep = false;       ///< all of them
  int minimum_layers = 0;  ///< those at the top without which there are fewer layers in all
};

/// Whether a writer makes all of a stack, or a piece for `StackWriter::takePiece` of another one: a
/// folder with the slices as they will be, besides their numbers, and with every layer.
enum class StackPart { whole, piece };

/// Writes a stack of slices, layer by layer. It exists under its name once it is committed.
class StackWriter {
 public:
  /// @param stack    all but its layers, slices and voxels
  /// @param encoder  planned with the same; must outlive the writer
  /// @param blank    all are kept also where no layer has a voxel or the encoder keeps them
  /// Throws DataError.
  StackWriter(const std::filesystem::path& target, Manifest stack, SliceNames names,
              const SliceEncoder& encoder, BlankLayers blank, StackPart part = StackPart::whole);

  /// Adds layers, which follow on those before.
  /// @param images  of each of the layers, the index of the material of each voxel
  /// @param grids   the slab's
  /// Throws DataError where a layer is missing, where a voxel's material is not in the table, and
  /// where the disk is full.
  void add(ZRange layers, std::vector<SpanImage> images, const Grids& grids);

  /// Adds the layers of a piece that another writer of the same stack made.
  /// @param folder  the piece, whose files are as they were written
  /// Throws DataError as `add` does, and for a piece of something else.
  void takePiece(const std::filesystem::path& folder);

  /// Completes the stack. Returns what its manifest says.
  const Manifest& finish();
  /// Gives the stack that `finish` completed its name. Throws DataError.
  void commit() { output_.commit(); }

 private:
  struct Layer;

  /// The name of the files of layer `z`, where layer `lowest` has the first number.
  [[nodiscard]] std::string nameOf(int z, int lowest) const;
  /// Says that `layers` come now.
  void expect(ZRange layers);
  /// Moves a layer to `ready`, behind the blank ones that wait for it.
  void keep(Layer&& layer, std::vector<Layer>& ready);
  [[nodiscard]] bool beginsAtBottom() const {
    return known_.begin == stack_.lattice.layers().begin;
  }
  /// Moves the blank layers that wait, which end at `end`, to `layers`.
  void release(int end, std::vector<Layer>& layers);
  void encodeAll(std::vector<Layer> layers, const Grids& grids);
  void encode(Layer& layer, const Grids& grids) const;
  [[nodiscard]] std::vector<std::uint64_t> countedVoxels(const Layer& layer) const;
  void store(Layer& layer);
  void finishPiece();

  Manifest stack_;
  SliceNames names_;
  const SliceEncoder& encoder_;
  BlankLayers blank_;
  StackPart part_;
  StackPiece piece_;  ///< of `StackPart::piece`: what it tells of the layers so far
  ZRange known_;      ///< the layers that came
  int waiting_ = 0;   ///< the last blank ones of these
  int lowest_;        ///< the layer that is number `first`
  StackOutput output_;
  StackPreview preview_;
};

}  // namespace vdbdither
