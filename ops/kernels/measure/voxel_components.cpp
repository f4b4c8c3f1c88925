#include "ops/kernels/measure/voxel_components.h"

#include <algorithm>
#include <bit>
#include <functional>
#include <span>
#include <utility>

#include "ops/kernels/leaf/disjoint_sets.h"
#include "ops/kernels/measure/touching_spans.h"

namespace vdbdither {

namespace {

constexpr int word_bits = 64;

/// Calls visit(begin, end) for every span of set bits of a row; with `flip`, of unset bits.
template <typename Visit>
void forEachSpan(const std::uint64_t* row, int words, bool flip, const Visit& visit) {
  const std::uint64_t mask = flip ? ~std::uint64_t{0} : 0;
  int begin = -1;
  for (int word = 0; word < words; ++word) {
    const std::uint64_t bits = row[word] ^ mask;
    for (int at = 0; at < word_bits;) {
      // The distance to the next change.
      const std::uint64_t rest = (begin < 0 ? bits : ~bits) >> at;
      if (rest == 0) break;
      at += std::countr_zero(rest);
      const int x = word * word_bits + at;
      if (begin < 0) {
        begin = x;
      } else {
        visit(begin, x);
        begin = -1;
      }
    }
  }
  if (begin >= 0) visit(begin, words * word_bits);
}

}  // namespace

VoxelComponents::VoxelComponents(const BitLayout& layout) : layout_(layout) {
  full_.diagonal = true;
}

void VoxelComponents::add(const BitLayer& layer) {
  // The layer below the first one is outside too.
  if (!std::exchange(begun_, true)) addLayer(layout_.emptyLayer());
  addLayer(layer);
}

VoxelComponents::Counts VoxelComponents::finish() {
  Counts counts;
  if (!begun_) return counts;
  addLayer(layout_.emptyLayer());
  const auto sorted = [](std::vector<std::uint64_t> sizes) {
    std::sort(sizes.begin(), sizes.end(), std::greater<>());
    return sizes;
  };
  // The empty pieces that are still open are the outside.
  counts.components = sorted(std::move(full_.closed));
  counts.cavities = sorted(std::move(empty_.closed));
  return counts;
}

void VoxelComponents::addLayer(const BitLayer& layer) {
  for (Pieces* pieces : {&full_, &empty_}) {
    std::vector<Span> spans;
    std::vector<std::size_t> rows{0};
    for (int row = 0; row < layout_.rows(); ++row) {
      forEachSpan(layer.data() + layout_.row(row), layout_.words(), pieces == &empty_,
                  [&](int begin, int end) {
                    spans.push_back({begin, end, 0});
                  });
      rows.push_back(spans.size());
    }
    addSpans(*pieces, std::move(spans), std::move(rows));
  }
}

void VoxelComponents::addSpans(Pieces& pieces, std::vector<Span> spans,
                               std::vector<std::size_t> rows) const {
  const auto before = static_cast<std::uint32_t>(pieces.open.size());
  DisjointSets sets(before + spans.size());
  const int reach = pieces.diagonal ? 1 : 0;
  const auto rowOf = [](const std::vector<Span>& of, const std::vector<std::size_t>& begins,
                        int row) -> std::span<const Span> {
    const auto n = static_cast<std::size_t>(row);
    if (row < 0 || n + 1 >= begins.size()) return {};
    return {of.data() + begins[n], begins[n + 1] - begins[n]};
  };
  for (int row = 0; row < layout_.rows(); ++row) {
    const std::span<const Span> here = rowOf(spans, rows, row);
    const auto number = [&](std::size_t begin, std::size_t n) {
      return before + static_cast<std::uint32_t>(begin + n);
    };
    const std::size_t first = rows[static_cast<std::size_t>(row)];
    if (row > 0) {
      const std::size_t first_above = rows[static_cast<std::size_t>(row - 1)];
      forEachTouching(here, rowOf(spans, rows, row - 1), reach, [&](std::size_t i, std::size_t j) {
        sets.join(number(first, i), number(first_above, j));
      });
    }
    for (int other = row - reach; other <= row + reach; ++other) {
      const std::span<const Span> below = rowOf(pieces.spans, pieces.rows, other);
      forEachTouching(here, below, reach, [&](std::size_t i, std::size_t j) {
        sets.join(number(first, i), below[j].piece);
      });
    }
  }

  // Pieces that continue get new numbers; the others are complete.
  constexpr auto none = ~std::uint32_t{0};
  std::vector<std::uint32_t> renamed(before + spans.size(), none);
  std::vector<std::uint64_t> open;
  for (std::size_t n = 0; n < spans.size(); ++n) {
    const std::uint32_t root = sets.find(before + static_cast<std::uint32_t>(n));
    if (renamed[root] == none) {
      renamed[root] = static_cast<std::uint32_t>(open.size());
      open.push_back(0);
    }
    spans[n].piece = renamed[root];
    open[spans[n].piece] += static_cast<std::uint64_t>(spans[n].end - spans[n].begin);
  }
  for (std::uint32_t piece = 0; piece < before; ++piece) {
    const std::uint32_t to = renamed[sets.find(piece)];
    if (to == none) {
      // Earlier pieces can only have been joined by spans of this layer.
      pieces.closed.push_back(pieces.open[piece]);
    } else {
      open[to] += pieces.open[piece];
    }
  }
  pieces.spans = std::move(spans);
  pieces.rows = std::move(rows);
  pieces.open = std::move(open);
}

}  // namespace vdbdither
