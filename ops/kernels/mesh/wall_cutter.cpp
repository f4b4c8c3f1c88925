#include "ops/kernels/mesh/wall_cutter.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <numeric>
#include <utility>

#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// The distance from a wall at which its sides are examined.
constexpr double beside_mm = 1e-5;

using Cuts = std::vector<WallCut>;

/// Returns what of a wall is above a plane and below it; nothing where the plane only touches it.
std::optional<std::array<WallPiece, 2>> halvesOf(const WallPiece& wall, const WallPlane& plane) {
  const auto beyond = [&](double side) {
    return std::any_of(wall.begin(), wall.end(),
                       [&](const Vec3d& p) { return side * plane.at(p) > in_plane_mm; });
  };
  if (!beyond(1) || !beyond(-1)) return std::nullopt;
  std::array<WallPiece, 2> halves;
  for (std::size_t i = 0; i < wall.size(); ++i) {
    const Vec3d& p = wall[i];
    const Vec3d& q = wall[(i + 1) % wall.size()];
    const double at_p = plane.at(p);
    const double at_q = plane.at(q);
    if (at_p >= 0) halves[0].push_back(p);
    if (at_p <= 0) halves[1].push_back(p);
    if ((at_p > 0 && at_q < 0) || (at_p < 0 && at_q > 0)) {
      const Vec3d between = p + (q - p) * (at_p / (at_p - at_q));
      halves[0].push_back(between);
      halves[1].push_back(between);
    }
  }
  return halves;
}

/// Returns what of segments is above a plane and below it. Those in the plane are left out.
std::array<Cuts, 2> halvesOf(const Cuts& cuts, const WallPlane& plane) {
  std::array<Cuts, 2> halves;
  for (const WallCut& cut : cuts) {
    const double at_from = plane.at(cut.from);
    const double at_to = plane.at(cut.to);
    const bool is_above = std::max(at_from, at_to) > in_plane_mm;
    const bool is_below = std::min(at_from, at_to) < -in_plane_mm;
    if (is_above) halves[0].push_back(cut);
    if (is_below) halves[1].push_back(cut);
    if (!is_above || !is_below) continue;
    const Vec3d between = cut.from + (cut.to - cut.from) * (at_from / (at_from - at_to));
    (at_from < 0 ? halves[0].back().from : halves[0].back().to) = between;
    (at_from > 0 ? halves[1].back().from : halves[1].back().to) = between;
  }
  return halves;
}

/// Returns a plane with about half of the segments on each side, if they are many and can be parted
/// so. To cut along the segments of an outline one after the other would take the square of their
/// number.
std::optional<WallPlane> planeBetween(const Cuts& cuts) {
  constexpr std::size_t few = 8;
  if (cuts.size() <= few) return std::nullopt;
  std::vector<Vec3d> middles;
  middles.reserve(cuts.size());
  BoxTree::Box box;
  for (const WallCut& cut : cuts) {
    middles.push_back(0.5 * (cut.from + cut.to));
    box.expand(middles.back());
  }
  const auto axis = static_cast<int>(box.maxExtent());
  const auto half = middles.begin() + static_cast<std::ptrdiff_t>(middles.size() / 2);
  std::nth_element(middles.begin(), half, middles.end(),
                   [axis](const Vec3d& a, const Vec3d& b) { return a[axis] < b[axis]; });
  WallPlane plane{Vec3d(0.0), (*half)[axis]};
  plane.normal[axis] = 1;
  const auto beyond = [&](double side) {
    return static_cast<std::size_t>(
        std::count_if(cuts.begin(), cuts.end(), [&](const WallCut& cut) {
          return std::max(side * plane.at(cut.from), side * plane.at(cut.to)) > in_plane_mm;
        }));
  };
  const std::size_t above = beyond(1);
  const std::size_t below = beyond(-1);
  const bool parts =
      4 * std::max(above, below) <= 3 * cuts.size() && 2 * (above + below) <= 3 * cuts.size();
  return parts ? std::optional(plane) : std::nullopt;
}

}  // namespace

Vec3d middleOf(const WallPiece& piece) {
  return std::accumulate(piece.begin(), piece.end(), Vec3d(0, 0, 0)) /
         static_cast<double>(piece.size());
}

bool WallCutter::isSurface(const Vec3d& p) const {
  if (normal_ == Vec3d(0, 0, 0)) return false;
  const LineWinding::Sides sides = winding_.at(p, normal_, beside_mm);
  return (sides.front != 0) != (sides.back != 0);
}

/// On the straight way from the middle to any place of the wall each segment is passed at most
/// once. So the number cannot fall to zero if it is above the sum of all that it may fall.
bool WallCutter::isWithinSolid(const Vec3d& middle, const Cuts& cuts) const {
  const LineWinding::Sides sides = winding_.at(middle, normal_, beside_mm);
  int least = std::min(sides.front, sides.back);
  for (const WallCut& cut : cuts) {
    if (least <= 0) return false;
    const double height = cut.plane.at(middle);
    least -= std::max(height < 2 * beside_mm ? cut.from_below : 0,
                      height > -2 * beside_mm ? cut.from_above : 0);
  }
  return least > 0;
}

WallCutter::Surface WallCutter::divide(const WallPiece& wall, Cuts cuts,
                                       std::vector<WallPiece>& pieces) const {
  throwIfInterrupted();
  const Vec3d middle = middleOf(wall);
  if (cuts.size() > 1 && isWithinSolid(middle, cuts)) return Surface::none;
  std::optional<std::array<WallPiece, 2>> halves;
  WallPlane plane;
  if (const std::optional<WallPlane> between = planeBetween(cuts)) {
    plane = *between;
    halves = halvesOf(wall, plane);
  }
  while (!halves && !cuts.empty()) {
    const auto longest =
        std::max_element(cuts.begin(), cuts.end(), [](const WallCut& a, const WallCut& b) {
          return (a.to - a.from).lengthSqr() < (b.to - b.from).lengthSqr();
        });
    plane = longest->plane;
    halves = halvesOf(wall, plane);
    if (!halves) cuts.erase(longest);
  }
  if (!halves) {
    if (!isSurface(middle)) return Surface::none;
    pieces.push_back(wall);
    return Surface::all;
  }
  std::array<Cuts, 2> parted = halvesOf(cuts, plane);
  Cuts().swap(cuts);
  const std::size_t before = pieces.size();
  const Surface above = divide((*halves)[0], std::move(parted[0]), pieces);
  const Surface below = divide((*halves)[1], std::move(parted[1]), pieces);
  if (above != below) return Surface::some;
  if (above == Surface::all) {
    pieces.resize(before);
    pieces.push_back(wall);
  }
  return above;
}

WallCutter::Surface WallCutter::cut(const WallPiece& wall, const Cuts& cuts,
                                    std::vector<WallPiece>& pieces) const {
  Cuts within = cuts;
  for (std::size_t side = 0; side < wall.size(); ++side) {
    const Vec3d& a = wall[side];
    Vec3d inwards = normal_.cross(wall[(side + 1) % wall.size()] - a);
    inwards.normalize();
    within = std::move(halvesOf(within, {inwards, inwards.dot(a)})[0]);
  }
  return divide(wall, std::move(within), pieces);
}

}  // namespace vdbdither
