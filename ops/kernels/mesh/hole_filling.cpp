// A filling is inflated like a balloon: its corners move outwards where the number is above ½ and
// inwards where it is below, and its sides are cut until their middles need not move. Wherever a
// corner stops, everything it has passed is on the right side.
//
// Triangles of minimum area: Barequet, Sharir: "Filling gaps in the boundary of a polyhedron",
// Computer Aided Geometric Design 12(2), 1995. The winding number: see winding_number.cpp.

#include "ops/kernels/mesh/hole_filling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include <openvdb/Types.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/mesh/mesh_edges.h"
#include "ops/kernels/mesh/mesh_measures.h"
#include "ops/kernels/mesh/winding_number.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

using Triangle = Mesh::Triangle;

/// As a share of the solid's volume: the maximum sum over holes that keep their fan unexamined,
/// each counted as a half ball; and the maximum that the other fillings may miss.
constexpr double volume_tolerance = 4e-4;
constexpr int maximum_rounds = 10;
constexpr std::size_t maximum_triangles = 50'000;

double lengthOf(const Mesh& mesh, const HoleLoop& loop) {
  double length = 0;
  for (std::size_t i = 0; i < loop.size(); ++i)
    length += (mesh.vertices[loop[(i + 1) % loop.size()]] - mesh.vertices[loop[i]]).length();
  return length;
}

void fillWithFan(Mesh& mesh, const HoleLoop& loop) {
  if (loop.size() == 3) {
    mesh.triangles.push_back({loop[0], loop[1], loop[2]});
    return;
  }
  Vec3d middle(0, 0, 0);
  double length = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Vec3d& a = mesh.vertices[loop[i]];
    const Vec3d& b = mesh.vertices[loop[(i + 1) % loop.size()]];
    middle += 0.5 * (a + b) * (b - a).length();
    length += (b - a).length();
  }
  const auto centre = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.push_back(length > 0 ? middle / length : mesh.vertices[loop[0]]);
  for (std::size_t i = 0; i < loop.size(); ++i)
    mesh.triangles.push_back({loop[i], loop[(i + 1) % loop.size()], centre});
}

Vec3d areaOf(const Mesh& mesh, const Triangle& t) {
  const Vec3d& a = mesh.vertices[t[0]];
  return 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
}

/// Fills a loop with the triangles between its corners that have the minimum area (Barequet, Sharir
/// 1995), or with a fan if there are too many corners.
void fillWithMinimumArea(Mesh& mesh, const HoleLoop& loop) {
  const std::size_t count = loop.size();
  constexpr std::size_t maximum_corners = 500;
  if (count > maximum_corners) return fillWithFan(mesh, loop);
  struct Best {
    double area = 0;
    std::uint32_t corner = 0;
  };
  std::vector<Best> best(count * count);  // by corners `from` and `to`: of those between them
  for (std::size_t span = 2; span < count; ++span)
    for (std::size_t from = 0; from + span < count; ++from) {
      const std::size_t to = from + span;
      Best minimum{std::numeric_limits<double>::infinity()};
      for (std::size_t corner = from + 1; corner < to; ++corner) {
        const double area = best[from * count + corner].area + best[corner * count + to].area +
                            areaOf(mesh, {loop[from], loop[corner], loop[to]}).length();
        if (area < minimum.area) minimum = {area, static_cast<std::uint32_t>(corner)};
      }
      best[from * count + to] = minimum;
    }
  std::vector<std::pair<std::size_t, std::size_t>> sides{{0, count - 1}};
  while (!sides.empty()) {
    const auto [from, to] = sides.back();
    sides.pop_back();
    if (to - from < 2) continue;
    const std::uint32_t corner = best[from * count + to].corner;
    mesh.triangles.push_back({loop[from], loop[corner], loop[to]});
    sides.insert(sides.end(), {{from, corner}, {corner, to}});
  }
}

/// Fillings of holes, while they are moved to where the number is ½.
class Membranes {
 public:
  Membranes(const Mesh& open, const std::vector<const HoleLoop*>& loops, double miss_mm3);

  /// Moves the fillings. Returns which of them are better than a fan.
  std::vector<bool> bend();

  /// Adds the triangles of one filling to the open mesh.
  void addTo(Mesh& mesh, std::uint32_t hole) const;

 private:
  /// A place from which a corner may move along a line.
  struct Place {
    Vec3d at, outwards;
    double reach_mm;
  };
  struct Way {
    Vec3d by;
    bool
        leads_there;  ///< whether it ends where the filling should be, not at a triangle or nowhere
  };

  /// Returns the way that a place of a filling should move, within its reach.
  [[nodiscard]] Way way(const Place& place) const;
  [[nodiscard]] std::vector<Way> ways(const std::vector<Place>& places) const;
  bool cut();
  [[nodiscard]] std::vector<double> misses() const;

  WindingNumber number_;
  Mesh first_;  ///< the fillings before they were moved
  std::optional<WindingNumber> first_number_;
  Mesh mesh_;                        ///< the fillings; the loops' corners come first
  std::vector<std::uint32_t> hole_;  ///< by triangle
  std::vector<std::uint32_t> open_;  ///< by corner of a loop: the open mesh's vertex
  std::vector<bool> is_new_;         ///< by vertex: its sides were not yet examined
  std::size_t holes_;
  double miss_mm_;                   ///< the maximum distance of a side's middle from the surface
  double minimum_mm3_;               ///< the minimum volume that is worth a cut
  std::vector<double> of_fans_mm3_;  ///< by hole, the volume between the fan and the surface
};

Membranes::Membranes(const Mesh& open, const std::vector<const HoleLoop*>& loops, double miss_mm3)
    : number_(open), holes_(loops.size()), minimum_mm3_(miss_mm3 / 1000) {
  std::vector<HoleLoop> own;
  for (const HoleLoop* loop : loops) {
    HoleLoop& corners = own.emplace_back();
    for (const std::uint32_t v : *loop) {
      corners.push_back(static_cast<std::uint32_t>(open_.size()));
      open_.push_back(v);
      mesh_.vertices.push_back(open.vertices[v]);
    }
  }
  const auto fill = [&](const auto& with) {
    mesh_.triangles.clear();
    hole_.clear();
    for (std::uint32_t hole = 0; hole < holes_; ++hole) {
      with(mesh_, own[hole]);
      hole_.resize(mesh_.triangles.size(), hole);
    }
  };
  fill(fillWithMinimumArea);
  first_ = mesh_;
  std::vector<std::uint32_t> first_hole = hole_;
  first_number_.emplace(first_);
  miss_mm_ = miss_mm3 / vdbdither::areaOf(mesh_);
  fill(fillWithFan);
  of_fans_mm3_ = misses();
  mesh_ = first_;
  hole_ = std::move(first_hole);
  is_new_.assign(mesh_.vertices.size(), true);
}

/// Where the number is above ½, moves outwards until it is not, or until the solid that the first
/// fillings close begins again; where it is below, moves inwards until it is not.
Membranes::Way Membranes::way(const Place& place) const {
  constexpr int steps = 8;
  constexpr int narrowings = 8;
  constexpr double near_half = 2e-4;
  const double here = number_.closelyAt(place.at) - 0.5;
  const bool is_inside = here > 0;
  // Near ½ the gradient points the way. Between parts that cover each other's holes the number
  // hardly changes.
  const Vec3d slope = number_.gradientAt(place.at);
  const double rise = slope.length();
  const bool is_near = std::abs(here) < std::min(0.5, place.reach_mm * rise);
  Vec3d along = is_near ? slope * (-place.reach_mm / rise) : place.outwards * place.reach_mm;
  if (!is_inside) along = -along;
  struct Seen {
    double t, number;
    bool arrived;
  };
  const auto look = [&](double t) {
    const Vec3d p = place.at + along * t;
    const double number = number_.closelyAt(p);
    const bool is_covered = is_inside && !is_near && number + first_number_->closelyAt(p) > 0.5;
    return Seen{t, number, (number > 0.5) != is_inside || is_covered};
  };
  // On the filling itself its own number is undefined.
  Seen low = look(1e-3);
  if (low.arrived) return {Vec3d(0.0), true};
  Seen high = low;
  for (int step = 1; step <= steps && !high.arrived; ++step) {
    low = high;
    high = look(static_cast<double>(step) / steps);
  }
  if (!high.arrived) return {along, false};
  for (int narrowing = 0; narrowing < narrowings; ++narrowing) {
    // Where the number passes ½ without a triangle, it is almost linear.
    const bool is_passed = (high.number > 0.5) != is_inside;
    const double share =
        is_passed ? std::clamp((0.5 - low.number) / (high.number - low.number), 0.1, 0.9) : 0.5;
    const Seen middle = look(low.t + share * (high.t - low.t));
    if (is_passed && std::abs(middle.number - 0.5) < near_half) return {along * middle.t, true};
    (middle.arrived ? high : low) = middle;
  }
  const bool is_triangle =
      (high.number > 0.5) != is_inside && std::abs(high.number - low.number) > 0.5;
  return {along * high.t, !is_triangle};
}

std::vector<Membranes::Way> Membranes::ways(const std::vector<Place>& places) const {
  std::vector<Way> made(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(),
                    [&](std::size_t i) { made[i] = way(places[i]); });
  return made;
}

/// Cuts the sides whose middle is too far from the surface. Returns whether there were any.
bool Membranes::cut() {
  const MeshEdges edges(mesh_);
  std::vector<Place> places;
  std::vector<std::uint32_t> looked_at;
  for (std::uint32_t e = 0; e < edges.size(); ++e) {
    const auto [from, to, first] = edges[e];
    if (edges.halves(e).size() != 2 || !(is_new_[from] || is_new_[to])) continue;
    Vec3d normal(0.0);
    double area_mm2 = 0;
    for (const std::uint32_t half : edges.halves(e)) {
      const Vec3d area = areaOf(mesh_, mesh_.triangles[half / 3]);
      normal += area.unitSafe();
      area_mm2 += area.length();
    }
    const Vec3d side = mesh_.vertices[to] - mesh_.vertices[from];
    // A middle moves by the length of its side at most.
    const double least_mm = std::max(miss_mm_, 3 * minimum_mm3_ / area_mm2);
    if (side.length() <= least_mm) continue;
    looked_at.push_back(e);
    places.push_back({mesh_.vertices[from] + 0.5 * side, normal.unitSafe(), side.length()});
  }
  is_new_.assign(mesh_.vertices.size(), false);
  const std::vector<Way> made = ways(places);
  constexpr std::uint32_t none = ~std::uint32_t{0};
  std::vector<std::uint32_t> middle(3 * mesh_.triangles.size(), none);  // by half-edge
  bool is_cut = false;
  for (std::size_t i = 0; i < looked_at.size(); ++i) {
    double area_mm2 = 0;
    for (const std::uint32_t half : edges.halves(looked_at[i]))
      area_mm2 += areaOf(mesh_, mesh_.triangles[half / 3]).length();
    const double miss_mm = made[i].by.length();
    if (!made[i].leads_there || miss_mm <= miss_mm_ || miss_mm * area_mm2 < 3 * minimum_mm3_)
      continue;
    is_cut = true;
    for (const std::uint32_t half : edges.halves(looked_at[i]))
      middle[half] = static_cast<std::uint32_t>(mesh_.vertices.size());
    mesh_.vertices.push_back(places[i].at + made[i].by);
    is_new_.push_back(true);
  }
  std::vector<Triangle> cut;
  std::vector<std::uint32_t> hole;
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    Triangle t = mesh_.triangles[i];
    Triangle m{middle[3 * i], middle[3 * i + 1], middle[3 * i + 2]};
    const auto count = std::count_if(m.begin(), m.end(), [](std::uint32_t v) { return v != none; });
    // Rotated so that of one cut side it is the first, and of two the last is not cut.
    for (std::size_t turn = 0; turn < 2; ++turn)
      if ((count == 1 && m[0] == none) || (count == 2 && m[2] != none)) {
        std::rotate(t.begin(), t.begin() + 1, t.end());
        std::rotate(m.begin(), m.begin() + 1, m.end());
      }
    if (count == 0) cut.push_back(t);
    if (count == 1) cut.insert(cut.end(), {{t[0], m[0], t[2]}, {m[0], t[1], t[2]}});
    if (count == 2) {
      cut.push_back({m[0], t[1], m[1]});
      const double one = (mesh_.vertices[m[0]] - mesh_.vertices[t[2]]).lengthSqr();
      const double other = (mesh_.vertices[m[1]] - mesh_.vertices[t[0]]).lengthSqr();
      if (one < other) {
        cut.insert(cut.end(), {{t[0], m[0], t[2]}, {m[0], m[1], t[2]}});
      } else {
        cut.insert(cut.end(), {{t[0], m[0], m[1]}, {t[0], m[1], t[2]}});
      }
    }
    if (count == 3)
      cut.insert(cut.end(),
                 {{t[0], m[0], m[2]}, {m[0], t[1], m[1]}, {m[1], t[2], m[2]}, {m[0], m[1], m[2]}});
    hole.resize(cut.size(), hole_[i]);
  }
  mesh_.triangles = std::move(cut);
  hole_ = std::move(hole);
  return is_cut;
}

/// Returns by hole the volume between the filling and the surface, mm³, estimated at the triangles'
/// middles.
std::vector<double> Membranes::misses() const {
  std::vector<Place> places;
  for (const Triangle& t : mesh_.triangles) {
    const Vec3d area = areaOf(mesh_, t);
    const Vec3d middle = (mesh_.vertices[t[0]] + mesh_.vertices[t[1]] + mesh_.vertices[t[2]]) / 3;
    places.push_back({middle, area.unitSafe(), std::sqrt(area.length())});
  }
  const std::vector<Way> made = ways(places);
  std::vector<double> misses(holes_, 0.0);
  for (std::size_t i = 0; i < made.size(); ++i)
    misses[hole_[i]] += made[i].by.length() * areaOf(mesh_, mesh_.triangles[i]).length();
  return misses;
}

std::vector<bool> Membranes::bend() {
  for (int round = 0; round < maximum_rounds && mesh_.triangles.size() < maximum_triangles;
       ++round) {
    if (!cut()) break;
  }
  const std::vector<double> after = misses();
  std::vector<bool> better(holes_);
  for (std::size_t hole = 0; hole < holes_; ++hole)
    better[hole] = 2 * after[hole] < of_fans_mm3_[hole];
  return better;
}

void Membranes::addTo(Mesh& mesh, std::uint32_t hole) const {
  constexpr std::uint32_t none = ~std::uint32_t{0};
  std::vector<std::uint32_t> to = open_;
  to.resize(mesh_.vertices.size(), none);
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    if (hole_[i] != hole) continue;
    Triangle t = mesh_.triangles[i];
    for (std::uint32_t& v : t) {
      if (to[v] == none) {
        to[v] = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.push_back(mesh_.vertices[v]);
      }
      v = to[v];
    }
    mesh.triangles.push_back(t);
  }
}

}  // namespace

void fillWithFans(Mesh& mesh, std::span<const HoleLoop> loops) {
  for (const HoleLoop& loop : loops) fillWithFan(mesh, loop);
}

void fillWhereNumberIsHalf(Mesh& mesh, std::span<const HoleLoop> loops) {
  if (loops.empty()) return;
  Mesh fanned = mesh;
  fillWithFans(fanned, loops);
  const double miss_mm3 = volume_tolerance * std::abs(volumeOf(fanned));

  // The smallest holes keep their fans, as long as the sum of all of them is too small to matter.
  std::vector<double> half_ball_mm3;
  for (const HoleLoop& loop : loops) {
    const double radius_mm = lengthOf(mesh, loop) / (2 * std::numbers::pi);
    half_ball_mm3.push_back(2 * std::numbers::pi / 3 * radius_mm * radius_mm * radius_mm);
  }
  std::vector<std::uint32_t> order(loops.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(half_ball_mm3[a], a) < std::pair(half_ball_mm3[b], b);
  });
  std::vector<bool> matters(loops.size(), false);
  double sum_mm3 = 0;
  for (const std::uint32_t loop : order) {
    sum_mm3 += half_ball_mm3[loop];
    matters[loop] = sum_mm3 > miss_mm3 && loops[loop].size() > 3;
  }
  std::vector<const HoleLoop*> large;
  for (std::size_t i = 0; i < loops.size(); ++i)
    if (matters[i]) large.push_back(&loops[i]);
  if (large.empty()) {
    mesh = std::move(fanned);
    return;
  }
  Membranes membranes(mesh, large, miss_mm3);
  const std::vector<bool> better = membranes.bend();
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < loops.size(); ++i) {
    if (matters[i] && better[next]) {
      membranes.addTo(mesh, next);
    } else {
      fillWithFan(mesh, loops[i]);
    }
    next += matters[i];
  }
}

}  // namespace vdbdither
