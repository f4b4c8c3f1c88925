// The Gaussian of void and cluster as Ulichney, "The void-and-cluster method for dither array
// generation", SPIE 1913 (1993) samples it, and as Peters, "Free blue noise textures" (2016)
// applies it on the DFT. Both are products of one factor per axis.
#include "ops/kernels/mask/mask_kernel.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

namespace {

constexpr double pi = 3.14159265358979323846;

/// Returns exp(-x) for x ≥ 0. The library's function may differ in the last bit between processors.
double decay(double x) {
  if (x > 700) return 0;
  int halvings = 0;
  while (x > 0.125) {
    x /= 2;
    ++halvings;
  }
  double sum = 1;
  for (int i = 14; i > 0; --i) sum = 1 - sum * x / i;
  for (; halvings > 0; --halvings) sum *= sum;
  return sum;
}

/// Returns cos(2π·part/whole) for 0 ≤ part < whole, for the same reason.
double cosineOfTurn(int part, int whole) {
  if (2 * part > whole) part = whole - part;
  const bool flip = 4 * part > whole;
  const double angle = 2 * pi * (flip ? whole - 2 * part : 2 * part) / (2.0 * whole);
  double sum = 1;
  for (int i = 24; i > 0; i -= 2) sum = 1 - sum * angle * angle / (i * (i - 1));
  return flip ? -sum : sum;
}

std::vector<double> sampledGaussian(double sigma, int size) {
  std::vector<double> factor(size);
  const int repetitions = static_cast<int>(9 * sigma / size) + 1;
  for (int d = 0; d < size; ++d) {
    for (int r = -repetitions; r <= repetitions; ++r) {
      const double distance = (d + static_cast<double>(r) * size) / sigma;
      factor[d] += decay(distance * distance / 2);
    }
  }
  return factor;
}

std::vector<double> bandLimitedGaussian(double sigma, int size) {
  std::vector<double> factor(size);
  for (int d = 0; d < size; ++d) {
    for (int k = -(size / 2); k < size - size / 2; ++k) {
      const double frequency = static_cast<double>(k) / size;
      factor[d] += decay(2 * pi * pi * sigma * sigma * frequency * frequency) *
                   cosineOfTurn(std::abs(k) * d % size, size);
    }
  }
  return factor;
}

std::vector<double> origin(int size) {
  std::vector<double> factor(size);
  factor[0] = 1;
  return factor;
}

void scale(std::vector<double>& factor, double by) {
  for (double& value : factor) value *= by;
}

}  // namespace

ToroidalKernel::ToroidalKernel(const MaskKernel& kernel, const openvdb::Coord& size) {
  if (kernel.shape == MaskKernel::Shape::exponential) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int d = 0; d < size[axis]; ++d) {
        const double distance = std::min(d, size[axis] - d) / kernel.sigma[axis];
        square_distances_[axis].push_back(distance * distance);
      }
    }
    space_weight_ = kernel.space_weight;
    return;
  }
  const bool band_limited = kernel.shape == MaskKernel::Shape::peters;
  Term& space = terms_.emplace_back();
  for (int axis = 0; axis < 3; ++axis) {
    space[axis] =
        (band_limited ? bandLimitedGaussian : sampledGaussian)(kernel.sigma[axis], size[axis]);
  }
  if (kernel.shape == MaskKernel::Shape::axis_mix) {
    const openvdb::Vec3d& sigma = kernel.sigma;
    scale(space[0],
          kernel.space_weight / (std::sqrt(8 * pi * pi * pi) * sigma[0] * sigma[1] * sigma[2]));
    for (int normal = 0; normal < 3; ++normal) {
      Term plane;
      for (int axis = 0; axis < 3; ++axis) {
        plane[axis] =
            axis == normal ? origin(size[axis]) : sampledGaussian(kernel.plane_sigma, size[axis]);
      }
      scale(plane[0], 1 / (2 * pi * kernel.plane_sigma * kernel.plane_sigma));
      terms_.push_back(plane);
    }
  }
  const double peak = (*this)(0, 0, 0);
  for (Term& term : terms_) scale(term[0], 1 / peak);
}

double ToroidalKernel::operator()(int x, int y, int z) const {
  if (terms_.empty()) {
    const int planes = (x == 0 ? 1 : 0) + (y == 0 ? 1 : 0) + (z == 0 ? 1 : 0);
    return (space_weight_ + planes) / (space_weight_ + 3) *
           decay(std::sqrt(square_distances_[0][x] + square_distances_[1][y] +
                           square_distances_[2][z]));
  }
  double sum = 0;
  for (const Term& term : terms_) sum += term[0][x] * term[1][y] * term[2][z];
  return sum;
}

}  // namespace vdbdither
