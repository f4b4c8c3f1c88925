// Every feature of the mesh lowers the distances of a block's voxels in its region. The sign comes
// from a sweep along x, which needs only the triangles that cross the block's layers.

#include "ops/kernels/distance/mesh_distance_block.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "ops/kernels/distance/row_winding.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

namespace {

constexpr int edge = leaf_layers;

/// Closer than this, the direction to the nearest point does not define the normal.
constexpr double on_surface_mm = 1e-6;

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

/// Returns band_mm − sign · form, which is negative beyond the band.
LatticeForm within(const LatticeForm& form, double band_mm, double sign) {
  return {-sign * form.x, -sign * form.y, -sign * form.z, band_mm - sign * form.constant};
}

}  // namespace

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

/// Returns the block's voxels within a box; it may be empty.
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

/// Raises the band of the leaves that a triangle's band can matter to. Dithering decides a voxel by
/// the normal at its closest surface voxel, which is at most a band and a voxel diagonal away, and
/// the surface at most another band from there.
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
  // Of the voxels of the base leaf.
  const Vec3d middle_mm = ((sheet.base << 3).asVec3d() + Vec3d(0.5 * (edge - 1))) * pitch_mm_;
  const Vec3d step = all_.normal(triangle) * pitch_mm_;
  sheet.form = {step.x() * edge, step.y() * edge, step.z() * edge,
                all_.normal(triangle).dot(middle_mm - a)};
  sheet.limit =
      around_mm + 0.5 * (edge - 1) * (std::abs(step.x()) + std::abs(step.y()) + std::abs(step.z()));
  kernels_.raise(sheet, band_mm, work_.distances, work_.bands_mm.data());
}

/// Notes the rows that a triangle crosses, and lowers the distances to its features.
void MeshDistance::Block::enter(std::uint32_t triangle) {
  const Vec3d& a = all_.corner(triangle, 0);
  const Vec3d& b = all_.corner(triangle, 1);
  const Vec3d& c = all_.corner(triangle, 2);
  const Vec3d low = lowest(a, b, c);
  const Vec3d high = highest(a, b, c);
  // Rows begin before the block, so that triangles there count too.
  for (const int axis : {2, 1})
    if (low[axis] > high_mm_[axis] || high[axis] < low_mm_[axis]) return;
  if (all_.bounds(triangle)) {
    crossings_.visit({a, b, c}, voxels_, [&](const Coord& ijk, int delta) {
      work_.distances.note(work_.distances.slot(ijk >> 3), RowWinding::pack(ijk, delta));
    });
  }
  if (!all_.hasFeatures(triangle)) return;
  const CoordBBox reach = reachOf(low - maximum_mm_, high + maximum_mm_);
  if (reach.empty()) return;
  double band_mm = maximum_mm_;
  if (!work_.bands_mm.empty()) {
    // The widest band of the leaves that it can reach.
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
  const bool inside_only = field_.band_.inside_only;
  if (inside_only && feature.is_ridge) return;
  const double outside_mm = inside_only ? field_.tie_mm_ : band_mm;
  LatticeRegion region;
  Vec3d below_mm = feature.below * band_mm;
  Vec3d above_mm = feature.above * band_mm;
  if (inside_only && feature.rank == 1) {
    const Vec3d& normal = feature.distance[0].gradient;
    for (int axis = 0; axis < 3; ++axis)
      (normal[axis] < 0 ? below_mm : above_mm)[axis] = std::abs(normal[axis]) * outside_mm;
  }
  region.reach = reachOf(feature.min - below_mm - feature.spread_mm,
                         feature.max + above_mm + feature.spread_mm);
  if (region.reach.empty()) return;
  // The base must not depend on the block or the band, because rounding depends on it.
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
    region.bound[bounds++] = within(region.distance[0], outside_mm, 1);
    region.bound[bounds++] = within(region.distance[0], band_mm, -1);
  }
  if (feature.capped)
    region.bound[bounds++] = within(onLattice(feature.cap, pitch_mm_, base_mm), band_mm, 1);
  region.bounds = static_cast<int>(bounds);
  kernels_.lower(region, id.packed(), field_.extras_.normals || field_.extras_.closest,
                 work_.distances);
}

LeafBits MeshDistance::Block::existing(const Coord& origin) const {
  const auto within = [&](int axis) {
    return rowWithin(origin[axis], {voxels_.min()[axis], voxels_.max()[axis] + 1});
  };
  std::uint64_t plane = 0;
  for (std::uint64_t rows = within(1); rows != 0; rows &= rows - 1)
    plane |= std::uint64_t{within(2)} << (edge * std::countr_zero(rows));
  LeafBits bits{};
  for (unsigned planes = within(0); planes != 0; planes &= planes - 1)
    bits[static_cast<std::size_t>(std::countr_zero(planes))] = plane;
  return bits;
}

/// Makes the leaves and tiles, sweeping along x through all rows of leaves at once.
MeshDistance::Block::Made MeshDistance::Block::sweep() const {
  Made made;
  std::array<RowWinding, leaf_rows * LeafDistances::depth> rows;
  std::uint64_t filled = 0;   // rows with inside voxels in the last plane
  std::uint64_t running = 0;  // rows whose last leaf was wholly inside
  std::array<LeafSpan, leaf_rows * LeafDistances::depth> spans;
  const auto end_spans = [&](std::uint64_t ended) {
    for (; ended != 0; ended &= ended - 1) {
      made.add(spans[static_cast<std::size_t>(std::countr_zero(ended))]);
      running &= ~(ended & -ended);
    }
  };
  for (int x = leaves_.min().x(); x <= leaves_.max().x(); ++x) {
    const std::size_t first = work_.distances.slot({x, leaves_.min().y(), leaves_.min().z()});
    const std::uint64_t occupied = work_.distances.occupied(x);
    end_spans(running & (occupied | ~filled));
    for (std::uint64_t left = occupied | filled; left != 0; left &= left - 1) {
      const auto row = static_cast<std::uint32_t>(std::countr_zero(left));
      RowWinding& winding = rows[row];
      const Coord leaf(x, leaves_.min().y() + static_cast<int>(row) / LeafDistances::depth,
                       leaves_.min().z() + static_cast<int>(row) % LeafDistances::depth);
      const CoordBBox box = CoordBBox::createCube(leaf << 3, edge);
      if (!(occupied >> row & 1) && winding.bits() == ~0ULL && voxels_.isInside(box)) {
        if ((running >> row & 1) == 0) spans[row] = {box.min(), 0};
        running |= std::uint64_t{1} << row;
        ++spans[row].leaves;
        continue;
      }
      makeLeaf(leaf, winding.advance(work_.distances, first + row), made);
      filled = (filled & ~(1ULL << row)) | std::uint64_t{winding.bits() != 0} << row;
    }
  }
  end_spans(running);
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
      work_.bands_mm.empty() ? static_cast<float>(maximum_mm_) : work_.bands_mm[slot];

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
  leaf.surface.reset(newLeaf<openvdb::FloatTree>(origin));
  const LeafBits active = kernels_.finish(
      distances ? distances : far.data(), within, exists, static_cast<float>(field_.tie_mm_),
      band_mm, static_cast<float>(maximum_mm_), leaf.surface->buffer().data());
  const bool any_active =
      std::any_of(active.begin(), active.end(), [](std::uint64_t bits) { return bits != 0; });
  if (!any_active && !any_inside) return;
  if (!any_active && !any_outside) {
    made.add(LeafSpan{origin, 1});
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
  if (field_.extras_.normals) give(leaf.normals, newLeaf<openvdb::Vec3STree>(origin), no_normal);
  if (field_.extras_.closest) give(leaf.closest, newLeaf<openvdb::Int32Tree>(origin), -1);

  for (auto it = leaf.surface->cbeginValueOn(); it; ++it) {
    const openvdb::Index v = it.pos();
    const MeshFeatures::Id id(names[v]);
    if (field_.band_.inside_only) {
      leaf.closest->buffer().data()[v] = static_cast<std::int32_t>(all_.original(all_.ownerOf(id)));
      continue;
    }
    const auto [away, triangle] = all_.nearest(id, it.getCoord().asVec3d() * pitch_mm_);
    if (leaf.closest)
      leaf.closest->buffer().data()[v] = static_cast<std::int32_t>(all_.original(triangle));
    if (!leaf.normals) continue;
    const double distance = away.length();
    const Vec3d normal = distance < std::max(on_surface_mm, field_.tie_mm_)
                             ? all_.normal(triangle)
                             : away / (*it < 0 ? -distance : distance);
    leaf.normals->buffer().data()[v] = openvdb::Vec3s(normal);
  }
}

}  // namespace vdbdither
