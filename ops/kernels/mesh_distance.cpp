// The field is made leaf by leaf: every feature of the mesh is entered into the leaves that its
// region touches, then each leaf takes the minimum over its features in a buffer that stays in the
// cache. The sign comes from a sweep along x, which needs nothing but the triangles that cross the
// layers at hand.

#include "ops/kernels/mesh_distance.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/leaf_distances.h"
#include "ops/kernels/row_crossings.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

constexpr int edge = leaf_layers;
constexpr std::size_t features_per_task = 512;

/// A chunk with more features than this is split along y, which bounds what it holds of them.
constexpr std::size_t features_per_chunk = 1 << 17;

/// Closer than this the direction to the nearest point says nothing about the normal.
constexpr double on_surface_mm = 1e-6;

/// The items of every leaf of a chunk, in the order in which they were entered.
class LeafBins {
 public:
  struct Entry {
    std::uint32_t leaf, item;
  };

  template <class Task>
  LeafBins(std::size_t leaves, const std::vector<Task>& tasks, std::vector<Entry> Task::*entries)
      : first_(leaves + 1, 0) {
    for (const Task& task : tasks)
      for (const Entry& entry : task.*entries) ++first_[entry.leaf + 1];
    for (std::size_t leaf = 0; leaf < leaves; ++leaf) first_[leaf + 1] += first_[leaf];
    items_.resize(first_.back());
    for (const Task& task : tasks)
      for (const Entry& entry : task.*entries) items_[first_[entry.leaf]++] = entry.item;
    std::copy_backward(first_.begin(), first_.end() - 1, first_.end());
    first_[0] = 0;
  }
  LeafBins() = default;

  /// How many items the leaves [begin, end) hold.
  [[nodiscard]] std::size_t count(std::size_t begin, std::size_t end) const {
    return first_[end] - first_[begin];
  }

  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t leaf) const {
    return {items_.data() + first_[leaf], first_[leaf + 1] - first_[leaf]};
  }

 private:
  std::vector<std::uint32_t> first_;
  std::vector<std::uint32_t> items_;
};

/// The winding numbers of the 64 rows of a row of leaves, swept along x.
class RowWinding {
 public:
  static std::uint32_t pack(const Coord& ijk, int delta) {
    return static_cast<std::uint32_t>(
        ((ijk.x() & 7) << 6 | (ijk.y() & 7) << 3 | (ijk.z() & 7)) << 1 | (delta > 0 ? 1 : 0));
  }

  /// The inside of the last plane.
  [[nodiscard]] std::uint64_t bits() const { return bits_; }

  /// The inside of the next leaf, whose crossings were packed.
  LeafBits advance(std::span<const std::uint32_t> crossings) {
    LeafBits inside;
    inside.fill(bits_);
    if (crossings.empty()) return inside;
    // Rows of a plane that enter and leave; the few that do so more than once wait in `again`.
    std::array<LeafBits, 2> once{};
    std::vector<std::uint32_t> again;
    for (const std::uint32_t crossing : crossings) {
      const std::uint32_t plane = crossing >> 7;
      const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
      if (once[~crossing & 1][plane] & row) {
        once[~crossing & 1][plane] ^= row;
      } else if (once[crossing & 1][plane] & row) {
        again.push_back(crossing);
      } else {
        once[crossing & 1][plane] |= row;
      }
    }
    for (std::size_t plane = 0; plane < edge; ++plane) {
      lower(once[0][plane]);
      raise(once[1][plane]);
      for (const std::uint32_t crossing : again) {
        if (crossing >> 7 != plane) continue;
        const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
        (crossing & 1) ? raise(row) : lower(row);
      }
      bits_ = 0;
      for (const std::uint64_t digit : digits_) bits_ |= digit;
      inside[plane] = bits_;
    }
    return inside;
  }

 private:
  void raise(std::uint64_t rows) {
    for (std::uint64_t& digit : digits_) {
      if (rows == 0) break;
      digit ^= rows;
      rows &= ~digit;
    }
  }
  void lower(std::uint64_t rows) {
    for (std::uint64_t& digit : digits_) {
      if (rows == 0) break;
      digit ^= rows;
      rows &= digit;
    }
  }

  std::array<std::uint64_t, 16> digits_{};  ///< of the 64 numbers, in two's complement
  std::uint64_t bits_ = 0;                  ///< those that are not zero
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

/// The bounds of a feature, and two caps for each distance form.
constexpr std::size_t most_limits = MeshFeature::max_bounds + 6;

/// Calls visit(leaf) with the leaf coordinates of those leaves that overlap `reach` and meet every
/// one of the half-spaces `limits` (functions of voxel indices) on their own; that is nearly those
/// that meet all at once.
template <class Visit>
void visitLeaves(std::span<const LinearForm> limits, const CoordBBox& reach, const Visit& visit) {
  const Coord first = reach.min() >> 3;
  const Coord last = reach.max() >> 3;
  const auto best = [](double slope, int leaf) {
    return std::max(slope * (leaf * edge), slope * (leaf * edge + edge - 1));
  };
  std::array<double, most_limits> leaves_per_unit;
  for (std::size_t l = 0; l < limits.size(); ++l)
    leaves_per_unit[l] = -1 / (limits[l].gradient.x() * edge);
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      double x_low = first.x();
      double x_high = last.x();
      for (std::size_t l = 0; l < limits.size(); ++l) {
        const Vec3d& g = limits[l].gradient;
        const double rest = limits[l].constant + best(g.y(), y) + best(g.z(), z);
        if (g.x() > 0) {
          x_low = std::max(x_low, rest * leaves_per_unit[l] - (edge - 1.0) / edge);
        } else if (g.x() < 0) {
          x_high = std::min(x_high, rest * leaves_per_unit[l]);
        } else if (rest < 0) {
          x_high = -std::numeric_limits<double>::infinity();
        }
      }
      if (!(x_low <= x_high)) continue;
      const int end = static_cast<int>(std::floor(x_high));
      for (int x = static_cast<int>(std::ceil(x_low)); x <= end; ++x) visit(Coord(x, y, z));
    }
  }
}

}  // namespace

/// A few rows of leaves: binned, swept and handed over.
class MeshDistance::Chunk {
 public:
  /// `voxels`: those that exist. `features`: positions of those that may reach them, in rising
  /// order.
  Chunk(const MeshDistance& field, const CoordBBox& voxels,
        std::span<const std::uint32_t> features);

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
  /// What a task of `features_per_task` features leaves behind.
  struct Task {
    std::vector<LatticeFeature> features;  ///< their forms are offsets until all are in place
    std::vector<LinearForm> forms;
    std::vector<LeafBins::Entry> entries;
    std::vector<LeafBins::Entry> crossings;
  };

  [[nodiscard]] std::uint32_t indexOf(const Coord& leaf) const {
    const Coord at = leaf - leaves_.min();
    return static_cast<std::uint32_t>((at.z() * leaves_.dim().y() + at.y()) * leaves_.dim().x() +
                                      at.x());
  }
  [[nodiscard]] LeafBits existing(const Coord& origin) const;
  [[nodiscard]] CoordBBox reachOf(const MeshFeature& feature, double band_mm) const;
  void describe(Task& task, std::size_t begin, std::size_t end);
  void markBand(std::uint32_t triangle);
  void enter(Task& task, std::size_t begin) const;
  void sweepRow(int y, int z, Row& row) const;
  void makeLeaf(const Coord& leaf_index, std::span<const std::uint32_t> features,
                const LeafBits& inside, Row& row) const;
  void addExtras(Leaf& leaf, const LeafDistances& distances) const;

  const MeshDistance& field_;
  CoordBBox voxels_;
  CoordBBox leaves_;
  std::span<const std::uint32_t> positions_;
  double greatest_mm_;
  std::vector<Task> tasks_;
  std::vector<std::atomic<float>> bands_mm_;  ///< of every leaf; empty where it is the same for all
  LeafBins features_;
  LeafBins crossings_;
  std::vector<Row> rows_;
};

MeshDistance::Chunk::Chunk(const MeshDistance& field, const CoordBBox& voxels,
                           std::span<const std::uint32_t> features)
    : field_(field),
      voxels_(voxels),
      leaves_(voxels.min() >> 3, voxels.max() >> 3),
      positions_(features),
      greatest_mm_(field.backgroundMm()),
      tasks_((features.size() + features_per_task - 1) / features_per_task) {
  const auto leaf_count = static_cast<std::size_t>(leaves_.volume());
  if (!(field_.band_.mm > 0)) bands_mm_ = std::vector<std::atomic<float>>(leaf_count);

  const auto forEachTask = [&](const auto& work) {
    tbb::parallel_for(std::size_t{0}, tasks_.size(), [&](std::size_t i) {
      const std::size_t begin = i * features_per_task;
      work(tasks_[i], begin, std::min(begin + features_per_task, positions_.size()));
    });
  };
  forEachTask([&](Task& task, std::size_t begin, std::size_t end) { describe(task, begin, end); });
  forEachTask([&](Task& task, std::size_t begin, std::size_t) { enter(task, begin); });
  features_ = LeafBins(leaf_count, tasks_, &Task::entries);
  crossings_ = LeafBins(leaf_count, tasks_, &Task::crossings);

  const int height = leaves_.dim().y();
  rows_.resize(static_cast<std::size_t>(height) * static_cast<std::size_t>(leaves_.dim().z()));
  tbb::parallel_for(std::size_t{0}, rows_.size(), [&](std::size_t row) {
    sweepRow(leaves_.min().y() + static_cast<int>(row) % height,
             leaves_.min().z() + static_cast<int>(row) / height, rows_[row]);
  });
}

/// The voxels within the bounding box of the feature's region; empty where there are none.
CoordBBox MeshDistance::Chunk::reachOf(const MeshFeature& feature, double band_mm) const {
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  const Vec3d low = (feature.min - feature.below * band_mm) / pitch_mm;
  const Vec3d high = (feature.max + feature.above * band_mm) / pitch_mm;
  CoordBBox reach;
  for (int axis = 0; axis < 3; ++axis) {
    const double from = std::max(std::floor(low[axis]), static_cast<double>(voxels_.min()[axis]));
    const double to = std::min(std::ceil(high[axis]), static_cast<double>(voxels_.max()[axis]));
    if (!(from <= to)) return {};
    reach.min()[axis] = static_cast<int>(from);
    reach.max()[axis] = static_cast<int>(to);
  }
  return reach;
}

void MeshDistance::Chunk::describe(Task& task, std::size_t begin, std::size_t end) {
  const MeshFeatures& all = field_.features_;
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  const double low = voxels_.min().z() * pitch_mm.z() - greatest_mm_;
  const double high = voxels_.max().z() * pitch_mm.z() + greatest_mm_;
  constexpr std::size_t usual_forms = 6;
  task.features.reserve(end - begin);
  task.forms.reserve((end - begin) * usual_forms);
  std::vector<std::size_t> first_forms;
  first_forms.reserve(end - begin);
  for (std::size_t i = begin; i < end; ++i) {
    const MeshFeatures::Id id = all.id(positions_[i]);
    const bool face = id.kind() == MeshFeatures::Kind::face;
    first_forms.push_back(task.forms.size());
    if (face && !bands_mm_.empty()) markBand(id.index());
    if (!all.meets(positions_[i], 2, low, high)) {
      task.features.push_back({});
      continue;
    }
    const MeshFeature feature = all.describe(id);
    for (int f = 0; f < feature.rank + feature.bounds; ++f) {
      const LinearForm& form = feature.forms[static_cast<std::size_t>(f)];
      task.forms.push_back({form.gradient * pitch_mm, form.constant});
    }
    task.features.push_back({nullptr, feature.rank, feature.rank + feature.bounds, greatest_mm_,
                             reachOf(feature, greatest_mm_)});
    if (face) {
      visitRowCrossings(
          {all.corner(id.index(), 0), all.corner(id.index(), 1), all.corner(id.index(), 2)},
          pitch_mm, voxels_, [&](const Coord& ijk, int delta) {
            task.crossings.push_back({indexOf(ijk >> 3), RowWinding::pack(ijk, delta)});
          });
    }
  }
  for (std::size_t i = 0; i < task.features.size(); ++i)
    task.features[i].forms = task.forms.data() + first_forms[i];
}

/// A voxel is decided by the normal at its closest surface voxel. That lies at most a band and a
/// voxel diagonal away, and the surface at most another band from there.
void MeshDistance::Chunk::markBand(std::uint32_t triangle) {
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  const MeshFeatures& all = field_.features_;
  const float band_mm = field_.triangle_band_mm_[triangle];
  const double around_mm = 2 * band_mm + pitch_mm.length();
  MeshFeature wide;
  wide.min = openvdb::math::minComponent(
      openvdb::math::minComponent(all.corner(triangle, 0), all.corner(triangle, 1)),
      all.corner(triangle, 2));
  wide.max = openvdb::math::maxComponent(
      openvdb::math::maxComponent(all.corner(triangle, 0), all.corner(triangle, 1)),
      all.corner(triangle, 2));
  wide.below = wide.above = Vec3d(1, 1, 1);
  const CoordBBox reach = reachOf(wide, around_mm);
  if (reach.empty()) return;
  const Vec3d& n = all.normal(triangle);
  const double offset = n.dot(all.corner(triangle, 0));
  const std::array<LinearForm, 2> caps{LinearForm{n * pitch_mm, around_mm - offset},
                                       LinearForm{-n * pitch_mm, around_mm + offset}};
  visitLeaves(caps, reach, [&](const Coord& leaf) {
    std::atomic<float>& band = bands_mm_[indexOf(leaf)];
    float present = band.load(std::memory_order_relaxed);
    while (present < band_mm &&
           !band.compare_exchange_weak(present, band_mm, std::memory_order_relaxed)) {
    }
  });
}

void MeshDistance::Chunk::enter(Task& task, std::size_t begin) const {
  for (std::size_t i = 0; i < task.features.size(); ++i) {
    const LatticeFeature& feature = task.features[i];
    if (feature.rank == 0 || feature.reach.empty()) continue;
    const std::span forms(feature.forms, static_cast<std::size_t>(feature.count));
    const auto rank = static_cast<std::size_t>(feature.rank);
    std::array<LinearForm, most_limits> limits;
    auto end = std::copy(forms.begin() + feature.rank, forms.end(), limits.begin());
    for (const LinearForm& form : forms.first(rank)) {
      *end++ = {form.gradient, form.constant + greatest_mm_};
      *end++ = {-form.gradient, greatest_mm_ - form.constant};
    }
    const auto reaches = [&](const Coord& leaf, double band_mm) {
      const Vec3d centre = (leaf << 3).asVec3d() + Vec3d(0.5 * (edge - 1));
      return std::all_of(forms.begin(), forms.begin() + feature.rank, [&](const LinearForm& form) {
        const Vec3d& g = form.gradient;
        const double half =
            (std::abs(g.x()) + std::abs(g.y()) + std::abs(g.z())) * 0.5 * (edge - 1);
        return std::abs(form.at(centre)) <= band_mm + half;
      });
    };
    visitLeaves(std::span(limits.begin(), end), feature.reach, [&](const Coord& leaf) {
      const std::uint32_t index = indexOf(leaf);
      if (bands_mm_.empty() || reaches(leaf, bands_mm_[index]))
        task.entries.push_back({index, static_cast<std::uint32_t>(begin + i)});
    });
  }
}

LeafBits MeshDistance::Chunk::existing(const Coord& origin) const {
  LeafBits bits;
  bits.fill(~0ULL);
  if (voxels_.isInside(CoordBBox::createCube(origin, edge))) return bits;
  bits.fill(0);
  for (const Coord& ijk : CoordBBox::createCube(origin, edge)) {
    const Coord at = ijk - origin;
    if (voxels_.isInside(ijk))
      bits[static_cast<std::size_t>(at.x())] |= 1ULL << (edge * at.y() + at.z());
  }
  return bits;
}

void MeshDistance::Chunk::sweepRow(int y, int z, Row& row) const {
  const std::uint32_t begin = indexOf({leaves_.min().x(), y, z});
  const std::uint32_t end = begin + static_cast<std::uint32_t>(leaves_.dim().x());
  if (features_.count(begin, end) + crossings_.count(begin, end) == 0) return;
  RowWinding winding;
  for (std::uint32_t index = begin; index < end; ++index) {
    const std::span<const std::uint32_t> features = features_.of(index);
    const std::span<const std::uint32_t> crossings = crossings_.of(index);
    const bool crossed = !features.empty() || !crossings.empty();
    if (!crossed && winding.bits() == 0) continue;
    const Coord leaf(leaves_.min().x() + static_cast<int>(index - begin), y, z);
    const CoordBBox box = CoordBBox::createCube(leaf << 3, edge);
    if (!crossed && winding.bits() == ~0ULL && voxels_.isInside(box)) {
      row.interior.push_back(box.min());
    } else {
      makeLeaf(leaf, features, winding.advance(crossings), row);
    }
  }
}

void MeshDistance::Chunk::makeLeaf(const Coord& leaf_index, std::span<const std::uint32_t> features,
                                   const LeafBits& inside, Row& row) const {
  const Coord origin = leaf_index << 3;
  const bool track = field_.extras_.normals || field_.extras_.closest;
  const double band_mm = bands_mm_.empty() ? greatest_mm_ : double{bands_mm_[indexOf(leaf_index)]};
  const LeafKernels& kernels = leafKernels();

  LeafDistances distances;
  std::fill_n(distances.squared, LeafDistances::voxels, std::numeric_limits<double>::infinity());
  for (const std::uint32_t i : features) {
    LatticeFeature feature = tasks_[i / features_per_task].features[i % features_per_task];
    feature.band_mm = band_mm;
    kernels.lower(feature, origin, i, track, distances);
  }

  const LeafBits exists = existing(origin);
  LeafBits within;
  bool any_inside = false;
  bool any_outside = false;
  for (std::size_t plane = 0; plane < edge; ++plane) {
    within[plane] = inside[plane] & exists[plane];
    any_inside |= within[plane] != 0;
    any_outside |= within[plane] != ~0ULL;
  }
  Leaf leaf;
  leaf.surface.reset(newLeaf<openvdb::FloatTree>(origin, 0));
  const LeafBits active =
      kernels.finish(distances, within, exists, band_mm, static_cast<float>(greatest_mm_),
                     leaf.surface->buffer().data());
  const bool any_active =
      std::any_of(active.begin(), active.end(), [](std::uint64_t bits) { return bits != 0; });
  if (!any_active && !any_inside) return;
  if (!any_active && !any_outside) {
    row.interior.push_back(origin);
    return;
  }
  for (std::size_t plane = 0; plane < edge; ++plane)
    leaf.surface->getValueMask().getWord<std::uint64_t>(static_cast<openvdb::Index>(plane)) =
        active[plane];
  if (any_active && track) addExtras(leaf, distances);
  row.leaves.push_back(std::move(leaf));
}

void MeshDistance::Chunk::addExtras(Leaf& leaf, const LeafDistances& distances) const {
  const MeshFeatures& all = field_.features_;
  const Vec3d& pitch_mm = field_.lattice_.pitch_mm;
  const auto give = [&](auto& extra, auto* made, const auto& background) {
    extra.reset(made);
    std::fill_n(made->buffer().data(), LeafDistances::voxels, background);
    made->getValueMask() = leaf.surface->getValueMask();
  };
  const Coord origin = leaf.surface->origin();
  const openvdb::Vec3s no_normal(0, 0, 0);
  if (field_.extras_.normals)
    give(leaf.normals, newLeaf<openvdb::Vec3STree>(origin, no_normal), no_normal);
  if (field_.extras_.closest) give(leaf.closest, newLeaf<openvdb::Int32Tree>(origin, -1), -1);

  for (auto it = leaf.surface->cbeginValueOn(); it; ++it) {
    const openvdb::Index v = it.pos();
    const auto i = static_cast<std::size_t>(distances.nearest[v]);
    const std::uint32_t triangle = all.triangleOf(all.id(positions_[i]));
    if (leaf.closest) leaf.closest->buffer().data()[v] = static_cast<std::int32_t>(triangle);
    if (!leaf.normals) continue;
    const LatticeFeature& feature = tasks_[i / features_per_task].features[i % features_per_task];
    const Vec3d centre = it.getCoord().asVec3d();
    Vec3d away(0, 0, 0);  // from the nearest point to the centre
    for (int f = 0; f < feature.rank; ++f)
      away += feature.forms[f].gradient / pitch_mm * feature.forms[f].at(centre);
    const double distance = away.length();
    const Vec3d normal =
        distance < on_surface_mm ? all.normal(triangle) : away / (*it < 0 ? -distance : distance);
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

namespace {

/// The greatest band, in diameters, of the normals whose components are at least `least`.
double bandAcross(const Vec3d& least, const Vec3d& pitch_mm) {
  double inverse_diameter = 1 / pitch_mm.length();
  double step_mm = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double u = least[(axis + 1) % 3];
    const double v = least[(axis + 2) % 3];
    inverse_diameter = std::max(inverse_diameter, least[axis] / pitch_mm[axis]);
    step_mm = std::max(step_mm, pitch_mm[axis] * std::sqrt(std::max(0.0, 1 - u * u - v * v)));
  }
  return std::max(1 / inverse_diameter, step_mm);
}

}  // namespace

MeshDistance::MeshDistance(std::shared_ptr<const Mesh> mesh, const Lattice& lattice, Band band,
                           DistanceExtras extras)
    : mesh_(std::move(mesh)),
      lattice_(lattice),
      band_(band),
      extras_(extras),
      features_(*mesh_, lattice.origin_mm, lattice.pitch_mm.z() * leaf_layers) {
  if (band_.mm > 0) return;
  for (const Vec3d& least : features_.leastNormals())
    triangle_band_mm_.push_back(
        static_cast<float>(bandAcross(least, lattice_.pitch_mm) * band_.diameters));
}

double MeshDistance::memoryBytes() const {
  return static_cast<double>(mesh_->vertices.size() * sizeof(Vec3d) +
                             mesh_->triangles.size() * sizeof(Mesh::Triangle)) +
         static_cast<double>(triangle_band_mm_.capacity() * sizeof(float)) +
         features_.memoryBytes();
}

/// How far a feature can matter to a voxel: for the band's sake twice the band and a voxel
/// diagonal, and up to another voxel because boxes are rounded outwards.
double MeshDistance::reachMm() const {
  return band_.mm > 0 ? band_.mm : 2 * (backgroundMm() + lattice_.diagonalMm());
}

void MeshDistance::append(const CoordBBox& voxels, std::vector<std::uint32_t> features,
                          DistanceGrids& grids) const {
  const int middle = ((voxels.min().y() + voxels.max().y()) / 2 & ~(edge - 1)) - 1;
  if (features.size() <= features_per_chunk || middle < voxels.min().y()) {
    Chunk(*this, voxels, features).appendTo(grids);
    return;
  }
  for (const bool upper : {false, true}) {
    CoordBBox half = voxels;
    (upper ? half.min().y() : half.max().y()) = middle + (upper ? 1 : 0);
    std::vector<std::uint32_t> reaching;
    std::copy_if(features.begin(), features.end(), std::back_inserter(reaching),
                 [&](std::uint32_t position) {
                   return features_.meets(position, 1,
                                          half.min().y() * lattice_.pitch_mm.y() - reachMm(),
                                          half.max().y() * lattice_.pitch_mm.y() + reachMm());
                 });
    append(half, std::move(reaching), grids);
  }
}

DistanceGrids MeshDistance::run(ZRange core) const {
  DistanceGrids grids;
  const auto dress = [&](auto grid, const char* name, openvdb::GridClass grid_class) {
    grid->setName(name);
    grid->setGridClass(grid_class);
    grid->setTransform(transformOf(lattice_));
    return grid;
  };
  grids.surface = dress(openvdb::FloatGrid::create(static_cast<float>(backgroundMm())), "surface",
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
    append(voxels,
           features_.collect(begin * lattice_.pitch_mm.z() - reachMm(),
                             (end - 1) * lattice_.pitch_mm.z() + reachMm()),
           grids);
    begin = end;
  }
  openvdb::tools::prune(grids.surface->tree());
  return grids;
}

}  // namespace vdbdither
