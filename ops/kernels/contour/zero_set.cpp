// Gibson: "Constrained elastic surface nets", MICCAI 1998.

#include "ops/kernels/contour/zero_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Mat4d;
using openvdb::Vec3d;

namespace {

constexpr int block_edge = 8;
constexpr double infinity = std::numeric_limits<double>::infinity();

/// The cell between eight nodes: their values, < 0 inside, and their second differences along each
/// axis. Corner n lies at (n & 1, n >> 1 & 1, n >> 2).
struct Cell {
  std::array<double, 8> value;
  std::array<std::array<double, 8>, 3> bend;

  [[nodiscard]] bool uniform() const {
    return std::all_of(value.begin(), value.end(), [](double v) { return v < 0; }) ||
           std::none_of(value.begin(), value.end(), [](double v) { return v < 0; });
  }

  /// Whether the interpolant may change its sign; second differences change it by at most an eighth
  /// of them.
  [[nodiscard]] bool maybeCrossed() const {
    if (!uniform()) return true;
    double change = 0;
    for (const auto& along : bend) {
      double maximum = 0;
      for (const double b : along) maximum = std::max(maximum, std::abs(b));
      change += maximum / 8;
    }
    return std::any_of(value.begin(), value.end(),
                       [&](double v) { return std::abs(v) <= change * (1 + 1e-9); });
  }

  struct Sample {
    double value = 0;
    Vec3d gradient{0, 0, 0};  ///< per index
  };

  /// Returns the sample at `t` in [0, 1]³. It has the same bits on both sides of a face between two
  /// cells: terms of the other side are multiplied by an exact zero.
  [[nodiscard]] Sample at(const Vec3d& t) const {
    std::array<std::array<double, 2>, 3> weight, lift, lift_slope;
    for (std::size_t a = 0; a < 3; ++a) {
      const double u = t[static_cast<int>(a)];
      weight[a] = {1 - u, u};
      // The cubic through four nodes, expressed by the second differences at the inner two.
      lift[a] = {-u * (1 - u) * (2 - u) / 6, -u * (1 - u) * (1 + u) / 6};
      lift_slope[a] = {-(2 - 6 * u + 3 * u * u) / 6, -(1 - 3 * u * u) / 6};
    }
    Sample sample;
    for (std::size_t n = 0; n < 8; ++n) {
      const std::array<std::size_t, 3> side{n & 1, n >> 1 & 1, n >> 2};
      for (std::size_t a = 0; a < 3; ++a) {
        const std::size_t b = (a + 1) % 3;
        const std::size_t c = (a + 2) % 3;
        const double across = weight[b][side[b]] * weight[c][side[c]];
        const double bent = bend[a][n];
        sample.value += lift[a][side[a]] * across * bent;
        const double step_b = side[b] ? 1.0 : -1.0;
        const double step_c = side[c] ? 1.0 : -1.0;
        const double step_a = side[a] ? 1.0 : -1.0;
        sample.gradient[static_cast<int>(a)] +=
            lift_slope[a][side[a]] * across * bent + step_a * across * value[n];
        sample.gradient[static_cast<int>(b)] +=
            lift[a][side[a]] * step_b * weight[c][side[c]] * bent;
        sample.gradient[static_cast<int>(c)] +=
            lift[a][side[a]] * step_c * weight[b][side[b]] * bent;
      }
      sample.value += weight[0][side[0]] * weight[1][side[1]] * weight[2][side[2]] * value[n];
    }
    return sample;
  }
};

Coord unit(int axis) {
  Coord step(0);
  step[axis] = 1;
  return step;
}

Coord cornerOf(std::size_t n) {
  return {static_cast<int>(n & 1), static_cast<int>(n >> 1 & 1), static_cast<int>(n >> 2)};
}

Coord scaled(const Coord& ijk, int factor) {
  return {ijk.x() * factor, ijk.y() * factor, ijk.z() * factor};
}

std::size_t volumeOf(int edge) {
  const auto n = static_cast<std::size_t>(edge);
  return n * n * n;
}

/// Returns the index of `ijk` in an array over a cube.
std::size_t placeOf(const Coord& ijk, int edge) {
  return static_cast<std::size_t>((ijk.x() * edge + ijk.y()) * edge + ijk.z());
}

/// A node's value, < 0 inside, and whether it is active.
struct Node {
  double value = 0;
  bool active = false;
};

/// Returns the cell at `origin`, whose nodes `probe` reads.
template <typename Probe>
Cell cellAt(const Coord& origin, const Probe& probe) {
  Cell cell{};
  for (std::size_t n = 0; n < 8; ++n) {
    const Coord ijk = origin + cornerOf(n);
    const Node here = probe(ijk);
    cell.value[n] = here.value;
    for (int axis = 0; axis < 3 && here.active; ++axis) {
      const Node below = probe(ijk - unit(axis));
      const Node above = probe(ijk + unit(axis));
      if (below.active && above.active)
        cell.bend[static_cast<std::size_t>(axis)][n] = below.value - 2 * here.value + above.value;
    }
  }
  return cell;
}

/// Reads nodes one by one, for one thread.
class NodeReader {
 public:
  NodeReader(const openvdb::FloatTree& tree, ZeroSet::Reading reading)
      : accessor_(tree), level_(reading.level), sign_(reading.above ? -1 : 1) {}

  Node operator()(const Coord& ijk) const {
    float value = 0;
    const bool active = accessor_.probeValue(ijk, value);
    return {sign_ * (double{value} - level_), active};
  }

 private:
  openvdb::tree::ValueAccessor<const openvdb::FloatTree, false> accessor_;
  double level_;
  double sign_;
};

/// The nodes of a block of cells, with one more layer below and two above.
class NodeTile {
 public:
  NodeTile(const Coord& origin, const NodeReader& reader) : first_(origin.offsetBy(-1)) {
    for (const Coord& at : CoordBBox::createCube(Coord(0), edge))
      nodes_[placeOf(at, edge)] = reader(first_ + at);
  }

  const Node& operator()(const Coord& ijk) const { return nodes_[placeOf(ijk - first_, edge)]; }

 private:
  static constexpr int edge = block_edge + 3;
  Coord first_;
  std::array<Node, std::size_t{edge} * edge * edge> nodes_;
};

/// Returns the minimum and the maximum z of a box under an affine map.
std::pair<double, double> heights(const Mat4d& map, const Vec3d& min, const Vec3d& max) {
  double low = map(3, 2);
  double high = low;
  for (int axis = 0; axis < 3; ++axis) {
    const auto [a, b] = std::minmax({map(axis, 2) * min[axis], map(axis, 2) * max[axis]});
    low += a;
    high += b;
  }
  return {low, high};
}

/// Returns the mean of the crossings on the edges of a division, in [0, 1]³, from its corners'
/// values.
Vec3d meanCrossing(const std::array<double, 8>& value) {
  Vec3d sum(0, 0, 0);
  int count = 0;
  for (std::size_t n = 0; n < 8; ++n) {
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t other = n | std::size_t{1} << axis;
      if (other == n || (value[n] < 0) == (value[other] < 0)) continue;
      Vec3d at = cornerOf(n).asVec3d();
      at[axis] = value[n] / (value[n] - value[other]);
      sum += at;
      ++count;
    }
  }
  return sum / count;
}

/// Returns a point of the surface in a division that it passes, in coordinates of the cell, by four
/// steps of Newton's method.
Vec3d vertexIn(const Cell& cell, const Vec3d& division, int divisions,
               const std::array<double, 8>& corners) {
  const Vec3d low = division / divisions;
  const Vec3d high = (division + Vec3d(1, 1, 1)) / divisions;
  Vec3d at = (division + meanCrossing(corners)) / divisions;
  for (int step = 0; step < 4; ++step) {
    const Cell::Sample sample = cell.at(at);
    const double steepness = sample.gradient.lengthSqr();
    if (!(steepness > 0)) break;
    at -= sample.gradient * (sample.value / steepness);
    at = openvdb::math::minComponent(openvdb::math::maxComponent(at, low), high);
  }
  return at;
}

/// Adds two triangles, divided by the shorter diagonal.
void addQuad(const std::vector<Vec3d>& vertices, const std::array<std::int64_t, 4>& quad,
             std::vector<Mesh::Triangle>& triangles) {
  std::array<std::uint32_t, 4> q;
  for (std::size_t n = 0; n < 4; ++n) q[n] = static_cast<std::uint32_t>(quad[n]);
  const bool other =
      (vertices[q[3]] - vertices[q[1]]).lengthSqr() < (vertices[q[2]] - vertices[q[0]]).lengthSqr();
  if (other) {
    triangles.push_back({q[0], q[1], q[3]});
    triangles.push_back({q[1], q[2], q[3]});
  } else {
    triangles.push_back({q[0], q[1], q[2]});
    triangles.push_back({q[0], q[2], q[3]});
  }
}

}  // namespace

/// The surface in a leaf-sized block of cells.
struct ZeroSet::Block {
  std::vector<std::uint8_t> inside;  ///< by node of the divisions
  std::vector<std::int32_t> vertex;  ///< by division: the index in `vertices`, or −1
  std::vector<Vec3d> vertices;       ///< index space
};

ZeroSet::~ZeroSet() = default;

ZeroSet::ZeroSet(openvdb::FloatGrid::ConstPtr grid, const Mat4d& mm_from_index, Reading reading,
                 int divisions)
    : grid_(std::move(grid)),
      mm_from_index_(mm_from_index),
      index_from_mm_(mm_from_index.inverse()),
      reading_(reading),
      divisions_(divisions),
      bounds_{Vec3d(infinity), Vec3d(-infinity)} {
  Vec3d cell_mm(0, 0, 0);
  for (int axis = 0; axis < 3; ++axis)
    cell_mm[axis] = (positionMm(unit(axis).asVec3d()) - positionMm(Vec3d(0, 0, 0))).length();
  half_division_mm_ = 0.5 * cell_mm.length() / divisions_;

  const std::vector<Coord> origins = candidates();
  struct Found {
    Bounds bounds{Vec3d(infinity), Vec3d(-infinity)};
    std::size_t cells = 0;
  };
  std::vector<Found> found(origins.size());
  tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t i) {
    const Block block = blockAt(origins[i]);
    found[i].cells = block.vertices.size();
    for (const Vec3d& vertex : block.vertices) {
      const Vec3d at = positionMm(vertex);
      found[i].bounds.min = openvdb::math::minComponent(found[i].bounds.min, at);
      found[i].bounds.max = openvdb::math::maxComponent(found[i].bounds.max, at);
    }
  });
  for (std::size_t i = 0; i < origins.size(); ++i) {
    if (found[i].cells == 0) continue;
    blocks_.push_back(origins[i]);
    cells_ += static_cast<double>(found[i].cells);
    bounds_.min = openvdb::math::minComponent(bounds_.min, found[i].bounds.min);
    bounds_.max = openvdb::math::maxComponent(bounds_.max, found[i].bounds.max);
  }
}

double ZeroSet::memoryBytes() const {
  return static_cast<double>(grid_->memUsage()) +
         static_cast<double>(blocks_.capacity() * sizeof(Coord));
}

Vec3d ZeroSet::positionMm(const Vec3d& index) const { return mm_from_index_.transform(index); }

/// Returns the blocks of cells that have a node in a leaf or on the rim of an inside tile: signs
/// change nowhere else.
std::vector<Coord> ZeroSet::candidates() const {
  std::vector<Coord> origins;
  const auto add = [&](const Coord& origin) {
    for (std::size_t n = 0; n < 8; ++n) origins.push_back(origin - scaled(cornerOf(n), block_edge));
  };
  for (auto leaf = grid_->tree().cbeginLeaf(); leaf; ++leaf) add(leaf->origin());
  auto tile = grid_->tree().cbeginValueAll();
  tile.setMaxDepth(openvdb::FloatTree::ValueAllCIter::LEAF_DEPTH - 1);
  for (; tile; ++tile) {
    const bool inside = reading_.above ? *tile > reading_.level : *tile < reading_.level;
    if (!inside) continue;
    const CoordBBox box = tile.getBoundingBox();
    const auto is_rim = [&](int at, int axis) {
      return at == box.min()[axis] || at + block_edge > box.max()[axis];
    };
    for (int x = box.min().x(); x <= box.max().x(); x += block_edge) {
      for (int y = box.min().y(); y <= box.max().y(); y += block_edge) {
        const bool column = is_rim(x, 0) || is_rim(y, 1);
        const int step = column ? block_edge : std::max(block_edge, box.dim().z() - block_edge);
        for (int z = box.min().z(); z <= box.max().z(); z += step) add({x, y, z});
      }
    }
  }
  std::sort(origins.begin(), origins.end());
  origins.erase(std::unique(origins.begin(), origins.end()), origins.end());
  return origins;
}

ZeroSet::Block ZeroSet::blockAt(const Coord& origin) const {
  const NodeTile nodes(origin, NodeReader(grid_->tree(), reading_));
  Block block;
  std::vector<std::pair<Coord, Cell>> crossed;
  std::vector<Coord> inside;
  for (const Coord& local : CoordBBox::createCube(Coord(0), block_edge)) {
    const Coord at = origin + local;
    const bool first_inside = nodes(at).value < 0;
    int like_first = 0;
    for (std::size_t n = 0; n < 8; ++n)
      like_first += (nodes(at + cornerOf(n)).value < 0) == first_inside ? 1 : 0;
    // An undivided cell has no other nodes than its corners.
    if (like_first == 8 && (divisions_ == 1 || !cellAt(at, nodes).maybeCrossed())) {
      if (first_inside) inside.push_back(local);
    } else {
      crossed.emplace_back(local, cellAt(at, nodes));
    }
  }
  if (crossed.empty()) return block;

  const int divisions = block_edge * divisions_;
  block.inside.assign(volumeOf(divisions + 1), 0);
  block.vertex.assign(volumeOf(divisions), -1);
  const CoordBBox cell_nodes(Coord(0), Coord(divisions_));
  for (const Coord& local : inside) {
    for (const Coord& node : cell_nodes)
      block.inside[placeOf(scaled(local, divisions_) + node, divisions + 1)] = 1;
  }
  std::vector<double> values(volumeOf(divisions_ + 1));
  for (const auto& [local, cell] : crossed) {
    for (const Coord& node : cell_nodes) {
      const double value = cell.at(node.asVec3d() / divisions_).value;
      values[placeOf(node, divisions_ + 1)] = value;
      block.inside[placeOf(scaled(local, divisions_) + node, divisions + 1)] = value < 0 ? 1 : 0;
    }
    for (const Coord& division : CoordBBox::createCube(Coord(0), divisions_)) {
      std::array<double, 8> corners;
      int inside_corners = 0;
      for (std::size_t n = 0; n < 8; ++n) {
        corners[n] = values[placeOf(division + cornerOf(n), divisions_ + 1)];
        inside_corners += corners[n] < 0 ? 1 : 0;
      }
      if (inside_corners == 0 || inside_corners == 8) continue;
      block.vertex[placeOf(scaled(local, divisions_) + division, divisions)] =
          static_cast<std::int32_t>(block.vertices.size());
      block.vertices.push_back((origin + local).asVec3d() +
                               vertexIn(cell, division.asVec3d(), divisions_, corners));
    }
  }
  return block;
}

Mesh ZeroSet::triangles(double low_mm, double high_mm) const {
  // A triangle reaches at most two divisions beyond the cells of its vertices.
  const double slack_mm = 4 * half_division_mm_;
  std::vector<Coord> origins;
  std::copy_if(
      blocks_.begin(), blocks_.end(), std::back_inserter(origins), [&](const Coord& origin) {
        const auto [low, high] =
            heights(mm_from_index_, origin.asVec3d(), origin.offsetBy(block_edge).asVec3d());
        return low - slack_mm <= high_mm && high + slack_mm >= low_mm;
      });
  std::vector<Block> blocks(origins.size());
  tbb::parallel_for(std::size_t{0}, origins.size(),
                    [&](std::size_t i) { blocks[i] = blockAt(origins[i]); });
  std::vector<std::uint32_t> first(origins.size());
  Mesh mesh;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    first[i] = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vec3d& vertex : blocks[i].vertices) mesh.vertices.push_back(positionMm(vertex));
  }

  const int divisions = block_edge * divisions_;
  const bool mirrored = mm_from_index_.det() < 0;
  std::vector<std::vector<Mesh::Triangle>> made(blocks.size());
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t i) {
    // The block and those before it: bit a is set for one block back along axis a.
    std::array<const Block*, 8> around{};
    std::array<std::uint32_t, 8> first_around{};
    for (std::size_t n = 0; n < 8; ++n) {
      const Coord origin = origins[i] - scaled(cornerOf(n), block_edge);
      const auto found = std::lower_bound(origins.begin(), origins.end(), origin);
      if (found == origins.end() || *found != origin) continue;
      const auto at = static_cast<std::size_t>(found - origins.begin());
      around[n] = &blocks[at];
      first_around[n] = first[at];
    }
    const auto vertex_of = [&](Coord division) -> std::int64_t {
      std::size_t n = 0;
      for (int axis = 0; axis < 3; ++axis) {
        if (division[axis] >= 0) continue;
        division[axis] += divisions;
        n |= std::size_t{1} << axis;
      }
      if (!around[n]) return -1;
      const std::int32_t vertex = around[n]->vertex[placeOf(division, divisions)];
      return vertex < 0 ? -1 : std::int64_t{first_around[n]} + vertex;
    };
    const std::vector<std::uint8_t>& inside_at = blocks[i].inside;
    for (const Coord& node : CoordBBox::createCube(Coord(0), divisions)) {
      const bool inside = inside_at[placeOf(node, divisions + 1)] != 0;
      for (int axis = 0; axis < 3; ++axis) {
        if ((inside_at[placeOf(node + unit(axis), divisions + 1)] != 0) == inside) continue;
        const Coord b = unit((axis + 1) % 3);
        const Coord c = unit((axis + 2) % 3);
        std::array<std::int64_t, 4> quad{vertex_of(node - b - c), vertex_of(node - c),
                                         vertex_of(node), vertex_of(node - b)};
        if (*std::min_element(quad.begin(), quad.end()) < 0) continue;
        if (inside == mirrored) std::swap(quad[1], quad[3]);
        addQuad(mesh.vertices, quad, made[i]);
      }
    }
  });
  for (const auto& triangles : made)
    mesh.triangles.insert(mesh.triangles.end(), triangles.begin(), triangles.end());
  return mesh;
}

/// The cells read last.
struct ZeroSet::Feet::Cache {
  struct Entry {
    Coord origin = Coord::max();
    Cell cell;
  };
  explicit Cache(const ZeroSet& surface)
      : reader(surface.grid_->tree(), surface.reading_), entries(1 << 8) {}

  const Cell& at(const Coord& origin) {
    const auto hash = static_cast<std::size_t>((origin.x() * 25 + origin.y()) * 25 + origin.z());
    Entry& entry = entries[hash % entries.size()];
    if (entry.origin != origin) entry = {origin, cellAt(origin, reader)};
    return entry.cell;
  }

  NodeReader reader;
  std::vector<Entry> entries;
};

ZeroSet::Feet::Feet(const ZeroSet& surface)
    : surface_(surface), cache_(std::make_unique<Cache>(surface)) {}
ZeroSet::Feet::Feet(Feet&&) noexcept = default;
ZeroSet::Feet::~Feet() = default;

double ZeroSet::Feet::distanceMm(const Vec3d& position_mm, const Vec3d& foot_mm,
                                 double distance_mm) {
  // Each step multiplies the error by the distance divided by the surface's radius of curvature.
  constexpr int steps = 3;
  const double maximum_mm = surface_.half_division_mm_;
  double better_mm = distance_mm;
  Vec3d foot = foot_mm;
  for (int step = 0; step < steps; ++step) {
    const Vec3d index = surface_.index_from_mm_.transform(foot);
    const Coord origin = Coord::floor(index);
    const Cell::Sample sample = cache_->at(origin).at(index - origin.asVec3d());
    Vec3d slope(0, 0, 0);
    for (int axis = 0; axis < 3; ++axis) {
      for (int j = 0; j < 3; ++j)
        slope[axis] += surface_.index_from_mm_(axis, j) * sample.gradient[j];
    }
    const double steepness = slope.length();
    const Vec3d normal = slope / steepness;
    const double next_mm = normal.dot(position_mm - foot) + sample.value / steepness;
    // At a crease, or where the slope is zero, steps do not converge.
    if (!(std::abs(next_mm - distance_mm) <= maximum_mm)) break;
    better_mm = next_mm;
    foot = position_mm - normal * next_mm;
  }
  return better_mm;
}

}  // namespace vdbdither
