#include "tests/bench/dither_quality/print_measures.h"

#include <algorithm>
#include <bit>
#include <iostream>
#include <numbers>

namespace vdbdither::quality {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::Vec3d;

double Blurred::operator()(const Vec3d& at_mm) const {
  Coord first;
  for (int axis = 0; axis < 3; ++axis) first[axis] = weigh(axis, at_mm[axis]);
  const Coord size = box_.dim();
  double sum = 0;
  for (std::size_t i = 0; i < weights_[0].size(); ++i) {
    double of_plane = 0;
    for (std::size_t j = 0; j < weights_[1].size(); ++j) {
      const Coord row = first - box_.min() + Coord(static_cast<int>(i), static_cast<int>(j), 0);
      const float* values = occupied_.data() + (row.x() * size.y() + row.y()) * size.z() + row.z();
      float of_row = 0;
      for (std::size_t k = 0; k < weights_[2].size(); ++k) of_row += weights_[2][k] * values[k];
      of_plane += static_cast<double>(weights_[1][j]) * static_cast<double>(of_row);
    }
    sum += static_cast<double>(weights_[0][i]) * of_plane;
  }
  return sum;
}

/// Of a flat print whose occupancy there is this; a step of Newton's method for any other.
double Blurred::height(const Vec3d& at_mm) const {
  const double share = std::clamp((*this)(at_mm), 1e-5, 1 - 1e-5);
  double low = -5;
  double high = 5;
  for (int n = 0; n < 40; ++n) {
    const double middle = (low + high) / 2;
    (std::erfc(-middle / std::numbers::sqrt2) / 2 < share ? low : high) = middle;
  }
  return spread_mm_ * low;
}

int Blurred::weigh(int axis, double at_mm) const {
  const double pitch = pitch_mm_[axis];
  const int reach = static_cast<int>(std::ceil(3.6 * spread_mm_ / pitch));
  const int first = static_cast<int>(std::lround(at_mm / pitch)) - reach;
  auto& weights = weights_[static_cast<std::size_t>(axis)];
  weights.resize(static_cast<std::size_t>(2 * reach + 1));
  const auto below = [&](int n) {
    return std::erf(((first + n - 0.5) * pitch - at_mm) / spread_mm_ / std::numbers::sqrt2) / 2;
  };
  const double least = below(0);
  const double all = below(2 * reach + 1) - least;
  double before = least;
  for (int n = 0; n <= 2 * reach; ++n) {
    const double after = below(n + 1);
    weights[static_cast<std::size_t>(n)] = static_cast<float>((after - before) / all);
    before = after;
  }
  return first;
}

void Errors::print() const {
  double stairs = 0;
  double mean_deviation = 0;
  double deviation2 = 0;
  for (const Moments& phase : phases_) {
    stairs += std::pow(phase.mean() - all_.mean(), 2);
    mean_deviation += phase.deviation();
    deviation2 += std::pow(phase.deviation(), 2);
  }
  mean_deviation /= 16;
  std::cout << "\"bias\":" << all_.mean() << ",\"mean\":" << absolute_ / all_.count
            << ",\"rms\":" << std::sqrt(all_.squares / all_.count)
            << ",\"stairs\":" << std::sqrt(stairs / 16) << ",\"modulation\":"
            << std::sqrt(std::max(0.0, deviation2 / 16 - mean_deviation * mean_deviation));
}

int cavities(const Voxels& printed) {
  Voxels empty(printed.box(), 0);
  for (auto v = printed.box().begin(); v; ++v) empty[*v] = printed[*v] ? 0 : 1;
  return test::components(empty, test::Touching::faces) - 1;
}

int tunnels(const Voxels& printed) {
  const CoordBBox& box = printed.box();
  int euler = 0;
  // Every cell of the cubic complex is counted at its lowest corner: a voxel, or what the voxels
  // around it hold of it.
  for (auto v = CoordBBox(box.min(), box.max().offsetBy(1)).begin(); v; ++v) {
    for (int kind = 0; kind < 8; ++kind) {
      // Bits: the axes along which the cell is flat.
      bool held = false;
      for (int around = 0; around < 8 && !held; ++around) {
        if ((around & ~kind) != 0) continue;
        held = printed.at((*v).offsetBy(-(around & 1), -(around >> 1 & 1), -(around >> 2)), 0) != 0;
      }
      if (held) euler += std::popcount(static_cast<unsigned>(kind)) % 2 == 0 ? -1 : 1;
    }
  }
  return test::components(printed, test::Touching::corners) + cavities(printed) - euler;
}

double volumeMm3(const Voxels& printed, const Vec3d& pitch_mm) {
  double count = 0;
  for (auto v = printed.box().begin(); v; ++v) count += printed[*v] ? 1 : 0;
  return count * pitch_mm.product();
}

}  // namespace vdbdither::quality
