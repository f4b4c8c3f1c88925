#include "ops/kernels/colour/colour_field.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/empty_colours.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/node_writer.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Int32Grid;
using openvdb::Vec3d;
using openvdb::Vec4f;

namespace {

using Int32Leaf = openvdb::Int32Tree::LeafNodeType;
using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using Vec3SLeaf = openvdb::Vec3STree::LeafNodeType;

constexpr int edge = leaf_layers;

bool isAbove(const Coord& origin, const Coord& other) {
  return origin.x() == other.x() && origin.y() == other.y() && origin.z() > other.z();
}

ColourGrids emptyGrids(const Lattice& lattice, bool has_opacity) {
  ColourGrids grids;
  grids.colour = emptyColours(lattice);
  if (has_opacity) grids.opacity = emptyOpacities(lattice);
  return grids;
}

}  // namespace

/// Colours leaves from the searches of all solids over the same layers.
class ColourField::Painter {
 public:
  Painter(const ColourField& field, std::span<const DistanceGrids> bands, const Int32Grid* parts,
          ZRange core)
      : field_(field), bands_(bands), parts_(parts), core_(core), groups_(field.groups_) {
    const ZRange groups{groups_.zOf(core.begin), groups_.zOf(core.end - 1) + 1};
    for (const Solid& solid : field.solids_)
      below_.push_back(solid.below ? solid.below->run(groups) : DistanceGrids{});
  }

  [[nodiscard]] ColourGrids paint() const;

 private:
  class ColumnPainter;

  /// Leaves that the band of the whole or the search below it meets, in order.
  [[nodiscard]] std::vector<Coord> leafOrigins() const {
    std::vector<Coord> origins;
    appendLeafOrigins(bands_[0].closest->tree(), core_, origins);
    if (below_[0].closest) {
      for (auto leaf = below_[0].closest->tree().cbeginLeaf(); leaf; ++leaf) {
        const openvdb::CoordBBox voxels = groups_.voxelsOf(leaf->getNodeBoundingBox());
        const ZRange layers = intersection({voxels.min().z(), voxels.max().z() + 1}, core_);
        if (layers.empty()) continue;
        const Coord first(voxels.min().x(), voxels.min().y(), layers.begin & ~(edge - 1));
        forEachLeafOrigin({first, {voxels.max().x(), voxels.max().y(), layers.end - 1}},
                          [&](const Coord& origin) { origins.push_back(origin); });
      }
    }
    sortOnce(origins);
    return origins;
  }

  const ColourField& field_;
  std::span<const DistanceGrids> bands_;
  const Int32Grid* parts_;
  ZRange core_;
  VoxelGroups groups_;
  std::vector<DistanceGrids> below_;
};

/// Colours leaves one after the other: those on top of each other from below, so that it still
/// knows the colour of a group that reaches into the next leaf.
class ColourField::Painter::ColumnPainter {
 public:
  explicit ColumnPainter(const Painter& painter) : all_(painter), nearest_(painter.bands_.size()) {}

  /// @param opacities  null where all is opaque
  void paint(Vec3SLeaf& colours, FloatLeaf* opacities) {
    turnTo(colours, opacities);
    const Nearest& whole = nearestOf(0);
    const LeafBits bits = coloured(whole);
    for (openvdb::Index column = 0; column < Int32Leaf::SIZE; column += edge) {
      const unsigned in_band = whole.inBand(column);
      for (unsigned left = rowOf(bits, column); left != 0;) {
        const auto z = static_cast<std::size_t>(std::countr_zero(left));
        const unsigned bit = 1U << z;
        Found found{0, (in_band & bit) != 0, no_triangle};
        // Of several parts, a voxel takes the triangle of its own.
        const bool alone = found.in_band || all_.parts_ != nullptr;
        const unsigned alike = alone ? bit : left & layers_of_group_[z] & ~in_band;
        left &= ~alike;
        const openvdb::Index v = column + static_cast<openvdb::Index>(z);
        const Coord group = groupOf(v);
        found.triangle = triangleOf(whole, found.in_band, v, group);
        if (found.triangle == no_triangle) continue;
        if (all_.parts_ != nullptr) takePart(found, v, group);
        set(column, alike, colourOf(found, v, group));
      }
    }
  }

 private:
  static constexpr std::uint32_t no_triangle = ~std::uint32_t{0};
  static constexpr std::size_t no_solid = ~std::size_t{0};

  /// The nearest triangles of one solid.
  struct Nearest {
    const Int32Leaf* band = nullptr;
    std::array<const Int32Leaf*, edge> below{};  ///< by layer of the leaf

    /// A bit for each layer of a column of the leaf.
    [[nodiscard]] unsigned inBand(openvdb::Index column) const {
      return band == nullptr ? 0 : band->getValueMask().getWord<std::uint8_t>(column / edge);
    }
  };
  /// The triangle nearest to a voxel of the band, or below it to the middle of its group.
  struct Found {
    std::size_t solid;
    bool in_band;
    std::uint32_t triangle;
  };
  /// The colour of a group of voxels below the band.
  struct GroupColour {
    Coord group;
    std::size_t solid = no_solid;
    Vec4f colour{};
  };

  static unsigned rowOf(const LeafBits& bits, openvdb::Index column) {
    return bits[column / (edge * edge)] >> column % (edge * edge) & 255;
  }

  void turnTo(Vec3SLeaf& colours, FloatLeaf* opacities) {
    origin_ = colours.origin();
    for (int z = 0; z < edge; ++z)
      group_[static_cast<std::size_t>(z)] = all_.groups_.zOf(origin_.z() + z);
    for (std::size_t z = 0; z < edge; ++z) {
      layers_of_group_[z] = 0;
      for (std::size_t other = 0; other < edge; ++other)
        if (group_[other] == group_[z]) layers_of_group_[z] |= 1U << other;
    }
    const openvdb::FloatTree& surface = all_.bands_[0].surface->tree();
    const FloatLeaf* leaf = surface.probeConstLeaf(origin_);
    distances_ = leaf != nullptr ? leaf->buffer().data() : nullptr;
    is_tile_inside_ = leaf == nullptr && surface.getValue(origin_) < 0;
    std::fill(nearest_.begin(), nearest_.end(), std::nullopt);
    parts_.reset();
    colours_ = &colours;
    values_ = colours.buffer().data();
    std::fill_n(values_, Vec3SLeaf::SIZE, openvdb::Vec3s(0, 0, 0));
    opacities_ = opacities;
    if (opacities != nullptr) std::fill_n(opacities->buffer().data(), FloatLeaf::SIZE, 0.0F);
  }

  /// Returns the voxels that lie where voxels have a colour.
  [[nodiscard]] LeafBits coloured(const Nearest& whole) const {
    const std::uint64_t layers = everyRow(rowWithin(origin_.z(), all_.core_));
    const float beyond_mm = std::nextafter(static_cast<float>(all_.field_.lattice_.diagonalMm()),
                                           std::numeric_limits<float>::infinity());
    const auto depth_mm = static_cast<float>(all_.field_.depth_mm_);
    LeafBits bits{};
    for (openvdb::Index x = 0; x < edge; ++x) {
      if (distances_ == nullptr) {
        bits[x] = is_tile_inside_ ? layers : 0;
        continue;
      }
      const float* plane = distances_ + x * edge * edge;
      const std::uint64_t in_band =
          whole.band == nullptr ? 0 : whole.band->getValueMask().getWord<std::uint64_t>(x);
      const std::uint64_t near = wordBelow(plane, beyond_mm) & ~wordBelow(plane, -depth_mm);
      bits[x] = layers & ((in_band & near) | (~in_band & wordBelow(plane, 0)));
    }
    return bits;
  }

  [[nodiscard]] const Nearest& nearestOf(std::size_t solid) {
    std::optional<Nearest>& nearest = nearest_[solid];
    if (nearest) return *nearest;
    nearest.emplace();
    nearest->band = all_.bands_[solid].closest->tree().probeConstLeaf(origin_);
    if (const Int32Grid* below = all_.below_[solid].closest.get())
      for (std::size_t z = 0; z < edge; ++z)
        nearest->below[z] = below->tree().probeConstLeaf(
            {all_.groups_.xOf(origin_.x()), all_.groups_.yOf(origin_.y()), group_[z]});
    return *nearest;
  }

  [[nodiscard]] static std::uint32_t triangleOf(const Nearest& nearest, bool in_band,
                                                openvdb::Index v, const Coord& group) {
    if (in_band) return static_cast<std::uint32_t>(nearest.band->buffer().data()[v]);
    const Int32Leaf* below = nearest.below[v % edge];
    const openvdb::Index at = Int32Leaf::coordToOffset(group);
    return below != nullptr && below->getValueMask().isOn(at)
               ? static_cast<std::uint32_t>(below->buffer().data()[at])
               : no_triangle;
  }

  /// Replaces the triangle by one of the body that the voxel belongs to, if it has one nearby.
  void takePart(Found& found, openvdb::Index v, const Coord& group) {
    if (!parts_) parts_ = all_.parts_->tree().probeConstLeaf(origin_);
    const int part =
        *parts_ != nullptr ? (*parts_)->getValue(v) : all_.parts_->tree().getValue(origin_);
    if (part < 1) return;
    const auto solid = static_cast<std::size_t>(part);
    const Nearest& nearest = nearestOf(solid);
    const bool in_band = (nearest.inBand(v - v % edge) >> v % edge & 1) != 0;
    const std::uint32_t triangle = triangleOf(nearest, in_band, v, group);
    if (triangle != no_triangle) found = {solid, in_band, triangle};
  }

  [[nodiscard]] Coord groupOf(openvdb::Index v) const {
    const auto x = static_cast<int>(v / (edge * edge));
    const auto y = static_cast<int>(v / edge % edge);
    return {all_.groups_.xOf(origin_.x() + x), all_.groups_.yOf(origin_.y() + y), group_[v % edge]};
  }

  [[nodiscard]] Vec4f colourOf(const Found& found, openvdb::Index v, const Coord& group) {
    const SolidColours& colours = all_.field_.solids_[found.solid].colours;
    if (found.in_band)
      return colours.at(found.triangle,
                        all_.field_.lattice_.position(colours_->offsetToGlobalCoord(v)));
    GroupColour& known = known_[Int32Leaf::coordToOffset(group) % known_.size()];
    if (group != known.group || found.solid != known.solid)
      known = {group, found.solid,
               colours.at(found.triangle, all_.field_.middles_.position(group))};
    return known.colour;
  }

  void set(openvdb::Index column, unsigned layers, const Vec4f& colour) {
    colours_->getValueMask().getWord<std::uint8_t>(column / edge) |=
        static_cast<std::uint8_t>(layers);
    const openvdb::Vec3s value(colour.x(), colour.y(), colour.z());
    openvdb::Vec3s* values = values_ + column;
    for (unsigned left = layers; left != 0; left &= left - 1)
      values[std::countr_zero(left)] = value;
    if (opacities_ == nullptr) return;
    for (unsigned left = layers; left != 0; left &= left - 1)
      opacities_->setValueOn(column + static_cast<openvdb::Index>(std::countr_zero(left)),
                             colour.w());
  }

  const Painter& all_;
  std::array<GroupColour, Int32Leaf::SIZE> known_{};  ///< a place for each group of a leaf
  // Of the leaf.
  Coord origin_;
  Vec3SLeaf* colours_ = nullptr;
  openvdb::Vec3s* values_ = nullptr;  ///< of colours_
  FloatLeaf* opacities_ = nullptr;
  std::vector<std::optional<Nearest>> nearest_;  ///< by solid, as they are needed
  std::optional<const Int32Leaf*> parts_;
  const float* distances_ = nullptr;  ///< null of a tile
  bool is_tile_inside_ = false;
  std::array<int, edge> group_{};                 ///< by layer
  std::array<unsigned, edge> layers_of_group_{};  ///< by layer: those of its group, a bit for each
};

ColourGrids ColourField::Painter::paint() const {
  const std::vector<Coord> origins = leafOrigins();
  const bool has_opacity = field_.colours_->hasOpacity();
  std::vector<std::unique_ptr<Vec3SLeaf>> colours(origins.size());
  std::vector<std::unique_ptr<FloatLeaf>> opacities(has_opacity ? origins.size() : 0);
  std::vector<std::size_t> begins;  // of the columns of leaves
  for (std::size_t n = 0; n < origins.size(); ++n)
    if (n == 0 || !isAbove(origins[n], origins[n - 1])) begins.push_back(n);
  begins.push_back(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(1, begins.size()), [&](const auto& range) {
    ColumnPainter painter(*this);
    for (std::size_t n = begins[range.begin() - 1]; n < begins[range.end() - 1]; ++n) {
      colours[n].reset(newLeaf<openvdb::Vec3STree>(origins[n]));
      if (has_opacity) opacities[n].reset(newLeaf<openvdb::FloatTree>(origins[n]));
      painter.paint(*colours[n], has_opacity ? opacities[n].get() : nullptr);
    }
  });
  ColourGrids grids = emptyGrids(field_.lattice_, has_opacity);
  for (std::size_t n = 0; n < origins.size(); ++n) {
    if (colours[n]->isEmpty()) continue;
    grids.colour->tree().addLeaf(colours[n].release());
    if (has_opacity) grids.opacity->tree().addLeaf(opacities[n].release());
  }
  return grids;
}

ColourField::ColourField(std::shared_ptr<const SurfaceColours> colours, const Lattice& lattice,
                         double depth_mm, double tie_mm)
    : colours_(std::move(colours)),
      lattice_(lattice),
      depth_mm_(depth_mm),
      tie_mm_(tie_mm),
      groups_(lattice.pitch_mm),
      middles_(groups_.middlesOf(lattice)) {}

void ColourField::add(const SolidMesh& solid) {
  Solid& added = solids_.emplace_back(Solid{SolidColours(colours_, solid), nullptr});
  if (!(depth_mm_ > 0)) return;
  const Band band{.mm = depth_mm_, .inside_only = true};
  added.below = std::make_unique<MeshDistance>(
      solid.mesh, middles_, band, DistanceExtras{.closest = true}, solid.walls, tie_mm_);
}

ColourGrids ColourField::run(std::span<const DistanceGrids> bands, const Int32Grid* parts,
                             ZRange core) const {
  const ZRange layers = intersection(core, lattice_.layers());
  if (layers.empty()) return emptyGrids(lattice_, colours_->hasOpacity());
  return Painter(*this, bands, parts, layers).paint();
}

double ColourField::memoryBytes() const {
  double bytes = colours_->memoryBytes();
  for (const Solid& solid : solids_)
    bytes += solid.colours.memoryBytes() + (solid.below ? solid.below->memoryBytes() : 0);
  return bytes;
}

}  // namespace vdbdither
