#include "ops/kernels/colour/colour_field.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/node_writer.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3d;
using openvdb::Vec3SGrid;
using openvdb::Vec4f;

namespace {

using Int32Leaf = openvdb::Int32Tree::LeafNodeType;
using FloatLeaf = openvdb::FloatTree::LeafNodeType;
using Vec3SLeaf = openvdb::Vec3STree::LeafNodeType;

constexpr int edge = leaf_layers;

int floorDivided(int a, int b) { return a / b - (a % b < 0 ? 1 : 0); }

/// Layers of the lattice grouped in odd numbers: group K has its middle in layer `size` · K.
struct LayerGroups {
  int size = 1;

  [[nodiscard]] int of(int z) const { return floorDivided(z + size / 2, size); }
  [[nodiscard]] int begin(int group) const { return group * size - size / 2; }
};

int layersWithin(const Vec3d& pitch_mm) {
  const double longest_mm = std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()});
  constexpr int most = 15;
  constexpr double rounding = 1e-9;
  const auto beside = static_cast<int>(
      std::min(0.5 * longest_mm / pitch_mm.z() + rounding, static_cast<double>(most / 2)));
  return 2 * beside + 1;
}

ColourGrids emptyGrids(const Lattice& lattice, bool has_opacity) {
  ColourGrids grids;
  grids.colour = Vec3SGrid::create(openvdb::Vec3s(0, 0, 0));
  grids.colour->setName(colour_grid);
  grids.colour->setVectorType(openvdb::VEC_INVARIANT);
  grids.colour->setTransform(transformOf(lattice));
  if (!has_opacity) return grids;
  grids.opacity = FloatGrid::create(0);
  grids.opacity->setName(opacity_grid);
  grids.opacity->setGridClass(openvdb::GRID_FOG_VOLUME);
  grids.opacity->setTransform(transformOf(lattice));
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
    for (auto leaf = bands_[0].closest->tree().cbeginLeaf(); leaf; ++leaf)
      origins.push_back(leaf->origin());
    if (below_[0].closest) {
      for (auto leaf = below_[0].closest->tree().cbeginLeaf(); leaf; ++leaf) {
        const Coord origin = leaf->origin();
        const ZRange layers =
            intersection({groups_.begin(origin.z()), groups_.begin(origin.z() + edge)}, core_);
        for (int z = layers.begin & ~(edge - 1); z < layers.end; z += edge)
          origins.emplace_back(origin.x(), origin.y(), z);
      }
    }
    std::sort(origins.begin(), origins.end());
    origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
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
    std::fill_n(colours.buffer().data(), Vec3SLeaf::SIZE, openvdb::Vec3s(0, 0, 0));
    if (opacities != nullptr) std::fill_n(opacities->buffer().data(), FloatLeaf::SIZE, 0.0F);
  }

  void paint() {
    const openvdb::FloatTree& surface = all_.bands_[0].surface->tree();
    const FloatLeaf* distances = surface.probeConstLeaf(origin_);
    const float tile_mm = distances != nullptr ? 0 : surface.getValue(origin_);
    const auto outside_mm = static_cast<float>(all_.field_.lattice_.diagonalMm());
    for (openvdb::Index v = 0; v < Int32Leaf::SIZE; ++v) {
      const Coord at = Int32Leaf::offsetToLocalCoord(v);
      if (!all_.core_.contains(origin_.z() + at.z())) continue;
      const float distance_mm = distances != nullptr ? distances->getValue(v) : tile_mm;
      if (distance_mm > outside_mm) continue;
      if (const auto found = find(v, at, distance_mm)) set(v, colourOf(*found, origin_ + at));
    }
  }

 private:
  /// The nearest triangles of one solid.
  struct Nearest {
    const Int32Leaf* band = nullptr;
    std::array<const Int32Leaf*, edge> below{};  ///< by layer of the leaf
  };
  /// The triangle nearest to a voxel, or to the middle of its group.
  struct Found {
    std::size_t solid;
    std::uint32_t triangle;
    std::optional<int> group;  ///< below the band
    friend bool operator==(const Found&, const Found&) = default;
  };

  [[nodiscard]] const Nearest& nearestOf(std::size_t solid) {
    std::optional<Nearest>& nearest = nearest_[solid];
    if (nearest) return *nearest;
    nearest.emplace();
    nearest->band = all_.bands_[solid].closest->tree().probeConstLeaf(origin_);
    if (const Int32Grid* below = all_.below_[solid].closest.get())
      for (int z = 0; z < edge; ++z)
        nearest->below[static_cast<std::size_t>(z)] = below->tree().probeConstLeaf(
            {origin_.x(), origin_.y(), all_.groups_.of(origin_.z() + z)});
    return *nearest;
  }

  [[nodiscard]] std::optional<Found> findIn(std::size_t solid, openvdb::Index v, const Coord& at) {
    const Nearest& nearest = nearestOf(solid);
    if (nearest.band != nullptr && nearest.band->isValueOn(v))
      return Found{solid, static_cast<std::uint32_t>(nearest.band->getValue(v)), std::nullopt};
    const Int32Leaf* below = nearest.below[static_cast<std::size_t>(at.z())];
    if (below == nullptr) return std::nullopt;
    const int group = all_.groups_.of(origin_.z() + at.z());
    std::int32_t triangle = 0;
    if (!below->probeValue({at.x(), at.y(), group}, triangle)) return std::nullopt;
    return Found{solid, static_cast<std::uint32_t>(triangle), group};
  }

  /// Returns where the colour of a voxel comes from, or nothing if it has none.
  [[nodiscard]] std::optional<Found> find(openvdb::Index v, const Coord& at, float distance_mm) {
    const std::optional<Found> found = findIn(0, v, at);
    if (!found || (found->group && !(distance_mm < 0))) return std::nullopt;
    if (!found->group && distance_mm < -all_.field_.depth_mm_) return std::nullopt;
    if (all_.parts_ == nullptr) return found;
    if (!parts_) parts_ = all_.parts_->tree().probeConstLeaf(origin_);
    const int part =
        *parts_ != nullptr ? (*parts_)->getValue(v) : all_.parts_->tree().getValue(origin_);
    if (part < 1) return found;
    const std::optional<Found> own = findIn(static_cast<std::size_t>(part), v, at);
    return own ? own : found;
  }

  [[nodiscard]] Vec4f colourOf(const Found& found, const Coord& ijk) {
    if (found.group && last_ && last_->first == found && last_xy_ == std::pair(ijk.x(), ijk.y()))
      return last_->second;
    Coord middle = ijk;
    if (found.group) middle.z() = *found.group * all_.groups_.size;
    const Vec4f colour = all_.field_.solids_[found.solid].colours.at(
        found.triangle, all_.field_.lattice_.position(middle));
    last_ = {found, colour};
    last_xy_ = {ijk.x(), ijk.y()};
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
  std::optional<std::pair<Found, Vec4f>> last_;  ///< the colour found last
  std::pair<int, int> last_xy_{};
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
