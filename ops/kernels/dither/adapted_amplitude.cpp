// The displacement and its constant are eq. (5) of Morsy, Brunton, Urban: Shape Dithering for 3D
// Printing, ACM Transactions on Graphics 41(4), 2022. docs/evaluation.md has the measurements.

#include "ops/kernels/dither/adapted_amplitude.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

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

constexpr FacetDither ditherOf(std::size_t combination) {
  return {static_cast<float>(checkers[combination / amplitudes.size()]),
          static_cast<float>(amplitudes[combination % amplitudes.size()])};
}

constexpr std::array<FacetDither, combinations> dithers = [] {
  std::array<FacetDither, combinations> all;
  for (std::size_t n = 0; n < combinations; ++n) all[n] = ditherOf(n);
  return all;
}();

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

/// The maximum of lateral cycles per pitch, along each axis, up to which waves count. Where the
/// blur is smaller than the voxel, it leaves more of them, but they only give the steps sharp
/// edges. The number of waves that count is bounded by both maxima, whatever the pitch.
constexpr double maximum_lateral_cycles = 4;

/// Waves whose variance is certainly below this share of what counts as none are left out.
constexpr double faint_share = 1e-3;

/// Errors below this share of a voxel's diameter count as none.
constexpr double negligible_share = 0.01;

template <typename Vector>
int dominantAxis(const Vector& n) {
  const auto size = [&](int axis) { return std::abs(n[axis]); };
  return size(0) >= size(1) ? (size(0) >= size(2) ? 0 : 2) : (size(1) >= size(2) ? 1 : 2);
}

/// Returns sin²(πx) to 1e-9, in a fifth of the time of the library's sine and the same on every
/// machine.
double squaredSine(double x) {
  const double turn = std::abs(x);
  // Half a turn may go either way: the square is the same.
  // NOLINTNEXTLINE(bugprone-incorrect-roundings)
  const double a = pi * (turn - static_cast<double>(static_cast<std::int64_t>(turn + 0.5)));
  const double a2 = a * a;
  const double sine =
      a * (1 + a2 * (-1.0 / 6 +
                     a2 * (1.0 / 120 +
                           a2 * (-1.0 / 5040 + a2 * (1.0 / 362880 + a2 * (-1.0 / 39916800))))));
  return sine * sine;
}

/// Returns the square of sin(πx) / (πx).
double squaredSinc(double x) { return std::abs(x) < 1e-9 ? 1 : squaredSine(x) / (pi * pi * x * x); }

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
    addGrain();
    findPossible();
    addStairs();
  }

  /// Returns the number of the best combination.
  [[nodiscard]] std::size_t best() const {
    std::array<double, blurs> minimum;
    minimum.fill(std::numeric_limits<double>::infinity());
    forEachAllowed([&](std::size_t n) {
      for (int b = 0; b < blurs; ++b) minimum[b] = std::min(minimum[b], weighed(b, n));
    });

    std::size_t best = plain;
    double best_excess = std::numeric_limits<double>::infinity();
    forEachAllowed([&](std::size_t n) {
      double excess = 0;
      for (int b = 0; b < blurs; ++b)
        excess =
            std::max(excess, (weighed(b, n) + negligible_mm2_) / (minimum[b] + negligible_mm2_));
      if (excess < best_excess) {
        best_excess = excess;
        best = n;
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

  /// Finds the combinations that stay within the voxel, without those whose grain alone is worse
  /// than plain voxels can be: without a blur, the variance of plain voxels is that of a voxel's
  /// extent along the normal.
  void findPossible() {
    const double unblurred_mm2 = (normal_ * pitch_mm_).lengthSqr() / 12;
    for (std::size_t n = 0; n < combinations; ++n) {
      bool possible = isAllowed(checkers[n / amplitudes.size()], amplitudes[n % amplitudes.size()]);
      for (int b = 0; b < blurs; ++b)
        possible = possible && grain_[b][n] <= unblurred_mm2 + negligible_mm2_;
      if (!possible) continue;
      possible_.push_back(n);
      tried_[n % amplitudes.size()] = true;
    }
  }

  /// Calls `visit` with the number of each combination that is not worse than plain voxels after
  /// either blur, with all errors weighted equally.
  template <typename Visit>
  void forEachAllowed(const Visit& visit) const {
    for (const std::size_t n : possible_) {
      bool allowed = true;
      for (int b = 0; b < blurs; ++b)
        allowed = allowed && stairs_[b][n] + grain_[b][n] <= stairs_[b][plain] + negligible_mm2_;
      if (allowed) visit(n);
    }
  }

  /// Returns bounds of the lateral parts, in cycles per mm along each axis, of the waves that
  /// count.
  [[nodiscard]] Vec3d lateralReach() const {
    Vec3d reach;
    for (int axis = 0; axis < 3; ++axis) {
      const double sine = std::sqrt(std::max(1 - normal_[axis] * normal_[axis], 0.0));
      reach[axis] = std::min(std::sqrt(no_trace) / spread_mm_ * sine,
                             maximum_lateral_cycles / pitch_mm_[axis]);
    }
    // A lateral vector is at right angles to the normal.
    const Vec3d along = reach * openvdb::math::Abs(normal_);
    for (int axis = 0; axis < 3; ++axis) {
      const double others = along[(axis + 1) % 3] + along[(axis + 2) % 3];
      if (along[axis] > others) reach[axis] = others / std::abs(normal_[axis]);
    }
    return reach;
  }

  /// Adds the stairs of the reciprocal vectors near the normal; others are blurred away. Uses one
  /// of G and −G. Indices count halves: whole vectors have even ones, those of the checkerboard odd
  /// ones.
  void addStairs() {
    const Vec3d reach = lateralReach();
    // Along this axis the fewest vectors of each layer are near the normal.
    const int axis = dominantAxis(normal_ * pitch_mm_);
    const int b = (axis + 1) % 3;
    const int c = (axis + 2) % 3;
    const double cosine = std::abs(normal_[axis]);
    const double halves =
        2 * pitch_mm_[axis] * (maximum_cycles / (2 * half_diameter_mm_) * cosine + reach[axis]);
    // The span in which the layer at this index holds vectors that count.
    struct Span {
      int first, last;
    };
    const auto span = [&](int across, double centre) {
      const double slope = std::abs(normal_[across]) / cosine;
      const double extent = std::min(reach[across] + reach[axis] * slope,
                                     std::sqrt(no_trace) / spread_mm_ * std::hypot(1, slope));
      return Span{static_cast<int>(std::ceil(2 * pitch_mm_[across] * (centre - extent))),
                  static_cast<int>(std::floor(2 * pitch_mm_[across] * (centre + extent)))};
    };
    for (int i = 0; i <= halves; ++i) {
      const double height = 0.5 * i / pitch_mm_[axis];
      const Span of_b = span(b, height * normal_[b] / normal_[axis]);
      const Span of_c = span(c, height * normal_[c] / normal_[axis]);
      // Indices are all even or all odd.
      for (int j = of_b.first + ((of_b.first - i) & 1); j <= of_b.last; j += 2) {
        for (int k = of_c.first + ((of_c.first - i) & 1); k <= of_c.last; k += 2) {
          const bool is_second = i == 0 && (j < 0 || (j == 0 && k <= 0));
          if (is_second) continue;
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

    double power = 1 / (2 * pi * pi * along * along);
    const Vec3d per_pitch = lateral * pitch_mm_;
    double most = power;
    for (int axis = 0; axis < 3; ++axis) {
      const double waves = std::abs(per_pitch[axis]);
      if (waves > maximum_lateral_cycles) return;
      if (waves > 1 / pi) most /= pi * pi * waves * waves;
    }
    if (most < faint_share * negligible_mm2_) return;

    for (int axis = 0; axis < 3; ++axis) power *= squaredSinc(per_pitch[axis]);
    const double blurred = std::exp(-4 * pi * pi * blurMm(0) * blurMm(0) * lateral2);
    const double twice_blurred = blurred * blurred * blurred * blurred;  // σ² is fourfold
    const std::array<double, blurs> powers{power * blurred, power * twice_blurred};

    std::array<double, amplitudes.size()> left{};
    for (std::size_t n = 0; n < amplitudes.size(); ++n)
      if (tried_[n]) left[n] = squaredSinc(amplitudes[n] * half_diameter_mm_ * along);
    std::array<double, checkers.size()> checkered{};
    for (std::size_t n = 0; n < checkers.size(); ++n) {
      const double of_odd = squaredSine(checkers[n] * half_diameter_mm_ * along);
      checkered[n] = of_checkerboard ? of_odd : 1 - of_odd;
    }
    for (const std::size_t n : possible_) {
      const double kept = checkered[n / amplitudes.size()] * left[n % amplitudes.size()];
      for (int b = 0; b < blurs; ++b) stairs_[b][n] += powers[b] * kept;
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
  std::vector<std::size_t> possible_;
  std::array<bool, amplitudes.size()> tried_{};  ///< those of any possible combination
};

/// Cells per slope. They are narrower at small slopes, where the stairs change fastest.
constexpr int slope_cells = 64;

double slopeOf(int cell) { return std::pow((cell + 0.5) / slope_cells, 2); }

int cellOf(float slope) {
  return std::min(static_cast<int>(slope_cells * std::sqrt(slope)), slope_cells - 1);
}

}  // namespace

FacetDither bestFacetDither(const Vec3d& normal, const Vec3d& pitch_mm, double spread_mm) {
  return dithers[Facet(normal, pitch_mm, spread_mm).best()];
}

AdaptedAmplitude::AdaptedAmplitude(const Vec3d& pitch_mm, double spread_mm)
    : pitch_mm_(pitch_mm),
      spread_mm_(spread_mm),
      cells_(std::size_t{3} * slope_cells * slope_cells) {}

FacetDither AdaptedAmplitude::operator()(const openvdb::Vec3s& normal) const {
  const openvdb::Vec3s n(std::abs(normal[0]), std::abs(normal[1]), std::abs(normal[2]));
  const int axis = dominantAxis(n);
  if (n[axis] == 0) return {};
  const float per_axis = 1 / n[axis];
  const int row = cellOf(n[(axis + 1) % 3] * per_axis);
  const int column = cellOf(n[(axis + 2) % 3] * per_axis);
  std::atomic<std::uint8_t>& cell =
      cells_[static_cast<std::size_t>((axis * slope_cells + row) * slope_cells + column)];
  std::uint8_t known = cell.load(std::memory_order_relaxed);
  if (known == 0) {
    // Threads that meet here find the same.
    Vec3d middle;
    middle[axis] = 1;
    middle[(axis + 1) % 3] = slopeOf(row);
    middle[(axis + 2) % 3] = slopeOf(column);
    known = static_cast<std::uint8_t>(1 + Facet(middle.unit(), pitch_mm_, spread_mm_).best());
    cell.store(known, std::memory_order_relaxed);
  }
  return dithers[known - 1U];
}

}  // namespace vdbdither
