#include "ops/kernels/adapted_amplitude.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <tbb/parallel_for.h>

#include "ops/kernels/voxel_diameter.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr double pi = std::numbers::pi;

/// The levels of each that are tried; with more, errors fall by less than a per cent.
constexpr std::array checkers{0.0, 0.5, 1.0};
constexpr std::array amplitudes{0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0};
constexpr std::size_t combinations = checkers.size() * amplitudes.size();

/// Both must be able to act without leaving the voxel.
constexpr bool isAllowed(double checker, double amplitude) {
  return checker + amplitude <= 2 && (checker > 0 || amplitude != 0.25);
}

/// What a void-and-cluster mask (σ = 1.1) leaves of the variance of white noise after the blur, by
/// itself and on one half of a full checkerboard. Measured on facets of every tilt.
constexpr double blue_noise = 0.36;
constexpr double checkered_noise = 0.88;

/// Reciprocal vectors are counted up to this index along each axis; what lies beyond is below a
/// tenth of the first stair.
constexpr int greatest_index = 4;

/// Errors below this share of a voxel's diameter count as none.
constexpr double negligible_share = 0.01;

double sinc(double x) { return std::abs(x) < 1e-9 ? 1 : std::sin(pi * x) / (pi * x); }

/// Mean square errors by combination, mm², for one blur.
using Errors = std::array<double, combinations>;

class Facet {
 public:
  Facet(const Vec3d& normal, const Vec3d& pitch_mm, double spread_mm)
      : normal_(normal),
        pitch_mm_(pitch_mm),
        spread_mm_(spread_mm),
        half_diameter_mm_(halfVoxelDiameter(openvdb::Vec3s(normal), pitch_mm)) {
    addStairs();
    addGrain();
  }

  [[nodiscard]] FacetDither best() const {
    std::array<double, blurs> least;
    for (int b = 0; b < blurs; ++b) least[b] = leastOf(errors_[b]);
    const double negligible = std::pow(negligible_share * 2 * half_diameter_mm_, 2);

    FacetDither best;
    double best_excess = std::numeric_limits<double>::infinity();
    std::size_t n = 0;
    for (const double checker : checkers) {
      for (const double amplitude : amplitudes) {
        double excess = 0;
        for (int b = 0; b < blurs; ++b)
          excess = std::max(excess, (errors_[b][n] + negligible) / (least[b] + negligible));
        if (isAllowed(checker, amplitude) && excess < best_excess) {
          best_excess = excess;
          best = {static_cast<float>(checker), static_cast<float>(amplitude)};
        }
        ++n;
      }
    }
    return best;
  }

 private:
  static constexpr int blurs = 2;
  [[nodiscard]] double blurMm(int b) const { return spread_mm_ * (b + 1); }

  static double leastOf(const Errors& errors) {
    double least = std::numeric_limits<double>::infinity();
    std::size_t n = 0;
    for (const double checker : checkers) {
      for (const double amplitude : amplitudes) {
        if (isAllowed(checker, amplitude)) least = std::min(least, errors[n]);
        ++n;
      }
    }
    return least;
  }

  void addStairs() {
    constexpr int limit = 2 * greatest_index;
    // One of G and −G; whole vectors have even halves, those of the checkerboard odd ones.
    for (int i = 0; i <= limit; ++i) {
      for (int j = i % 2 - (i > 0 ? limit : 0); j <= limit; j += 2) {
        for (int k = i % 2 - (i > 0 || j > 0 ? limit : -2); k <= limit; k += 2) {
          addStair({0.5 * i / pitch_mm_.x(), 0.5 * j / pitch_mm_.y(), 0.5 * k / pitch_mm_.z()},
                   i % 2 != 0);
        }
      }
    }
  }

  void addStair(const Vec3d& G, bool of_checkerboard) {
    const double along = G.dot(normal_);
    const Vec3d lateral = G - along * normal_;
    const double lateral2 = lateral.lengthSqr();
    constexpr double no_trace = 0.3;  // exp(−4π²·0.3) is 7e-6
    if (lateral2 * spread_mm_ * spread_mm_ > no_trace) return;
    if (std::abs(along) * largestHalfVoxelDiameter(pitch_mm_) < 1e-6) return;

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
        for (int b = 0; b < blurs; ++b) errors_[b][n] += power[b] * checkered * of_threshold;
        ++n;
      }
    }
  }

  void addGrain() {
    // The face that the dither decides about, seen along the normal.
    const double face_mm2 =
        pitch_mm_.product() / (2 * half_diameter_mm_ * faceCosine() * faceCosine());
    std::size_t n = 0;
    for (const double checker : checkers) {
      const double kept = blue_noise + (checkered_noise - blue_noise) * checker;
      for (const double amplitude : amplitudes) {
        // A uniform choice of width w steps has the variance w/6, averaged over its phases.
        const double variance = kept * 4 * half_diameter_mm_ * half_diameter_mm_ * amplitude / 12;
        for (int b = 0; b < blurs; ++b)
          errors_[b][n] += variance * face_mm2 / (4 * pi * blurMm(b) * blurMm(b));
        ++n;
      }
    }
  }

  /// Of the normal and the axis along which it leaves a voxel.
  [[nodiscard]] double faceCosine() const {
    int axis = 0;
    for (const int other : {1, 2}) {
      if (std::abs(normal_[other]) / pitch_mm_[other] > std::abs(normal_[axis]) / pitch_mm_[axis])
        axis = other;
    }
    return std::abs(normal_[axis]);
  }

  Vec3d normal_;
  Vec3d pitch_mm_;
  double spread_mm_;
  double half_diameter_mm_;
  std::array<Errors, blurs> errors_{};
};

/// Cells per slope. They are narrow where slopes are small, for there the stairs change fastest.
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
  const int axis = n[0] >= n[1] ? (n[0] >= n[2] ? 0 : 2) : (n[1] >= n[2] ? 1 : 2);
  if (n[axis] == 0) return {};
  const float per_axis = 1 / n[axis];
  const int row = cellOf(n[(axis + 1) % 3] * per_axis);
  const int column = cellOf(n[(axis + 2) % 3] * per_axis);
  return cells_[static_cast<std::size_t>((axis * slope_cells + row) * slope_cells + column)];
}

}  // namespace vdbdither
