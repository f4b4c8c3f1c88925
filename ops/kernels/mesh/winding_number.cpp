// The solid angle of a triangle: van Oosterom, Strackee: "The Solid Angle of a Plane Triangle",
// IEEE Transactions on Biomedical Engineering 30(2), 1983. The winding number: Jacobson, Kavan,
// Sorkine-Hornung: "Robust inside-outside segmentation using generalized winding numbers", ACM
// Transactions on Graphics 32(4), 2013. Groups of triangles: Barill, Dickson, Schmidt, Levin,
// Jacobson: "Fast winding numbers for soups and clouds", ACM Transactions on Graphics 37(4),
// 2018.

#include "ops/kernels/mesh/winding_number.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

/// A number nearer to ½ than this is computed again, more accurately.
constexpr double rough_doubt = 0.01;
constexpr double close_doubt = 0.0005;

double fromHalf(double number) { return std::abs(std::abs(number) - 0.5); }

/// A complex number whose argument is half a triangle's solid angle.
struct HalfAngle {
  double re, im;
};
/// Of the triangle whose corners are seen at a, b and c.
HalfAngle halfAngle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const double la = std::sqrt(a.x() * a.x() + a.y() * a.y() + a.z() * a.z());
  const double lb = std::sqrt(b.x() * b.x() + b.y() * b.y() + b.z() * b.z());
  const double lc = std::sqrt(c.x() * c.x() + c.y() * c.y() + c.z() * c.z());
  return {la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb, a.dot(b.cross(c))};
}
HalfAngle halfAngle(const std::array<Vec3d, 3>& corners, const Vec3d& p) {
  return halfAngle(corners[0] - p, corners[1] - p, corners[2] - p);
}

/// A sum of half angles: their product, and how often its argument has passed π.
class HalfAngleSum {
 public:
  void add(const HalfAngle& half) {
    if (half.im == 0) return;
    const double size = std::max(std::abs(half.re), std::abs(half.im));
    const double re = half.re / size;
    const double im = half.im / size;
    const double next_re = re_ * re - im_ * im;
    const double next_im = re_ * im + im_ * re;
    if (im_ >= 0 && im > 0 && next_im < 0) ++turns_;
    if (im_ < 0 && im < 0 && next_im >= 0) --turns_;
    re_ = next_re;
    im_ = next_im;
  }
  /// Prevents that the product of many grows beyond all bounds.
  void shorten() {
    const double size = std::max(std::abs(re_), std::abs(im_));
    re_ /= size;
    im_ /= size;
  }
  [[nodiscard]] double total() const {
    return std::atan2(im_, re_) + 2 * std::numbers::pi * turns_;
  }

 private:
  double re_ = 1, im_ = 0;
  int turns_ = 0;
};

}  // namespace

double solidAngle(const std::array<Vec3d, 3>& corners, const Vec3d& p) {
  const HalfAngle half = halfAngle(corners, p);
  return half.im == 0 ? 0 : 2 * std::atan2(half.im, half.re);
}

double windingOf(const Mesh& mesh, std::span<const std::uint32_t> triangles, const Vec3d& p) {
  HalfAngleSum sum;
  for (const std::uint32_t triangle : triangles) sum.add(halfAngle(cornersOf(mesh, triangle), p));
  return sum.total() / (2 * std::numbers::pi);
}

Vec3d windingGradientOf(const Mesh& mesh, std::span<const std::uint32_t> triangles,
                        const Vec3d& p) {
  Vec3d sum(0.0);
  for (const std::uint32_t triangle : triangles) {
    std::array<Vec3d, 3> to = cornersOf(mesh, triangle);
    std::array<double, 3> length;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      to[corner] -= p;
      length[corner] = to[corner].length();
    }
    for (std::size_t side = 0; side < 3; ++side) {
      const std::size_t next = (side + 1) % 3;
      const double product = length[side] * length[next];
      const double between = product + to[side].dot(to[next]);
      if (between > 0)
        sum += to[side].cross(to[next]) * ((length[side] + length[next]) / (product * between));
    }
  }
  return sum / (4 * std::numbers::pi);
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
  for (Node& node : nodes_) {
    if (node.other != 0) continue;
    node.corners = static_cast<std::uint32_t>(leaf_corners_.size());
    LeafCorners& leaf = leaf_corners_.emplace_back();
    for (std::uint32_t i = node.begin; i < node.end; ++i) {
      const std::array<Vec3d, 3> at = corners(order_[i]);
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::size_t corner = 0; corner < 3; ++corner)
          leaf[3 * corner + axis][i - node.begin] = at[corner][static_cast<int>(axis)];
    }
  }
}

WindingNumber::Node WindingNumber::nodeOf(std::uint32_t begin, std::uint32_t end) const {
  Node node{};
  node.begin = begin;
  node.end = end;
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
  for (std::uint32_t i = begin; i < end; ++i) {
    std::array<Vec3d, 3> at = corners(order_[i]);
    for (Vec3d& corner : at) {
      corner -= node.centre;
      node.radius = std::max(node.radius, corner.length());
    }
    const Vec3d area = 0.5 * (at[1] - at[0]).cross(at[2] - at[0]);
    const Vec3d total = at[0] + at[1] + at[2];
    const Vec3d x = total / 3;
    for (int axis = 0; axis < 3; ++axis)
      node.first[static_cast<std::size_t>(axis)] += area[axis] * x[axis];
    node.first[3] += 0.5 * (area.x() * x.y() + area.y() * x.x());
    node.first[4] += 0.5 * (area.x() * x.z() + area.z() * x.x());
    node.first[5] += 0.5 * (area.y() * x.z() + area.z() * x.y());
    // The mean of x xᵀ over a triangle.
    const auto mean = [&](int j, int k) {
      return (at[0][j] * at[0][k] + at[1][j] * at[1][k] + at[2][j] * at[2][k] +
              total[j] * total[k]) /
             12;
    };
    const double xx = mean(0, 0);
    const double yy = mean(1, 1);
    const double zz = mean(2, 2);
    const double xy = mean(0, 1);
    const double xz = mean(0, 2);
    const double yz = mean(1, 2);
    node.second_trace +=
        area * (xx + yy + zz) + 2.0 * Vec3d(area.x() * xx + area.y() * xy + area.z() * xz,
                                            area.x() * xy + area.y() * yy + area.z() * yz,
                                            area.x() * xz + area.y() * yz + area.z() * zz);
    node.second[0] += area.x() * xx;
    node.second[1] += area.y() * yy;
    node.second[2] += area.z() * zz;
    node.second[3] += 2 * area.x() * xy + area.y() * xx;
    node.second[4] += 2 * area.x() * xz + area.z() * xx;
    node.second[5] += 2 * area.y() * xy + area.x() * yy;
    node.second[6] += 2 * area.y() * yz + area.z() * yy;
    node.second[7] += 2 * area.z() * xz + area.x() * zz;
    node.second[8] += 2 * area.z() * yz + area.y() * zz;
    node.second[9] += 2 * (area.x() * yz + area.y() * xz + area.z() * xy);
  }
  return node;
}

std::uint32_t WindingNumber::build(std::uint32_t begin, std::uint32_t end) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(nodeOf(begin, end));
  if (end - begin <= triangles_per_leaf) return index;
  openvdb::math::BBox<Vec3d> box;
  for (std::uint32_t i = begin; i < end; ++i) box.expand(middles_[order_[i]]);
  const auto axis = static_cast<int>(box.maxExtent());
  const std::uint32_t half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double at_a = middles_[a][axis];
                     const double at_b = middles_[b][axis];
                     return at_a < at_b || (at_a == at_b && a < b);
                   });
  build(begin, half);
  const std::uint32_t other = build(half, end);
  nodes_[index].other = other;
  return index;
}

double WindingNumber::exactAt(const Vec3d& p) const {
  double sum = 0;
  for (std::uint32_t t = 0; t < order_.size(); ++t) sum += solidAngle(corners(t), p);
  return sum / (4 * std::numbers::pi);
}

double WindingNumber::judgedAt(const Vec3d& p) const {
  const double rough = at(p);
  if (fromHalf(rough) > rough_doubt) return rough;
  const double close = closelyAt(p);
  return fromHalf(close) > close_doubt ? close : exactAt(p);
}

template <class Far, class Near>
void WindingNumber::forEach(const Vec3d& p, double far_radii, const Far& far,
                            const Near& near) const {
  if (nodes_.empty()) return;
  std::array<std::uint32_t, 64> waiting;
  std::size_t count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const std::uint32_t index = waiting[--count];
    const Node& node = nodes_[index];
    const Vec3d r = node.centre - p;
    if (r.lengthSqr() > far_radii * far_radii * node.radius * node.radius) {
      far(node, r);
    } else if (node.other == 0) {
      near(node);
    } else {
      waiting[count++] = node.other;
      waiting[count++] = index + 1;
    }
  }
}

std::size_t WindingNumber::workAt(const Vec3d& p) const {
  std::size_t work = 0;
  forEach(
      p, close_radii, [&work](const Node&, const Vec3d&) { ++work; },
      [&work](const Node& node) { work += node.end - node.begin; });
  return work;
}

/// A group adds the field of a dipole, a·r / r³ with r from the point to the group's centre, and
/// its first and second derivatives, contracted with the moments.
double WindingNumber::sum(const Vec3d& p, double far_radii) const {
  double sum = 0;
  const auto far = [&sum](const Node& node, const Vec3d& r) {
    const double x = r.x();
    const double y = r.y();
    const double z = r.z();
    const auto& one = node.first;
    const auto& two = node.second;
    const double squared = r.lengthSqr();
    const double per_squared = 1 / squared;
    const double trace = one[0] + one[1] + one[2];
    const double across = one[0] * x * x + one[1] * y * y + one[2] * z * z +
                          2 * (one[3] * x * y + one[4] * x * z + one[5] * y * z);
    const double thrice = x * (x * (two[0] * x + two[3] * y + two[4] * z) + two[9] * y * z) +
                          y * (y * (two[1] * y + two[5] * x + two[6] * z)) +
                          z * (z * (two[2] * z + two[7] * x + two[8] * y));
    sum += (node.area.dot(r) + trace +
            per_squared *
                (-3 * across - 1.5 * node.second_trace.dot(r) + 7.5 * per_squared * thrice)) *
           per_squared / std::sqrt(squared);
  };
  HalfAngleSum angles;
  const auto near = [&](const Node& node) {
    const LeafCorners& at = leaf_corners_[node.corners];
    std::array<double, triangles_per_leaf> re;
    std::array<double, triangles_per_leaf> im;
    for (std::size_t i = 0; i < triangles_per_leaf; ++i) {
      const auto to = [&](std::size_t corner) {
        return Vec3d(at[3 * corner][i] - p.x(), at[3 * corner + 1][i] - p.y(),
                     at[3 * corner + 2][i] - p.z());
      };
      const HalfAngle half = halfAngle(to(0), to(1), to(2));
      re[i] = half.re;
      im[i] = half.im;
    }
    for (std::size_t i = 0; i < node.end - node.begin; ++i) angles.add({re[i], im[i]});
    angles.shorten();
  };
  forEach(p, far_radii, far, near);
  return angles.total() / (2 * std::numbers::pi) + sum / (4 * std::numbers::pi);
}

/// A group adds the derivative of its terms in the number.
Vec3d WindingNumber::gradientAt(const Vec3d& p) const {
  Vec3d sum(0.0);
  const auto far = [&sum](const Node& node, const Vec3d& r) {
    const double x = r.x();
    const double y = r.y();
    const double z = r.z();
    const auto& one = node.first;
    const auto& two = node.second;
    const double per_squared = 1 / r.lengthSqr();
    const double trace = one[0] + one[1] + one[2];
    const Vec3d turned(one[0] * x + one[3] * y + one[4] * z, one[3] * x + one[1] * y + one[5] * z,
                       one[4] * x + one[5] * y + one[2] * z);
    const Vec3d thrice(x * (3 * two[0] * x + 2 * (two[3] * y + two[4] * z)) + two[9] * y * z +
                           two[5] * y * y + two[7] * z * z,
                       y * (3 * two[1] * y + 2 * (two[5] * x + two[6] * z)) + two[9] * x * z +
                           two[3] * x * x + two[8] * z * z,
                       z * (3 * two[2] * z + 2 * (two[7] * x + two[8] * y)) + two[9] * x * y +
                           two[4] * x * x + two[6] * y * y);
    const double along = 3 * (node.area.dot(r) + trace) -
                         per_squared * (15 * turned.dot(r) + 7.5 * node.second_trace.dot(r) -
                                        17.5 * per_squared * thrice.dot(r));
    sum += (per_squared *
                (along * r + 6.0 * turned + 1.5 * node.second_trace - 7.5 * per_squared * thrice) -
            node.area) *
           (per_squared * std::sqrt(per_squared));
  };
  Vec3d gradient(0.0);
  const auto near = [&](const Node& node) {
    gradient += windingGradientOf(mesh_, trianglesOf(node), p);
  };
  forEach(p, close_radii, far, near);
  return gradient + sum / (4 * std::numbers::pi);
}

}  // namespace vdbdither
