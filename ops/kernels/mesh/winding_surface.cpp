// By dual contouring of an octree of leaves of any size beside each other, whose dual is closed
// whatever their sizes (Ju, Losasso, Schaefer, Warren: "Dual Contouring of Hermite Data", 2002).

#include "ops/kernels/mesh/winding_surface.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <openvdb/math/BBox.h>

#include "ops/kernels/mesh/grid_keys.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/progress_part.h"
#include "ops/kernels/mesh/winding_cells.h"
#include "ops/kernels/mesh/winding_number.h"
#include "ops/kernels/mesh/winding_octree.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// Cells along the longest side of the triangles' bounding box.
constexpr int most_along_longest = 64;
constexpr int least_along_longest = 16;
/// How many triangles may be looked at, at 20 to 40 ns each: to find cells, and then to divide
/// them.
constexpr std::size_t least_work = 40'000'000;
constexpr std::size_t work_per_triangle = 1500;
constexpr double most_touches = 1e7;

/// About how many cells the triangles meet, a cell counted for each of them.
double touches(const Mesh& mesh, const openvdb::math::BBox<Vec3d>& bounds, int along_longest) {
  const double cell_mm = bounds.extents()[static_cast<int>(bounds.maxExtent())] / along_longest;
  double sum = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = cornersOf(mesh, t);
    const double around_mm = (b - a).length() + (c - b).length() + (a - c).length();
    const double area_mm2 = 0.5 * (b - a).cross(c - a).length();
    sum += 1 + around_mm / cell_mm + 1.5 * area_mm2 / (cell_mm * cell_mm);
  }
  return sum;
}

/// A cut edge that no smaller leaf lies beside, and the leaves around it.
struct CutEdge {
  Key key;
  std::array<std::uint32_t, 4> leaves;
};

std::vector<CutEdge> cutEdgesOf(const WindingOctree& octree) {
  std::vector<Key> keys;
  for (const WindingOctree::Leaf& leaf : octree.leaves()) {
    if (leaf.divided) continue;
    for (int e = 0; e < 12; ++e)
      if (WindingOctree::isCut(leaf, e))
        keys.push_back(WindingOctree::edgeKey(WindingOctree::edgeOf(leaf, e)));
  }
  sortUnique(keys);
  std::vector<CutEdge> cut(keys.size());
  forAll(keys.size(), [&](std::size_t i) {
    const WindingOctree::Edge edge = WindingOctree::edgeOf(keys[i]);
    cut[i].key = keys[i];
    for (int turn = 0; turn < 4; ++turn) {
      const std::uint32_t leaf = octree.leafBeside(edge, turn);
      if (octree.leaves()[leaf].size < edge.size) cut[i].key = 0;
      cut[i].leaves[static_cast<std::size_t>(turn)] = leaf;
    }
  });
  std::erase_if(cut, [](const CutEdge& edge) { return edge.key == 0; });
  return cut;
}

/// The dual of the octree: a vertex on every cut edge, one in every leaf that has such an edge, and
/// four triangles about each edge, which come from the triangle that the edge pierces.
DerivedMesh surfaceOf(const WindingOctree& octree) {
  const std::vector<CutEdge> cut = cutEdgesOf(octree);
  DerivedMesh made;
  Mesh& mesh = made.mesh;
  mesh.vertices.resize(cut.size());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> of_leaf;  // and which edge
  for (std::uint32_t i = 0; i < cut.size(); ++i) {
    mesh.vertices[i] = octree.crossingAt(cut[i].key).at;
    for (const std::uint32_t leaf : cut[i].leaves) of_leaf.emplace_back(leaf, i);
  }
  sortUnique(of_leaf);
  std::vector<std::uint32_t> begins;
  std::vector<std::uint32_t> vertex(octree.leaves().size(), WindingOctree::none);
  for (std::uint32_t i = 0; i < of_leaf.size(); ++i)
    if (i == 0 || of_leaf[i].first != of_leaf[i - 1].first) {
      vertex[of_leaf[i].first] = static_cast<std::uint32_t>(mesh.vertices.size() + begins.size());
      begins.push_back(i);
    }
  begins.push_back(static_cast<std::uint32_t>(of_leaf.size()));
  mesh.vertices.resize(cut.size() + begins.size() - 1);
  forAll(begins.size() - 1, [&](std::size_t i) {
    std::vector<EdgeCrossing> crossings;
    for (std::uint32_t c = begins[i]; c < begins[i + 1]; ++c)
      crossings.push_back(octree.crossingAt(cut[of_leaf[c].second].key));
    mesh.vertices[cut.size() + i] =
        octree.vertexOf(octree.leaves()[of_leaf[begins[i]].first], crossings);
  });
  mesh.triangles.reserve(4 * cut.size());
  made.source.reserve(4 * cut.size());
  for (std::uint32_t i = 0; i < cut.size(); ++i) {
    std::array<std::uint32_t, 4> around = cut[i].leaves;
    if (!octree.isInside(WindingOctree::edgeOf(cut[i].key).low)) std::swap(around[1], around[3]);
    for (std::size_t turn = 0; turn < 4; ++turn) {
      const std::uint32_t a = vertex[around[turn]];
      const std::uint32_t b = vertex[around[(turn + 1) % 4]];
      if (a != b) mesh.triangles.push_back({i, a, b});
    }
    made.source.resize(mesh.triangles.size(), octree.crossingAt(cut[i].key).triangle);
  }
  return made;
}

}  // namespace

WindingSurface windingSurface(const Mesh& triangles, const std::function<void(double)>& progress,
                              std::size_t max_leaves) {
  WindingSurface made;
  openvdb::math::BBox<Vec3d> bounds;
  for (const Mesh::Triangle& t : triangles.triangles)
    for (const std::uint32_t v : t) bounds.expand(triangles.vertices[v]);
  if (bounds.empty() || !(bounds.extents().length() > 0)) return made;

  const ProgressPart whole(progress);
  const WindingNumber winding(triangles);
  const std::size_t most_work =
      std::max(least_work, work_per_triangle * triangles.triangles.size());
  for (int along_longest = most_along_longest; along_longest >= least_along_longest;
       along_longest /= 2) {
    if (touches(triangles, bounds, along_longest) > most_touches) continue;
    WindingCells cells(triangles, winding, bounds, along_longest);
    const auto volume = [&](double side, const ProgressPart& part) -> std::optional<double> {
      WindingOctree coarse(WindingSolid(cells, side), 0, 0, 0);
      if (!coarse.grow(part, most_work)) return {};
      return volumeOf(surfaceOf(coarse).mesh);
    };
    const std::optional<double> outwards = volume(1, whole.part(0, 0.05));
    if (!outwards) continue;
    const std::optional<double> inwards = volume(-1, whole.part(0.05, 0.1));
    if (!inwards) continue;
    made.turned = *inwards > 2 * *outwards;
    WindingOctree fine(WindingSolid(cells, made.turned ? -1 : 1), WindingOctree::max_cuts,
                       max_leaves, 3 * most_work);
    fine.grow(whole.part(0.1, 1));
    made.cell_mm = fine.smallestMm();
    static_cast<DerivedMesh&>(made) = surfaceOf(fine);
    return made;
  }
  made.is_given_up = true;
  return made;
}

}  // namespace vdbdither
