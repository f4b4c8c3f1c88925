// The field is made leaf by leaf: every feature of the mesh is entered into the leaves that its
// region touches, then each leaf takes the minimum over its features in a buffer that stays in the
// cache. The sign comes from a sweep along x, which needs nothing but the triangles that cross the
// layers at hand.

#include "ops/kernels/mesh_distance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/feature_sweep.h"
#include "ops/kernels/row_crossings.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

constexpr int edge = leaf_layers;
constexpr std::size_t features_per_task = 512;

/// Closer than this the direction to the nearest point says nothing about the normal.
constexpr double on_surface_mm = 1e-6;

int floorDiv8(int i) { return i >> 3; }

/// The items of every leaf of a chunk, in the order in which they were entered.
class LeafBins {
 public:
  struct Entry {
    std::uint32_t leaf, item;
  };

  LeafBins(std::size_t leaves, const std::vector<std::vector<Entry>>& parts)
      : first_(leaves + 1, 0) {
    for (const auto& part : parts)
      for (const Entry& entry : part) ++first_[entry.leaf + 1];
    for (std::size_t leaf = 0; leaf < leaves; ++leaf) first_[leaf + 1] += first_[leaf];
    items_.resize(first_.back());
    for (const auto& part : parts)
      for (const Entry& entry : part) items_[first_[entry.leaf]++] = entry.item;
    std::copy_backward(first_.begin(), first_.end() - 1, first_.end());
    first_[0] = 0;
  }

  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t leaf) const {
    return {items_.data() + first_[leaf], first_[leaf + 1] - first_[leaf]};
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> items_;
};

/// Eight planes of constant x, bit 8·j + k in each: OpenVDB's own order of a leaf.
using LeafBits = std::array<std::uint64_t, edge>;

/// The winding numbers of the 64 rows of a row of leaves, swept along x.
class RowWinding {
 public:
  static std::uint32_t pack(const Coord& ijk, int delta) {
    return static_cast<std::uint32_t>(
        ((ijk.x() & 7) << 6 | (ijk.y() & 7) << 3 | (ijk.z() & 7)) << 1 | (delta > 0));
  }

  /// The inside of the next leaf, whose crossings were packed.
  LeafBits advance(std::span<const std::uint32_t> crossings) {
    LeafBits inside;
    if (crossings.empty()) {
      inside.fill(bits_);
      return inside;
    }
    std::array<std::array<std::int16_t, 64>, edge> steps{};
    for (const std::uint32_t crossing : crossings)
      steps[crossing >> 7][(crossing >> 1) & 63] = static_cast<std::int16_t>(
          steps[crossing >> 7][(crossing >> 1) & 63] + ((crossing & 1) ? 1 : -1));
    for (std::size_t x = 0; x < edge; ++x) {
      std::uint64_t bits = 0;
      for (std::size_t row = 0; row < 64; ++row) {
        winding_[row] = static_cast<std::int16_t>(winding_[row] + steps[x][row]);
        bits |= static_cast<std::uint64_t>(winding_[row] != 0) << row;
      }
      inside[x] = bits;
    }
    bits_ = inside[edge - 1];
    return inside;
  }

 private:
  std::array<std::int16_t, 64> winding_{};
  std::uint64_t bits_ = 0;
};

openvdb::math::Transform::Ptr transformOf(const Lattice& lattice) {
  using namespace openvdb::math;
  if (lattice.origin_mm == Vec3d(0, 0, 0))
    return std::make_shared<Transform>(std::make_shared<ScaleMap>(lattice.pitch_mm));
  return std::make_shared<Transform>(
      std::make_shared<ScaleTranslateMap>(lattice.pitch_mm, lattice.origin_mm));
}

template <class Tree>
typename Tree::LeafNodeType* newLeaf(const Coord& origin, const typename Tree::ValueType& value) {
  auto* leaf = new typename Tree::LeafNodeType(openvdb::PartialCreate(), origin, value, false);
  leaf->allocate();
  return leaf;
}

/// Sets level-1 tiles, most of them along runs within one parent.
class TileWriter {
 public:
  explicit TileWriter(openvdb::FloatTree& tree) : accessor_(tree) {}

  void set(const Coord& xyz, float value) {
    const Coord origin = xyz & ~(Parent::DIM - 1);
    if (!parent_ || origin != parent_->origin()) {
      accessor_.addTile(1, xyz, value, false);
      parent_ = accessor_.probeNode<Parent>(xyz);
    } else {
      parent_->addTile(1, xyz, value, false);
    }
  }

 private:
  using Parent = openvdb::FloatTree::RootNodeType::ChildNodeType::ChildNodeType;
  openvdb::tree::ValueAccessor<openvdb::FloatTree> accessor_;
  Parent* parent_ = nullptr;
};

/// Calls visit(leaf) for the leaves of `leaves` (leaf coordinates) that the region of `feature`
/// within `band_mm` touches; a few that it does not touch may be among them.
template <class Visit>
void visitLeaves(const MeshFeature& feature, double band_mm, const Vec3d& pitch_mm,
                 const CoordBBox& voxels, const Visit& visit) {
  const Vec3d low = (feature.min - feature.below * band_mm) / pitch_mm;
  const Vec3d high = (feature.max + feature.above * band_mm) / pitch_mm;
  Coord first, last;
  for (int axis = 0; axis < 3; ++axis) {
    const double from = std::max(std::floor(low[axis]), static_cast<double>(voxels.min()[axis]));
    const double to = std::min(std::ceil(high[axis]), static_cast<double>(voxels.max()[axis]));
    if (!(from <= to)) return;
    first[axis] = floorDiv8(static_cast<int>(from));
    last[axis] = floorDiv8(static_cast<int>(to));
  }
  if (first == last) {
    visit(first);
    return;
  }
  // The bounds, and the caps that the band sets on the distance to the plane or line, in voxels.
  constexpr std::size_t max_limits = MeshFeature::max_bounds + 4;
  std::array<LinearForm, max_limits> limits;
  std::size_t count = 0;
  const auto add = [&](const LinearForm& form) {
    limits[count++] = {form.gradient * pitch_mm, form.constant};
  };
  for (int f = feature.rank; f < feature.rank + feature.bounds; ++f)
    add(feature.forms[static_cast<std::size_t>(f)]);
  for (int f = 0; f < feature.rank && feature.rank < 3; ++f) {
    const LinearForm& form = feature.forms[static_cast<std::size_t>(f)];
    add({form.gradient, form.constant + band_mm});
    add({-form.gradient, -form.constant + band_mm});
  }
  const auto best = [](double slope, int leaf) {
    return std::max(slope * (leaf * edge), slope * (leaf * edge + edge - 1));
  };
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      double x_low = first.x();
      double x_high = last.x();
      for (std::size_t l = 0; l < count; ++l) {
        const Vec3d& g = limits[l].gradient;
        const double rest = limits[l].constant + best(g.y(), y) + best(g.z(), z);
        if (g.x() > 0) {
          x_low = std::max(x_low, (-rest / g.x() - (edge - 1)) / edge);
        } else if (g.x() < 0) {
          x_high = std::min(x_high, -rest / g.x() / edge);
        } else if (rest < 0) {
          x_high = x_low - 1;
        }
      }
      if (!(x_low <= x_high)) continue;
      for (int x = static_cast<int>(std::ceil(x_low)); x <= static_cast<int>(std::floor(x_high));
           ++x)
        visit(Coord(x, y, z));
    }
  }
}

}  // namespace

/// A few rows of leaves: binned, swept and handed over.
class MeshDistance::Chunk {
 public:
  /// `voxels`: the voxels that exist.
  Chunk(const MeshDistance& field, const CoordBBox& voxels);

  void appendTo(DistanceGrids& grids);

 private:
  struct Leaf {
    std::unique_ptr<openvdb::FloatTree::LeafNodeType> surface;
    std::unique_ptr<openvdb::Vec3STree::LeafNodeType> normals;
    std::unique_ptr<openvdb::Int32Tree::LeafNodeType> closest;
  };
  struct Row {
    std::vector<Leaf> leaves;
    std::vector<Coord> interior;  ///< origins of the leaves that are wholly inside
  };

  [[nodiscard]] std::uint32_t indexOf(const Coord& leaf) const {
    const Coord at = leaf - leaves_.min();
    return static_cast<std::uint32_t>((at.z() * leaves_.dim().y() + at.y()) * leaves_.dim().x() +
                                      at.x());
  }
  [[nodiscard]] LeafBits existing(const Coord& origin) const;
  void enter();
  void sweepRow(int y, int z, Row& row) const;
  void makeLeaf(const Coord& origin, std::span<const std::uint32_t> features,
                const LeafBits& inside, Row& row) const;
  void nearest(const Coord& origin, std::span<const std::uint32_t> features,
               LeafDistances& distances) const;
  void extras(Leaf& leaf, std::span<const std::uint32_t> features,
              const LeafDistances& distances) const;

  const MeshDistance& field_;
  CoordBBox voxels_;
  CoordBBox leaves_;
  std::vector<Row> rows_;
  LeafBins features_{0, {}};
  LeafBins crossings_{0, {}};
};

MeshDistance::Chunk::Chunk(const MeshDistance& field, const CoordBBox& voxels)
    : field_(field), voxels_(voxels), leaves_(voxels.min() >> 3, voxels.max() >> 3) {
  enter();
  const int height = leaves_.dim().y();
  rows_.resize(static_cast<std::size_t>(height) * static_cast<std::size_t>(leaves_.dim().z()));
  tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
    sweepRow(leaves_.min().y() + static_cast<int>(row) % height,
             leaves_.min().z() + static_cast<int>(row) / height, rows_[row]);
  });
}

void MeshDistance::Chunk::enter() {
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  std::vector<std::uint32_t> found;
  field_.features_.collect(voxels_.min().z() * pitch_mm.z() - field_.band_.mm,
                           voxels_.max().z() * pitch_mm.z() + field_.band_.mm, found);
  const std::size_t tasks = (found.size() + features_per_task - 1) / features_per_task;
  std::vector<std::vector<LeafBins::Entry>> features(tasks);
  std::vector<std::vector<LeafBins::Entry>> crossings(tasks);
  tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
    const std::size_t end = std::min((task + 1) * features_per_task, found.size());
    for (std::size_t i = task * features_per_task; i < end; ++i) {
      const MeshFeatures::Id id = field_.features_.id(found[i]);
      const MeshFeature feature = field_.features_.describe(id);
      if (feature.rank > 0) {
        visitLeaves(feature, field_.band_.mm, pitch_mm, voxels_, [&](const Coord& leaf) {
          features[task].push_back({indexOf(leaf), found[i]});
        });
      }
      if (id.kind() == MeshFeatures::Kind::face) {
        visitRowCrossings(
            {field_.features_.corner(id.index(), 0), field_.features_.corner(id.index(), 1),
             field_.features_.corner(id.index(), 2)},
            pitch_mm, voxels_, [&](const Coord& ijk, int delta) {
              crossings[task].push_back({indexOf(ijk >> 3), RowWinding::pack(ijk, delta)});
            });
      }
    }
  });
  const auto leaves = static_cast<std::size_t>(leaves_.volume());
  features_ = LeafBins(leaves, features);
  crossings_ = LeafBins(leaves, crossings);
}

LeafBits MeshDistance::Chunk::existing(const Coord& origin) const {
  std::uint64_t plane = 0;
  for (int j = 0; j < edge; ++j)
    for (int k = 0; k < edge; ++k)
      if (voxels_.isInside(Coord(voxels_.min().x(), origin.y() + j, origin.z() + k)))
        plane |= 1ULL << (edge * j + k);
  LeafBits bits;
  for (int i = 0; i < edge; ++i) {
    const int x = origin.x() + i;
    bits[static_cast<std::size_t>(i)] =
        x >= voxels_.min().x() && x <= voxels_.max().x() ? plane : 0;
  }
  return bits;
}

void MeshDistance::Chunk::sweepRow(int y, int z, Row& row) const {
  const std::uint64_t all = ~0ULL;
  RowWinding winding;
  for (int x = leaves_.min().x(); x <= leaves_.max().x(); ++x) {
    const Coord leaf(x, y, z);
    const std::uint32_t index = indexOf(leaf);
    const std::span<const std::uint32_t> features = features_.of(index);
    LeafBits inside = winding.advance(crossings_.of(index));
    const auto is = [&](std::uint64_t plane) {
      return std::all_of(inside.begin(), inside.end(),
                         [plane](std::uint64_t bits) { return bits == plane; });
    };
    if (features.empty() && is(0)) continue;
    const Coord origin = leaf << 3;
    if (features.empty() && is(all) && voxels_.isInside(origin) &&
        voxels_.isInside(origin.offsetBy(edge - 1))) {
      row.interior.push_back(origin);
      continue;
    }
    makeLeaf(origin, features, inside, row);
  }
}

void MeshDistance::Chunk::nearest(const Coord& origin, std::span<const std::uint32_t> features,
                                  LeafDistances& distances) const {
  const bool track = field_.extras_.normals || field_.extras_.closest;
  static const std::array<FeatureSweep, 2> sweeps{featureSweep(false), featureSweep(true)};
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  const Vec3d corner = origin.asVec3d() * pitch_mm;
  std::fill_n(distances.squared, LeafDistances::voxels, field_.band_.mm * field_.band_.mm);
  for (const std::uint32_t position : features) {
    const MeshFeature feature = field_.features_.describe(field_.features_.id(position));
    LeafFeature local;
    local.rank = feature.rank;
    local.forms = feature.rank + feature.bounds;
    for (int f = 0; f < local.forms; ++f) {
      const LinearForm& form = feature.forms[static_cast<std::size_t>(f)];
      local.x[f] = form.gradient.x() * pitch_mm.x();
      local.y[f] = form.gradient.y() * pitch_mm.y();
      local.z[f] = form.gradient.z() * pitch_mm.z();
      local.constant[f] = form.at(corner);
    }
    const Vec3d low = (feature.min - feature.below * field_.band_.mm - corner) / pitch_mm;
    const Vec3d high = (feature.max + feature.above * field_.band_.mm - corner) / pitch_mm;
    const auto begin = [](double from) {
      return static_cast<int>(std::clamp(std::floor(from), 0.0, 8.0));
    };
    const auto end = [](double to) {
      return static_cast<int>(std::clamp(std::ceil(to) + 1, 0.0, 8.0));
    };
    local.i_begin = begin(low.x());
    local.i_end = end(high.x());
    local.j_begin = begin(low.y());
    local.j_end = end(high.y());
    sweeps[track](local, position, distances);
  }
}

void MeshDistance::Chunk::makeLeaf(const Coord& origin, std::span<const std::uint32_t> features,
                                   const LeafBits& inside, Row& row) const {
  const double limit = field_.band_.mm * field_.band_.mm;
  const auto background = static_cast<float>(field_.band_.mm);
  alignas(64) LeafDistances distances;
  nearest(origin, features, distances);

  const LeafBits exists = existing(origin);
  Leaf leaf;
  leaf.surface.reset(newLeaf<openvdb::FloatTree>(origin, background));
  float* values = leaf.surface->buffer().data();
  bool any_active = false;
  bool any_inside = false;
  bool any_outside = false;
  for (std::size_t plane = 0; plane < edge; ++plane) {
    const std::uint64_t within = inside[plane] & exists[plane];
    std::uint64_t active = 0;
    for (std::size_t v = 0; v < 64; ++v) {
      const double squared = distances.squared[64 * plane + v];
      const auto distance = static_cast<float>(std::sqrt(squared));
      const bool is_active = squared < limit && (exists[plane] >> v & 1);
      const float magnitude = is_active ? distance : background;
      values[64 * plane + v] = (within >> v & 1) ? 0 - magnitude : magnitude;
      active |= static_cast<std::uint64_t>(is_active) << v;
    }
    leaf.surface->getValueMask().getWord<std::uint64_t>(static_cast<openvdb::Index>(plane)) =
        active;
    any_active |= active != 0;
    any_inside |= within != 0;
    any_outside |= within != ~0ULL;
  }
  if (!any_active && !any_inside) return;
  if (!any_active && !any_outside) {
    row.interior.push_back(origin);
    return;
  }
  if (any_active && (field_.extras_.normals || field_.extras_.closest))
    extras(leaf, features, distances);
  row.leaves.push_back(std::move(leaf));
}

void MeshDistance::Chunk::extras(Leaf& leaf, std::span<const std::uint32_t> features,
                                 const LeafDistances& distances) const {
  const MeshFeatures& all = field_.features_;
  std::vector<MeshFeature> described;
  for (const std::uint32_t position : features) described.push_back(all.describe(all.id(position)));
  const Coord origin = leaf.surface->origin();
  if (field_.extras_.normals)
    leaf.normals.reset(newLeaf<openvdb::Vec3STree>(origin, openvdb::Vec3s(0, 0, 0)));
  if (field_.extras_.closest) leaf.closest.reset(newLeaf<openvdb::Int32Tree>(origin, -1));
  if (leaf.normals) {
    std::fill_n(leaf.normals->buffer().data(), LeafDistances::voxels, openvdb::Vec3s(0, 0, 0));
    leaf.normals->getValueMask() = leaf.surface->getValueMask();
  }
  if (leaf.closest) {
    std::fill_n(leaf.closest->buffer().data(), LeafDistances::voxels, -1);
    leaf.closest->getValueMask() = leaf.surface->getValueMask();
  }
  for (auto it = leaf.surface->cbeginValueOn(); it; ++it) {
    const openvdb::Index v = it.pos();
    const auto position = static_cast<std::uint32_t>(distances.nearest[v]);
    const MeshFeatures::Id id = all.id(position);
    if (leaf.closest)
      leaf.closest->buffer().data()[v] = static_cast<std::int32_t>(all.triangleOf(id));
    if (!leaf.normals) continue;
    const auto found =
        std::lower_bound(features.begin(), features.end(), position) - features.begin();
    const MeshFeature& feature = described[static_cast<std::size_t>(found)];
    const Vec3d centre = it.getCoord().asVec3d() * field_.lattice_.pitch_mm;
    Vec3d normal(0, 0, 0);
    for (int f = 0; f < feature.rank; ++f) {
      const LinearForm& form = feature.forms[static_cast<std::size_t>(f)];
      normal += form.gradient * form.at(centre);
    }
    const double distance = normal.length();
    if (distance < on_surface_mm) {
      normal = all.normal(all.triangleOf(id));
    } else {
      normal /= *it < 0 ? -distance : distance;
    }
    leaf.normals->buffer().data()[v] = openvdb::Vec3s(normal);
  }
}

void MeshDistance::Chunk::appendTo(DistanceGrids& grids) {
  TileWriter tiles(grids.surface->tree());
  openvdb::FloatGrid::Accessor surface = grids.surface->getAccessor();
  for (Row& row : rows_) {
    for (Leaf& leaf : row.leaves) {
      if (leaf.normals) grids.normals->tree().addLeaf(leaf.normals.release());
      if (leaf.closest) grids.closest->tree().addLeaf(leaf.closest.release());
      surface.addLeaf(leaf.surface.release());
    }
    for (const Coord& origin : row.interior) tiles.set(origin, -grids.surface->background());
  }
}

MeshDistance::MeshDistance(std::shared_ptr<const Mesh> mesh, const Lattice& lattice, Band band,
                           DistanceExtras extras)
    : mesh_(std::move(mesh)),
      lattice_(lattice),
      band_(band),
      extras_(extras),
      features_(*mesh_, lattice.origin_mm, lattice.pitch_mm.z() * leaf_layers) {}

double MeshDistance::memoryBytes() const {
  return static_cast<double>(mesh_->vertices.size() * sizeof(Vec3d) +
                             mesh_->triangles.size() * sizeof(Mesh::Triangle)) +
         features_.memoryBytes();
}

DistanceGrids MeshDistance::run(ZRange core) const {
  DistanceGrids grids;
  const auto dress = [&](auto grid, const char* name, openvdb::GridClass grid_class) {
    grid->setName(name);
    grid->setGridClass(grid_class);
    grid->setTransform(transformOf(lattice_));
    return grid;
  };
  grids.surface = dress(openvdb::FloatGrid::create(static_cast<float>(band_.mm)), "surface",
                        openvdb::GRID_LEVEL_SET);
  if (extras_.normals) {
    grids.normals =
        dress(openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0)), "N", openvdb::GRID_UNKNOWN);
    grids.normals->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  }
  if (extras_.closest)
    grids.closest = dress(openvdb::Int32Grid::create(-1), "closest", openvdb::GRID_UNKNOWN);

  if (lattice_.box.empty()) return grids;
  const ZRange layers = intersection(core, lattice_.layers());
  for (int begin = layers.begin; begin < layers.end;) {
    const int end = std::min(layers.end, (begin & ~(chunk_layers - 1)) + chunk_layers);
    CoordBBox voxels = lattice_.box;
    voxels.min().z() = begin;
    voxels.max().z() = end - 1;
    Chunk(*this, voxels).appendTo(grids);
    begin = end;
  }
  openvdb::tools::prune(grids.surface->tree());
  return grids;
}

}  // namespace vdbdither
