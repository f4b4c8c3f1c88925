#include "io/stack/slice_spans.h"

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <memory>
#include <utility>

#include <openvdb/tools/Prune.h>
#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

namespace vdbdither {

namespace {

using openvdb::Coord;

/// Eight rows of eight layers, the unit in which a tree is walked: row 8·y + z, as a leaf orders
/// its voxels.
constexpr std::ptrdiff_t strip_rows = 64;
static_assert(strip_rows == leaf_layers * leaf_layers);

/// The spans of a strip, row after row.
struct StripSpans {
  std::array<std::uint32_t, strip_rows + 1> begin{};
  std::vector<Span> spans;
};

using LeafValues = std::array<std::int32_t, leaf_layers * strip_rows>;

/// What a voxel of a tile counts as, and those of a leaf: eight planes of equal x, each in the
/// order of a strip.
std::uint32_t countsAs(std::int32_t value, bool) { return static_cast<std::uint32_t>(value); }
std::uint32_t countsAs(bool value, bool active) { return value && active ? 1 : 0; }

const std::int32_t* planes(const openvdb::Int32Tree::LeafNodeType& leaf, LeafValues&) {
  return leaf.buffer().data();
}
const std::int32_t* planes(const openvdb::BoolTree::LeafNodeType& leaf, LeafValues& scratch) {
  for (int x = 0; x < leaf_layers; ++x) {
    const std::uint64_t bits =
        leaf.getValueMask().getWord<openvdb::Index64>(x) & leaf.buffer().data()[x];
    for (int row = 0; row < strip_rows; ++row)
      scratch[x * strip_rows + row] = static_cast<std::int32_t>(bits >> row & 1);
  }
  return scratch.data();
}

/// A bit for every row of a plane whose values differ.
std::uint64_t differing(const std::int32_t* a, const std::int32_t* b) {
#ifdef __SSE2__
  const auto equal = [&](int row) {
    return _mm_cmpeq_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(a + row)),
                           _mm_loadu_si128(reinterpret_cast<const __m128i*>(b + row)));
  };
  std::uint64_t rows = 0;
  for (int row = 0; row < strip_rows; row += 16) {
    const __m128i low = _mm_packs_epi32(equal(row), equal(row + 4));
    const __m128i high = _mm_packs_epi32(equal(row + 8), equal(row + 12));
    const auto bits = static_cast<std::uint16_t>(_mm_movemask_epi8(_mm_packs_epi16(low, high)));
    rows |= std::uint64_t{bits} << row;
  }
  return ~rows;
#else
  std::uint64_t rows = 0;
  for (int row = 0; row < strip_rows; ++row) rows |= std::uint64_t{a[row] != b[row]} << row;
  return rows;
#endif
}

/// Collects the spans of a strip from left to right.
class StripBuilder {
 public:
  void clear() {
    for (auto& row : rows_) row.clear();
    values_.fill(0);
    uniform_ = true;
  }

  /// From `column` on every row holds `value`.
  void fill(std::uint32_t column, std::uint32_t value) {
    const auto wanted = static_cast<std::int32_t>(value);
    if (uniform_ && values_[0] == wanted) return;
    for (int row = 0; row < strip_rows; ++row) change(row, column, wanted);
    uniform_ = true;
  }

  /// From `column` on each row holds its own value.
  void plane(std::uint32_t column, const std::int32_t* values) {
    for (std::uint64_t rows = differing(values, values_.data()); rows != 0; rows &= rows - 1) {
      const int row = std::countr_zero(rows);
      uniform_ = false;
      change(row, column, values[row]);
    }
  }

  [[nodiscard]] StripSpans finish(std::uint32_t width) {
    StripSpans strip;
    std::size_t count = strip_rows;
    for (const auto& row : rows_) count += row.size();
    strip.spans.reserve(count);
    for (int row = 0; row < strip_rows; ++row) {
      strip.spans.insert(strip.spans.end(), rows_[row].begin(), rows_[row].end());
      strip.spans.push_back({width, static_cast<std::uint32_t>(values_[row])});
      strip.begin[row + 1] = static_cast<std::uint32_t>(strip.spans.size());
    }
    return strip;
  }

 private:
  void change(int row, std::uint32_t column, std::int32_t value) {
    if (values_[row] == value) return;
    if (column > 0) rows_[row].push_back({column, static_cast<std::uint32_t>(values_[row])});
    values_[row] = value;
  }

  std::array<std::vector<Span>, strip_rows> rows_;
  std::array<std::int32_t, strip_rows> values_{};
  bool uniform_ = true;
};

template <typename Grid>
StripSpans walkStrip(const Grid& grid, const SliceLayout& layout, int y, int z,
                     StripBuilder& builder) {
  using Tree = typename Grid::TreeType;
  using Branch = typename Tree::RootNodeType::ChildNodeType::ChildNodeType;
  const int x_begin = layout.box.min().x();
  const int x_end = layout.box.max().x() + 1;
  const auto column = [&](int x) {
    return static_cast<std::uint32_t>(std::max(x, x_begin) - x_begin + layout.padding);
  };
  const auto accessor = grid.getConstAccessor();
  LeafValues scratch;
  builder.clear();
  for (int x = x_begin & ~(leaf_layers - 1); x < x_end;) {
    const Coord origin(x, y, z);
    const int branch_end = (x | (Branch::DIM - 1)) + 1;
    const Branch* branch = accessor.template probeConstNode<Branch>(origin);
    if (!branch) {
      typename Grid::ValueType value;
      const bool active = accessor.probeValue(origin, value);
      builder.fill(column(x), countsAs(value, active));
      x = branch_end;
      continue;
    }
    for (const int end = std::min(branch_end, x_end); x < end; x += leaf_layers) {
      const Coord at(x, y, z);
      if (const auto* leaf = accessor.probeConstLeaf(at)) {
        const std::int32_t* values = planes(*leaf, scratch);
        for (int i = std::max(0, x_begin - x); i < std::min(leaf_layers, x_end - x); ++i) {
          builder.plane(column(x + i), values + i * strip_rows);
        }
      } else {
        builder.fill(column(x), countsAs(branch->getValue(at), branch->isValueOn(at)));
      }
    }
  }
  if (layout.padding) builder.fill(layout.width() - layout.padding, 0);
  return builder.finish(layout.width());
}

void mirror(std::span<Span> spans) {
  std::reverse(spans.begin(), spans.end());
  const std::uint32_t width = spans.front().end;
  for (std::size_t i = 0; i + 1 < spans.size(); ++i) spans[i].end = width - spans[i + 1].end;
  spans.back().end = width;
}

template <typename Grid>
std::vector<SpanImage> slice(const Grid& grid, const SliceLayout& layout, ZRange layers) {
  std::vector<SpanImage> images(std::max(0, layers.size()));
  const ZRange aligned = alignedToLeaves(layers);
  const int y_begin = layout.box.min().y() & ~(leaf_layers - 1);
  const int strip_count = (layout.box.max().y() - y_begin) / leaf_layers + 1;
  // One over the other: tiles that are neighbours along z share a cache line.
  std::vector<StripSpans> all_strips(static_cast<std::size_t>(aligned.size() / leaf_layers) *
                                     strip_count);
  const auto stripsAt = [&](int z) {
    return std::span(all_strips)
        .subspan(static_cast<std::size_t>((z - aligned.begin) / leaf_layers) * strip_count,
                 strip_count);
  };
  tbb::enumerable_thread_specific<StripBuilder> builders;
  tbb::parallel_for(0, strip_count, [&](int strip) {
    StripBuilder& builder = builders.local();
    for (int z = aligned.begin; z < aligned.end; z += leaf_layers)
      stripsAt(z)[strip] = walkStrip(grid, layout, y_begin + strip * leaf_layers, z, builder);
  });
  for (int z = aligned.begin; z < aligned.end; z += leaf_layers) {
    const std::span<const StripSpans> strips = stripsAt(z);
    const ZRange here = intersection({z, z + leaf_layers}, layers);
    tbb::parallel_for(here.begin, here.end, [&](int layer) {
      SpanImage& image = images[layer - layers.begin];
      image.width = layout.width();
      image.height = layout.height();
      image.row_begin.reserve(image.height + 1);
      image.row_begin.push_back(0);
      std::size_t size = 2 * static_cast<std::size_t>(layout.padding);
      for (const StripSpans& strip : strips) {
        for (int row = layer - z; row < strip_rows; row += leaf_layers)
          size += strip.begin[row + 1] - strip.begin[row];
      }
      image.spans.reserve(size);
      const auto add_blank_rows = [&] {
        for (int i = 0; i < layout.padding; ++i) {
          image.spans.push_back({image.width, 0});
          image.row_begin.push_back(image.spans.size());
        }
      };
      add_blank_rows();
      const int rows = layout.box.dim().y();
      for (int i = 0; i < rows; ++i) {
        const int y = layout.flip_y ? layout.box.min().y() + i : layout.box.max().y() - i;
        const StripSpans& strip = strips[(y - y_begin) / leaf_layers];
        const int row = (y - y_begin) % leaf_layers * leaf_layers + (layer - z);
        image.spans.insert(image.spans.end(), strip.spans.begin() + strip.begin[row],
                           strip.spans.begin() + strip.begin[row + 1]);
        if (layout.flip_x) mirror(std::span(image.spans).subspan(image.row_begin.back()));
        image.row_begin.push_back(image.spans.size());
      }
      add_blank_rows();
    });
  }
  return images;
}

using Leaf = openvdb::Int32Tree::LeafNodeType;

/// The leaves of eight rows of eight layers: nodes with voxels of their own, and how many of their
/// 64 rows are wholly of one value.
class LeafStrip {
 public:
  LeafStrip(const SliceLayout& layout, int y, int z)
      : layout_(layout),
        y_(y),
        z_(z),
        first_(layout.box.min().x() >> 3),
        leaves_(static_cast<std::size_t>((layout.box.max().x() >> 3) - first_ + 1)) {}

  /// Where `images` hold the layers from `first_layer` on.
  void fill(std::span<const SpanImage> images, int first_layer) {
    const auto each_span = [&](const auto& take) {
      for (int row = 0; row < strip_rows; ++row) {
        const int y = y_ + row / leaf_layers;
        const int z = z_ + row % leaf_layers;
        if (y < layout_.box.min().y() || y > layout_.box.max().y() || z < first_layer ||
            z >= first_layer + std::ssize(images)) {
          continue;
        }
        const int from_top = layout_.flip_y ? y - layout_.box.min().y() : layout_.box.max().y() - y;
        std::uint32_t begin = 0;
        for (const Span& span : images[z - first_layer].row(from_top + layout_.padding)) {
          if (span.value)
            take(row, columns(begin, span.end), static_cast<std::int32_t>(span.value));
          begin = span.end;
        }
      }
    };
    each_span([&](int, std::pair<int, int> x, std::int32_t value) { countWholeRows(x, value); });
    each_span(
        [&](int row, std::pair<int, int> x, std::int32_t value) { setVoxels(row, x, value); });
  }

  /// Hands over what was made.
  void moveTo(openvdb::tree::ValueAccessor<openvdb::Int32Tree>& target) {
    for (std::size_t i = 0; i < leaves_.size(); ++i) {
      if (leaves_[i].whole_rows == strip_rows) {
        target.addTile(1, origin(i), leaves_[i].value, true);
      } else if (leaves_[i].node) {
        target.addLeaf(leaves_[i].node.release());
      }
    }
  }

 private:
  struct Place {
    std::unique_ptr<Leaf> node;
    std::int32_t value = 0;  ///< of the whole rows
    int whole_rows = 0;      ///< of that value
  };

  [[nodiscard]] Coord origin(std::size_t i) const {
    return {(first_ + static_cast<int>(i)) * leaf_layers, y_, z_};
  }

  /// The voxels, half open, behind columns of a picture.
  [[nodiscard]] std::pair<int, int> columns(std::uint32_t begin, std::uint32_t end) const {
    const int low = layout_.box.min().x();
    const int high = layout_.box.max().x() + 1;
    int from = static_cast<int>(begin) - layout_.padding;
    int to = static_cast<int>(end) - layout_.padding;
    if (layout_.flip_x) {
      std::swap(from, to);
      from = high - low - from;
      to = high - low - to;
    }
    return {std::max(low, low + from), std::min(high, low + to)};
  }

  void countWholeRows(std::pair<int, int> x, std::int32_t value) {
    for (int leaf = (x.first + leaf_layers - 1) >> 3; leaf < x.second >> 3; ++leaf) {
      Place& place = leaves_[static_cast<std::size_t>(leaf - first_)];
      if (place.whole_rows == 0) place.value = value;
      if (place.value == value) ++place.whole_rows;
    }
  }

  void setVoxels(int row, std::pair<int, int> x, std::int32_t value) {
    for (int at = x.first; at < x.second;) {
      const int leaf = at >> 3;
      const int end = std::min(x.second, (leaf + 1) * leaf_layers);
      const auto i = static_cast<std::size_t>(leaf - first_);
      Place& place = leaves_[i];
      if (place.whole_rows < strip_rows) {
        if (!place.node) place.node = std::make_unique<Leaf>(origin(i), 0, false);
        for (int column = at; column < end; ++column) {
          place.node->setValueOn(static_cast<openvdb::Index>((column & 7) * strip_rows + row),
                                 value);
        }
      }
      at = end;
    }
  }

  const SliceLayout& layout_;
  int y_, z_;
  int first_;  ///< leaf along x
  std::vector<Place> leaves_;
};

}  // namespace

openvdb::Int32Grid::Ptr gridOfSpans(std::span<const SpanImage> images, const SliceLayout& layout,
                                    ZRange layers) {
  auto grid = openvdb::Int32Grid::create(0);
  auto target = grid->getAccessor();
  const int y_begin = layout.box.min().y() & ~(leaf_layers - 1);
  const int strip_count = (layout.box.max().y() - y_begin) / leaf_layers + 1;
  const ZRange aligned = alignedToLeaves(layers);
  for (int z = aligned.begin; z < aligned.end; z += leaf_layers) {
    std::vector<LeafStrip> strips;
    strips.reserve(strip_count);
    for (int i = 0; i < strip_count; ++i) strips.emplace_back(layout, y_begin + i * leaf_layers, z);
    tbb::parallel_for(0, strip_count, [&](int i) { strips[i].fill(images, layers.begin); });
    for (LeafStrip& strip : strips) strip.moveTo(target);
  }
  openvdb::tools::prune(grid->tree());
  return grid;
}

std::vector<SpanImage> sliceSpans(const openvdb::Int32Grid& grid, const SliceLayout& layout,
                                  ZRange layers) {
  return slice(grid, layout, layers);
}

std::vector<SpanImage> sliceSpans(const openvdb::BoolGrid& grid, const SliceLayout& layout,
                                  ZRange layers) {
  return slice(grid, layout, layers);
}

SpanImage blankSlice(const SliceLayout& layout) {
  SpanImage image{layout.width(), layout.height(), {}, {}};
  for (std::uint32_t y = 0; y <= image.height; ++y) image.row_begin.push_back(y);
  image.spans.assign(image.height, {image.width, 0});
  return image;
}

void expandByPrinted(openvdb::CoordBBox& box, const SpanImage& image, int z) {
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const std::span<const Span> row = image.row(y);
    std::size_t first = 0;
    while (first < row.size() && row[first].value == 0) ++first;
    if (first == row.size()) continue;
    std::size_t last = row.size() - 1;
    while (row[last].value == 0) --last;
    const auto at = static_cast<int>(y);
    box.expand({first == 0 ? 0 : static_cast<int>(row[first - 1].end), at, z});
    box.expand({static_cast<int>(row[last].end) - 1, at, z});
  }
}

SpanImage onlyValue(SpanImage slice, std::uint32_t value) {
  for (Span& span : slice.spans) span.value = span.value == value ? 1 : 0;
  return slice;
}

bool isBlank(const SpanImage& slice) {
  return std::all_of(slice.spans.begin(), slice.spans.end(),
                     [](const Span& span) { return span.value == 0; });
}

}  // namespace vdbdither
