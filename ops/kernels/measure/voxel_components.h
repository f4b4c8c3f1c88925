#pragma once

#include <cstdint>
#include <vector>

#include "ops/kernels/leaf/bit_layers.h"

namespace vdbdither {

/// Counts the pieces and the cavities of a set of voxels, layer by layer.
///
/// Pieces hang together by faces, edges and corners (26 neighbours), what is empty by faces (6).
/// A cavity is an empty piece that does not reach the outside. Memory is two layers of runs.
class VoxelComponents {
 public:
  explicit VoxelComponents(const BitFrame& frame);

  /// The next layer, on top of those before.
  void add(const BitLayer& layer);

  struct Counts {
    std::vector<std::uint64_t> components;  ///< voxels of every piece, largest first
    std::vector<std::uint64_t> cavities;    ///< likewise
  };
  /// After the last layer.
  Counts finish();

 private:
  /// Voxels of a row that follow each other: [begin, end), with the piece they belong to.
  struct Run {
    int begin, end;
    std::uint32_t piece;
  };
  /// One kind of voxels: those set, or those that are not.
  struct Pieces {
    bool diagonal = false;              ///< whether edges and corners join
    std::vector<Run> runs;              ///< of the last layer
    std::vector<std::size_t> rows;      ///< where each row of it begins
    std::vector<std::uint64_t> open;    ///< voxels of the pieces in the last layer, by number
    std::vector<std::uint64_t> closed;  ///< of those that ended
  };

  void addRuns(Pieces& pieces, std::vector<Run> runs, std::vector<std::size_t> rows) const;
  void addLayer(const BitLayer& layer);

  BitFrame frame_;
  Pieces full_, empty_;
  bool begun_ = false;
};

}  // namespace vdbdither
