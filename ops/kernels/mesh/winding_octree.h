#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "ops/kernels/contour/marching_cubes.h"
#include "ops/kernels/mesh/grid_keys.h"
#include "ops/kernels/mesh/progress_part.h"
#include "ops/kernels/mesh/winding_cells.h"
#include "ops/kernels/mesh/winding_crossing.h"

namespace vdbdither {

/// The leaves of an octree that triangles or the surface of their winding solid pass, small where
/// one vertex cannot represent the surface in a leaf. The roots are the cells of WindingCells.
class WindingOctree {
 public:
  /// How often a cell can be divided; the smallest leaves have an edge of one unit.
  static constexpr int max_cuts = 5;
  static constexpr int root_units = WindingCells::units;
  static_assert(root_units == 1 << max_cuts);
  static constexpr std::uint32_t none = ~std::uint32_t{0};

  struct Leaf {
    openvdb::Coord low;
    int size;  ///< in units
    bool divided = false;
    std::uint8_t inside = 0;             ///< by corner, a bit each
    std::uint32_t cell = 0;              ///< the root that it lies in
    std::uint32_t first = 0, count = 0;  ///< the triangles that meet it, in touches_
  };
  /// An edge of a leaf.
  struct Edge {
    openvdb::Coord low;
    int axis;
    int size;
  };

  /// \param cuts        how often a cell may be divided
  /// \param max_leaves  no more are made by dividing
  /// \param max_work    no cell is divided if that is more work; in triangles looked at, as
  ///                    WindingCells counts them
  WindingOctree(const WindingSolid& solid, int cuts, std::size_t max_leaves, std::size_t max_work)
      : solid_(solid),
        cells_(solid.cells()),
        mesh_(cells_.mesh()),
        unit_mm_(cells_.unitMm()),
        smallest_(root_units >> cuts),
        max_leaves_(max_leaves),
        max_work_(max_work) {}

  static constexpr std::size_t unlimited = ~std::size_t{0};

  /// Finds the leaves; must be called once, before all else. Returns false if it gave up, because
  /// it is more work than `most_work`.
  bool grow(const ProgressPart& progress, std::size_t most_work = unlimited);

  /// All leaves, the divided ones included.
  [[nodiscard]] const std::vector<Leaf>& leaves() const { return leaves_; }
  /// The edge of the smallest leaf.
  [[nodiscard]] double smallestMm() const { return smallest_made_ * unit_mm_; }

  /// Whether edge 0 … 11 of a leaf crosses the surface, by its ends; numbered as in
  /// marching_cubes.h.
  static bool isCut(const Leaf& leaf, int edge) {
    return (cubeCases()[leaf.inside].edges >> edge & 1) != 0;
  }
  static Edge edgeOf(const Leaf& leaf, int edge);
  static Edge edgeOf(Key key) {
    return {coordOf(key >> 5), static_cast<int>(key & 3), 1 << (key >> 2 & 7)};
  }
  static Key edgeKey(const Edge& edge) {
    return leafKey(edge.low, edge.size) << 2 | static_cast<Key>(edge.axis);
  }

  /// Whether a corner of a leaf is inside the solid.
  [[nodiscard]] bool isInside(const openvdb::Coord& corner) const {
    const bool* found = inside_.find(keyOf(corner));
    return found != nullptr && *found;
  }
  /// The leaf beside an edge, or none: turn 0 … 3, counter-clockwise seen from its upper end.
  [[nodiscard]] std::uint32_t leafBeside(const Edge& edge, int turn) const {
    return leafAt(unitBeside(edge, turn));
  }
  /// The crossing of an edge that is cut.
  [[nodiscard]] const EdgeCrossing& crossingAt(Key edge) const {
    return crossings_[crossing_at_.at(edge)];
  }
  /// The place that represents the surface in a leaf whose edges have these crossings.
  [[nodiscard]] openvdb::Vec3d vertexOf(const Leaf& leaf,
                                        std::span<const EdgeCrossing> crossings) const;

 private:
  static Key leafKey(const openvdb::Coord& low, int size) {
    return keyOf(low) << 3 | static_cast<Key>(std::countr_zero(static_cast<unsigned>(size)));
  }
  static openvdb::Coord cornerOf(const Leaf& leaf, int corner) {
    return leaf.low.offsetBy((corner & 1) * leaf.size, (corner >> 1 & 1) * leaf.size,
                             (corner >> 2 & 1) * leaf.size);
  }
  static openvdb::Coord unitBeside(const Edge& edge, int turn);
  [[nodiscard]] LeafCube cubeOf(const Leaf& leaf) const {
    return {cells_.position(leaf.low), leaf.size * unit_mm_};
  }
  [[nodiscard]] std::uint32_t leafAt(const openvdb::Coord& unit) const;
  [[nodiscard]] std::uint8_t insideOf(const Leaf& leaf) const;
  [[nodiscard]] EdgeCrossing crossing(const Edge& edge, const Leaf& leaf) const;
  [[nodiscard]] bool needsDivision(const Leaf& leaf) const;

  void addTouched();
  std::uint32_t add(const openvdb::Coord& low, int size);
  void divide(std::uint32_t leaf, std::vector<std::uint32_t>& fresh);
  bool findCells(std::span<const std::uint32_t> fresh, std::size_t most_work);
  void judgeCorners(std::span<const std::uint32_t> fresh, const ProgressPart& progress);
  void findCrossings(std::span<const std::uint32_t> fresh, const ProgressPart& progress);
  std::vector<std::uint32_t> spread(std::span<const std::uint32_t> fresh,
                                    std::size_t work_of_fresh);

  WindingSolid solid_;
  WindingCells& cells_;
  const Mesh& mesh_;
  double unit_mm_;
  int smallest_;  ///< that leaves may become
  std::size_t max_leaves_;
  std::size_t max_work_;
  std::size_t work_ = 0;
  std::vector<Leaf> leaves_;
  KeyMap<std::uint32_t> leaf_at_;
  std::vector<std::uint32_t> touches_;
  KeyMap<bool> inside_;  ///< by corner
  std::vector<EdgeCrossing> crossings_;
  KeyMap<std::uint32_t> crossing_at_;  ///< by edge
  int smallest_made_ = root_units;
};

}  // namespace vdbdither
