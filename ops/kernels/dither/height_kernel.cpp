#include "ops/kernels/dither/height_kernel.h"

#include <algorithm>
#include <cmath>

namespace vdbdither {

using openvdb::Vec3d;

namespace {

double squared(double x) { return x * x; }

}  // namespace

HeightKernel::HeightKernel(const Vec3d& pitch_mm, const Vec3d& spread_mm,
                           const std::vector<Term>& terms, double reach) {
  const Vec3d step = pitch_mm / spread_mm;  // in σ
  for (int axis = 0; axis < 3; ++axis)
    reach_[axis] =
        static_cast<int>(std::min(std::floor(reach / step[axis]), double{maximum_reach}));
  for (int x = -reach_.x(); x <= reach_.x(); ++x) {
    for (int y = -reach_.y(); y <= reach_.y(); ++y) {
      const double across2 = squared(x * step.x()) + squared(y * step.y());
      const double left2 = reach * reach - across2;
      if (left2 < 0) continue;
      const int z = std::min(static_cast<int>(std::sqrt(left2) / step.z()), reach_.z());
      addColumn(x, y, z, across2, step.z());
    }
  }

  for (const Term& term : terms)
    hills_.push_back(
        {static_cast<float>(1 / (32 * term.width * term.width)), static_cast<float>(term.factor)});
}

void HeightKernel::addColumn(int x, int y, int z, double across2, double step) {
  constexpr std::size_t lanes = 8;
  constexpr float beyond = 1e9F;
  columns_.push_back({x, y, z, static_cast<std::uint32_t>(apart2_.size())});
  for (int n = -z; n <= z; ++n)
    apart2_.push_back(static_cast<float>(across2) + static_cast<float>(squared(n * step)));
  apart2_.resize((apart2_.size() + lanes - 1) / lanes * lanes, beyond);
}

}  // namespace vdbdither
