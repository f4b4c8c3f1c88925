// Distance by characteristic regions: the point of the mesh nearest to any point in space lies on a
// face whose prism holds that point, on an edge whose wedge holds it, or on a vertex whose cone
// holds it (S. Mauch, "A fast algorithm for computing the closest point and distance transform",
// Caltech 2000). The regions are the intersections of half-spaces that follow from the first-order
// condition for any set of triangles, so that they are right for open and non-manifold meshes too:
// a wedge lies beyond every face of its edge, a cone beyond every edge of its vertex.

#include "ops/kernels/distance/mesh_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/mesh/closest_point.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// How far regions reach beyond their borders, mm: far above the rounding at 1 m, and below the
/// tolerance of distances. Thinner features need no region.
constexpr double slack_mm = 1e-7;

/// Triangles lower than this are represented by their edges alone.
constexpr double least_height_mm = 1e-7;

/// The maximum bend at an edge or a vertex that faces represent.
constexpr double greatest_bend = 0.06;
constexpr double abrupt = 2;

constexpr std::uint32_t block_size = 256;

double manhattanLength(const Vec3d& v) {
  return std::abs(v.x()) + std::abs(v.y()) + std::abs(v.z());
}

LinearForm formThrough(const Vec3d& gradient, const Vec3d& point) {
  return {gradient, -gradient.dot(point)};
}

/// Returns the half-space into which `gradient` points from `point`, widened a little.
LinearForm halfSpace(const Vec3d& gradient, const Vec3d& point) {
  return {gradient, slack_mm * manhattanLength(gradient) - gradient.dot(point)};
}

/// Returns the unit normal; for slivers from the longest side and the height on it, which stays
/// accurate.
Vec3d faceNormal(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  std::array<Vec3d, 3> corners{a, b, c};
  const std::array<double, 3> lengths{(b - a).lengthSqr(), (c - b).lengthSqr(),
                                      (a - c).lengthSqr()};
  const double longest = *std::max_element(lengths.begin(), lengths.end());
  const Vec3d twice_area = (b - a).cross(c - a);
  const double squared = twice_area.lengthSqr();
  constexpr double sliver = 1e-6;
  if (squared > sliver * longest * longest && longest > sliver)
    return twice_area / std::sqrt(squared);
  std::rotate(
      corners.begin(),
      corners.begin() + (std::max_element(lengths.begin(), lengths.end()) - lengths.begin()),
      corners.end());
  const Vec3d side = corners[1] - corners[0];
  const double length = side.length();
  if (!(length > least_height_mm)) return {0, 0, 0};
  const Vec3d along = side / length;
  const Vec3d over = corners[2] - corners[0];
  const Vec3d height = over - along * over.dot(along);
  const double rise = height.length();
  if (!(rise > least_height_mm)) return {0, 0, 0};
  return along.cross(height / rise);
}

Vec3d anyPerpendicular(const Vec3d& unit) {
  const Vec3d other = std::abs(unit.x()) < 0.6 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
  const Vec3d across = unit.cross(other);
  return across / across.length();
}

Vec3d magnitudes(const Vec3d& v) { return {std::abs(v.x()), std::abs(v.y()), std::abs(v.z())}; }

Vec3d componentMin(const Vec3d& a, const Vec3d& b) { return openvdb::math::minComponent(a, b); }
Vec3d componentMax(const Vec3d& a, const Vec3d& b) { return openvdb::math::maxComponent(a, b); }

}  // namespace

MeshFeatures::MeshFeatures(const Mesh& mesh, const SwallowedWalls& walls, const Vec3d& origin_mm,
                           double layer_mm, double row_mm, double maximum_mm)
    : mesh_(sorted(mesh, walls, origin_mm, layer_mm, row_mm)),
      edges_(mesh_, features_),
      maximum_mm_(maximum_mm) {
  findNormals();
  findNeighbours();
  findOwned();
  findBlocks();
}

double MeshFeatures::memoryBytes() const {
  const auto bytes = [](const auto& vector) {
    return static_cast<double>(vector.capacity() * sizeof(vector[0]));
  };
  return bytes(mesh_.vertices) + bytes(mesh_.triangles) + bytes(normals_) + edges_.memoryBytes() +
         bytes(first_edge_) + bytes(vertex_edges_) + bytes(side_edges_) + bytes(owned_) +
         bytes(bend_) + bytes(original_) + bytes(blocks_);
}

void MeshFeatures::findNormals() {
  normals_.resize(mesh_.triangles.size());
  tbb::parallel_for(std::size_t{0}, normals_.size(), [this](std::size_t i) {
    const auto t = static_cast<std::uint32_t>(i);
    normals_[i] = faceNormal(corner(t, 0), corner(t, 1), corner(t, 2));
  });
}

void MeshFeatures::findNeighbours() {
  first_edge_.assign(mesh_.vertices.size() + 1, 0);
  const std::uint32_t count = edges_.size();
  for (std::uint32_t e = 0; e < count; ++e) {
    ++first_edge_[edges_[e].from + 1];
    ++first_edge_[edges_[e].to + 1];
  }
  for (std::size_t v = 0; v < mesh_.vertices.size(); ++v) first_edge_[v + 1] += first_edge_[v];
  vertex_edges_.resize(first_edge_.back());
  std::vector<std::uint32_t> next(first_edge_.begin(), first_edge_.end() - 1);
  for (std::uint32_t e = 0; e < count; ++e) {
    vertex_edges_[next[edges_[e].from]++] = e;
    vertex_edges_[next[edges_[e].to]++] = e;
  }
}

/// Returns the sine of half the angle between the two faces at an edge, or `abrupt` if it does not
/// have two faces.
///
/// A point nearest to the edge lies in a direction between the normals of the faces; this is the
/// maximum difference from the nearer one.
double MeshFeatures::bendAtEdge(std::uint32_t edge) const {
  const auto halves = edges_.halves(edge);
  if (halves.size() != 2) return abrupt;
  const auto start = [&](std::size_t i) { return mesh_.triangles[halves[i] / 3][halves[i] % 3]; };
  const Vec3d& a = normals_[halves[0] / 3];
  const Vec3d& b = normals_[halves[1] / 3];
  if (start(0) == start(1) || !(a.dot(b) > 0)) return abrupt;
  return 0.5 * (a - b).length();
}

/// Returns the same for a vertex with faces all around it.
///
/// Let the normals n of the faces differ from their mean N by an angle of at most φ. Seen along N,
/// the surface at the vertex is then a function f with the gradients of the faces. A point nearest
/// to the vertex lies in the direction (−r, 1) of a plane that bounds f from above, r · x ≥ f(x)
/// for all x, or of one that bounds it from below. If r were not between the gradients g, some x
/// would have g · x > r · x for all of them, and so f(x) > r · x. The direction is therefore a sum
/// of normals, u = s Σ λ n with s ≤ 1 / cos φ. If it differed from all of them by more than φ, then
/// u · u = s Σ λ n · u would be less than 1.
double MeshFeatures::bendAtVertex(std::uint32_t vertex, const std::vector<float>& at_edge) const {
  const std::span around(vertex_edges_.data() + first_edge_[vertex],
                         first_edge_[vertex + 1] - first_edge_[vertex]);
  Vec3d mean(0, 0, 0);
  // At the vertex, the corner of exactly one face begins with each edge.
  const auto normalAfter = [&](std::uint32_t edge) -> const Vec3d& {
    const auto halves = edges_.halves(edge);
    const bool first = mesh_.triangles[halves[0] / 3][halves[0] % 3] == vertex;
    return normals_[halves[first ? 0 : 1] / 3];
  };
  for (const std::uint32_t edge : around) {
    if (at_edge[edge] > greatest_bend) return abrupt;
    mean += normalAfter(edge);
  }
  if (!mean.normalize()) return abrupt;
  double cosine = 1;
  for (const std::uint32_t edge : around) cosine = std::min(cosine, normalAfter(edge).dot(mean));
  return cosine > 0 ? std::sqrt(std::max(0.0, 1 - cosine * cosine)) : abrupt;
}

/// Assigns to every triangle the edges and vertices that it owns, and the bend of the others.
void MeshFeatures::findOwned() {
  const auto vertices = static_cast<std::uint32_t>(mesh_.vertices.size());
  const auto triangles = static_cast<std::uint32_t>(mesh_.triangles.size());
  std::vector<float> at_edge(edges_.size());
  std::vector<float> at_vertex(vertices);
  std::vector<std::uint32_t> owner(vertices, std::numeric_limits<std::uint32_t>::max());
  side_edges_.assign(std::size_t{3} * triangles, 0);
  owned_.assign(triangles, 0);
  bend_.assign(triangles, 0);
  tbb::parallel_for(std::uint32_t{0}, edges_.size(), [&](std::uint32_t e) {
    for (const std::uint32_t half : edges_.halves(e)) side_edges_[half] = e;
    at_edge[e] = static_cast<float>(bendAtEdge(e));
  });
  tbb::parallel_for(std::uint32_t{0}, vertices, [&](std::uint32_t v) {
    at_vertex[v] = static_cast<float>(bendAtVertex(v, at_edge));
    if (at_vertex[v] <= greatest_bend) return;
    for (std::uint32_t i = first_edge_[v]; i < first_edge_[v + 1]; ++i)
      owner[v] = std::min(owner[v], edges_.halves(vertex_edges_[i]).front() / 3);
  });
  // Hidden triangles own none.
  tbb::parallel_for(std::uint32_t{0}, features_, [&](std::uint32_t t) {
    const auto look = [&](float bend, bool first, unsigned bit) {
      if (bend <= greatest_bend) {
        bend_[t] = std::max(bend_[t], bend);
      } else if (first) {
        owned_[t] |= static_cast<std::uint8_t>(1U << bit);
      }
    };
    for (unsigned side = 0; side < 3; ++side) {
      const std::uint32_t v = mesh_.triangles[t][side];
      look(at_vertex[v], owner[v] == t, side + 3);
      if (v == mesh_.triangles[t][(side + 1) % 3]) continue;
      const std::uint32_t half = 3 * t + side;
      const std::uint32_t edge = side_edges_[half];
      look(at_edge[edge], edges_.halves(edge).front() == half, side);
    }
  });
}

/// Returns the mesh with its triangles in order and its vertices in the order of their first use,
/// so that data used together lies together. Unused vertices are omitted.
Mesh MeshFeatures::sorted(const Mesh& mesh, const SwallowedWalls& walls, const Vec3d& origin_mm,
                          double layer_mm, double row_mm) {
  Mesh sorted;
  const auto given = static_cast<std::uint32_t>(mesh.triangles.size());
  const auto count = given + static_cast<std::uint32_t>(walls.pieces.triangles.size());
  if (given == 0) return sorted;
  const auto first_piece = static_cast<std::uint32_t>(mesh.vertices.size());
  const auto triangleAt = [&](std::uint32_t t) {
    if (t < given) return mesh.triangles[t];
    Mesh::Triangle piece = walls.pieces.triangles[t - given];
    for (std::uint32_t& v : piece) v += first_piece;
    return piece;
  };
  const auto vertexAt = [&](std::uint32_t v) -> const Vec3d& {
    return v < first_piece ? mesh.vertices[v] : walls.pieces.vertices[v - first_piece];
  };
  Vec3d low = mesh.vertices.front();
  Vec3d high = low;
  for (const Vec3d& p : mesh.vertices) {
    low = componentMin(low, p);
    high = componentMax(high, p);
  }
  const double layer_bin_mm = std::max(layer_mm, (high - low).z() / 1e4);
  const double row_bin_mm = std::max(row_mm, (high - low).y() / 1e2);
  const auto rows = static_cast<std::uint32_t>((high - low).y() / row_bin_mm) + 1;
  const auto layers = static_cast<std::uint32_t>((high - low).z() / layer_bin_mm) + 1;
  const std::uint32_t group = rows * layers;  // whole triangles, pieces, hidden triangles
  std::vector<std::uint32_t> bins(count);
  std::vector<std::uint32_t> first(std::size_t{3} * group + 1, 0);
  for (std::uint32_t t = 0; t < count; ++t) {
    const Mesh::Triangle triangle = triangleAt(t);
    const Vec3d corner = componentMin(componentMin(vertexAt(triangle[0]), vertexAt(triangle[1])),
                                      vertexAt(triangle[2]));
    const auto binOf = [](double along, double bin_mm, std::uint32_t end) {
      return std::min(static_cast<std::uint32_t>(std::max(0.0, along / bin_mm)), end - 1);
    };
    bins[t] = binOf(corner.z() - low.z(), layer_bin_mm, layers) * rows +
              binOf(corner.y() - low.y(), row_bin_mm, rows);
    if (t >= given) {
      bins[t] += group;
    } else if (!walls.hidden.empty() && walls.hidden[t]) {
      bins[t] += 2 * group;
    }
    ++first[bins[t] + 1];
  }
  for (std::size_t bin = 1; bin < first.size(); ++bin) first[bin] += first[bin - 1];
  whole_ = first[group];
  features_ = first[std::size_t{2} * group];
  std::vector<std::uint32_t> order(count);
  for (std::uint32_t t = 0; t < count; ++t) order[first[bins[t]]++] = t;

  constexpr std::uint32_t unseen = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> renumbered(first_piece + walls.pieces.vertices.size(), unseen);
  sorted.triangles.reserve(count);
  sorted.vertices.reserve(renumbered.size());
  original_.reserve(count);
  for (const std::uint32_t t : order) {
    original_.push_back(t < given ? t : walls.piece_of[t - given]);
    Mesh::Triangle triangle = triangleAt(t);
    for (std::uint32_t& v : triangle) {
      if (renumbered[v] == unseen) {
        renumbered[v] = static_cast<std::uint32_t>(sorted.vertices.size());
        sorted.vertices.push_back(vertexAt(v) - origin_mm);
      }
      v = renumbered[v];
    }
    sorted.triangles.push_back(triangle);
  }
  return sorted;
}

void MeshFeatures::findBlocks() {
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  for (std::uint32_t begin = 0; begin < count; begin += block_size) {
    Extent block = extent(begin, 2);
    for (std::uint32_t t = begin; t < std::min(begin + block_size, count); ++t) {
      const Extent one = extent(t, 2);
      block = {std::min(block.low, one.low), std::max(block.high, one.high)};
    }
    blocks_.push_back(block);
  }
}

std::vector<std::uint32_t> MeshFeatures::collect(double low, double high) const {
  std::vector<std::uint32_t> found;
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  for (std::uint32_t b = 0; b < blocks_.size(); ++b) {
    if (blocks_[b].low > high || blocks_[b].high < low) continue;
    for (std::uint32_t t = b * block_size; t < std::min((b + 1) * block_size, count); ++t) {
      const Extent one = extent(t, 2);
      if (one.low <= high && one.high >= low) found.push_back(t);
    }
  }
  return found;
}

MeshFeature MeshFeatures::describe(Id id) const {
  switch (id.kind()) {
    case Kind::face:
      return describeFace(id.index());
    case Kind::edge:
      return describeEdge(id.index());
    case Kind::vertex:
      return describeVertex(id.index());
  }
  return {};
}

MeshFeature MeshFeatures::describeFace(std::uint32_t triangle) const {
  const Vec3d& n = normals_[triangle];
  MeshFeature face;
  face.min =
      componentMin(componentMin(corner(triangle, 0), corner(triangle, 1)), corner(triangle, 2));
  face.max =
      componentMax(componentMax(corner(triangle, 0), corner(triangle, 1)), corner(triangle, 2));
  face.below = face.above = magnitudes(n);
  if (n == Vec3d(0, 0, 0)) return face;
  face.rank = 1;
  face.bounds = 3;
  face.distance[0] = formThrough(n, corner(triangle, 0));
  // The same for all distances, so that no voxel depends on the block in which it is made.
  face.spread_mm = slack_mm + maximum_mm_ * double{bend_[triangle]};
  for (int side = 0; side < 3; ++side) {
    const Vec3d& a = corner(triangle, side);
    Vec3d along = corner(triangle, (side + 1) % 3) - a;
    const double length_mm = along.length();
    along /= length_mm;
    const Vec3d outward = along.cross(n);
    const auto s = static_cast<std::size_t>(side);
    face.side[s] = {formThrough(outward, a), formThrough(along, a), length_mm};
    face.bound[s] = {-outward, face.spread_mm - face.side[s].outward.constant};
  }
  return face;
}

MeshFeature MeshFeatures::describeEdge(std::uint32_t index) const {
  const MeshEdges::Edge& edge = edges_[index];
  const Vec3d& a = mesh_.vertices[edge.from];
  const Vec3d& b = mesh_.vertices[edge.to];
  MeshFeature feature;
  feature.min = componentMin(a, b);
  feature.max = componentMax(a, b);
  feature.below = feature.above = Vec3d(1, 1, 1);
  const double length = (b - a).length();
  if (!(length > 0)) return feature;  // its two vertices represent it
  const Vec3d along = (b - a) / length;

  feature.rank = 2;
  feature.bound[0] = halfSpace(along, a);
  feature.bound[1] = halfSpace(-along, b);
  feature.bounds = 2;
  std::array<Vec3d, 2> normals;
  std::array<Vec3d, 2> outwards;
  std::uint32_t faces = 0;
  for (const std::uint32_t half : edges_.halves(index)) {
    const std::uint32_t triangle = half / 3;
    const Vec3d& n = normals_[triangle];
    if (n == Vec3d(0, 0, 0)) continue;
    const bool forward = mesh_.triangles[triangle][half % 3] == edge.from;
    const Vec3d outward = forward ? along.cross(n) : n.cross(along);
    if (faces < 2) {
      normals[faces] = n;
      outwards[faces] = outward;
    }
    ++faces;
    if (feature.bounds < MeshFeature::max_bounds)
      feature.bound[static_cast<std::size_t>(feature.bounds++)] = halfSpace(outward, a);
  }
  const Vec3d across = faces > 0 ? normals[0] : anyPerpendicular(along);
  feature.distance[0] = formThrough(across, a);
  feature.distance[1] = formThrough(along.cross(across), a);
  if (faces == 2) {
    const Vec3d first = outwards[1].dot(normals[0]) < 0 ? -normals[0] : normals[0];
    const Vec3d second = outwards[0].dot(normals[1]) < 0 ? -normals[1] : normals[1];
    feature.is_ridge = outwards[1].dot(normals[0]) > 0 && outwards[0].dot(normals[1]) > 0;
    const double cosine = first.dot(second);
    if (cosine > 0.1) {
      // No direction between the two reaches farther along an axis than one of them or `tip`.
      const Vec3d middle = first + second;
      const Vec3d tip = middle * (1 / (1 + cosine));
      const Vec3d none(0, 0, 0);
      feature.above = componentMax(componentMax(first, second), componentMax(tip, none));
      feature.below = -componentMin(componentMin(first, second), componentMin(tip, none));
      feature.capped = true;
      feature.cap = formThrough(middle / middle.length(), a);
    }
  }
  return feature;
}

MeshFeature MeshFeatures::describeVertex(std::uint32_t index) const {
  const Vec3d& p = mesh_.vertices[index];
  MeshFeature feature;
  feature.min = feature.max = p;
  feature.below = feature.above = Vec3d(1, 1, 1);
  feature.rank = 3;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Vec3d unit(0, 0, 0);
    unit[static_cast<int>(axis)] = 1;
    feature.distance[axis] = formThrough(unit, p);
  }
  for (std::uint32_t i = first_edge_[index]; i < first_edge_[index + 1]; ++i) {
    if (feature.bounds == MeshFeature::max_bounds) break;
    const MeshEdges::Edge& edge = edges_[vertex_edges_[i]];
    const Vec3d& other = mesh_.vertices[edge.from == index ? edge.to : edge.from];
    feature.bound[static_cast<std::size_t>(feature.bounds++)] = halfSpace(p - other, p);
  }
  return feature;
}

MeshFeatures::Nearest MeshFeatures::nearest(Id id, const Vec3d& p) const {
  const auto atVertex = [&](std::uint32_t vertex) {
    return Nearest{p - mesh_.vertices[vertex], lowestAtVertex(vertex)};
  };
  const auto atEdge = [&](std::uint32_t edge) {
    const Vec3d& a = mesh_.vertices[edges_[edge].from];
    const Vec3d along = mesh_.vertices[edges_[edge].to] - a;
    return Nearest{p - a - along * (along.dot(p - a) / along.lengthSqr()), lowestAtEdge(edge)};
  };
  if (id.kind() == Kind::vertex) return atVertex(id.index());
  if (id.kind() == Kind::edge) return atEdge(id.index());
  const std::uint32_t triangle = id.index();
  const PlaceOnTriangle at =
      nearestPlace(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2), p);
  if (at.corner()) return atVertex(mesh_.triangles[triangle][*at.corner()]);
  if (at.side()) return atEdge(side_edges_[3 * triangle + *at.side()]);
  const Vec3d& n = normals_[triangle];
  return {n * n.dot(p - corner(triangle, 0)), triangle};
}

Vec3d MeshFeatures::minimumNormal(std::uint32_t triangle) const {
  const Vec3d& normal = normals_[triangle];
  Vec3d minimum = magnitudes(normal);
  if (!hasFeatures(triangle)) return minimum;
  const Mesh::Triangle& corners = mesh_.triangles[triangle];
  for (std::uint32_t side = 0; side < 3; ++side) {
    if (corners[side] == corners[(side + 1) % 3]) continue;
    const std::uint32_t half = 3 * triangle + side;
    const auto halves = edges_.halves(side_edges_[half]);
    // Unknown at borders and where more than two faces meet.
    if (halves.size() != 2) return {0, 0, 0};
    const std::uint32_t other = halves[halves[0] == half ? 1 : 0];
    const bool turned = mesh_.triangles[other / 3][other % 3] == corners[side];
    for (int axis = 0; axis < 3; ++axis) {
      const double across = turned ? -normals_[other / 3][axis] : normals_[other / 3][axis];
      minimum[axis] = normal[axis] * across > 0 ? std::min(minimum[axis], std::abs(across)) : 0;
    }
  }
  return minimum;
}

/// A triangle without area comes last, because it has no normal.
bool MeshFeatures::comesBefore(std::uint32_t one, std::uint32_t other) const {
  const auto place = [&](std::uint32_t triangle) {
    return std::pair(normals_[triangle] == Vec3d(0, 0, 0), original_[triangle]);
  };
  return place(one) < place(other);
}

std::uint32_t MeshFeatures::lowestAtEdge(std::uint32_t edge) const {
  const auto halves = edges_.halves(edge);
  return *std::min_element(halves.begin(), halves.end(), [&](std::uint32_t a, std::uint32_t b) {
    return comesBefore(a / 3, b / 3);
  }) / 3;
}

std::uint32_t MeshFeatures::lowestAtVertex(std::uint32_t vertex) const {
  std::uint32_t lowest = lowestAtEdge(vertex_edges_[first_edge_[vertex]]);
  for (std::uint32_t i = first_edge_[vertex] + 1; i < first_edge_[vertex + 1]; ++i) {
    const std::uint32_t other = lowestAtEdge(vertex_edges_[i]);
    if (comesBefore(other, lowest)) lowest = other;
  }
  return lowest;
}

}  // namespace vdbdither
