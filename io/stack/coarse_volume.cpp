#include "io/stack/coarse_volume.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace vdbdither {

CoarseVolume::CoarseVolume(const std::array<std::uint32_t, 3>& size, const openvdb::Vec3d& pitch_mm,
                           std::vector<std::array<std::uint8_t, 4>> colours)
    : colours_(std::move(colours)),
      values_(colours_.size()),
      cell_mm_(std::max({pitch_mm[0], pitch_mm[1], pitch_mm[2]})),
      cells_{} {
  for (int axis = 0; axis < 3; ++axis)
    cell_mm_ = std::max(cell_mm_, size[axis] * pitch_mm[axis] / most_cells);
  for (int axis = 0; axis < 3; ++axis) {
    const double length = size[axis] * pitch_mm[axis] / cell_mm_;
    cells_[axis] = std::clamp<std::uint32_t>(static_cast<std::uint32_t>(std::ceil(length - 1e-6)),
                                             1, most_cells);
    cell_of_[axis].resize(size[axis]);
    begin_[axis].assign(cells_[axis] + 1, 0);
    for (std::uint32_t i = 0; i < size[axis]; ++i) {
      const auto cell = static_cast<std::uint32_t>((i + 0.5) * pitch_mm[axis] / cell_mm_);
      cell_of_[axis][i] = std::min(cell, cells_[axis] - 1);
      ++begin_[axis][cell_of_[axis][i] + 1];
    }
    for (std::uint32_t cell = 0; cell < cells_[axis]; ++cell)
      begin_[axis][cell + 1] += begin_[axis][cell];
  }
  const std::size_t area = std::size_t{cells_[0]} * cells_[1];
  counts_.resize(area * values_);
  share_.resize(area * cells_[2]);
  value_.resize(area * cells_[2]);
  light_.resize(std::size_t{blocks()[0]} * blocks()[1]);
}

void CoarseVolume::add(std::uint32_t z, const SpanImage& slice) {
  while (cell_of_[2][z] != layer_) {
    endCellLayer();
    ++layer_;
  }
  for (std::uint32_t y = 0; y < slice.height; ++y) {
    std::uint32_t* counts = counts_.data() + std::size_t{cell_of_[1][y]} * cells_[0] * values_;
    std::uint32_t begin = 0;
    for (const Span& span : slice.row(y)) {
      while (span.value && begin < span.end) {
        const std::uint32_t cell = cell_of_[0][begin];
        const std::uint32_t end = std::min(span.end, begin_[0][cell + 1]);
        counts[std::size_t{cell} * values_ + span.value - 1] += end - begin;
        begin = end;
      }
      begin = span.end;
    }
  }
}

void CoarseVolume::endCellLayer() {
  const auto voxels = [&](int axis, std::size_t cell) {
    return std::uint64_t{begin_[axis][cell + 1]} - begin_[axis][cell];
  };
  const std::size_t area = std::size_t{cells_[0]} * cells_[1];
  for (std::size_t i = 0; i < area; ++i) {
    const auto counts = counts_.begin() + static_cast<std::ptrdiff_t>(i * values_);
    const auto end = counts + values_;
    std::uint64_t sum = 0;
    for (auto count = counts; count != end; ++count) sum += *count;
    if (sum == 0) continue;
    const std::uint64_t all =
        voxels(0, i % cells_[0]) * voxels(1, i / cells_[0]) * voxels(2, layer_);
    const std::size_t at = area * layer_ + i;
    share_[at] = static_cast<std::uint8_t>((sum * 15 + all / 2) / all * 17);
    value_[at] = static_cast<std::uint8_t>(std::max_element(counts, end) - counts + 1);
    std::array<std::uint64_t, 4>& light =
        light_[i / cells_[0] / 2 * blocks()[0] + i % cells_[0] / 2];
    for (std::size_t value = 0; value < values_; ++value) {
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const std::uint64_t level = colours_[value][channel];
        light[channel] += counts[static_cast<std::ptrdiff_t>(value)] * level * level;
      }
    }
    light[3] += sum;
  }
  std::fill(counts_.begin(), counts_.end(), 0);
  if (layer_ % 2 == 1) endBlockLayer();
}

void CoarseVolume::endBlockLayer() {
  colour_.resize(3 * light_.size() * (layer_ / 2));
  for (std::array<std::uint64_t, 4>& light : light_) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      if (light[3] == 0) {
        colour_.push_back(0);
        continue;
      }
      const double square = static_cast<double>(light[channel]) / static_cast<double>(light[3]);
      // Steps that nobody sees would not be compressed.
      const int level = static_cast<int>(std::lround(std::sqrt(square))) & ~3;
      colour_.push_back(static_cast<std::uint8_t>(std::max(level, 4)));
    }
    light = {};
  }
}

std::vector<std::uint8_t> CoarseVolume::finish() {
  endCellLayer();
  if (layer_ % 2 == 0) endBlockLayer();
  colour_.resize(3 * light_.size() * blocks()[2]);
  share_.insert(share_.end(), value_.begin(), value_.end());
  share_.insert(share_.end(), colour_.begin(), colour_.end());
  return std::move(share_);
}

}  // namespace vdbdither
