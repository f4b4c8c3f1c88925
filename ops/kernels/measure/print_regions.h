#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "vdbdither/model/lattice.h"
#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// A connected region of voxels.
struct Region {
  std::uint64_t voxels = 0;
  int layer = 0;  ///< the lowest one
  std::uint32_t column = 0;
  std::uint32_t row = 0;  ///< of its first voxel there, row by row

  friend bool operator==(const Region&, const Region&) = default;
};

/// Regions of one kind.
struct Regions {
  std::uint64_t count = 0;
  std::uint64_t voxels = 0;     ///< of all
  std::vector<Region> largest;  ///< at most `listed`, the largest first, then by place

  static constexpr std::size_t listed = 8;
  void add(const Region& region);
};

/// What may go wrong in a print, whatever its materials. docs/verify.md shows each kind.
struct PrintFindings {
  /// Regions of a layer, connected by faces, without a printed voxel below them, above the lowest
  /// printed layer. Specks are not among them.
  Regions islands;
  Regions small_islands;  ///< the same, below the least size
  /// Printed voxels that touch no other by a face.
  Regions specks;
  /// Empty regions, connected by faces, that do not reach the outside.
  Regions cavities;
  /// Empty regions that are closed by the build plate, by what is printed up to a layer and by the
  /// film beneath it, and that open later. Their voxels are those at the time of opening.
  Regions cups;
  /// Layers without a voxel between printed ones, in rising order.
  std::vector<ZRange> empty_layers;
};

/// Finds regions in layers that come from the lowest one on. What it holds follows the regions and
/// spans of two layers and of those that are added together, not the whole stack.
class PrintRegions {
 public:
  /// What is smaller counts as the grain of dithering, in voxels.
  struct Least {
    std::uint64_t island = 1;  ///< smaller islands are counted apart
    std::uint64_t cup = 1;     ///< smaller cups are not told
  };
  PrintRegions() : PrintRegions(Least{}) {}
  explicit PrintRegions(const Least& least);
  ~PrintRegions();
  PrintRegions(const PrintRegions&) = delete;
  PrintRegions& operator=(const PrintRegions&) = delete;

  /// A layer, where 0 is empty.
  struct Layer {
    int number = 0;  ///< rises from layer to layer; a number that is left out is not known
    const SpanImage& image;
  };

  /// Adds the next layers, all of one size. They are worked on in parallel; the result does not
  /// depend on how many come together.
  void add(std::span<const Layer> layers);

  /// After the last layer.
  PrintFindings finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace vdbdither
