// Perlin: "Improving Noise", SIGGRAPH 2002.

#include "ops/kernels/mask/gradient_noise.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <tuple>

#include "ops/kernels/mask/void_and_cluster.h"

namespace vdbdither {

namespace {

using openvdb::Coord;

/// The directions from the centre of a cube to the middles of its edges.
constexpr std::array<std::array<int, 3>, 12> gradients{{{1, 1, 0},
                                                        {-1, 1, 0},
                                                        {1, -1, 0},
                                                        {-1, -1, 0},
                                                        {1, 0, 1},
                                                        {-1, 0, 1},
                                                        {1, 0, -1},
                                                        {-1, 0, -1},
                                                        {0, 1, 1},
                                                        {0, -1, 1},
                                                        {0, 1, -1},
                                                        {0, -1, -1}}};

std::size_t index(const Coord& at, const Coord& size) {
  return at.x() + static_cast<std::size_t>(size.x()) *
                      (at.y() + static_cast<std::size_t>(size.y()) * at.z());
}

double fade(double t) { return t * t * t * (t * (6 * t - 15) + 10); }

}  // namespace

std::vector<std::uint32_t> gradientNoiseRanks(const Coord& size, int cell, std::uint64_t seed) {
  const Coord cells(size.x() / cell, size.y() / cell, size.z() / cell);
  const auto corners = static_cast<std::uint32_t>(cells.x() * cells.y() * cells.z());
  // Another seed than that of the order among equals, which must not depend on the gradients.
  const std::vector<std::uint32_t> directions = randomPermutation(corners, ~seed);
  std::vector<double> values;
  for (int z = 0; z < size.z(); ++z) {
    for (int y = 0; y < size.y(); ++y) {
      for (int x = 0; x < size.x(); ++x) {
        const std::array<int, 3> voxel{x, y, z};
        double value = 0;
        for (int corner = 0; corner < 8; ++corner) {
          Coord at;
          std::array<double, 3> from{};
          double weight = 1;
          for (int axis = 0; axis < 3; ++axis) {
            const int upper = corner >> axis & 1;
            // Voxel centres lie between the corners of cells, at which the noise is 0.
            from[axis] = (voxel[axis] % cell + 0.5) / cell - upper;
            at[axis] = (voxel[axis] / cell + upper) % cells[axis];
            weight *= fade(upper ? 1 + from[axis] : 1 - from[axis]);
          }
          const auto& gradient = gradients[directions[index(at, cells)] % gradients.size()];
          value += weight * (gradient[0] * from[0] + gradient[1] * from[1] + gradient[2] * from[2]);
        }
        values.push_back(value);
      }
    }
  }
  const auto count = static_cast<std::uint32_t>(values.size());
  const std::vector<std::uint32_t> among_equals = randomPermutation(count, seed);
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(values[a], among_equals[a]) < std::tie(values[b], among_equals[b]);
  });
  std::vector<std::uint32_t> ranks(count);
  for (std::uint32_t rank = 0; rank < count; ++rank) ranks[order[rank]] = rank;
  return ranks;
}

}  // namespace vdbdither
