#include "ops/kernels/mesh/wall_cutter.h"

#include <algorithm>
#include <array>
#include <cstddef>
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
/// Corners in the plane stay where they are, so that no piece has two at one place.
std::optional<std::array<WallPiece, 2>> halvesOf(const WallPiece& wall, const WallPlane& plane) {
  const auto sideOf = [&](const Vec3d& p) {
    const double height = plane.at(p);
    return height > in_plane_mm ? 1 : height < -in_plane_mm ? -1 : 0;
  };
  std::array<WallPiece, 2> halves;
  std::array<bool, 2> beyond{};
  for (std::size_t i = 0; i < wall.size(); ++i) {
    const Vec3d& p = wall[i];
    const Vec3d& q = wall[(i + 1) % wall.size()];
    const int side = sideOf(p);
    if (side >= 0) halves[0].push_back(p);
    if (side <= 0) halves[1].push_back(p);
    beyond[0] |= side > 0;
    beyond[1] |= side < 0;
    if (side * sideOf(q) >= 0) continue;
    const double at_p = plane.at(p);
    const Vec3d between = p + (q - p) * (at_p / (at_p - plane.at(q)));
    halves[0].push_back(between);
    halves[1].push_back(between);
  }
  return beyond[0] && beyond[1] ? std::optional(std::move(halves)) : std::nullopt;
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

/// Returns by how much the number of a body may fall, at most once at each of some segments.
int largestFall(int number, int segments, int lowest) {
  const bool is_known = number == lowest || number == lowest + 1;
  return is_known ? std::min(segments, number - lowest) : segments;
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

/// Judges a wall without segments by the numbers at its middle.
WallCutter::Surface WallCutter::surfaceBy(const Numbers& numbers) {
  const bool is_solid_in_front = numbers.here.front != 0;
  const bool is_solid_behind = numbers.is_front_enough || numbers.here.back != 0;
  return is_solid_in_front != is_solid_behind ? Surface::all : Surface::none;
}

/// Returns how much of a wall is surface where the numbers at its middle tell; otherwise leaves out
/// the segments that cannot matter. On the straight way from the middle to any place each segment
/// is passed at most once, so the number of a body cannot fall by more than one at each of its
/// segments that lies above the middle's side, nor below the lowest number of the body.
std::optional<WallCutter::Surface> WallCutter::judge(const Vec3d& middle, Cuts& cuts,
                                                     Numbers& numbers) const {
  Numbers next = numbers;
  next.open.clear();
  next.here = numbers.settled;
  LineWinding::Sides least = numbers.settled;
  bool front_changes = false;
  auto cut = cuts.begin();
  for (const std::uint32_t body : numbers.open) {
    const LineWinding::Sides here = winding_.ofBody(body, middle, normal_, beside_mm);
    LineWinding::Sides falls;
    bool changes = false;
    for (; cut != cuts.end() && cut->body == body; ++cut) {
      const bool may_fall = cut->plane.at(middle) < 2 * beside_mm;
      falls.front += cut->in_front && may_fall ? 1 : 0;
      falls.back += cut->behind && may_fall ? 1 : 0;
      front_changes |= cut->in_front;
      changes = true;
    }
    if (changes) {
      next.open.push_back(body);
    } else {
      next.settled += here;
    }
    next.here += here;
    least.front += here.front - largestFall(here.front, falls.front, lowest_[body]);
    least.back += here.back - largestFall(here.back, falls.back, lowest_[body]);
  }
  numbers = std::move(next);
  if (cuts.empty()) return surfaceBy(numbers);
  if (least.front > 0 && least.back > 0) return Surface::none;
  if (is_opposed_ || least.front < 0) return std::nullopt;
  // The number behind is greater than that in front by the triangles in the plane.
  if (least.front > 0) return Surface::none;
  if (!front_changes) return Surface::all;
  numbers.is_front_enough = true;
  std::erase_if(cuts, [](const WallCut& each) { return !each.in_front; });
  return std::nullopt;
}

WallCutter::Surface WallCutter::divide(const WallPiece& wall, Cuts cuts, Numbers numbers,
                                       std::vector<WallPiece>& pieces) const {
  throwIfInterrupted();
  std::optional<Surface> judged = judge(middleOf(wall), cuts, numbers);
  if (judged == Surface::all) pieces.push_back(wall);
  if (judged) return *judged;
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
    judged = surfaceBy(numbers);
    if (judged == Surface::all) pieces.push_back(wall);
    return *judged;
  }
  std::array<Cuts, 2> parted = halvesOf(cuts, plane);
  Cuts().swap(cuts);
  const std::size_t before = pieces.size();
  const Surface above = divide((*halves)[0], std::move(parted[0]), numbers, pieces);
  const Surface below = divide((*halves)[1], std::move(parted[1]), std::move(numbers), pieces);
  if (above != below) return Surface::some;
  if (above == Surface::all) {
    pieces.resize(before);
    pieces.push_back(wall);
  }
  return above;
}

WallCutter::Surface WallCutter::cut(const WallPiece& wall, Cuts cuts,
                                    std::vector<WallPiece>& pieces) const {
  for (std::size_t side = 0; side < wall.size(); ++side) {
    const Vec3d& a = wall[side];
    Vec3d inwards = normal_.cross(wall[(side + 1) % wall.size()] - a);
    inwards.normalize();
    cuts = std::move(halvesOf(cuts, {inwards, inwards.dot(a)})[0]);
  }
  std::stable_sort(cuts.begin(), cuts.end(),
                   [](const WallCut& a, const WallCut& b) { return a.body < b.body; });
  Numbers numbers;
  for (const WallCut& each : cuts)
    if (numbers.open.empty() || each.body != numbers.open.back()) numbers.open.push_back(each.body);
  numbers.settled = winding_.at(middleOf(wall), normal_, beside_mm, numbers.open);
  return divide(wall, std::move(cuts), std::move(numbers), pieces);
}

}  // namespace vdbdither
