#include "ops/kernels/mesh/winding_cells.h"

#include <array>

#include "ops/kernels/mesh/progress_part.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

WindingCells::WindingCells(const Mesh& mesh, const WindingNumber& winding,
                           const openvdb::math::BBox<Vec3d>& bounds, int along_longest)
    : mesh_(mesh),
      winding_(winding),
      longest_mm_(bounds.extents()[static_cast<int>(bounds.maxExtent())]),
      unit_mm_(longest_mm_ / along_longest / units),
      // Offsets that keep corners out of the planes that designs often use.
      origin_mm_(bounds.min() - units * unit_mm_ * Vec3d(0.3819, 0.4142, 0.3028)),
      limits_(Coord::floor((bounds.min() - 0.5 * longest_mm_ - origin_mm_) / unit_mm_),
              Coord::ceil((bounds.max() + 0.5 * longest_mm_ - origin_mm_) / unit_mm_)) {}

std::size_t WindingCells::workOfMaking(std::span<const Coord> lows) const {
  constexpr std::size_t sampled = 256;
  // A corner is shared by up to eight cells, and has a number and a gradient of all triangles and
  // of those near each cell.
  constexpr std::size_t looks_per_cell = 4;
  const std::size_t stride = (lows.size() + sampled - 1) / sampled;
  std::size_t work = 0;
  for (std::size_t i = 0; i < lows.size(); i += stride)
    work += stride * looks_per_cell * winding_.workAt(position(lows[i]));
  return work;
}

std::vector<std::uint32_t> WindingCells::at(const std::vector<Coord>& lows) {
  const auto cornerOf = [](const Coord& low, unsigned corner) {
    return low.offsetBy((corner & 1) != 0 ? units : 0, (corner & 2) != 0 ? units : 0,
                        (corner & 4) != 0 ? units : 0);
  };
  std::vector<std::uint32_t> found;
  std::vector<Coord> fresh;
  std::vector<Key> asked;
  for (const Coord& low : lows) {
    const auto [cell, is_new] =
        cell_at_.add(keyOf(low), static_cast<std::uint32_t>(cells_.size() + fresh.size()));
    found.push_back(cell);
    if (!is_new) continue;
    fresh.push_back(low);
    for (unsigned corner = 0; corner < 8; ++corner) asked.push_back(keyOf(cornerOf(low, corner)));
  }
  sortUnique(asked);
  eraseAll(asked, [this](Key key) { return corners_.contains(key); });
  std::vector<WindingCell::Corner> made(asked.size());
  forAll(asked.size(), [&](std::size_t i) {
    const Vec3d p = position(coordOf(asked[i]));
    made[i] = {winding_.closelyAt(p), winding_.gradientAt(p)};
  });
  for (std::size_t i = 0; i < asked.size(); ++i) corners_.add(asked[i], made[i]);
  const std::size_t before = cells_.size();
  cells_.resize(before + fresh.size());
  forAll(fresh.size(), [&](std::size_t i) {
    std::array<WindingCell::Corner, 8> corners;
    for (unsigned corner = 0; corner < 8; ++corner)
      corners[corner] = corners_.at(keyOf(cornerOf(fresh[i], corner)));
    cells_[before + i] =
        WindingCell(mesh_, winding_, position(fresh[i]), units * unit_mm_, corners);
  });
  return found;
}

}  // namespace vdbdither
