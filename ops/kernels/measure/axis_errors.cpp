#include "ops/kernels/measure/axis_errors.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

constexpr std::size_t phases = 16;

/// Weighted sums of a number and its square.
struct Sums {
  double weight = 0;
  double sum = 0;
  double squares = 0;

  void add(double value, double by) {
    weight += by;
    sum += by * value;
    squares += by * value * value;
  }
  [[nodiscard]] double mean() const { return weight > 0 ? sum / weight : 0; }
  [[nodiscard]] double variance() const {
    return weight > 0 ? std::max(0.0, squares / weight - mean() * mean()) : 0;
  }
};

/// The axis of the largest component of a unit vector, and the component's sign.
struct Facing {
  std::size_t axis;
  std::size_t up;
};
Facing facing(const Vec3d& normal) {
  std::size_t axis = 0;
  for (std::size_t other = 1; other < 3; ++other) {
    if (std::abs(normal[static_cast<int>(other)]) > std::abs(normal[static_cast<int>(axis)]))
      axis = other;
  }
  return {axis, normal[static_cast<int>(axis)] > 0 ? 1U : 0U};
}

}  // namespace

std::array<AxisError, 3> axisErrors(const SurfaceErrors& errors, const ClosestPoints& reference,
                                    const Lattice* lattice) {
  struct AxisSums {
    Sums position, error, size;
    double product = 0;
    // Errors are separated by the sign of the direction, because outwards is up on one side and
    // down on the other.
    std::array<Sums, 2> sides;
    std::array<std::array<Sums, phases>, 2> by_phase;
  };
  std::array<AxisSums, 3> sums;
  for (std::size_t n = 0; n < errors.size(); ++n) {
    const double weight = errors.weight_mm2[n];
    if (!(weight > 0)) continue;
    const double error = errors.error_mm[n];
    const Vec3d at(errors.nearest[n]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double position = at[static_cast<int>(axis)];
      sums[axis].position.add(position, weight);
      sums[axis].product += weight * position * error;
    }
    const auto [axis, up] = facing(reference.normal(errors.triangle[n]));
    AxisSums& of = sums[axis];
    of.error.add(error, weight);
    of.size.add(std::abs(error), weight);
    of.sides[up].add(error, weight);
    if (!lattice) continue;
    const int a = static_cast<int>(axis);
    const double index = (at[a] - lattice->origin_mm[a]) / lattice->pitch_mm[a];
    const double phase = index - std::floor(index);
    const auto bin = std::min(phases - 1, static_cast<std::size_t>(phase * phases));
    of.by_phase[up][bin].add(error, weight);
  }

  Sums all;
  for (const AxisSums& of : sums) {
    all.weight += of.error.weight;
    all.sum += of.error.sum;
    all.squares += of.error.squares;
  }
  std::array<AxisError, 3> result;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const AxisSums& of = sums[axis];
    AxisError& made = result[axis];
    const double spread = std::sqrt(of.position.variance() * all.variance());
    if (spread > 0) {
      made.correlation = (of.product / all.weight - of.position.mean() * all.mean()) / spread;
    }
    if (!(of.error.weight > 0)) continue;
    made.area_mm2 = of.error.weight;
    made.bias_mm = of.error.mean();
    made.mean_mm = of.size.mean();
    made.rms_mm = std::sqrt(of.error.squares / of.error.weight);
    if (!lattice) continue;
    double staircase = 0;
    double within = 0;
    double modulation = 0;
    for (std::size_t side = 0; side < 2; ++side) {
      Sums deviations;
      for (const Sums& bin : of.by_phase[side]) {
        const double off = bin.mean() - of.sides[side].mean();
        staircase += bin.weight * off * off;
        within += bin.weight * bin.variance();
        if (bin.weight > 0) deviations.add(std::sqrt(bin.variance()), bin.weight);
      }
      modulation += deviations.weight * deviations.variance();
    }
    AxisError::Phase phase;
    phase.staircase_mm = std::sqrt(staircase / of.error.weight);
    phase.explained = staircase + within > 0 ? staircase / (staircase + within) : 0;
    phase.modulation_mm = std::sqrt(modulation / of.error.weight);
    made.phase = phase;
  }
  return result;
}

}  // namespace vdbdither
