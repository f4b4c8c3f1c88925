// Distance by characteristic regions: every point of space has its nearest point of the mesh on a
// face whose prism holds it, on an edge whose wedge holds it, or on a vertex whose cone holds it
// (S. Mauch, "A fast algorithm for computing the closest point and distance transform", Caltech
// 2000). The regions used here are the intersections of half-spaces that the first-order condition
// gives for any set of triangles, so they are right for open and non-manifold meshes too: a wedge
// lies beyond every face of its edge, a cone beyond every edge of its vertex.

#include "ops/kernels/mesh_features.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// How far regions reach over their borders, mm: far above the rounding at 1 m, below what a
/// distance may err. What is thinner needs no region of its own.
constexpr double slack_mm = 1e-7;

/// Triangles lower than this are told by their edges alone.
constexpr double least_height_mm = 1e-7;

constexpr std::uint32_t block_size = 256;

double manhattanLength(const Vec3d& v) {
  return std::abs(v.x()) + std::abs(v.y()) + std::abs(v.z());
}

LinearForm formThrough(const Vec3d& gradient, const Vec3d& point) {
  return {gradient, -gradient.dot(point)};
}

/// The half-space `gradient` points into from `point`, a little widened.
LinearForm halfSpace(const Vec3d& gradient, const Vec3d& point) {
  return {gradient, slack_mm * manhattanLength(gradient) - gradient.dot(point)};
}

/// Unit normal from the longest side and the height on it, which stays accurate for slivers.
Vec3d faceNormal(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  std::array<Vec3d, 3> corners{a, b, c};
  const std::array<double, 3> lengths{(b - a).lengthSqr(), (c - b).lengthSqr(),
                                      (a - c).lengthSqr()};
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
                           double layer_mm, double row_mm, double greatest_mm)
    : mesh_(sorted(mesh, walls, origin_mm, layer_mm, row_mm)), edges_(mesh_, features_) {
  findNormals();
  findNeighbours();
  findOwned(greatest_mm);
  findBlocks();
}

double MeshFeatures::memoryBytes() const {
  const auto bytes = [](const auto& vector) {
    return static_cast<double>(vector.capacity() * sizeof(vector[0]));
  };
  return bytes(mesh_.vertices) + bytes(mesh_.triangles) + bytes(normals_) + edges_.memoryBytes() +
         bytes(first_edge_) + bytes(vertex_edges_) + bytes(side_edges_) + bytes(owned_) +
         bytes(original_) + bytes(blocks_);
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

/// Whether the wedge beyond the faces of an edge is too thin to matter.
bool MeshFeatures::isFlat(std::uint32_t edge, double greatest_mm) const {
  const auto halves = edges_.halves(edge);
  if (halves.size() != 2) return false;
  const auto start = [&](std::size_t i) { return mesh_.triangles[halves[i] / 3][halves[i] % 3]; };
  if (start(0) == start(1)) return false;
  const Vec3d& a = normals_[halves[0] / 3];
  const Vec3d& b = normals_[halves[1] / 3];
  return a.dot(b) > 0 && a.cross(b).length() * greatest_mm < slack_mm;
}

void MeshFeatures::findOwned(double greatest_mm) {
  side_edges_.assign(3 * mesh_.triangles.size(), 0);
  owned_.assign(mesh_.triangles.size(), 0);
  std::vector<bool> flat(edges_.size());
  for (std::uint32_t e = 0; e < edges_.size(); ++e) {
    for (const std::uint32_t half : edges_.halves(e)) side_edges_[half] = e;
    flat[e] = isFlat(e, greatest_mm);
    const std::uint32_t owner = edges_.halves(e).front();
    if (!flat[e]) owned_[owner / 3] |= static_cast<std::uint8_t>(1U << owner % 3);
  }
  for (std::uint32_t v = 0; v < mesh_.vertices.size(); ++v) {
    const auto begin = vertex_edges_.begin() + first_edge_[v];
    const auto end = vertex_edges_.begin() + first_edge_[v + 1];
    // Also where there is none: at vertices of hidden triangles alone.
    if (std::all_of(begin, end, [&](std::uint32_t e) { return flat[e]; })) continue;
    std::uint32_t owner = std::numeric_limits<std::uint32_t>::max();
    for (auto e = begin; e != end; ++e) owner = std::min(owner, edges_.halves(*e).front() / 3);
    const Mesh::Triangle& t = mesh_.triangles[owner];
    owned_[owner] |=
        static_cast<std::uint8_t>(8U << (std::find(t.begin(), t.end(), v) - t.begin()));
  }
}

/// The mesh with its triangles in order and its vertices as they first occur in them, so that what
/// is used together lies together; those that no triangle has are left out.
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
  for (int side = 0; side < 3; ++side) {
    const Vec3d& a = corner(triangle, side);
    const Vec3d& b = corner(triangle, (side + 1) % 3);
    face.bound[static_cast<std::size_t>(side)] = halfSpace(n.cross(b - a), a);
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
  if (!(length > 0)) return feature;  // its two vertices stand for it
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
    const double cosine = first.dot(second);
    if (cosine > 0.1) {
      // No direction between the two reaches further along an axis than one of them or `tip`.
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

Vec3d MeshFeatures::away(Id id, const Vec3d& p) const {
  switch (id.kind()) {
    case Kind::face: {
      const Vec3d& n = normals_[id.index()];
      return n * n.dot(p - corner(id.index(), 0));
    }
    case Kind::edge: {
      const Vec3d& a = mesh_.vertices[edges_[id.index()].from];
      const Vec3d along = mesh_.vertices[edges_[id.index()].to] - a;
      return p - a - along * (along.dot(p - a) / along.lengthSqr());
    }
    case Kind::vertex:
      return p - mesh_.vertices[id.index()];
  }
  return {0, 0, 0};
}

std::vector<Vec3d> MeshFeatures::leastNormals() const {
  std::vector<Vec3d> least(normals_.size());
  std::transform(normals_.begin(), normals_.end(), least.begin(), magnitudes);
  for (std::uint32_t e = 0; e < edges_.size(); ++e) {
    const auto halves = edges_.halves(e);
    Vec3d across(0, 0, 0);  // unknown at borders and where more than two faces meet
    if (halves.size() == 2) {
      const auto start = [&](std::size_t i) {
        return mesh_.triangles[halves[i] / 3][halves[i] % 3];
      };
      const Vec3d& a = normals_[halves[0] / 3];
      const Vec3d b = normals_[halves[1] / 3] * (start(0) == start(1) ? -1.0 : 1.0);
      for (int axis = 0; axis < 3; ++axis)
        if (a[axis] * b[axis] > 0) across[axis] = std::min(std::abs(a[axis]), std::abs(b[axis]));
    }
    for (const std::uint32_t half : halves) least[half / 3] = componentMin(least[half / 3], across);
  }
  return least;
}

std::uint32_t MeshFeatures::triangleOf(Id id) const {
  if (id.kind() == Kind::face) return id.index();
  std::uint32_t lowest = std::numeric_limits<std::uint32_t>::max();
  const auto look = [&](std::uint32_t edge) {
    for (const std::uint32_t half : edges_.halves(edge))
      if (lowest > original_.size() || original_[half / 3] < original_[lowest]) lowest = half / 3;
  };
  if (id.kind() == Kind::edge) {
    look(id.index());
  } else {
    for (std::uint32_t i = first_edge_[id.index()]; i < first_edge_[id.index() + 1]; ++i)
      look(vertex_edges_[i]);
  }
  return lowest;
}

}  // namespace vdbdither
