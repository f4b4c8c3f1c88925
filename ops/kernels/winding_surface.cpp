// Away from the triangles the number is harmonic, and like the field of dipoles it has no flux
// through a surface around any of them. So no piece of the surface at ½ is clear of all triangles:
// it could neither rise nor fall across the piece. From the cells that triangles pass, growing
// through the faces of cells with corners on both sides finds all of it, and the cost follows the
// surface.

#include "ops/kernels/winding_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <openvdb/math/BBox.h>
#include <openvdb/math/Mat3.h>
#include <openvdb/tree/ValueAccessor.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "ops/kernels/marching_cubes.h"
#include "ops/kernels/winding_number.h"
#include "vdbdither/openvdb.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

using Bounds = openvdb::math::BBox<Vec3d>;
/// A cell, by its lowest corner, or a corner; in the order of z, y, x.
using Key = std::uint64_t;

constexpr int key_bits = 20;
constexpr int key_offset = 1 << (key_bits - 1);

/// Along the longest side, where orientation and size are judged.
constexpr double coarse_cells = 64;
/// So many along the longest side fit into keys, with all around it.
constexpr double most_cells_along = 200'000;

Key keyOf(const Coord& ijk) {
  const auto part = [](int index) { return static_cast<Key>(index + key_offset); };
  return part(ijk.z()) << 2 * key_bits | part(ijk.y()) << key_bits | part(ijk.x());
}
Coord coordOf(Key key) {
  const auto part = [](Key bits) {
    return static_cast<int>(bits & ((1U << key_bits) - 1)) - key_offset;
  };
  return {part(key), part(key >> key_bits), part(key >> 2 * key_bits)};
}

Coord cornerOf(const Coord& cell, int corner) {
  return cell.offsetBy(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
}

template <class T>
void sortUnique(std::vector<T>& values) {
  tbb::parallel_sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

/// Tells of a stretch of the whole.
class Stretch {
 public:
  explicit Stretch(const std::function<void(double)>& progress) : progress_(progress) {}
  [[nodiscard]] Stretch part(double from, double to) const {
    Stretch part = *this;
    part.from_ = from_ + (to_ - from_) * from;
    part.to_ = from_ + (to_ - from_) * to;
    return part;
  }
  void operator()(double fraction) const {
    if (progress_) progress_(from_ + (to_ - from_) * fraction);
  }

 private:
  const std::function<void(double)>& progress_;
  double from_ = 0, to_ = 1;
};

/// Calls work(i) for i below `count` on all threads, with a word in between.
template <class Work>
void forAll(std::size_t count, const Stretch& stretch, const Work& work) {
  constexpr std::size_t at_once = 1 << 16;
  for (std::size_t begin = 0; begin < count; begin += at_once) {
    stretch(static_cast<double>(begin) / static_cast<double>(count));
    tbb::parallel_for(begin, std::min(count, begin + at_once), work);
  }
}

/// The set and its surface on cells of one size.
class Cells {
 public:
  Cells(const Mesh& triangles, const WindingNumber& winding, const Bounds& bounds, double cell_mm);

  /// Finds the cells that triangles or the surface pass.
  void find(const Stretch& stretch);
  [[nodiscard]] std::size_t count() const { return cells_.size(); }
  [[nodiscard]] Mesh surface(const Stretch& stretch) const;

 private:
  struct Touch {
    Key cell;
    std::uint32_t triangle;

    friend auto operator<=>(const Touch&, const Touch&) = default;
  };
  struct Cut {
    Key corner;
    int axis;
  };
  /// Where an edge passes the surface.
  struct Crossing {
    Vec3d at;
    Vec3d normal;  ///< unit, in either direction; or zero
  };

  [[nodiscard]] Vec3d position(const Coord& corner) const {
    return origin_mm_ + corner.asVec3d() * cell_mm_;
  }
  [[nodiscard]] std::array<Vec3d, 3> corners(std::uint32_t triangle) const {
    const Mesh::Triangle& t = mesh_.triangles[triangle];
    return {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]};
  }
  [[nodiscard]] bool isInside(const Vec3d& p) const { return winding_.judgedAt(p) > 0.5; }
  void touch(std::uint32_t triangle, std::vector<Touch>& touches) const;
  [[nodiscard]] std::span<const Touch> touchesOf(Key cell) const;
  [[nodiscard]] Crossing crossing(const Cut& cut, bool low_is_inside) const;
  [[nodiscard]] double smoothCrossing(const Vec3d& from, const Vec3d& along, double low,
                                      double high) const;
  [[nodiscard]] Vec3d gradientAt(const Vec3d& p) const;
  [[nodiscard]] Vec3d meet(const Coord& cell, std::span<const Crossing> crossings) const;

  const Mesh& mesh_;
  const WindingNumber& winding_;
  double cell_mm_;
  Vec3d origin_mm_;
  openvdb::CoordBBox limits_;         ///< of corners that may be inside
  std::vector<Touch> touches_;        ///< sorted
  openvdb::BoolTree corners_{false};  ///< inside, and active where that is known
  std::vector<Key> cells_;
};

Cells::Cells(const Mesh& triangles, const WindingNumber& winding, const Bounds& bounds,
             double cell_mm)
    : mesh_(triangles), winding_(winding), cell_mm_(cell_mm) {
  // A part of a cell that keeps corners out of planes which designers like.
  origin_mm_ = bounds.min() - cell_mm * Vec3d(0.3819, 0.4142, 0.3028);
  const double around_mm = 0.5 * bounds.extents()[static_cast<int>(bounds.maxExtent())];
  limits_ = {Coord::floor((bounds.min() - around_mm - origin_mm_) / cell_mm),
             Coord::ceil((bounds.max() + around_mm - origin_mm_) / cell_mm)};
}

/// Notes the cells that a triangle passes: of the columns of cells across the axis that it faces
/// most those that it meets, and in each what the slope of its plane leaves.
void Cells::touch(std::uint32_t triangle, std::vector<Touch>& touches) const {
  constexpr double widening = 1e-6;  // of a cell, for rounding
  std::array<Vec3d, 3> at = corners(triangle);
  for (Vec3d& corner : at) corner = (corner - origin_mm_) / cell_mm_;
  const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
  const auto w = static_cast<int>(openvdb::math::MaxIndex(
      Vec3d(std::abs(normal.x()), std::abs(normal.y()), std::abs(normal.z()))));
  if (normal[w] == 0) return;  // without area
  const int u = (w + 1) % 3;
  const int v = (w + 2) % 3;
  Bounds box;
  for (const Vec3d& corner : at) box.expand(corner);
  box.expand(widening);
  const double turn = normal[w] > 0 ? 1 : -1;
  const double slope_u = -normal[u] / normal[w];
  const double slope_v = -normal[v] / normal[w];
  const double rise = 0.5 * (std::abs(slope_u) + std::abs(slope_v)) + widening;
  for (int i = static_cast<int>(std::floor(box.min()[u])); i <= box.max()[u]; ++i) {
    for (int j = static_cast<int>(std::floor(box.min()[v])); j <= box.max()[v]; ++j) {
      const double middle_u = i + 0.5;
      const double middle_v = j + 0.5;
      bool outside = false;
      for (std::size_t side = 0; side < 3 && !outside; ++side) {
        const Vec3d& a = at[side];
        const Vec3d& b = at[(side + 1) % 3];
        const double along_u = turn * (b[u] - a[u]);
        const double along_v = turn * (b[v] - a[v]);
        const double reach = (0.5 + widening) * (std::abs(along_u) + std::abs(along_v));
        outside = along_u * (middle_v - a[v]) - along_v * (middle_u - a[u]) < -reach;
      }
      if (outside) continue;
      const double height =
          at[0][w] + slope_u * (middle_u - at[0][u]) + slope_v * (middle_v - at[0][v]);
      const double low = std::max(height - rise, box.min()[w]);
      const double high = std::min(height + rise, box.max()[w]);
      Coord cell;
      cell[u] = i;
      cell[v] = j;
      for (int k = static_cast<int>(std::floor(low)); k <= high; ++k) {
        cell[w] = k;
        touches.push_back({keyOf(cell), triangle});
      }
    }
  }
}

std::span<const Cells::Touch> Cells::touchesOf(Key cell) const {
  const auto first = std::lower_bound(touches_.begin(), touches_.end(), Touch{cell, 0});
  const auto last =
      std::find_if(first, touches_.end(), [&](const Touch& touch) { return touch.cell != cell; });
  return {touches_.data() + (first - touches_.begin()), static_cast<std::size_t>(last - first)};
}

/// By corner, a bit each.
template <class Accessor>
int insideOf(const Coord& cell, const Accessor& corners) {
  int inside = 0;
  for (int corner = 0; corner < 8; ++corner)
    if (corners.getValue(cornerOf(cell, corner))) inside |= 1 << corner;
  return inside;
}

void Cells::find(const Stretch& stretch) {
  constexpr std::uint32_t in_a_block = 256;
  const auto count = static_cast<std::uint32_t>(mesh_.triangles.size());
  std::vector<std::vector<Touch>> blocks((count + in_a_block - 1) / in_a_block);
  tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t block) {
    const auto begin = static_cast<std::uint32_t>(block * in_a_block);
    for (std::uint32_t t = begin; t < std::min(count, begin + in_a_block); ++t)
      touch(t, blocks[block]);
  });
  for (std::vector<Touch>& block : blocks) {
    touches_.insert(touches_.end(), block.begin(), block.end());
    block = {};
  }
  tbb::parallel_sort(touches_.begin(), touches_.end());

  openvdb::MaskTree reached;
  openvdb::tree::ValueAccessor<openvdb::MaskTree, false> reached_at(reached);
  openvdb::tree::ValueAccessor<openvdb::BoolTree, false> corners_at(corners_);
  std::vector<Key> front;
  for (const Touch& touch : touches_)
    if (front.empty() || front.back() != touch.cell) front.push_back(touch.cell);
  for (const Key cell : front) reached_at.setValueOn(coordOf(cell));
  const auto touched = static_cast<double>(front.size());
  std::vector<Key> asked;
  std::vector<char> inside;
  while (!front.empty()) {
    asked.clear();
    for (const Key cell : front)
      for (int corner = 0; corner < 8; ++corner) {
        const Coord at = cornerOf(coordOf(cell), corner);
        if (!corners_at.isValueOn(at) && limits_.isInside(at)) asked.push_back(keyOf(at));
      }
    sortUnique(asked);
    inside.assign(asked.size(), 0);
    // How far the surface grows is not known before.
    const double done = cells_.empty() ? 0 : 1 - 0.5 * touched / static_cast<double>(cells_.size());
    const double next = cells_.empty() ? 0.5 : done;
    forAll(asked.size(), stretch.part(done, next),
           [&](std::size_t i) { inside[i] = isInside(position(coordOf(asked[i]))) ? 1 : 0; });
    for (std::size_t i = 0; i < asked.size(); ++i)
      corners_at.setValueOn(coordOf(asked[i]), inside[i] != 0);
    cells_.insert(cells_.end(), front.begin(), front.end());
    std::vector<Key> grown;
    for (const Key key : front) {
      const Coord cell = coordOf(key);
      const int corners = insideOf(cell, corners_at);
      for (int axis = 0; axis < 3; ++axis) {
        constexpr std::array<int, 3> low_faces{0x55, 0x33, 0x0f};
        for (int side = 0; side < 2; ++side) {
          const int face = low_faces[static_cast<std::size_t>(axis)] << (side << axis);
          if ((corners & face) == 0 || (corners & face) == face) continue;
          Coord beyond = cell;
          beyond[axis] += 2 * side - 1;
          if (reached_at.isValueOn(beyond)) continue;
          reached_at.setValueOn(beyond);
          grown.push_back(keyOf(beyond));
        }
      }
    }
    front = std::move(grown);
  }
  tbb::parallel_sort(cells_.begin(), cells_.end());
}

/// Where the number passes ½ on a stretch that no triangle cuts: regula falsi, held in by halving
/// the weight of the end that stays (Illinois).
double Cells::smoothCrossing(const Vec3d& from, const Vec3d& along, double low, double high) const {
  const auto above = [&](double t) { return winding_.closelyAt(from + along * t) - 0.5; };
  double at_low = above(low);
  double at_high = above(high);
  int kept = 0;
  for (int step = 0; step < 20 && high - low > 1e-4; ++step) {
    // The ends were judged by the exact number.
    if ((at_low > 0) == (at_high > 0)) return std::abs(at_low) < std::abs(at_high) ? low : high;
    const double t = low + (high - low) * at_low / (at_low - at_high);
    const double at_t = above(t);
    if (std::abs(at_t) < 1e-7) return t;
    if ((at_t > 0) == (at_low > 0)) {
      low = t;
      at_low = at_t;
      if (kept == 1) at_high *= 0.5;
      kept = 1;
    } else {
      high = t;
      at_high = at_t;
      if (kept == -1) at_low *= 0.5;
      kept = -1;
    }
  }
  return 0.5 * (low + high);
}

/// The direction in which the number changes, where no triangle is near.
Vec3d Cells::gradientAt(const Vec3d& p) const {
  Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d step(0.0);
    step[axis] = 0.01 * cell_mm_;
    gradient[axis] = winding_.closelyAt(p + step) - winding_.closelyAt(p - step);
  }
  const double length = gradient.length();
  return length > 0 ? gradient / length : gradient;
}

/// Where the tangents at crossings meet: the point of least squares, where they say nothing the
/// middle of the crossings (Ju, Losasso, Schaefer, Warren: "Dual Contouring of Hermite Data",
/// 2002). Within the cell.
Vec3d Cells::meet(const Coord& cell, std::span<const Crossing> crossings) const {
  Vec3d middle(0.0);
  for (const Crossing& crossing : crossings) middle += crossing.at;
  middle /= static_cast<double>(crossings.size());
  openvdb::Mat3d sum = openvdb::Mat3d::zero();
  Vec3d pull(0.0);
  for (const Crossing& crossing : crossings) {
    const Vec3d& n = crossing.normal;
    const double height = n.dot(crossing.at - middle);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum(i, j) += n[i] * n[j];
    pull += n * height;
  }
  openvdb::Mat3d directions;
  Vec3d strengths;
  if (!openvdb::math::diagonalizeSymmetricMatrix(sum, directions, strengths)) return middle;
  Vec3d at = middle;
  for (int i = 0; i < 3; ++i) {
    const Vec3d direction(directions(0, i), directions(1, i), directions(2, i));
    if (strengths[i] > 0.02) at += direction * (direction.dot(pull) / strengths[i]);
  }
  const Vec3d low = position(cell);
  constexpr double least = 1.0 / 1024;
  for (int axis = 0; axis < 3; ++axis)
    at[axis] =
        std::clamp(at[axis], low[axis] + least * cell_mm_, low[axis] + (1 - least) * cell_mm_);
  return at;
}

/// Where along the edge the set ends.
Cells::Crossing Cells::crossing(const Cut& cut, bool low_is_inside) const {
  constexpr double beside = 1e-5;       // of an edge: where a triangle's sides are looked at
  constexpr double least = 1.0 / 1024;  // so that no two crossings are at one place
  const Vec3d from = position(coordOf(cut.corner));
  Vec3d along(0.0);
  along[cut.axis] = cell_mm_;
  const int u = (cut.axis + 1) % 3;
  const int v = (cut.axis + 2) % 3;
  struct Pierced {
    double t;
    Vec3d normal;
  };
  std::vector<Pierced> pierced;
  for (const Touch& touch : touchesOf(cut.corner)) {
    const std::array<Vec3d, 3> at = corners(touch.triangle);
    const Vec3d normal = (at[1] - at[0]).cross(at[2] - at[0]);
    if (normal[cut.axis] == 0) continue;
    int left = 0;
    for (std::size_t side = 0; side < 3; ++side) {
      const Vec3d& a = at[side];
      const Vec3d& b = at[(side + 1) % 3];
      left += (b[u] - a[u]) * (from[v] - a[v]) - (b[v] - a[v]) * (from[u] - a[u]) >= 0 ? 1 : 0;
    }
    if (left != (normal[cut.axis] > 0 ? 3 : 0)) continue;
    const double t = normal.dot(at[0] - from) / (normal[cut.axis] * cell_mm_);
    if (t > beside && t < 1 - beside) pierced.push_back({t, normal});
  }
  std::sort(pierced.begin(), pierced.end(),
            [](const Pierced& a, const Pierced& b) { return a.t < b.t; });
  double low = 0;
  double high = 1;
  auto first = pierced.begin();
  auto last = pierced.end();
  while (first != last) {
    const auto middle = first + (last - first) / 2;
    if (isInside(from + along * (middle->t - beside)) != low_is_inside) {
      high = middle->t - beside;
      last = middle;
    } else if (isInside(from + along * (middle->t + beside)) != low_is_inside) {
      return {from + along * std::clamp(middle->t, least, 1 - least),
              middle->normal / middle->normal.length()};
    } else {
      low = middle->t + beside;
      first = middle + 1;
    }
  }
  const double t = high > low ? smoothCrossing(from, along, low, high) : low;
  const Vec3d at = from + along * std::clamp(t, least, 1 - least);
  return {at, gradientAt(at)};
}

/// The polygons of a case of marching cubes.
struct Sheets {
  std::array<std::int8_t, 12> of{};  ///< by edge; −1 where it is not cut
  std::int8_t count = 0;
};
const std::array<Sheets, 256>& sheetsOfCases() {
  static const std::array<Sheets, 256> all = [] {
    std::array<Sheets, 256> made;
    for (std::size_t inside = 0; inside < 256; ++inside) {
      Sheets& sheets = made[inside];
      std::array<std::uint8_t, 12> root;
      for (std::uint8_t edge = 0; edge < 12; ++edge) root[edge] = edge;
      const auto join = [&](std::uint8_t a, std::uint8_t b) {
        const std::uint8_t from = root[b];
        for (std::uint8_t& r : root)
          if (r == from) r = root[a];
      };
      for (const auto& t : cubeCases()[inside].triangles) {
        join(t[0], t[1]);
        join(t[0], t[2]);
      }
      sheets.of.fill(-1);
      for (std::size_t edge = 0; edge < 12; ++edge) {
        if ((cubeCases()[inside].edges >> edge & 1) == 0) continue;
        for (std::size_t before = 0; before < edge; ++before)
          if (root[before] == root[edge] && sheets.of[before] >= 0)
            sheets.of[edge] = sheets.of[before];
        if (sheets.of[edge] < 0) sheets.of[edge] = sheets.count++;
      }
    }
    return made;
  }();
  return all;
}

Mesh Cells::surface(const Stretch& stretch) const {
  struct Mixed {
    Key cell;
    int inside;
  };
  std::vector<Mixed> mixed;
  std::vector<Key> edges;  // thrice its corner, plus its axis
  const openvdb::tree::ValueAccessor<const openvdb::BoolTree, false> corners_at(corners_);
  const auto edgeOf = [](const Coord& cell, int edge) {
    const int axis = edge / 4;
    Coord corner = cell;
    corner[axis == 0 ? 1 : 0] += edge & 1;
    corner[axis == 2 ? 1 : 2] += edge >> 1 & 1;
    return 3 * keyOf(corner) + static_cast<Key>(axis);
  };
  for (const Key key : cells_) {
    const Coord cell = coordOf(key);
    const int inside = insideOf(cell, corners_at);
    if (inside == 0 || inside == 0xff) continue;
    mixed.push_back({key, inside});
    const unsigned cut = cubeCases()[static_cast<std::size_t>(inside)].edges;
    for (int edge = 0; edge < 12; ++edge)
      if ((cut >> edge & 1) != 0) edges.push_back(edgeOf(cell, edge));
  }
  sortUnique(edges);

  const auto place = [&](Key edge) {
    return static_cast<std::size_t>(std::lower_bound(edges.begin(), edges.end(), edge) -
                                    edges.begin());
  };
  std::vector<Crossing> crossings(edges.size());
  forAll(edges.size(), stretch, [&](std::size_t i) {
    const Cut cut{edges[i] / 3, static_cast<int>(edges[i] % 3)};
    crossings[i] = crossing(cut, corners_.getValue(coordOf(cut.corner)));
  });
  std::vector<std::uint32_t> first_vertex(mixed.size() + 1);  // of a cell
  first_vertex[0] = static_cast<std::uint32_t>(edges.size());
  for (std::size_t i = 0; i < mixed.size(); ++i)
    first_vertex[i + 1] =
        first_vertex[i] + static_cast<std::uint32_t>(
                              sheetsOfCases()[static_cast<std::size_t>(mixed[i].inside)].count);
  Mesh mesh;
  mesh.vertices.resize(first_vertex.back());
  for (std::size_t i = 0; i < edges.size(); ++i) mesh.vertices[i] = crossings[i].at;
  tbb::parallel_for(std::size_t{0}, mixed.size(), [&](std::size_t i) {
    const Coord cell = coordOf(mixed[i].cell);
    const Sheets& sheets = sheetsOfCases()[static_cast<std::size_t>(mixed[i].inside)];
    for (int sheet = 0; sheet < sheets.count; ++sheet) {
      std::array<Crossing, 12> own;
      std::size_t count = 0;
      for (int edge = 0; edge < 12; ++edge)
        if (sheets.of[static_cast<std::size_t>(edge)] == sheet)
          own[count++] = crossings[place(edgeOf(cell, edge))];
      mesh.vertices[first_vertex[i] + static_cast<std::uint32_t>(sheet)] =
          meet(cell, {own.data(), count});
    }
  });
  mesh.triangles.resize(4 * edges.size());
  tbb::parallel_for(std::size_t{0}, edges.size(), [&](std::size_t i) {
    const auto axis = static_cast<int>(edges[i] % 3);
    const Coord corner = coordOf(edges[i] / 3);
    const int u = (axis + 1) % 3;
    const int v = (axis + 2) % 3;
    // Around the edge, counter-clockwise seen from its upper end.
    std::array<std::uint32_t, 4> around;
    for (std::size_t turn = 0; turn < 4; ++turn) {
      const bool at_u = turn == 1 || turn == 2;
      const bool at_v = turn == 2 || turn == 3;
      Coord cell = corner;
      cell[u] -= at_u;
      cell[v] -= at_v;
      const Key key = keyOf(cell);
      const auto found = std::lower_bound(mixed.begin(), mixed.end(), key,
                                          [](const Mixed& m, Key k) { return m.cell < k; });
      // Edges are numbered by the lower of the other axes first.
      const bool low_at = axis == 1 ? at_v : axis == 0 ? at_u : at_u;
      const bool high_at = axis == 1 ? at_u : at_v;
      const int edge = axis == 2 ? 8 + at_u + 2 * at_v : 4 * axis + low_at + 2 * high_at;
      const auto sheet = sheetsOfCases()[static_cast<std::size_t>(found->inside)]
                             .of[static_cast<std::size_t>(edge)];
      around[turn] = first_vertex[static_cast<std::size_t>(found - mixed.begin())] +
                     static_cast<std::uint32_t>(sheet);
    }
    if (!corners_.getValue(corner)) std::swap(around[1], around[3]);
    for (std::size_t turn = 0; turn < 4; ++turn)
      mesh.triangles[4 * i + turn] = {static_cast<std::uint32_t>(i), around[turn],
                                      around[(turn + 1) % 4]};
  });
  return mesh;
}

double volumeOf(const Mesh& mesh, const Vec3d& about) {
  double sum = 0;
  for (const Mesh::Triangle& t : mesh.triangles)
    sum += (mesh.vertices[t[0]] - about)
               .dot((mesh.vertices[t[1]] - about).cross(mesh.vertices[t[2]] - about));
  return sum / 6;
}

}  // namespace

WindingSurface windingSurface(const Mesh& triangles, const WindingCells& cells,
                              const std::function<void(double)>& progress) {
  WindingSurface made;
  Bounds bounds;
  for (const Mesh::Triangle& t : triangles.triangles)
    for (const std::uint32_t v : t) bounds.expand(triangles.vertices[v]);
  const double longest_mm =
      bounds.empty() ? 0 : bounds.extents()[static_cast<int>(bounds.maxExtent())];
  if (!(longest_mm > 0)) return made;
  const double least_mm = std::max(cells.least_mm, longest_mm / most_cells_along);
  made.cell_mm = std::max(least_mm, longest_mm / coarse_cells);

  const Stretch stretch(progress);
  Mesh faced = triangles;
  const auto turn = [&faced] {
    for (Mesh::Triangle& t : faced.triangles) std::swap(t[1], t[2]);
  };
  std::array<double, 2> volumes{};
  std::size_t count = 0;
  for (std::size_t turned = 0; turned < 2; ++turned) {
    const WindingNumber winding(faced);
    Cells coarse(faced, winding, bounds, made.cell_mm);
    coarse.find(stretch.part(0.02 * static_cast<double>(turned), 0.02 * (1 + turned)));
    volumes[turned] = volumeOf(coarse.surface(stretch.part(0, 0)), bounds.getCenter());
    count = std::max(count, coarse.count());
    turn();
  }
  made.turned = volumes[1] > 2 * volumes[0];
  if (made.turned) turn();
  const WindingNumber winding(faced);
  // The cells of a surface grow by the square of their fineness, those of a crowd faster: so they
  // become finer step by step.
  for (double done = 0.04;; done = std::min(0.3, done + 0.08)) {
    const double ratio = std::sqrt(static_cast<double>(count) / static_cast<double>(cells.about));
    made.cell_mm = std::max(least_mm, made.cell_mm * std::clamp(ratio, 0.5, 1.0));
    const bool last = ratio > 0.5 || made.cell_mm <= least_mm;
    Cells fine(faced, winding, bounds, made.cell_mm);
    fine.find(stretch.part(done, last ? 0.6 : done + 0.08));
    count = fine.count();
    if (!last) continue;
    made.mesh = fine.surface(stretch.part(0.6, 1));
    return made;
  }
}

}  // namespace vdbdither
