#include "ops/kernels/colour/colour_field.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/empty_colours.h"
#include "ops/kernels/leaf/floor_divided.h"
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

/// Layers of the lattice grouped in odd numbers: group K has its middle in layer `size` · K.
struct LayerGroups {
  int size = 1;

  [[nodiscard]] int of(int z) const { return floorDivided(z + size / 2, size); }
  [[nodiscard]] int begin(int group) const { return group * size - size / 2; }
};

int layersWithin(const Vec3d& pitch_mm) {
  const double longest_mm = std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  constexpr double most_beside = 7;
  constexpr double rounding = 1e-9;
  const auto beside =
      static_cast<int>(std::min(0.5 * longest_mm / pitch_mm.z() + rounding, most_beside));
  return 2 * beside + 1;
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
      : field_(field), bands_(bands), parts_(parts), core_(core), groups_{field.layers_} {
    const ZRange groups{groups_.of(core.begin), groups_.of(core.end - 1) + 1};
    for (const Solid& solid : field.solids_)
      below_.push_back(solid.below ? solid.below->run(groups) : DistanceGrids{});
  }

  [[nodiscard]] ColourGrids paint() const;

 private:
  class LeafPainter;

  /// Leaves that the band of the whole or the search below it meets, in order.
  [[nodiscard]] std::vector<Coord> leafOrigins() const {
    std::vector<Coord> origins;
    appendLeafOrigins(bands_[0].closest->tree(), core_, origins);
    if (below_[0].closest) {
      for (auto leaf = below_[0].closest->tree().cbeginLeaf(); leaf; ++leaf) {
        const Coord origin = leaf->origin();
        const ZRange layers =
            intersection({groups_.begin(origin.z()), groups_.begin(origin.z() + edge)}, core_);
        for (int z = layers.begin & ~(edge - 1); z < layers.end; z += edge)
          origins.emplace_back(origin.x(), origin.y(), z);
      }
    }
    sortOnce(origins);
    return origins;
  }

  const ColourField& field_;
  std::span<const DistanceGrids> bands_;
  const Int32Grid* parts_;
  ZRange core_;
  LayerGroups groups_;
  std::vector<DistanceGrids> below_;
};

class ColourField::Painter::LeafPainter {
 public:
  /// @param opacities  null where all is opaque
  LeafPainter(const Painter& painter, Vec3SLeaf& colours, FloatLeaf* opacities)
      : all_(painter),
        origin_(colours.origin()),
        colours_(colours),
        opacities_(opacities),
        nearest_(painter.bands_.size()) {
    for (int z = 0; z < edge; ++z)
      group_[static_cast<std::size_t>(z)] = painter.groups_.of(origin_.z() + z);
    std::fill_n(colours.buffer().data(), Vec3SLeaf::SIZE, openvdb::Vec3s(0, 0, 0));
    if (opacities != nullptr) std::fill_n(opacities->buffer().data(), FloatLeaf::SIZE, 0.0F);
  }

  void paint() {
    const openvdb::FloatTree& surface = all_.bands_[0].surface->tree();
    const FloatLeaf* distances = surface.probeConstLeaf(origin_);
    const float tile_mm = distances != nullptr ? 0 : surface.getValue(origin_);
    const auto outside_mm = static_cast<float>(all_.field_.lattice_.diagonalMm());
    const auto depth_mm = static_cast<float>(all_.field_.depth_mm_);
    const Nearest& whole = nearestOf(0);
    const ZRange layers =
        intersection({0, edge}, {all_.core_.begin - origin_.z(), all_.core_.end - origin_.z()});
    for (openvdb::Index column = 0; column < Int32Leaf::SIZE; column += edge) {
      last_triangle_ = no_triangle;
      for (int z = layers.begin; z < layers.end; ++z) {
        const openvdb::Index v = column + static_cast<openvdb::Index>(z);
        const float distance_mm = distances != nullptr ? distances->getValue(v) : tile_mm;
        if (distance_mm > outside_mm) continue;
        Found found{0, whole.inBand(v), no_triangle};
        if (found.in_band ? distance_mm < -depth_mm : !(distance_mm < 0)) continue;
        found.triangle = triangleOf(whole, found.in_band, v);
        if (found.triangle == no_triangle) continue;
        if (all_.parts_ != nullptr) takePart(found, v);
        set(v, colourOf(found, v));
      }
    }
  }

 private:
  static constexpr std::uint32_t no_triangle = ~std::uint32_t{0};

  /// The nearest triangles of one solid.
  struct Nearest {
    const Int32Leaf* band = nullptr;
    std::array<const Int32Leaf*, edge> below{};  ///< by layer of the leaf

    [[nodiscard]] bool inBand(openvdb::Index v) const {
      return band != nullptr && band->getValueMask().isOn(v);
    }
  };
  /// The triangle nearest to a voxel of the band, or below it to the middle of its group.
  struct Found {
    std::size_t solid;
    bool in_band;
    std::uint32_t triangle;
  };

  [[nodiscard]] const Nearest& nearestOf(std::size_t solid) {
    std::optional<Nearest>& nearest = nearest_[solid];
    if (nearest) return *nearest;
    nearest.emplace();
    nearest->band = all_.bands_[solid].closest->tree().probeConstLeaf(origin_);
    if (const Int32Grid* below = all_.below_[solid].closest.get())
      for (std::size_t z = 0; z < edge; ++z)
        nearest->below[z] = below->tree().probeConstLeaf({origin_.x(), origin_.y(), group_[z]});
    return *nearest;
  }

  [[nodiscard]] std::uint32_t triangleOf(const Nearest& nearest, bool in_band,
                                         openvdb::Index v) const {
    if (in_band) return static_cast<std::uint32_t>(nearest.band->getValue(v));
    const std::size_t z = v % edge;
    const Int32Leaf* below = nearest.below[z];
    const openvdb::Index at = v - v % edge + static_cast<openvdb::Index>(group_[z] & (edge - 1));
    return below != nullptr && below->getValueMask().isOn(at)
               ? static_cast<std::uint32_t>(below->getValue(at))
               : no_triangle;
  }

  /// Replaces the triangle by one of the body that the voxel belongs to, if it has one nearby.
  void takePart(Found& found, openvdb::Index v) {
    if (!parts_) parts_ = all_.parts_->tree().probeConstLeaf(origin_);
    const int part =
        *parts_ != nullptr ? (*parts_)->getValue(v) : all_.parts_->tree().getValue(origin_);
    if (part < 1) return;
    const auto solid = static_cast<std::size_t>(part);
    const Nearest& nearest = nearestOf(solid);
    const bool in_band = nearest.inBand(v);
    const std::uint32_t triangle = triangleOf(nearest, in_band, v);
    if (triangle != no_triangle) found = {solid, in_band, triangle};
  }

  [[nodiscard]] Vec4f colourOf(const Found& found, openvdb::Index v) {
    const std::size_t z = v % edge;
    if (!found.in_band && found.triangle == last_triangle_ && found.solid == last_solid_ &&
        group_[z] == last_group_)
      return last_colour_;
    Coord ijk = colours_.offsetToGlobalCoord(v);
    if (!found.in_band) ijk.z() = group_[z] * all_.groups_.size;
    const Vec4f colour = all_.field_.solids_[found.solid].colours.at(
        found.triangle, all_.field_.lattice_.position(ijk));
    if (found.in_band) return colour;
    last_triangle_ = found.triangle;
    last_solid_ = found.solid;
    last_group_ = group_[z];
    last_colour_ = colour;
    return colour;
  }

  void set(openvdb::Index v, const Vec4f& colour) {
    colours_.setValueOn(v, openvdb::Vec3s(colour.x(), colour.y(), colour.z()));
    if (opacities_ != nullptr) opacities_->setValueOn(v, colour.w());
  }

  const Painter& all_;
  Coord origin_;
  Vec3SLeaf& colours_;
  FloatLeaf* opacities_;
  std::vector<std::optional<Nearest>> nearest_;  ///< by solid, as they are needed
  std::optional<const Int32Leaf*> parts_;
  std::array<int, edge> group_{};  ///< by layer of the leaf
  // The colour found last below the band, in the same column.
  std::uint32_t last_triangle_ = no_triangle;
  std::size_t last_solid_ = 0;
  int last_group_ = 0;
  Vec4f last_colour_{};
};

ColourGrids ColourField::Painter::paint() const {
  const std::vector<Coord> origins = leafOrigins();
  const bool has_opacity = field_.colours_->hasOpacity();
  std::vector<std::unique_ptr<Vec3SLeaf>> colours(origins.size());
  std::vector<std::unique_ptr<FloatLeaf>> opacities(has_opacity ? origins.size() : 0);
  tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
    colours[n].reset(newLeaf<openvdb::Vec3STree>(origins[n]));
    if (has_opacity) opacities[n].reset(newLeaf<openvdb::FloatTree>(origins[n]));
    LeafPainter(*this, *colours[n], has_opacity ? opacities[n].get() : nullptr).paint();
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
      layers_(layersWithin(lattice.pitch_mm)) {}

void ColourField::add(const SolidMesh& solid) {
  Solid& added = solids_.emplace_back(Solid{SolidColours(colours_, solid), nullptr});
  if (!(depth_mm_ > 0)) return;
  const LayerGroups groups{layers_};
  Lattice search = lattice_;
  search.pitch_mm.z() *= layers_;
  search.box.min().z() = groups.of(lattice_.box.min().z());
  search.box.max().z() = groups.of(lattice_.box.max().z());
  const Band band{.mm = depth_mm_, .inside_only = true};
  added.below = std::make_unique<MeshDistance>(
      solid.mesh, search, band, DistanceExtras{.closest = true}, solid.walls, tie_mm_);
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
