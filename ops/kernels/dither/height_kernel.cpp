#include "ops/kernels/dither/height_kernel.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

std::vector<float> apart2(float across2, int half, double step) {
  constexpr std::size_t lanes = 8;
  constexpr float beyond = 1e9F;
  std::vector<float> apart2;
  for (int n = -half; n <= half; ++n)
    apart2.push_back(across2 + static_cast<float>(n * step * (n * step)));
  apart2.resize((apart2.size() + lanes - 1) / lanes * lanes, beyond);
  return apart2;
}

}  // namespace

HeightKernel::HeightKernel(const Vec3d& pitch_mm, const Vec3d& spread_mm,
                           const std::vector<Term>& terms, double reach) {
  const Vec3d step = pitch_mm / spread_mm;  // in σ
  for (int axis = 0; axis < 3; ++axis)
    reach_[axis] =
        static_cast<int>(std::min(std::floor(reach / step[axis]), double{maximum_reach}));
  for (int x = -reach_.x(); x <= reach_.x(); ++x) {
    for (int y = -reach_.y(); y <= reach_.y(); ++y) {
      const double across2 = x * step.x() * (x * step.x()) + y * step.y() * (y * step.y());
      const double left2 = reach * reach - across2;
      if (left2 < 0) continue;
      const int z = std::min(static_cast<int>(std::sqrt(left2) / step.z()), reach_.z());
      columns_.push_back({x, y, z, apart2(static_cast<float>(across2), z, step.z())});
    }
  }

  for (const Term& term : terms)
    hills_.push_back(
        {static_cast<float>(1 / (32 * term.width * term.width)), static_cast<float>(term.factor)});
}

}  // namespace vdbdither
