#include "ops/kernels/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr std::uint32_t triangles_per_leaf = 8;

/// From how many radii a group counts as a dipole.
constexpr double far_radii = 4;

}  // namespace

double solidAngle(const std::array<Vec3d, 3>& corners, const Vec3d& p) {
  const Vec3d a = corners[0] - p;
  const Vec3d b = corners[1] - p;
  const Vec3d c = corners[2] - p;
  const double la = a.length();
  const double lb = b.length();
  const double lc = c.length();
  const double volume = a.dot(b.cross(c));
  if (volume == 0) return 0;
  return 2 * std::atan2(volume, la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

WindingNumber::WindingNumber(const Mesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0U);
  middles_.reserve(order_.size());
  for (std::uint32_t t = 0; t < order_.size(); ++t) {
    const auto [a, b, c] = corners(t);
    middles_.push_back((a + b + c) / 3);
  }
  nodes_.reserve(order_.size() / 2);
  if (!order_.empty()) build(0, static_cast<std::uint32_t>(order_.size()));
  middles_.clear();
  middles_.shrink_to_fit();
}

std::array<Vec3d, 3> WindingNumber::corners(std::uint32_t triangle) const {
  const Mesh::Triangle& t = mesh_.triangles[triangle];
  return {mesh_.vertices[t[0]], mesh_.vertices[t[1]], mesh_.vertices[t[2]]};
}

std::uint32_t WindingNumber::build(std::uint32_t begin, std::uint32_t end) {
  Node node{Vec3d(0, 0, 0), Vec3d(0, 0, 0), 0, begin, end, 0};
  double weight = 0;
  openvdb::math::BBox<Vec3d> box;
  for (std::uint32_t i = begin; i < end; ++i) {
    const auto [a, b, c] = corners(order_[i]);
    const Vec3d area = 0.5 * (b - a).cross(c - a);
    node.area += area;
    node.centre += middles_[order_[i]] * area.length();
    weight += area.length();
    box.expand(middles_[order_[i]]);
  }
  node.centre = weight > 0 ? node.centre / weight : box.getCenter();
  for (std::uint32_t i = begin; i < end; ++i)
    for (const Vec3d& corner : corners(order_[i]))
      node.radius = std::max(node.radius, (corner - node.centre).length());
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(node);
  if (end - begin <= triangles_per_leaf) return index;
  const auto axis = static_cast<int>(box.maxExtent());
  const std::uint32_t half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double at_a = middles_[a][axis];
                     const double at_b = middles_[b][axis];
                     return at_a < at_b || (at_a == at_b && a < b);
                   });
  build(begin, half);
  const std::uint32_t second = build(half, end);
  nodes_[index].second = second;
  return index;
}

double WindingNumber::exactAt(const Vec3d& p) const {
  double sum = 0;
  for (std::uint32_t t = 0; t < order_.size(); ++t) sum += solidAngle(corners(t), p);
  return sum / (4 * std::numbers::pi);
}

double WindingNumber::at(const Vec3d& p) const {
  if (nodes_.empty()) return 0;
  double sum = 0;
  std::array<std::uint32_t, 64> waiting;
  std::size_t count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const std::uint32_t index = waiting[--count];
    const Node& node = nodes_[index];
    const Vec3d away = node.centre - p;
    const double squared = away.lengthSqr();
    if (squared > far_radii * far_radii * node.radius * node.radius) {
      sum += node.area.dot(away) / (squared * std::sqrt(squared));
    } else if (node.second == 0) {
      for (std::uint32_t i = node.begin; i < node.end; ++i)
        sum += solidAngle(corners(order_[i]), p);
    } else {
      waiting[count++] = node.second;
      waiting[count++] = index + 1;
    }
  }
  return sum / (4 * std::numbers::pi);
}

}  // namespace vdbdither
