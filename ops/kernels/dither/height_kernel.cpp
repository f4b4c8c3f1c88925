#include "ops/kernels/dither/height_kernel.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

using openvdb::Vec3d;

HeightKernel::HeightKernel(const Vec3d& pitch_mm, const Vec3d& spread_mm,
                           const std::vector<Term>& terms, double reach) {
  const Vec3d step = pitch_mm / spread_mm;  // in σ
  for (int axis = 0; axis < 3; ++axis)
    reach_[axis] =
        static_cast<int>(std::min(std::floor(reach / step[axis]), double{maximum_reach}));
  constexpr float beyond = 1e9F;
  for (int half = 0; half <= reach_.z(); ++half) {
    std::vector<Floats>& along2 = along2_[static_cast<std::size_t>(half)];
    for (int n = 0; n <= 2 * half; n += 4) {
      Floats& four = along2.emplace_back();
      for (int lane = 0; lane < 4; ++lane) {
        const double z = (n + lane - half) * step.z();
        four[lane] = n + lane <= 2 * half ? static_cast<float>(z * z) : beyond;
      }
    }
  }
  for (int x = -reach_.x(); x <= reach_.x(); ++x) {
    for (int y = -reach_.y(); y <= reach_.y(); ++y) {
      const double across2 = x * step.x() * (x * step.x()) + y * step.y() * (y * step.y());
      const double left2 = reach * reach - across2;
      if (left2 < 0) continue;
      const int z = std::min(static_cast<int>(std::sqrt(left2) / step.z()), reach_.z());
      columns_.push_back({x, y, z, static_cast<float>(across2)});
    }
  }

  for (const Term& term : terms)
    hills_.push_back(
        {static_cast<float>(1 / (32 * term.width * term.width)), static_cast<float>(term.factor)});
}

}  // namespace vdbdither
