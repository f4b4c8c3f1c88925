#include "ops/kernels/contour/iso_surface.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/contour/marching_cubes.h"
#include "ops/kernels/printing/normal_distribution.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

using RowsOfSteps = tbb::blocked_range<int>;

constexpr int word_bits = 64;
constexpr double minimum_share = 1.0 / 256;

/// Returns the word whose bit n is bit n + 1 of a row.
std::uint64_t shiftedDown(const std::uint64_t* row, int word, int words) {
  const std::uint64_t next = word + 1 < words ? row[word + 1] : 0;
  return row[word] >> 1 | next << (word_bits - 1);
}

template <typename Visit>
void forEachBitOf(std::uint64_t word, const Visit& visit) {
  for (; word != 0; word &= word - 1) visit(std::countr_zero(word));
}

}  // namespace

std::uint32_t IsoSurface::CutLines::vertex(std::size_t row, int x) const {
  const std::size_t word = row + static_cast<std::size_t>(x / word_bits);
  const std::uint64_t before = cut[word] & ((std::uint64_t{1} << (x % word_bits)) - 1);
  return first[word] + static_cast<std::uint32_t>(std::popcount(before));
}

/// The space between a layer and the one above it.
struct IsoSurface::Step {
  int z = 0;  ///< of the lower layer
  const Layer* lower = nullptr;
  Layer* upper = nullptr;
  CutLines along_z;
  std::uint32_t first_of_upper = 0;  ///< the first vertex on the lines within the upper layer
  std::vector<std::size_t> first_triangle;  ///< by row, in the piece
};

/// The field at voxel centres, for one thread.
class IsoSurface::Values {
 public:
  explicit Values(const IsoSurface& surface)
      : surface_(surface),
        box_(surface.lattice_.box),
        level_(surface.is_field_ ? scaled(surface.level_) : 0) {
    if (surface.below_) below_.emplace(surface.below_->getConstAccessor());
    if (surface.here_) here_.emplace(surface.here_->getConstAccessor());
  }

  /// Returns where the surface cuts the line from `from` to its neighbour along `axis`, 0 … 1.
  double share(const Coord& from, int axis) {
    if (!surface_.is_field_) return 0.5;
    Coord to = from;
    ++to[axis];
    const double a = scaled(value(from));
    const double b = scaled(value(to));
    return std::clamp((level_ - a) / (b - a), minimum_share, 1 - minimum_share);
  }

 private:
  [[nodiscard]] double scaled(float value) const {
    return surface_.between_ == Between::probit ? probit(value) : value;
  }

  float value(const Coord& ijk) {
    if (!box_.isInside(ijk) || ijk.z() < surface_.first_layer_) return surface_.background_;
    if (ijk.z() < surface_.here_layers_.begin)
      return below_ ? below_->getValue(ijk) : surface_.background_;
    return here_ && ijk.z() < surface_.here_layers_.end ? here_->getValue(ijk)
                                                        : surface_.background_;
  }

  const IsoSurface& surface_;
  openvdb::CoordBBox box_;
  double level_;
  std::optional<openvdb::FloatGrid::ConstAccessor> below_, here_;
};

void append(Mesh& mesh, const SurfacePiece& piece) {
  mesh.vertices.insert(mesh.vertices.end(), piece.vertices.begin(), piece.vertices.end());
  mesh.triangles.insert(mesh.triangles.end(), piece.triangles.begin(), piece.triangles.end());
}

IsoSurface::IsoSurface(const Lattice& lattice) : lattice_(lattice), layout_(lattice.box) {}

IsoSurface::IsoSurface(const Lattice& lattice, Inside inside, float level, float background,
                       Between between)
    : lattice_(lattice),
      layout_(lattice.box),
      is_field_(true),
      inside_(inside),
      level_(level),
      background_(background),
      between_(between) {}

SurfacePiece IsoSurface::add(const openvdb::BoolGrid::ConstPtr& voxels, ZRange layers) {
  return addBits(insideOf(*voxels, layers), layers);
}

SurfacePiece IsoSurface::add(const openvdb::FloatGrid::ConstPtr& field, ZRange layers) {
  below_ = std::move(here_);
  here_ = field;
  return addBits(insideOf(*field, layers), layers);
}

SurfacePiece IsoSurface::finish() {
  below_ = std::move(here_);
  here_ = nullptr;
  if (!begun_) return {};
  return addBits({layout_.emptyLayer()}, {next_layer_, next_layer_ + 1});
}

SurfacePiece IsoSurface::addBits(std::vector<BitLayer> bits, ZRange layers) {
  SurfacePiece piece;
  if (bits.empty()) return piece;
  if (!std::exchange(begun_, true)) {
    first_layer_ = layers.begin;
    last_.inside = layout_.emptyLayer();
    for (CutLines* lines : {&last_.along_x, &last_.along_y}) {
      lines->cut = last_.inside;
      lines->first.assign(last_.inside.size(), 0);
    }
  }
  here_layers_ = layers;
  next_layer_ = layers.end;
  // A few layers at a time, to limit the memory.
  for (std::size_t begin = 0; begin < bits.size(); begin += leaf_layers) {
    const std::size_t end = std::min(bits.size(), begin + leaf_layers);
    std::vector<Layer> made(end - begin);
    std::vector<Step> steps(end - begin);
    for (std::size_t n = 0; n < made.size(); ++n) {
      const int z = layers.begin + static_cast<int>(begin + n);
      made[n].inside = std::move(bits[begin + n]);
      steps[n].z = z - 1;
      steps[n].lower = n == 0 ? &last_ : &made[n - 1];
      steps[n].upper = &made[n];
    }
    march(steps, piece);
    last_ = std::move(made.back());
  }
  return piece;
}

/// Calls visit(x, case) for the cells that the surface passes between a row and the next, in rising
/// x.
template <typename Visit>
void IsoSurface::forEachCell(const Step& step, int row, const Visit& visit) const {
  if (row + 1 == layout_.rows()) return;
  const int words = layout_.words();
  const std::array<const std::uint64_t*, 4> corner_rows{
      step.lower->inside.data() + layout_.row(row),
      step.lower->inside.data() + layout_.row(row + 1),
      step.upper->inside.data() + layout_.row(row),
      step.upper->inside.data() + layout_.row(row + 1)};
  const auto& cases = cubeCases();
  for (int word = 0; word < words; ++word) {
    std::array<std::uint64_t, 4> here{}, next{};
    std::uint64_t any = 0;
    std::uint64_t all = ~std::uint64_t{0};
    for (std::size_t n = 0; n < 4; ++n) {
      here[n] = corner_rows[n][word];
      next[n] = shiftedDown(corner_rows[n], word, words);
      any |= here[n] | next[n];
      all &= here[n] & next[n];
    }
    forEachBitOf(any & ~all, [&](int x) {
      unsigned inside = 0;
      for (std::size_t n = 0; n < 4; ++n) {
        inside |= static_cast<unsigned>(here[n] >> x & 1) << (2 * n);
        inside |= static_cast<unsigned>(next[n] >> x & 1) << (2 * n + 1);
      }
      visit(word * word_bits + x, cases[inside]);
    });
  }
}

/// Calls work(rows) on all threads for ranges of rows, counted through the steps.
template <typename Work>
void IsoSurface::forSomeRows(const std::vector<Step>& steps, const Work& work) const {
  tbb::parallel_for(RowsOfSteps(0, static_cast<int>(steps.size()) * layout_.rows(), 64), work);
}

void IsoSurface::march(std::vector<Step>& steps, SurfacePiece& piece) {
  for (Step& step : steps) {
    for (CutLines* lines : {&step.along_z, &step.upper->along_x, &step.upper->along_y}) {
      lines->cut.assign(last_.inside.size(), 0);
      lines->first.assign(last_.inside.size(), 0);
    }
    step.first_triangle.assign(static_cast<std::size_t>(layout_.rows()), 0);
  }
  forSomeRows(steps, [&](const RowsOfSteps& rows) {
    for (int n = rows.begin(); n != rows.end(); ++n)
      findCuts(steps[static_cast<std::size_t>(n / layout_.rows())], n % layout_.rows());
  });
  number(steps, piece);
  forSomeRows(steps, [&](const RowsOfSteps& rows) {
    Values values(*this);
    for (int n = rows.begin(); n != rows.end(); ++n) {
      const Step& step = steps[static_cast<std::size_t>(n / layout_.rows())];
      emitVertices(step, n % layout_.rows(), values, piece);
      emitTriangles(step, n % layout_.rows(), piece);
    }
  });
}

/// Finds the cut lines of a row, counts them by word, and counts its triangles.
void IsoSurface::findCuts(Step& step, int row) const {
  const int words = layout_.words();
  const std::size_t begin = layout_.row(row);
  const std::uint64_t* lower = step.lower->inside.data() + begin;
  const std::uint64_t* upper = step.upper->inside.data() + begin;
  const auto count = [](CutLines& lines, std::size_t at, std::uint64_t cut) {
    lines.cut[at] = cut;
    lines.first[at] = static_cast<std::uint32_t>(std::popcount(cut));
  };
  for (int word = 0; word < words; ++word) {
    const std::size_t at = begin + static_cast<std::size_t>(word);
    count(step.along_z, at, lower[word] ^ upper[word]);
    count(step.upper->along_x, at, upper[word] ^ shiftedDown(upper, word, words));
    if (row + 1 < layout_.rows()) count(step.upper->along_y, at, upper[word] ^ upper[word + words]);
  }
  forEachCell(step, row, [&](int, const CubeCase& cube) {
    step.first_triangle[static_cast<std::size_t>(row)] += cube.triangles.size();
  });
}

/// Turns counts of cut lines and of triangles into the indices of the first, and resizes the piece.
void IsoSurface::number(std::vector<Step>& steps, SurfacePiece& piece) {
  std::uint64_t vertices = vertex_count_;
  std::size_t triangles = piece.triangles.size();
  const auto number_lines = [&](CutLines& lines) {
    for (std::uint32_t& first : lines.first) {
      const std::uint32_t cut = first;
      first = static_cast<std::uint32_t>(vertices);
      vertices += cut;
    }
  };
  for (Step& step : steps) {
    number_lines(step.along_z);
    step.first_of_upper = static_cast<std::uint32_t>(vertices);
    number_lines(step.upper->along_x);
    number_lines(step.upper->along_y);
    for (std::size_t& first : step.first_triangle) triangles += std::exchange(first, triangles);
  }
  if (vertices > std::numeric_limits<std::uint32_t>::max())
    throw DataError("the surface has more than 4294967295 vertices; take fewer --layers");

  const std::uint32_t piece_begin =
      vertex_count_ - static_cast<std::uint32_t>(piece.vertices.size());
  piece.vertices.resize(vertices - piece_begin);
  piece.triangles.resize(triangles);
  vertex_count_ = static_cast<std::uint32_t>(vertices);
  piece.open_from = steps.back().first_of_upper;
}

/// Writes the vertices on the lines of a row.
void IsoSurface::emitVertices(const Step& step, int row, Values& values,
                              SurfacePiece& piece) const {
  const std::uint32_t piece_begin =
      vertex_count_ - static_cast<std::uint32_t>(piece.vertices.size());
  const auto emit = [&](const CutLines& lines, int z, int axis) {
    for (int word = 0; word < layout_.words(); ++word) {
      const std::size_t at = layout_.row(row) + static_cast<std::size_t>(word);
      std::uint32_t vertex = lines.first[at] - piece_begin;
      forEachBitOf(lines.cut[at], [&](int n) {
        const Coord from(layout_.xBegin() + word * word_bits + n, layout_.yBegin() + row, z);
        Vec3d index = from.asVec3d();
        index[axis] += values.share(from, axis);
        piece.vertices[vertex++] = lattice_.origin_mm + index * lattice_.pitch_mm;
      });
    }
  };
  emit(step.along_z, step.z, 2);
  emit(step.upper->along_x, step.z + 1, 0);
  emit(step.upper->along_y, step.z + 1, 1);
}

/// Writes the triangles of the cells between a row and the next.
void IsoSurface::emitTriangles(const Step& step, int row, SurfacePiece& piece) const {
  std::size_t next = step.first_triangle[static_cast<std::size_t>(row)];
  forEachCell(step, row, [&](int x, const CubeCase& cube) {
    std::array<std::uint32_t, 12> vertex{};
    forEachBitOf(cube.edges, [&](int edge) {
      const int first = edge & 1;
      const int second = edge >> 1 & 1;
      const Layer& layer = second ? *step.upper : *step.lower;
      if (edge < 4) {
        vertex[edge] = layer.along_x.vertex(layout_.row(row + first), x);
      } else if (edge < 8) {
        vertex[edge] = layer.along_y.vertex(layout_.row(row), x + first);
      } else {
        vertex[edge] = step.along_z.vertex(layout_.row(row + second), x + first);
      }
    });
    for (const auto& t : cube.triangles)
      piece.triangles[next++] = {vertex[t[0]], vertex[t[1]], vertex[t[2]]};
  });
}

}  // namespace vdbdither
