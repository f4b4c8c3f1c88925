// The displacement and its constant are eq. (5) of Morsy, Brunton, Urban: Shape Dithering for 3D
// Printing, ACM Transactions on Graphics 41(4), 2022. docs/evaluation.md has the measurements.

#include "ops/kernels/dither/adapted_amplitude.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <tbb/parallel_for.h>

#include "ops/kernels/dither/voxel_diameter.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr double pi = std::numbers::pi;

/// The levels that are tried; more of them reduce the errors by less than a per cent.
constexpr std::array checkers{0.0, 0.5, 1.0};
constexpr std::array amplitudes{0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0};
constexpr std::size_t combinations = checkers.size() * amplitudes.size();
constexpr std::size_t plain = 0;  ///< the first combination: plain voxels

/// Whether both together stay within the voxel.
constexpr bool isAllowed(double checker, double amplitude) {
  return checker + amplitude <= 2 && (checker > 0 || amplitude != 0.25);
}

/// The weight of the variance of the stairs, relative to that of the grain: lines are visible where
/// grain is not. Compared with 1, a weight of 3 raises the mean error by 1 % up to 10° and by 5 %
/// beyond, and removes a third of the stairs. Larger weights hardly move the angles at which the
/// checkerboard replaces the thresholds.
constexpr double stairs_weight = 3;

/// The share of white noise's variance that remains after the blur, measured on facets of every
/// tilt with the default mask. At the constant 2 it rises with the facet's slope in voxels, because
/// the mask is bluest in the lattice planes, and with the share of a voxel's face in the blur. At
/// smaller constants fewer thresholds have an effect, and what they leave of a blue mask is whiter.
/// The checkerboard hides every other threshold, so that hardly any blue remains.
constexpr double blue_noise_flat = 0.05;
constexpr double blue_noise_per_face = 0.14;
constexpr double blue_noise_per_slope = 0.7;
constexpr double blue_noise_steep = 0.6;
constexpr double checkered_noise = 0.9;

/// The maximum of cycles per voxel diameter, along the normal, up to which waves count; beyond,
/// their height is below a hundredth of a diameter. High waves matter: on special slopes, such as 1
/// in 6, one can be as long as the facet while the first stairs are blurred away.
constexpr double maximum_cycles = 16;

/// Errors below this share of a voxel's diameter count as none.
constexpr double negligible_share = 0.01;

template <typename Vector>
int dominantAxis(const Vector& n) {
  const auto size = [&](int axis) { return std::abs(n[axis]); };
  return size(0) >= size(1) ? (size(0) >= size(2) ? 0 : 2) : (size(1) >= size(2) ? 1 : 2);
}

double sinc(double x) { return std::abs(x) < 1e-9 ? 1 : std::sin(pi * x) / (pi * x); }

/// Mean square errors by combination, mm², for one blur.
using Errors = std::array<double, combinations>;

class Facet {
 public:
  Facet(const Vec3d& normal, const Vec3d& pitch_mm, double spread_mm)
      : normal_(normal),
        pitch_mm_(pitch_mm),
        spread_mm_(spread_mm),
        half_diameter_mm_(halfVoxelDiameter(openvdb::Vec3s(normal), pitch_mm)),
        negligible_mm2_(std::pow(negligible_share * 2 * half_diameter_mm_, 2)) {
    addStairs();
    addGrain();
  }

  [[nodiscard]] FacetDither best() const {
    std::array<double, blurs> minimum;
    minimum.fill(std::numeric_limits<double>::infinity());
    forEachAllowed([&](std::size_t n, const FacetDither&) {
      for (int b = 0; b < blurs; ++b) minimum[b] = std::min(minimum[b], weighed(b, n));
    });

    FacetDither best;
    double best_excess = std::numeric_limits<double>::infinity();
    forEachAllowed([&](std::size_t n, const FacetDither& dither) {
      double excess = 0;
      for (int b = 0; b < blurs; ++b)
        excess =
            std::max(excess, (weighed(b, n) + negligible_mm2_) / (minimum[b] + negligible_mm2_));
      if (excess < best_excess) {
        best_excess = excess;
        best = dither;
      }
    });
    return best;
  }

 private:
  static constexpr int blurs = 2;
  [[nodiscard]] double blurMm(int b) const { return spread_mm_ * (b + 1); }

  [[nodiscard]] double weighed(int b, std::size_t n) const {
    return stairs_weight * stairs_[b][n] + grain_[b][n];
  }

  /// Calls `visit` with each combination, and its number, that stays within the voxel and is not
  /// worse than plain voxels after either blur, with all errors weighted equally.
  template <typename Visit>
  void forEachAllowed(const Visit& visit) const {
    std::size_t n = 0;
    for (const double checker : checkers) {
      for (const double amplitude : amplitudes) {
        bool allowed = isAllowed(checker, amplitude);
        for (int b = 0; b < blurs; ++b)
          allowed = allowed && stairs_[b][n] + grain_[b][n] <= stairs_[b][plain] + negligible_mm2_;
        if (allowed)
          visit(n, FacetDither{static_cast<float>(checker), static_cast<float>(amplitude)});
        ++n;
      }
    }
  }

  /// Adds the stairs of the reciprocal vectors near the normal; others are blurred away. Uses one
  /// of G and −G. Indices count halves: whole vectors have even ones, those of the checkerboard odd
  /// ones.
  void addStairs() {
    const double reach = std::sqrt(no_trace) / spread_mm_;
    const int axis = dominantAxis(normal_);
    const int b = (axis + 1) % 3;
    const int c = (axis + 2) % 3;
    const double cosine = std::abs(normal_[axis]);
    const double halves =
        2 * pitch_mm_[axis] * (maximum_cycles / (2 * half_diameter_mm_) * cosine + reach);
    // The span in which the layer at this index cuts the cylinder of that radius around the normal.
    struct Span {
      int first, last;
    };
    const auto span = [&](int across, double centre) {
      const double extent = reach * std::hypot(cosine, normal_[across]) / cosine;
      return Span{static_cast<int>(std::ceil(2 * pitch_mm_[across] * (centre - extent))),
                  static_cast<int>(std::floor(2 * pitch_mm_[across] * (centre + extent)))};
    };
    for (int i = 0; i <= halves; ++i) {
      const double height = 0.5 * i / pitch_mm_[axis];
      const Span of_b = span(b, height * normal_[b] / normal_[axis]);
      const Span of_c = span(c, height * normal_[c] / normal_[axis]);
      for (int j = of_b.first; j <= of_b.last; ++j) {
        for (int k = of_c.first; k <= of_c.last; ++k) {
          const bool is_second = i == 0 && (j < 0 || (j == 0 && k <= 0));
          if (is_second || (i - j) % 2 != 0 || (i - k) % 2 != 0) continue;
          Vec3d G;
          G[axis] = height;
          G[b] = 0.5 * j / pitch_mm_[b];
          G[c] = 0.5 * k / pitch_mm_[c];
          addStair(G, i % 2 != 0);
        }
      }
    }
  }

  void addStair(const Vec3d& G, bool of_checkerboard) {
    const double along = G.dot(normal_);
    const Vec3d lateral = G - along * normal_;
    const double lateral2 = lateral.lengthSqr();
    if (lateral2 * spread_mm_ * spread_mm_ > no_trace) return;
    const double cycles = std::abs(along) * 2 * half_diameter_mm_;
    if (cycles < 1e-6 || cycles > maximum_cycles) return;

    double height_mm = 1 / (2 * pi * along);
    for (int axis = 0; axis < 3; ++axis) height_mm *= sinc(lateral[axis] * pitch_mm_[axis]);
    std::array<double, blurs> power;
    for (int b = 0; b < blurs; ++b)
      power[b] =
          2 * height_mm * height_mm * std::exp(-4 * pi * pi * blurMm(b) * blurMm(b) * lateral2);

    std::array<double, amplitudes.size()> left{};
    for (std::size_t n = 0; n < amplitudes.size(); ++n)
      left[n] = std::pow(sinc(amplitudes[n] * half_diameter_mm_ * along), 2);
    std::size_t n = 0;
    for (const double checker : checkers) {
      const double phase = pi * checker * half_diameter_mm_ * along;
      const double checkered = std::pow(of_checkerboard ? std::sin(phase) : std::cos(phase), 2);
      for (const double of_threshold : left) {
        for (int b = 0; b < blurs; ++b) stairs_[b][n] += power[b] * checkered * of_threshold;
        ++n;
      }
    }
  }

  void addGrain() {
    for (int b = 0; b < blurs; ++b) {
      const double blur_mm2 = 4 * pi * blurMm(b) * blurMm(b);
      // The error of one voxel, spread over the facet.
      const double step_mm2 = 2 * half_diameter_mm_ * pitch_mm_.product() / blur_mm2;
      const double blue = blueNoise(blurMm(b));
      std::size_t n = 0;
      for (const double checker : checkers) {
        for (const double amplitude : amplitudes) {
          // A uniform choice of width w steps has the variance w/6, averaged over its phases.
          if (amplitude > 0) {
            const double kept =
                checker > 0 ? checkered_noise : std::min(blue * std::sqrt(2 / amplitude), 1.0);
            grain_[b][n] = kept * amplitude / 12 * step_mm2;
          }
          ++n;
        }
      }
    }
  }

  /// The share of white noise's variance that the mask keeps at the constant 2.
  [[nodiscard]] double blueNoise(double blur_mm) const {
    const double face_mm2 = pitch_mm_.product() / pitch_mm_[dominantAxis(normal_ / pitch_mm_)];
    const Vec3d steps = openvdb::math::Abs(normal_ * pitch_mm_);
    std::array sorted{steps[0], steps[1], steps[2]};
    std::sort(sorted.begin(), sorted.end());
    return std::min(blue_noise_flat + blue_noise_per_face * face_mm2 / (blur_mm * blur_mm) +
                        blue_noise_per_slope * sorted[1] / sorted[2],
                    blue_noise_steep);
  }

  /// Lateral cycles² per blur² that leave no trace: exp(−4π²·0.3) is 7e-6.
  static constexpr double no_trace = 0.3;

  Vec3d normal_;
  Vec3d pitch_mm_;
  double spread_mm_;
  double half_diameter_mm_;
  double negligible_mm2_;
  std::array<Errors, blurs> stairs_{};
  std::array<Errors, blurs> grain_{};
};

/// Cells per slope. They are narrower at small slopes, where the stairs change fastest.
constexpr int slope_cells = 64;

double slopeOf(int cell) { return std::pow((cell + 0.5) / slope_cells, 2); }

int cellOf(float slope) {
  return std::min(static_cast<int>(slope_cells * std::sqrt(slope)), slope_cells - 1);
}

}  // namespace

FacetDither bestFacetDither(const Vec3d& normal, const Vec3d& pitch_mm, double spread_mm) {
  return Facet(normal, pitch_mm, spread_mm).best();
}

AdaptedAmplitude::AdaptedAmplitude(const Vec3d& pitch_mm, double spread_mm)
    : cells_(3 * slope_cells * slope_cells) {
  tbb::parallel_for(0, 3 * slope_cells, [&](int row) {
    const int axis = row / slope_cells;
    for (int column = 0; column < slope_cells; ++column) {
      Vec3d normal;
      normal[axis] = 1;
      normal[(axis + 1) % 3] = slopeOf(row % slope_cells);
      normal[(axis + 2) % 3] = slopeOf(column);
      cells_[static_cast<std::size_t>(row * slope_cells + column)] =
          bestFacetDither(normal.unit(), pitch_mm, spread_mm);
    }
  });
}

FacetDither AdaptedAmplitude::operator()(const openvdb::Vec3s& normal) const {
  const openvdb::Vec3s n(std::abs(normal[0]), std::abs(normal[1]), std::abs(normal[2]));
  const int axis = dominantAxis(n);
  if (n[axis] == 0) return {};
  const float per_axis = 1 / n[axis];
  const int row = cellOf(n[(axis + 1) % 3] * per_axis);
  const int column = cellOf(n[(axis + 2) % 3] * per_axis);
  return cells_[static_cast<std::size_t>((axis * slope_cells + row) * slope_cells + column)];
}

}  // namespace vdbdither
