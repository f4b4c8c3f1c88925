#include "ops/kernels/colour/table_separation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace vdbdither {

TableSeparation::TableSeparation(const InkSet& set) : table_(*set.table), inks_(set.inks.size()) {}

void TableSeparation::run(const openvdb::Vec3s& linear_rgb, std::span<float> coverages) const {
  const int last = table_.edge - 1;
  std::array<std::pair<double, std::size_t>, 3> axes;  // share of the cell, step in the table
  std::size_t node = 0;
  std::size_t step = inks_;
  for (int channel = 2; channel >= 0; --channel) {
    const double at = std::sqrt(std::clamp(double{linear_rgb[channel]}, 0.0, 1.0)) * last;
    const int cell = std::min(static_cast<int>(at), last - 1);
    node += static_cast<std::size_t>(cell) * step;
    axes[static_cast<std::size_t>(channel)] = {at - cell, step};
    step *= static_cast<std::size_t>(table_.edge);
  }
  // The path from the lowest node of the cell to the highest takes the largest share first.
  std::stable_sort(axes.begin(), axes.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  double before = 1;
  std::fill(coverages.begin(), coverages.end(), 0.0F);
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const double share = corner < 3 ? axes[corner].first : 0;
    const auto weight = static_cast<float>(before - share);
    for (std::size_t ink = 0; ink < inks_; ++ink)
      coverages[ink] += weight * table_.values[node + ink];
    if (corner < 3) node += axes[corner].second;
    before = share;
  }
}

double TableSeparation::memoryBytes() const {
  return static_cast<double>(table_.values.size()) * sizeof(float);
}

}  // namespace vdbdither
