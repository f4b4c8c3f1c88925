#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The name of the file that tells, beside the manifest, what joining a piece of a stack takes.
inline constexpr const char* stack_piece_name = "piece.bin";

/// What a run that makes only some layers of a stack tells of them, besides the manifest and the
/// slices.
struct StackPiece {
  ZRange layers;
  std::size_t materials = 0;
  std::vector<std::uint64_t> voxels;  ///< of each material of each layer, layer by layer
  std::vector<std::uint8_t> preview;  ///< see StackPreview::part

  /// The voxels of layer `z`, one of `layers`, by material.
  [[nodiscard]] std::span<const std::uint64_t> voxelsOf(int z) const {
    return std::span(voxels).subspan(static_cast<std::size_t>(z - layers.begin) * materials,
                                     materials);
  }
};

/// The bytes of the file.
std::vector<std::uint8_t> bytesOf(const StackPiece& piece);

/// Reads them back. Throws DataError in words that go on from the file's name.
StackPiece stackPieceOf(std::span<const std::uint8_t> bytes);

}  // namespace vdbdither
