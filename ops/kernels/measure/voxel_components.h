#pragma once

#include <cstdint>
#include <vector>

#include "ops/kernels/leaf/bit_layers.h"

namespace vdbdither {

/// Counts the pieces and the cavities of a set of voxels, layer by layer.
///
/// Voxels of a piece are connected by faces, edges and corners (26 neighbours), empty voxels by
/// faces (6). A cavity is a connected set of empty voxels that does not reach the outside. Two
/// layers of spans are held in memory.
class VoxelComponents {
 public:
  explicit VoxelComponents(const BitLayout& layout);

  /// Adds the next layer, above those before.
  void add(const BitLayer& layer);

  struct Counts {
    std::vector<std::uint64_t> components;  ///< the number of voxels of every piece, largest first
    std::vector<std::uint64_t> cavities;    ///< the same of every cavity
  };
  /// Returns the counts; must be called after the last layer.
  Counts finish();

 private:
  /// Consecutive voxels of a row, [begin, end), and their piece.
  struct Span {
    int begin, end;
    std::uint32_t piece;
  };
  /// The pieces of one kind of voxels: set or empty.
  struct Pieces {
    bool diagonal = false;              ///< whether edges and corners connect
    std::vector<Span> spans;            ///< of the last layer
    std::vector<std::size_t> rows;      ///< where each row of the last layer begins
    std::vector<std::uint64_t> open;    ///< voxels of the pieces in the last layer, by number
    std::vector<std::uint64_t> closed;  ///< voxels of the pieces that are complete
  };

  void addSpans(Pieces& pieces, std::vector<Span> spans, std::vector<std::size_t> rows) const;
  void addLayer(const BitLayer& layer);

  BitLayout layout_;
  Pieces full_, empty_;
  bool begun_ = false;
};

}  // namespace vdbdither
