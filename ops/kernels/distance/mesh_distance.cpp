// The layers are made in blocks of a few rows of leaves. Every feature of the mesh lowers the
// distances of a block's voxels where its region holds them; the sign comes from a sweep along x,
// which needs nothing but the triangles that cross the layers at hand.

#include "ops/kernels/distance/mesh_distance.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/tools/Prune.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/distance/leaf_distances.h"
#include "ops/kernels/distance/row_crossings.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

constexpr int edge = leaf_layers;
/// Rows of leaves of a block: so many that few triangles meet two blocks and that the leaves which
/// a part's surface takes stay in the cache.
constexpr int block_rows = LeafDistances::max_rows;

/// Closer than this the direction to the nearest point says nothing about the normal.
constexpr double on_surface_mm = 1e-6;

/// The items of every bin, in the order in which they were entered.
class Bins {
 public:
  struct Entry {
    std::uint32_t bin, item;
  };

  Bins() = default;
  Bins(std::size_t bins, std::span<const Entry> entries) : first_(bins + 1, 0) {
    for (const Entry& entry : entries) ++first_[entry.bin + 1];
    for (std::size_t bin = 0; bin < bins; ++bin) first_[bin + 1] += first_[bin];
    items_.resize(entries.size());
    for (const Entry& entry : entries) items_[first_[entry.bin]++] = entry.item;
    std::copy_backward(first_.begin(), first_.end() - 1, first_.end());
    first_[0] = 0;
  }

  [[nodiscard]] std::span<const std::uint32_t> of(std::size_t bin) const {
    return {items_.data() + first_[bin], first_[bin + 1] - first_[bin]};
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

  /// The inside of the next leaf, at `slot`, where crossings were noted.
  LeafBits advance(const LeafDistances& noted, std::size_t slot) {
    LeafBits inside;
    inside.fill(bits_);
    if (!noted.noted(slot)) return inside;
    // Rows of a plane that enter and leave; the few that do so more than once wait in `again`.
    std::array<LeafBits, 2> once{};
    std::vector<std::uint32_t> again;
    noted.visitNotes(slot, [&](std::uint32_t crossing) {
      const std::uint32_t plane = crossing >> 7;
      const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
      if (once[~crossing & 1][plane] & row) {
        once[~crossing & 1][plane] ^= row;
      } else if (once[crossing & 1][plane] & row) {
        again.push_back(crossing);
      } else {
        once[crossing & 1][plane] |= row;
      }
    });
    for (std::size_t plane = 0; plane < edge; ++plane) {
      if ((once[0][plane] | once[1][plane]) != 0 || !again.empty()) {
        lower(once[0][plane]);
        raise(once[1][plane]);
        for (const std::uint32_t crossing : again) {
          if (crossing >> 7 != plane) continue;
          const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
          (crossing & 1) ? raise(row) : lower(row);
        }
        bits_ = 0;
        for (const std::uint64_t digit : digits_) bits_ |= digit;
      }
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

template <class Tree>
typename Tree::LeafNodeType* newLeaf(const Coord& origin, const typename Tree::ValueType& value) {
  auto* leaf = new typename Tree::LeafNodeType(openvdb::PartialCreate(), origin, value, false);
  leaf->allocate();
  return leaf;
}

/// Leaves beside each other along x, from the one at `origin` on.
struct Run {
  Coord origin;
  int leaves;
};

/// Hangs leaves and tiles into the nodes above leaves, which must be there. Several threads may do
/// so at once in different nodes.
template <class Tree>
class NodeWriter {
 public:
  using Parent = typename Tree::RootNodeType::ChildNodeType::ChildNodeType;

  static Coord parentOf(const Coord& xyz) { return xyz & ~(static_cast<int>(Parent::DIM) - 1); }

  /// Makes the node above the leaf at `origin`.
  static void makeParent(Tree& tree, const Coord& origin) {
    if (!tree.template probeConstNode<Parent>(origin))
      tree.addTile(1, origin, tree.background(), false);
  }

  explicit NodeWriter(Tree& tree) : tree_(tree) {}

  void set(std::unique_ptr<typename Tree::LeafNodeType> leaf) {
    Parent& parent = parentAt(leaf->origin());
    parent.addLeaf(leaf.release());
  }

  void set(const Run& run, const typename Tree::ValueType& value) {
    for (int leaf = 0; leaf < run.leaves; ++leaf) {
      const Coord origin = run.origin.offsetBy(leaf * edge, 0, 0);
      parentAt(origin).addTile(Parent::coordToOffset(origin), value, false);
    }
  }

 private:
  Parent& parentAt(const Coord& xyz) {
    if (!parent_ || parent_->origin() != parentOf(xyz))
      parent_ = tree_.template probeNode<Parent>(xyz);
    return *parent_;
  }

  Tree& tree_;
  Parent* parent_ = nullptr;
};

Vec3d lowest(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return openvdb::math::minComponent(openvdb::math::minComponent(a, b), c);
}
Vec3d highest(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  return openvdb::math::maxComponent(openvdb::math::maxComponent(a, b), c);
}

Coord roundedDownAll(const Vec3d& p) {
  return {roundedDown(p.x()), roundedDown(p.y()), roundedDown(p.z())};
}

LatticeForm onLattice(const LinearForm& form, const Vec3d& pitch_mm, const Vec3d& base_mm) {
  return {form.gradient.x() * pitch_mm.x(), form.gradient.y() * pitch_mm.y(),
          form.gradient.z() * pitch_mm.z(), form.at(base_mm)};
}

/// band_mm − sign · form, which is below zero beyond the band.
LatticeForm within(const LatticeForm& form, double band_mm, double sign) {
  return {-sign * form.x, -sign * form.y, -sign * form.z, band_mm - sign * form.constant};
}

}  // namespace

/// Rows of leaves that one thread makes.
class MeshDistance::Block {
 public:
  /// What a thread keeps between blocks.
  struct Workspace {
    LeafDistances distances;
    std::vector<float> bands_mm;  ///< of every leaf; empty where it is the same for all
  };
  struct Leaf {
    std::unique_ptr<openvdb::FloatTree::LeafNodeType> surface;
    std::unique_ptr<openvdb::Vec3STree::LeafNodeType> normals;
    std::unique_ptr<openvdb::Int32Tree::LeafNodeType> closest;
  };
  /// What it comes to.
  struct Made {
    std::vector<Leaf> leaves;
    std::vector<Run> interior;   ///< leaves that are wholly inside
    std::vector<Coord> parents;  ///< origins of the few nodes above all of them

    void add(Leaf leaf) {
      noteParent(leaf.surface->origin());
      leaves.push_back(std::move(leaf));
    }
    void add(const Run& run) {
      const int end = run.origin.x() + run.leaves * edge;
      for (Coord at = NodeWriter<openvdb::FloatTree>::parentOf(run.origin); at.x() < end;
           at.x() += static_cast<int>(NodeWriter<openvdb::FloatTree>::Parent::DIM))
        noteParent(at);
      interior.push_back(run);
    }

   private:
    void noteParent(const Coord& xyz) {
      const Coord parent = NodeWriter<openvdb::FloatTree>::parentOf(xyz);
      if (std::find(parents.rbegin(), parents.rend(), parent) == parents.rend())
        parents.push_back(parent);
    }
  };

  /// `voxels`: those that exist. `triangles`: those that may reach them, in the mesh's order.
  Block(const MeshDistance& field, const CoordBBox& voxels, Workspace& workspace)
      : field_(field),
        all_(field.features_),
        pitch_mm_(field.lattice_.pitch_mm),
        per_mm_(1.0 / pitch_mm_.x(), 1.0 / pitch_mm_.y(), 1.0 / pitch_mm_.z()),
        voxels_(voxels),
        leaves_(voxels.min() >> 3, voxels.max() >> 3),
        greatest_mm_(field.backgroundMm()),
        low_mm_(voxels.min().asVec3d() * pitch_mm_ - greatest_mm_),
        high_mm_(voxels.max().asVec3d() * pitch_mm_ + greatest_mm_),
        kernels_(leafKernels()),
        work_(workspace) {}

  Made make(std::span<const std::uint32_t> triangles);

 private:
  [[nodiscard]] LeafBits existing(const Coord& origin) const;
  [[nodiscard]] CoordBBox reachOf(const Vec3d& low_mm, const Vec3d& high_mm) const;
  void markBand(std::uint32_t triangle);
  void enter(std::uint32_t triangle);
  void lower(MeshFeatures::Id id, double band_mm);
  [[nodiscard]] Made sweep() const;
  void makeLeaf(const Coord& leaf_index, const LeafBits& inside, Made& made) const;
  void addExtras(Leaf& leaf, const std::uint32_t* names) const;

  const MeshDistance& field_;
  const MeshFeatures& all_;
  Vec3d pitch_mm_;
  Vec3d per_mm_;  ///< voxels
  CoordBBox voxels_;
  CoordBBox leaves_;
  double greatest_mm_;
  Vec3d low_mm_, high_mm_;  ///< what may matter to the voxels
  const LeafKernels& kernels_;
  Workspace& work_;
};

MeshDistance::Block::Made MeshDistance::Block::make(std::span<const std::uint32_t> triangles) {
  const bool track = field_.extras_.normals || field_.extras_.closest;
  work_.distances.begin(leaves_, track);
  work_.bands_mm.clear();
  if (!(field_.band_.mm > 0)) {
    work_.bands_mm.resize(work_.distances.slots(), 0);
    for (const std::uint32_t triangle : triangles)
      if (all_.hasFeatures(triangle)) markBand(triangle);
  }
  for (const std::uint32_t triangle : triangles) enter(triangle);
  return sweep();
}

/// The voxels within a box; empty where there are none.
CoordBBox MeshDistance::Block::reachOf(const Vec3d& low_mm, const Vec3d& high_mm) const {
  CoordBBox reach;
  for (int axis = 2; axis >= 0; --axis) {
    constexpr double rounding = 1e-6;
    const double from =
        std::max(low_mm[axis] * per_mm_[axis] - rounding, static_cast<double>(voxels_.min()[axis]));
    const double to = std::min(high_mm[axis] * per_mm_[axis] + rounding,
                               static_cast<double>(voxels_.max()[axis]));
    if (!(from <= to)) return {};
    reach.min()[axis] = roundedUp(from);
    reach.max()[axis] = roundedDown(to);
    if (reach.min()[axis] > reach.max()[axis]) return {};
  }
  return reach;
}

/// A voxel is decided by the normal at its closest surface voxel. That lies at most a band and a
/// voxel diagonal away, and the surface at most another band from there.
void MeshDistance::Block::markBand(std::uint32_t triangle) {
  const float band_mm = field_.triangle_band_mm_[triangle];
  const double around_mm = 2 * band_mm + pitch_mm_.length();
  const Vec3d& a = all_.corner(triangle, 0);
  const Vec3d& b = all_.corner(triangle, 1);
  const Vec3d& c = all_.corner(triangle, 2);
  const Vec3d low = lowest(a, b, c);
  const Vec3d high = highest(a, b, c);
  LatticeSheet sheet;
  for (int axis = 0; axis < 3; ++axis) {
    sheet.base[axis] = roundedDown((low[axis] - around_mm) * per_mm_[axis]) >> 3;
    const int top = roundedUp((high[axis] + around_mm) * per_mm_[axis]) >> 3;
    if (sheet.base[axis] > leaves_.max()[axis] || top < leaves_.min()[axis]) return;
    sheet.leaves.min()[axis] = std::max(sheet.base[axis], leaves_.min()[axis]);
    sheet.leaves.max()[axis] = std::min(top, leaves_.max()[axis]);
  }
  const Vec3d middle_mm =
      ((sheet.base << 3).asVec3d() + Vec3d(0.5 * (edge - 1))) * pitch_mm_;  // of the base's voxels
  const Vec3d step = all_.normal(triangle) * pitch_mm_;
  sheet.form = {step.x() * edge, step.y() * edge, step.z() * edge,
                all_.normal(triangle).dot(middle_mm - a)};
  sheet.limit =
      around_mm + 0.5 * (edge - 1) * (std::abs(step.x()) + std::abs(step.y()) + std::abs(step.z()));
  kernels_.raise(sheet, band_mm, work_.distances, work_.bands_mm.data());
}

/// Counts the rows that a triangle crosses and lowers distances to its features.
void MeshDistance::Block::enter(std::uint32_t triangle) {
  const Vec3d& a = all_.corner(triangle, 0);
  const Vec3d& b = all_.corner(triangle, 1);
  const Vec3d& c = all_.corner(triangle, 2);
  const Vec3d low = lowest(a, b, c);
  const Vec3d high = highest(a, b, c);
  // Rows begin before the block: what lies there counts.
  for (const int axis : {2, 1})
    if (low[axis] > high_mm_[axis] || high[axis] < low_mm_[axis]) return;
  if (all_.bounds(triangle)) {
    visitRowCrossings({a, b, c}, pitch_mm_, voxels_, [&](const Coord& ijk, int delta) {
      work_.distances.note(work_.distances.slot(ijk >> 3), RowWinding::pack(ijk, delta));
    });
  }
  if (!all_.hasFeatures(triangle)) return;
  const CoordBBox reach = reachOf(low - greatest_mm_, high + greatest_mm_);
  if (reach.empty()) return;
  double band_mm = greatest_mm_;
  if (!work_.bands_mm.empty()) {
    // The widest of the leaves that it may reach.
    float widest_mm = 0;
    const CoordBBox around(reach.min() >> 3, reach.max() >> 3);
    for (int x = around.min().x(); x <= around.max().x(); ++x)
      for (int y = around.min().y(); y <= around.max().y(); ++y) {
        const float* column =
            work_.bands_mm.data() + work_.distances.slot({x, y, around.min().z()});
        widest_mm = std::max(widest_mm, *std::max_element(column, column + around.dim().z()));
      }
    band_mm = widest_mm;
  }
  all_.visit(triangle, [&](MeshFeatures::Id id) { lower(id, band_mm); });
}

void MeshDistance::Block::lower(MeshFeatures::Id id, double band_mm) {
  if (!all_.meets(id, low_mm_, high_mm_)) return;
  const MeshFeature feature = all_.describe(id);
  if (feature.rank == 0) return;
  LatticeRegion region;
  region.reach = reachOf(feature.min - feature.below * band_mm - feature.spread_mm,
                         feature.max + feature.above * band_mm + feature.spread_mm);
  if (region.reach.empty()) return;
  // The base must not depend on the block or the band, for rounding does on it.
  region.base = roundedDownAll(feature.min * per_mm_) & ~(edge - 1);
  const Vec3d base_mm = region.base.asVec3d() * pitch_mm_;
  region.rank = feature.rank;
  for (std::size_t f = 0; f < static_cast<std::size_t>(feature.rank); ++f)
    region.distance[f] = onLattice(feature.distance[f], pitch_mm_, base_mm);
  std::size_t bounds = 0;
  for (; bounds < static_cast<std::size_t>(feature.bounds); ++bounds)
    region.bound[bounds] = onLattice(feature.bound[bounds], pitch_mm_, base_mm);
  if (feature.rank == 1) {
    for (std::size_t s = 0; s < region.side.size(); ++s)
      region.side[s] = {onLattice(feature.side[s].outward, pitch_mm_, base_mm),
                        onLattice(feature.side[s].along, pitch_mm_, base_mm),
                        feature.side[s].length_mm};
    region.spread_mm = feature.spread_mm;
    region.bound[bounds++] = within(region.distance[0], band_mm, 1);
    region.bound[bounds++] = within(region.distance[0], band_mm, -1);
  }
  if (feature.capped)
    region.bound[bounds++] = within(onLattice(feature.cap, pitch_mm_, base_mm), band_mm, 1);
  region.bounds = static_cast<int>(bounds);
  kernels_.lower(region, id.packed(), field_.extras_.normals || field_.extras_.closest,
                 work_.distances);
}

LeafBits MeshDistance::Block::existing(const Coord& origin) const {
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

/// Along x, all rows of leaves at once.
MeshDistance::Block::Made MeshDistance::Block::sweep() const {
  Made made;
  std::array<RowWinding, block_rows * LeafDistances::depth> rows;
  std::uint64_t filled = 0;   // rows with some of the inside in the last plane
  std::uint64_t running = 0;  // rows whose last leaf was wholly inside
  std::array<Run, block_rows * LeafDistances::depth> runs;
  const auto end_runs = [&](std::uint64_t ended) {
    for (; ended != 0; ended &= ended - 1) {
      made.add(runs[static_cast<std::size_t>(std::countr_zero(ended))]);
      running &= ~(ended & -ended);
    }
  };
  for (int x = leaves_.min().x(); x <= leaves_.max().x(); ++x) {
    const std::size_t first = work_.distances.slot({x, leaves_.min().y(), leaves_.min().z()});
    const std::uint64_t occupied = work_.distances.occupied(x);
    end_runs(running & (occupied | ~filled));
    for (std::uint64_t left = occupied | filled; left != 0; left &= left - 1) {
      const auto row = static_cast<std::uint32_t>(std::countr_zero(left));
      RowWinding& winding = rows[row];
      const Coord leaf(x, leaves_.min().y() + static_cast<int>(row) / LeafDistances::depth,
                       leaves_.min().z() + static_cast<int>(row) % LeafDistances::depth);
      const CoordBBox box = CoordBBox::createCube(leaf << 3, edge);
      if (!(occupied >> row & 1) && winding.bits() == ~0ULL && voxels_.isInside(box)) {
        if ((running >> row & 1) == 0) runs[row] = {box.min(), 0};
        running |= std::uint64_t{1} << row;
        ++runs[row].leaves;
        continue;
      }
      makeLeaf(leaf, winding.advance(work_.distances, first + row), made);
      filled = (filled & ~(1ULL << row)) | std::uint64_t{winding.bits() != 0} << row;
    }
  }
  end_runs(running);
  return made;
}

void MeshDistance::Block::makeLeaf(const Coord& leaf_index, const LeafBits& inside,
                                   Made& made) const {
  static const auto far = [] {
    std::array<float, LeafDistances::voxels> values;
    values.fill(std::numeric_limits<float>::infinity());
    return values;
  }();
  const Coord origin = leaf_index << 3;
  const std::size_t slot = work_.distances.slot(leaf_index);
  const float* distances = work_.distances.distances(slot);
  const float band_mm =
      work_.bands_mm.empty() ? static_cast<float>(greatest_mm_) : work_.bands_mm[slot];

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
      kernels_.finish(distances ? distances : far.data(), within, exists, band_mm,
                      static_cast<float>(greatest_mm_), leaf.surface->buffer().data());
  const bool any_active =
      std::any_of(active.begin(), active.end(), [](std::uint64_t bits) { return bits != 0; });
  if (!any_active && !any_inside) return;
  if (!any_active && !any_outside) {
    made.add(Run{origin, 1});
    return;
  }
  for (std::size_t plane = 0; plane < edge; ++plane)
    leaf.surface->getValueMask().getWord<std::uint64_t>(static_cast<openvdb::Index>(plane)) =
        active[plane];
  if (any_active && (field_.extras_.normals || field_.extras_.closest))
    addExtras(leaf, work_.distances.names(slot));
  made.add(std::move(leaf));
}

void MeshDistance::Block::addExtras(Leaf& leaf, const std::uint32_t* names) const {
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
    const MeshFeatures::Id id(names[v]);
    const auto [away, triangle] = all_.nearest(id, it.getCoord().asVec3d() * pitch_mm_);
    if (leaf.closest)
      leaf.closest->buffer().data()[v] = static_cast<std::int32_t>(all_.original(triangle));
    if (!leaf.normals) continue;
    const double distance = away.length();
    const Vec3d normal =
        distance < on_surface_mm ? all_.normal(triangle) : away / (*it < 0 ? -distance : distance);
    leaf.normals->buffer().data()[v] = openvdb::Vec3s(normal);
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

MeshDistance::MeshDistance(const Mesh& mesh, const Lattice& lattice, Band band,
                           DistanceExtras extras, const SwallowedWalls& walls)
    : lattice_(lattice),
      band_(band),
      extras_(extras),
      features_(mesh, walls, lattice.origin_mm, lattice.pitch_mm.z() * leaf_layers,
                lattice.pitch_mm.y() * leaf_layers * block_rows,
                band.greatestMm(lattice.pitch_mm)) {
  if (band_.mm > 0) return;
  triangle_band_mm_.resize(features_.triangles());
  tbb::parallel_for(std::uint32_t{0}, features_.triangles(), [&](std::uint32_t t) {
    triangle_band_mm_[t] = static_cast<float>(
        bandAcross(features_.leastNormal(t), lattice_.pitch_mm) * band_.diameters);
  });
  for (const float band_mm : triangle_band_mm_) widest_mm_ = std::max(widest_mm_, double{band_mm});
}

double MeshDistance::memoryBytes() const {
  return static_cast<double>(triangle_band_mm_.capacity() * sizeof(float)) +
         features_.memoryBytes();
}

/// How far along an axis a triangle can matter to a voxel: for the band's sake as `markBand` looks,
/// a voxel more because boxes are rounded outwards.
double MeshDistance::reachMm(int axis) const {
  return band_.mm > 0 ? band_.mm
                      : 2 * widest_mm_ + lattice_.diagonalMm() + 2 * lattice_.pitch_mm[axis];
}

void MeshDistance::append(const CoordBBox& voxels, DistanceGrids& grids) const {
  // Blocks and nodes begin together.
  const int first = NodeWriter<openvdb::FloatTree>::parentOf(voxels.min()).y() / edge;
  const auto blocks =
      static_cast<std::uint32_t>(((voxels.max().y() >> 3) - first) / block_rows + 1);
  const double block_mm = block_rows * edge * lattice_.pitch_mm.y();
  const double first_mm = first * edge * lattice_.pitch_mm.y();
  const auto blockAt = [&](double y) {
    return static_cast<std::uint32_t>(std::clamp((y - first_mm) / block_mm, 0.0, blocks - 1.0));
  };
  std::vector<Bins::Entry> entries;
  for (const std::uint32_t triangle :
       features_.collect(voxels.min().z() * lattice_.pitch_mm.z() - reachMm(2),
                         voxels.max().z() * lattice_.pitch_mm.z() + reachMm(2))) {
    const MeshFeatures::Extent extent = features_.extent(triangle, 1);
    const std::uint32_t end = blockAt(extent.high + reachMm(1));
    for (std::uint32_t block = blockAt(extent.low - reachMm(1)); block <= end; ++block)
      entries.push_back({block, triangle});
  }
  const Bins triangles(blocks, entries);

  std::vector<Block::Made> made(blocks);
  tbb::enumerable_thread_specific<Block::Workspace> workspaces;
  tbb::parallel_for(std::uint32_t{0}, blocks, [&](std::uint32_t block) {
    CoordBBox part = voxels;
    const int begin = (first + static_cast<int>(block) * block_rows) * edge;
    part.min().y() = std::max(part.min().y(), begin);
    part.max().y() = std::min(part.max().y(), begin + block_rows * edge - 1);
    if (part.empty() || triangles.of(block).empty()) return;
    made[block] = Block(*this, part, workspaces.local()).make(triangles.of(block));
  });

  for (const Block::Made& block : made) {
    for (const Coord& origin : block.parents) {
      NodeWriter<openvdb::FloatTree>::makeParent(grids.surface->tree(), origin);
      if (grids.normals) NodeWriter<openvdb::Vec3STree>::makeParent(grids.normals->tree(), origin);
      if (grids.closest) NodeWriter<openvdb::Int32Tree>::makeParent(grids.closest->tree(), origin);
    }
  }
  // Blocks that share nodes lie in one of these groups.
  constexpr int group_rows = NodeWriter<openvdb::FloatTree>::Parent::DIM / edge;
  const std::uint32_t group_blocks = group_rows / block_rows;
  const std::uint32_t groups = (blocks + group_blocks - 1) / group_blocks;
  tbb::parallel_for(std::uint32_t{0}, groups, [&](std::uint32_t group) {
    NodeWriter surface(grids.surface->tree());
    std::optional<NodeWriter<openvdb::Vec3STree>> normals;
    std::optional<NodeWriter<openvdb::Int32Tree>> closest;
    if (grids.normals) normals.emplace(grids.normals->tree());
    if (grids.closest) closest.emplace(grids.closest->tree());
    for (std::uint32_t n = group * group_blocks; n < std::min(blocks, (group + 1) * group_blocks);
         ++n) {
      for (Block::Leaf& leaf : made[n].leaves) {
        if (leaf.normals) normals->set(std::move(leaf.normals));
        if (leaf.closest) closest->set(std::move(leaf.closest));
        surface.set(std::move(leaf.surface));
      }
      for (const Run& run : made[n].interior) surface.set(run, -grids.surface->background());
      made[n] = {};
    }
  });
}

DistanceGrids MeshDistance::run(ZRange core) const {
  DistanceGrids grids;
  const auto dress = [&](auto grid, const char* name, openvdb::GridClass grid_class) {
    grid->setName(name);
    grid->setGridClass(grid_class);
    grid->setTransform(transformOf(lattice_));
    return grid;
  };
  grids.surface = dress(openvdb::FloatGrid::create(static_cast<float>(backgroundMm())),
                        surface_grid, openvdb::GRID_LEVEL_SET);
  if (extras_.normals) {
    grids.normals = dress(openvdb::Vec3SGrid::create(openvdb::Vec3s(0, 0, 0)), normal_grid,
                          openvdb::GRID_UNKNOWN);
    grids.normals->setVectorType(openvdb::VEC_COVARIANT_NORMALIZE);
  }
  if (extras_.closest)
    grids.closest = dress(openvdb::Int32Grid::create(-1), closest_grid, openvdb::GRID_UNKNOWN);

  if (lattice_.box.empty()) return grids;
  const ZRange layers = intersection(core, lattice_.layers());
  for (int begin = layers.begin; begin < layers.end;) {
    const int end = std::min(layers.end, (begin & ~(edge - 1)) + chunk_layers);
    CoordBBox voxels = lattice_.box;
    voxels.min().z() = begin;
    voxels.max().z() = end - 1;
    append(voxels, grids);
    begin = end;
  }
  openvdb::tools::pruneTiles(grids.surface->tree());
  return grids;
}

}  // namespace vdbdither
