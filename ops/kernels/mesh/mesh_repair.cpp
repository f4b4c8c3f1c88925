// In any set of triangles the sides that no opposite side meets form closed loops. Filling the
// loops makes the mesh a cycle, whose winding number is a whole number everywhere.

#include "ops/kernels/mesh/mesh_repair.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <utility>

#include "ops/kernels/mesh/box_tree.h"
#include "ops/kernels/mesh/enclosure.h"
#include "ops/kernels/mesh/hole_filling.h"
#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Far below a voxel, far above the rounding of coordinates that were written as floats.
constexpr double weld_mm = 1e-3;

using Triangle = Mesh::Triangle;

/// Renumbers the corners and drops the triangles of which two became the same.
void renumber(DerivedMesh& made, const std::vector<std::uint32_t>& to, MeshRepairs& repairs) {
  std::vector<Triangle>& triangles = made.mesh.triangles;
  for (Triangle& t : triangles)
    for (std::uint32_t& v : t) v = to[v];
  const std::size_t before = triangles.size();
  dropTriangles(made, [&triangles](std::uint32_t i) { return isDegenerate(triangles[i]); });
  repairs.degenerate_triangles += before - triangles.size();
}

void weldEqual(DerivedMesh& made, MeshRepairs& repairs) {
  renumber(made, firstAtPlace(made.mesh), repairs);
}

/// A directed side that opposite sides do not cancel, and its surplus.
struct Border {
  std::uint32_t from, to;
  int count;
};
std::vector<Border> bordersOf(const Mesh& mesh, const MeshEdges& edges) {
  std::vector<Border> borders;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const int surplus = edges.surplus(mesh, e);
    if (surplus > 0) borders.push_back({edges[e].from, edges[e].to, surplus});
    if (surplus < 0) borders.push_back({edges[e].to, edges[e].from, -surplus});
  }
  return borders;
}

/// Merges the vertices of open edges that lie within `weld_mm` of an earlier one.
void weldBorders(DerivedMesh& made, MeshRepairs& repairs) {
  const Mesh& mesh = made.mesh;
  const MeshEdges edges(mesh);
  std::vector<std::uint32_t> open;
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    if (edges.halves(e).size() == 1) open.insert(open.end(), {edges[e].from, edges[e].to});
  if (open.empty()) return;
  std::sort(open.begin(), open.end());
  open.erase(std::unique(open.begin(), open.end()), open.end());

  using Cell = std::array<std::int64_t, 3>;
  std::map<Cell, std::vector<std::uint32_t>> kept;
  std::vector<std::uint32_t> to(mesh.vertices.size());
  std::iota(to.begin(), to.end(), 0U);
  for (const std::uint32_t v : open) {
    const Vec3d& p = mesh.vertices[v];
    Cell cell;
    for (std::size_t axis = 0; axis < 3; ++axis)
      cell[axis] = static_cast<std::int64_t>(std::floor(p[static_cast<int>(axis)] / weld_mm));
    double nearest = weld_mm * weld_mm;
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const auto found = kept.find({cell[0] + neighbour % 3 - 1, cell[1] + neighbour / 3 % 3 - 1,
                                    cell[2] + neighbour / 9 - 1});
      if (found == kept.end()) continue;
      for (const std::uint32_t other : found->second) {
        const double distance = (mesh.vertices[other] - p).lengthSqr();
        if (distance >= nearest) continue;
        nearest = distance;
        to[v] = other;
      }
    }
    if (to[v] == v) {
      kept[cell].push_back(v);
    } else {
      ++repairs.welded_vertices;
    }
  }
  if (repairs.welded_vertices > 0) renumber(made, to, repairs);
}

/// `mesh` without the triangles to drop.
Mesh remaining(const Mesh& mesh, const std::vector<bool>& drop) {
  Mesh rest;
  rest.vertices = mesh.vertices;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i)
    if (!drop[i]) rest.triangles.push_back(mesh.triangles[i]);
  return rest;
}

/// Of triangles with the same corners one stays. Two that face opposite ways are a wall between two
/// solids; both are dropped, unless most of the mesh consists of such pairs: then it is a two-sided
/// surface, and one of each pair stays. Where shells that are closed on their own share triangles,
/// but not all, dropping one would open both: then all that do not cancel stay.
void dropDuplicates(DerivedMesh& made, MeshRepairs& repairs) {
  const Mesh& mesh = made.mesh;
  struct Corners {
    Triangle sorted;
    std::uint32_t triangle;
    bool even;  // the order of the corners is an even permutation of the sorted one
  };
  std::vector<Corners> all;
  all.reserve(mesh.triangles.size());
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    Triangle t = mesh.triangles[i];
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    const bool even = t[1] < t[2];
    if (!even) std::swap(t[1], t[2]);
    all.push_back({t, i, even});
  }
  std::sort(all.begin(), all.end(), [](const Corners& a, const Corners& b) {
    return std::tie(a.sorted, a.triangle) < std::tie(b.sorted, b.triangle);
  });
  std::vector<bool> drop(mesh.triangles.size(), false);
  std::vector<std::uint32_t> walls;
  std::vector<std::uint32_t> others;  // that face the way of the one that stays, and do not cancel
  for (auto begin = all.begin(); begin != all.end();) {
    const auto end =
        std::find_if(begin, all.end(), [&](const Corners& c) { return c.sorted != begin->sorted; });
    const auto even = std::count_if(begin, end, [](const Corners& c) { return c.even; });
    const auto odd = (end - begin) - even;
    const auto stays = std::find_if(
        begin, end, [&](const Corners& c) { return even == odd || c.even == (even > odd); });
    for (auto it = begin; it != end; ++it) drop[it->triangle] = it != stays;
    if (even == odd) walls.push_back(stays->triangle);
    auto left = std::abs(even - odd) - 1;
    for (auto it = stays; left > 0 && ++it != end;) {
      if (it->even != stays->even) continue;
      others.push_back(it->triangle);
      --left;
    }
    begin = end;
  }
  if (4 * walls.size() < mesh.triangles.size()) {
    for (const std::uint32_t wall : walls) drop[wall] = true;
    if (!others.empty() && isBalanced(mesh) && !isBalanced(remaining(mesh, drop)))
      for (const std::uint32_t other : others) drop[other] = false;
  }
  const std::size_t before = drop.size();
  dropTriangles(made, [&drop](std::uint32_t i) { return drop[i]; });
  repairs.duplicate_triangles += before - mesh.triangles.size();
}

/// Turns triangles to agree across the edges at which two meet. Returns the part of every triangle:
/// those connected by such edges.
std::vector<std::uint32_t> orient(Mesh& mesh, MeshRepairs& repairs) {
  const MeshEdges edges(mesh);
  const auto count = static_cast<std::uint32_t>(mesh.triangles.size());
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> edge_of(3 * std::size_t{count}, none);
  for (std::uint32_t e = 0; e < edges.size(); ++e)
    if (edges.halves(e).size() == 2)
      for (const std::uint32_t half : edges.halves(e)) edge_of[half] = e;

  std::vector<std::uint32_t> part(count, none);
  std::vector<bool> flip(count, false);
  std::uint32_t parts = 0;
  std::vector<std::uint32_t> members;
  for (std::uint32_t seed = 0; seed < count; ++seed) {
    if (part[seed] != none) continue;
    members.assign(1, seed);
    part[seed] = parts;
    std::size_t flipped = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const std::uint32_t triangle = members[i];
      flipped += flip[triangle];
      for (std::uint32_t side = 0; side < 3; ++side) {
        const std::uint32_t half = 3 * triangle + side;
        if (edge_of[half] == none) continue;
        const auto both = edges.halves(edge_of[half]);
        const std::uint32_t other = both[0] == half ? both[1] : both[0];
        if (part[other / 3] != none) continue;
        const bool agree = mesh.triangles[triangle][side] != mesh.triangles[other / 3][other % 3];
        flip[other / 3] = flip[triangle] == agree;
        part[other / 3] = parts;
        members.push_back(other / 3);
      }
    }
    const bool turn_all = 2 * flipped > members.size();
    for (const std::uint32_t triangle : members) {
      if (flip[triangle] == turn_all) continue;
      std::swap(mesh.triangles[triangle][1], mesh.triangles[triangle][2]);
      ++repairs.flipped_triangles;
    }
    ++parts;
  }
  return part;
}

/// Returns for every part whether turning it would open sides that others meet: where shells share
/// a face but not its triangles, the face is a part of its own, which has no inside.
std::vector<bool> boundParts(const Mesh& mesh, const std::vector<std::uint32_t>& part,
                             std::size_t count) {
  std::vector<bool> bound(count, false);
  const MeshEdges edges(mesh);
  std::map<std::uint32_t, int> surplus;  // of each part at an edge
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    if (edges.halves(e).size() < 3 || edges.surplus(mesh, e) != 0) continue;
    surplus.clear();
    for (const std::uint32_t half : edges.halves(e))
      surplus[part[half / 3]] += mesh.triangles[half / 3][half % 3] == edges[e].from ? 1 : -1;
    for (const auto& [some, own] : surplus)
      if (own != 0) bound[some] = true;
  }
  return bound;
}

/// The parts of a mesh: triangles that are connected.
class ConnectedParts {
 public:
  /// \param part  of every triangle
  ConnectedParts(Mesh& mesh, const std::vector<std::uint32_t>& part) : mesh_(mesh) {
    const std::size_t count = part.empty() ? 0 : *std::max_element(part.begin(), part.end()) + 1;
    parts_.resize(count);
    bounds_.resize(count);
    for (std::uint32_t i = 0; i < part.size(); ++i) {
      parts_[part[i]].triangles.push_back(i);
      for (const std::uint32_t v : mesh.triangles[i]) bounds_[part[i]].expand(mesh.vertices[v]);
    }
    std::vector<std::uint32_t> all(count);
    std::iota(all.begin(), all.end(), 0U);
    tree_ = BoxTree(bounds_, std::move(all));
  }

  [[nodiscard]] std::size_t size() const { return parts_.size(); }

  [[nodiscard]] double volumeOf(std::size_t part) const {
    const Vec3d centre = bounds_[part].getCenter();
    double volume = 0;
    for (const std::uint32_t i : parts_[part].triangles)
      volume += volumeFrom(centre, mesh_, mesh_.triangles[i]);
    return volume;
  }

  /// Whether a place of the part lies inside of others: their winding number there is beyond ½.
  bool isSurrounded(std::size_t part) {
    const Triangle& first = mesh_.triangles[parts_[part].triangles.front()];
    const Vec3d p =
        (mesh_.vertices[first[0]] + mesh_.vertices[first[1]] + mesh_.vertices[first[2]]) / 3;
    std::vector<std::uint32_t> around;
    tree_.visit([&](const BoxTree::Box& box) { return box.isInside(bounds_[part]); },
                [&](std::uint32_t other) {
                  if (other != part) around.push_back(other);
                  return true;
                });
    std::sort(around.begin(), around.end());
    double number = 0;
    for (const std::uint32_t other : around) number += closeNumber(other, p);
    if (std::abs(std::abs(number) - 0.5) < 0.001 * static_cast<double>(around.size())) {
      number = 0;
      for (const std::uint32_t other : around) number += exactNumber(other, p);
    }
    return std::abs(number) > 0.5;
  }

  void turn(std::size_t part) {
    for (const std::uint32_t i : parts_[part].triangles)
      std::swap(mesh_.triangles[i][1], mesh_.triangles[i][2]);
    parts_[part].winding.reset();
  }

 private:
  /// The winding number of a part of many triangles, by groups of them.
  struct GroupedWinding {
    Mesh mesh;
    WindingNumber number{mesh};
    explicit GroupedWinding(Mesh own) : mesh(std::move(own)) {}
  };
  struct Part {
    std::vector<std::uint32_t> triangles;
    std::unique_ptr<GroupedWinding> winding;  ///< once it is asked for
  };

  [[nodiscard]] double exactNumber(std::uint32_t part, const Vec3d& p) const {
    return windingOf(mesh_, parts_[part].triangles, p);
  }

  double closeNumber(std::uint32_t part, const Vec3d& p) {
    constexpr std::size_t few = 64;
    Part& own = parts_[part];
    if (own.triangles.size() < few) return exactNumber(part, p);
    if (!own.winding) {
      Mesh alone;
      for (const std::uint32_t i : own.triangles) {
        const auto first = static_cast<std::uint32_t>(alone.vertices.size());
        for (const std::uint32_t v : mesh_.triangles[i])
          alone.vertices.push_back(mesh_.vertices[v]);
        alone.triangles.push_back({first, first + 1, first + 2});
      }
      own.winding = std::make_unique<GroupedWinding>(std::move(alone));
    }
    return own.winding->number.closelyAt(p);
  }

  Mesh& mesh_;
  std::vector<Part> parts_;
  std::vector<BoxTree::Box> bounds_;
  BoxTree tree_;
};

/// Turns the parts of negative volume that no other part surrounds.
void turnInsideOut(Mesh& mesh, const std::vector<std::uint32_t>& part, MeshRepairs& repairs) {
  ConnectedParts parts(mesh, part);
  std::vector<std::size_t> negative;
  for (std::size_t i = 0; i < parts.size(); ++i)
    if (parts.volumeOf(i) < 0) negative.push_back(i);
  if (negative.empty()) return;
  const std::vector<bool> bound = boundParts(mesh, part, parts.size());
  for (const std::size_t i : negative) {
    if (bound[i] || parts.isSurrounded(i)) continue;
    parts.turn(i);
    ++repairs.turned_parts;
  }
}

/// Returns the loops of the borders, split wherever they touch themselves.
std::vector<HoleLoop> holesOf(const Mesh& mesh, MeshRepairs& repairs) {
  std::vector<HoleLoop> loops;
  std::map<std::uint32_t, std::vector<std::uint32_t>> next;  // directed against the borders
  for (const Border& border : bordersOf(mesh, MeshEdges(mesh))) {
    repairs.boundary_edges += static_cast<std::uint64_t>(border.count);
    next[border.to].insert(next[border.to].end(), static_cast<std::size_t>(border.count),
                           border.from);
  }
  std::map<std::uint32_t, std::size_t> place;  // in the path
  for (auto& [start, ways] : next) {
    while (!ways.empty()) {
      std::vector<std::uint32_t> path{start};
      place = {{start, 0}};
      while (!path.empty()) {
        std::vector<std::uint32_t>& onward = next[path.back()];
        if (onward.empty()) break;  // back at the start
        const std::uint32_t v = onward.back();
        onward.pop_back();
        const auto seen = place.find(v);
        if (seen == place.end()) {
          place[v] = path.size();
          path.push_back(v);
          continue;
        }
        loops.emplace_back(path.begin() + static_cast<std::ptrdiff_t>(seen->second), path.end());
        for (const std::uint32_t w : loops.back())
          if (w != v) place.erase(w);
        path.resize(seen->second + 1);
      }
    }
  }
  return loops;
}

void closeHoles(Mesh& mesh, MeshRepairs& repairs) {
  const std::vector<HoleLoop> loops = holesOf(mesh, repairs);
  const std::size_t given = mesh.triangles.size();
  // The time for better fillings is lost on a surface that bounds nothing.
  bool bounds_volume = !repairs.areOfLooseTriangles(given);
  if (bounds_volume && !loops.empty()) {
    Mesh fanned = mesh;
    fillWithFans(fanned, loops);
    bounds_volume = enclosureOf(fanned, fanned.triangles.size() - given).boundsVolume();
  }
  if (bounds_volume) {
    fillWhereNumberIsHalf(mesh, loops);
  } else {
    fillWithFans(mesh, loops);
  }
  repairs.closed_holes += loops.size();
  repairs.filling_triangles = mesh.triangles.size() - given;
}

}  // namespace

std::vector<std::string> MeshRepairs::lines() const {
  std::vector<std::string> lines;
  const auto tell = [&](std::uint64_t count, const char* one, const char* many) {
    if (count > 0) lines.push_back(std::to_string(count) + ' ' + (count == 1 ? one : many));
  };
  tell(welded_vertices, "vertex at a border welded to one within a micrometre",
       "vertices at borders welded to others within a micrometre");
  tell(degenerate_triangles, "degenerate triangle dropped", "degenerate triangles dropped");
  tell(duplicate_triangles, "duplicate triangle dropped", "duplicate triangles dropped");
  tell(flipped_triangles, "triangle turned to agree with its neighbours",
       "triangles turned to agree with their neighbours");
  tell(turned_parts, "part turned that was inside out", "parts turned that were inside out");
  tell(boundary_edges, "boundary edge", "boundary edges");
  tell(closed_holes, "hole filled", "holes filled");
  tell(swallowed_triangles, "triangle within the solid is no surface",
       "triangles within the solid are no surface");
  tell(cut_triangles, "triangle lies partly within the solid",
       "triangles lie partly within the solid");
  return lines;
}

DerivedMesh repaired(DerivedMesh triangles, MeshRepairs& repairs) {
  weldEqual(triangles, repairs);
  weldBorders(triangles, repairs);
  dropDuplicates(triangles, repairs);
  const std::vector<std::uint32_t> part = orient(triangles.mesh, repairs);
  turnInsideOut(triangles.mesh, part, repairs);
  closeHoles(triangles.mesh, repairs);
  triangles.source.resize(triangles.mesh.triangles.size(), no_source);
  return triangles;
}

DerivedMesh withoutDuplicates(DerivedMesh triangles, MeshRepairs& repairs) {
  weldEqual(triangles, repairs);
  dropDuplicates(triangles, repairs);
  return triangles;
}

}  // namespace vdbdither
