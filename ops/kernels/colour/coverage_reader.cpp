#include "ops/kernels/colour/coverage_reader.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <sstream>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3s;
using openvdb::Vec3STree;

namespace {

constexpr unsigned whole_row = 255;

/// The active voxels of a column of a leaf.
template <class Leaf>
unsigned rowOf(const Leaf& leaf, unsigned column) {
  return leaf.getValueMask().template getWord<std::uint8_t>(column / leaf_layers);
}

bool sameBits(const Vec3s& a, const Vec3s& b) {
  std::uint32_t difference = 0;
  for (int c = 0; c < 3; ++c)
    difference |= std::bit_cast<std::uint32_t>(a[c]) ^ std::bit_cast<std::uint32_t>(b[c]);
  return difference == 0;
}

class ColourReader : public CoverageReader {
 public:
  ColourReader(const openvdb::Vec3SGrid& colour, const FloatGrid* opacity, const InkSet& set,
               const Separation& separation)
      : colour_(colour.tree()), set_(set), separation_(separation) {
    if (opacity != nullptr && set.clear) opacity_.emplace(opacity->tree());
  }

  bool visit(const Coord& origin) override {
    origin_ = origin;
    leaf_ = colour_.probeConstLeaf(origin);
    values_ = leaf_ != nullptr ? leaf_->buffer().data() : nullptr;
    opacity_leaf_ = opacity_ ? opacity_->probeConstLeaf(origin) : nullptr;
    return leaf_ != nullptr || colour_.probeValue(origin, tile_colour_);
  }

  [[nodiscard]] unsigned layersWith(unsigned column) const override {
    return leaf_ != nullptr ? rowOf(*leaf_, column) : whole_row;
  }

  unsigned read(unsigned column, unsigned layers, std::span<float> coverages) override {
    const auto lowest = static_cast<unsigned>(std::countr_zero(layers));
    const Vec3s colour = colourAt(column + lowest);
    // Voxels that are near each other often have one colour.
    Separated& separated = separated_[placeOf(colour)];
    if (separated.inks.empty() || !sameBits(colour, separated.colour)) {
      if (!std::isfinite(colour[0]) || !std::isfinite(colour[1]) || !std::isfinite(colour[2]))
        refuse(column + lowest);
      separated.colour = colour;
      separated.inks.resize(set_.inks.size());
      separation_.run(colour, separated.inks);
    }
    std::copy(separated.inks.begin(), separated.inks.end(), coverages.begin());
    unsigned alike = 1U << lowest;
    if (opacity_) {
      addClear(opacityAt(column + lowest), coverages);
    } else {
      for (unsigned next = alike << 1; (layers & next) != 0; next <<= 1) {
        if (!sameBits(colourAt(column + static_cast<unsigned>(std::countr_zero(next))), colour))
          break;
        alike |= next;
      }
    }
    return alike;
  }

 private:
  /// A colour and its coverages; none at first.
  struct Separated {
    Vec3s colour{0.0F};
    std::vector<float> inks;
  };
  static constexpr int place_bits = 6;

  static std::size_t placeOf(const Vec3s& colour) {
    std::uint32_t hash = 0;
    for (int c = 0; c < 3; ++c)
      hash = (hash ^ std::bit_cast<std::uint32_t>(colour[c])) * 0x9e3779b1U;
    return hash >> (32 - place_bits);
  }

  [[nodiscard]] const Vec3s& colourAt(unsigned offset) const {
    return values_ != nullptr ? values_[offset] : tile_colour_;
  }
  [[nodiscard]] float opacityAt(unsigned offset) const {
    if (opacity_leaf_ == nullptr)
      return opacity_->isValueOn(origin_) ? opacity_->getValue(origin_) : 1;
    return opacity_leaf_->isValueOn(offset) ? opacity_leaf_->getValue(offset) : 1;
  }

  void addClear(float opacity, std::span<float> coverages) const {
    const float share = std::isnan(opacity) ? 1 : std::clamp(opacity, 0.0F, 1.0F);
    for (float& coverage : coverages) coverage *= share;
    coverages[*set_.clear] += 1 - share;
  }

  [[noreturn]] void refuse(unsigned offset) const {
    std::ostringstream text;
    text << "grid 'Cd' has a colour that is not a number at voxel " << at(offset)
         << "; mend the grid";
    throw DataError(text.str());
  }

  [[nodiscard]] Coord at(unsigned offset) const {
    return origin_ + Vec3STree::LeafNodeType::offsetToLocalCoord(offset);
  }

  openvdb::tree::ValueAccessor<const Vec3STree, false> colour_;
  std::optional<openvdb::tree::ValueAccessor<const FloatTree, false>> opacity_;
  const InkSet& set_;
  const Separation& separation_;
  Coord origin_;
  const Vec3STree::LeafNodeType* leaf_ = nullptr;
  const Vec3s* values_ = nullptr;  ///< of leaf_
  const FloatTree::LeafNodeType* opacity_leaf_ = nullptr;
  Vec3s tile_colour_{0.0F};
  std::array<Separated, std::size_t{1} << place_bits> separated_;  ///< by place
};

class GridReader : public CoverageReader {
 public:
  GridReader(const std::vector<GridCoverages::Grid>& grids, std::optional<std::size_t> rest)
      : rest_(rest) {
    for (const auto& [grid, name, material] : grids)
      columns_.push_back(
          {FloatGrid::ConstAccessor(grid->tree()), name, material, nullptr, false, 0});
  }

  bool visit(const Coord& origin) override {
    origin_ = origin;
    bool some = false;
    for (Column& column : columns_) {
      column.leaf = column.values.probeConstLeaf(origin);
      column.tile = column.leaf == nullptr && column.values.isValueOn(origin);
      column.tile_value = column.tile ? column.values.getValue(origin) : 0;
      some |= column.leaf != nullptr || column.tile;
    }
    return some;
  }

  [[nodiscard]] unsigned layersWith(unsigned column) const override {
    unsigned layers = 0;
    for (const Column& grid : columns_)
      layers |= grid.leaf != nullptr ? rowOf(*grid.leaf, column) : grid.tile ? whole_row : 0;
    return layers;
  }

  unsigned read(unsigned column, unsigned layers, std::span<float> coverages) override {
    const auto lowest = static_cast<unsigned>(std::countr_zero(layers));
    readVoxel(column + lowest, coverages);
    return 1U << lowest;
  }

 private:
  struct Column {
    FloatGrid::ConstAccessor values;
    std::string name;
    std::size_t material;
    const FloatTree::LeafNodeType* leaf;
    bool tile;
    float tile_value;
  };

  void readVoxel(unsigned offset, std::span<float> coverages) const {
    std::fill(coverages.begin(), coverages.end(), 0.0F);
    double sum = 0;
    for (const Column& column : columns_) {
      const bool held = column.leaf != nullptr && column.leaf->isValueOn(offset);
      if (!held && !column.tile) continue;
      const float value = held ? column.leaf->getValue(offset) : column.tile_value;
      if (!(value >= 0) || !std::isfinite(value))
        refuse(column.name, "is " + textOf(value), offset);
      coverages[column.material] += value;
      sum += double{value};
    }
    if (rest_ && sum < 1) {
      coverages[*rest_] += static_cast<float>(1 - sum);
      return;
    }
    if (sum == 0) {
      std::ostringstream text;
      text << "the coverages are all 0 at voxel " << at(offset)
           << "; name the material of such voxels (--rest), or mend the grids";
      throw DataError(text.str());
    }
    for (float& coverage : coverages) coverage = static_cast<float>(double{coverage} / sum);
  }

  static std::string textOf(float value) {
    std::ostringstream text;
    text << value;
    return text.str();
  }

  [[noreturn]] void refuse(const std::string& name, const std::string& what,
                           unsigned offset) const {
    std::ostringstream text;
    text << "grid '" << name << "' " << what << " at voxel " << at(offset)
         << "; coverages must be finite and not negative";
    throw DataError(text.str());
  }

  [[nodiscard]] Coord at(unsigned offset) const {
    return origin_ + FloatTree::LeafNodeType::offsetToLocalCoord(offset);
  }

  std::optional<std::size_t> rest_;
  std::vector<Column> columns_;
  Coord origin_;
};

}  // namespace

std::unique_ptr<CoverageReader> ColourCoverages::reader() const {
  return std::make_unique<ColourReader>(colour_, opacity_, set_, separation_);
}

std::unique_ptr<CoverageReader> GridCoverages::reader() const {
  return std::make_unique<GridReader>(grids_, rest_);
}

}  // namespace vdbdither
