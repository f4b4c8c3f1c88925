#include "ops/kernels/printing/gaussian_spread.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include <openvdb/tools/Prune.h>
#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/bit_layers.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/printing/normal_distribution.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;

namespace {

constexpr float negligible = 1e-5F;

std::vector<float> weightsAlong(double pitch_mm, double sigma_mm) {
  if (!(sigma_mm > 0)) return {1.0F};
  // The first voxel wholly beyond is omitted with the tail.
  const int reach =
      std::max(0, static_cast<int>(std::ceil(GaussianSpread::sigmas * sigma_mm / pitch_mm - 0.5)));
  std::vector<double> shares;
  double sum = 0;
  for (int n = -reach; n <= reach; ++n) {
    const double step = pitch_mm / sigma_mm;
    shares.push_back(normalShare((std::abs(n) + 0.5) * step) -
                     normalShare((std::abs(n) - 0.5) * step));
    sum += shares.back();
  }
  std::vector<float> weights;
  weights.reserve(shares.size());
  for (const double share : shares) weights.push_back(static_cast<float>(share / sum));
  return weights;
}

int reachOf(const std::vector<float>& weights) { return static_cast<int>(weights.size() / 2); }

/// The common value of the voxels of a leaf or of its surroundings.
enum class Content : std::uint8_t { unknown = 0, empty = 1, full = 2, mixed = 3 };

/// The bits of the voxels of a job, and the content of every leaf.
class Occupancy {
 public:
  Occupancy(const openvdb::BoolGrid& solid, const CoordBBox& box, ZRange valid)
      : layout_(box), box_(box), valid_(valid), layers_(bitLayers(solid, layout_, valid)) {
    // One empty leaf on every side.
    first_leaf_ = Coord(layout_.xBegin() - leaf_layers, (box.min().y() & ~7) - leaf_layers,
                        alignedToLeaves(valid).begin - leaf_layers);
    leaves_ = Coord((box.max().x() - first_leaf_.x()) / leaf_layers + 2,
                    (box.max().y() - first_leaf_.y()) / leaf_layers + 2,
                    (valid.end - 1 - first_leaf_.z()) / leaf_layers + 2);
    contents_.assign(static_cast<std::size_t>(leaves_.x()) * static_cast<std::size_t>(leaves_.y()) *
                         static_cast<std::size_t>(leaves_.z()),
                     Content::empty);
    tbb::parallel_for(0, leaves_.y(), [&](int y) {
      for (int z = 0; z < leaves_.z(); ++z) {
        for (int x = 0; x < leaves_.x(); ++x)
          contents_[index(Coord(x, y, z))] = contentOf(Coord(x, y, z));
      }
    });
  }

  /// Returns eight bits from x on, a multiple of 8.
  [[nodiscard]] std::uint8_t byte(int x, int y, int z) const {
    const int row = y - layout_.yBegin();
    const int at = x - layout_.xBegin();
    if (!valid_.contains(z) || row < 0 || row >= layout_.rows() || at < 0 ||
        at >= layout_.words() * 64)
      return 0;
    const std::uint64_t word = layers_[static_cast<std::size_t>(z - valid_.begin)]
                                      [layout_.row(row) + static_cast<std::size_t>(at / 64)];
    return static_cast<std::uint8_t>(word >> (at % 64));
  }

  /// Returns the common content of the leaves within `reach` of the leaf at `origin`.
  [[nodiscard]] Content around(const Coord& origin, const Coord& reach) const {
    int seen = 0;
    const Coord low = leafOf(origin - reach);
    const Coord high = leafOf(origin.offsetBy(leaf_layers - 1) + reach);
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const Coord at(x, y, z);
          const bool known = at.x() >= 0 && at.y() >= 0 && at.z() >= 0 && at.x() < leaves_.x() &&
                             at.y() < leaves_.y() && at.z() < leaves_.z();
          seen |= static_cast<int>(known ? contents_[index(at)] : beyond(at));
          if (seen == static_cast<int>(Content::mixed)) return Content::mixed;
        }
      }
    }
    return static_cast<Content>(seen);
  }

 private:
  [[nodiscard]] Coord leafOf(const Coord& ijk) const {
    return {(ijk.x() - first_leaf_.x()) >> 3, (ijk.y() - first_leaf_.y()) >> 3,
            (ijk.z() - first_leaf_.z()) >> 3};
  }
  [[nodiscard]] std::size_t index(const Coord& leaf) const {
    return (static_cast<std::size_t>(leaf.y()) * static_cast<std::size_t>(leaves_.z()) +
            static_cast<std::size_t>(leaf.z())) *
               static_cast<std::size_t>(leaves_.x()) +
           static_cast<std::size_t>(leaf.x());
  }
  /// Layers of the job that are not in `valid` are never requested; beyond the box everything is
  /// empty.
  [[nodiscard]] Content beyond(const Coord& leaf) const {
    const int z = first_leaf_.z() + leaf_layers * leaf.z();
    const bool here = z >= box_.min().z() && z + leaf_layers - 1 <= box_.max().z();
    const bool within =
        leaf.x() >= 0 && leaf.y() >= 0 && leaf.x() < leaves_.x() && leaf.y() < leaves_.y();
    return here && within ? Content::unknown : Content::empty;
  }
  [[nodiscard]] Content contentOf(const Coord& leaf) const {
    const Coord origin(first_leaf_.x() + leaf_layers * leaf.x(),
                       first_leaf_.y() + leaf_layers * leaf.y(),
                       first_leaf_.z() + leaf_layers * leaf.z());
    int seen = 0;
    for (int z = origin.z(); z < origin.z() + leaf_layers; ++z) {
      if (!valid_.contains(z)) {
        if (z < box_.min().z() || z > box_.max().z()) seen |= static_cast<int>(Content::empty);
        continue;
      }
      for (int y = origin.y(); y < origin.y() + leaf_layers; ++y) {
        const std::uint8_t row = byte(origin.x(), y, z);
        seen |= static_cast<int>(row == 0      ? Content::empty
                                 : row == 0xFF ? Content::full
                                               : Content::mixed);
        if (seen == static_cast<int>(Content::mixed)) return Content::mixed;
      }
    }
    return static_cast<Content>(seen);
  }

  BitLayout layout_;
  CoordBBox box_;
  ZRange valid_;
  std::vector<BitLayer> layers_;
  Coord first_leaf_, leaves_;
  std::vector<Content> contents_;
};

/// Eight adjacent values along x.
using Octet = std::array<float, 8>;

/// Returns Σ weights[n]·values[n] for eight columns.
Octet weighted(const std::vector<float>& weights, const Octet* values, std::size_t stride) {
  Octet sum{};
  for (const float weight : weights) {
    for (std::size_t i = 0; i < 8; ++i) sum[i] += weight * (*values)[i];
    values += stride;
  }
  return sum;
}

/// Convolves one leaf at a time.
class LeafSpread {
 public:
  LeafSpread(const Occupancy& occupancy, const std::array<std::vector<float>, 3>& weights)
      : occupancy_(occupancy),
        weights_(weights),
        reach_(reachOf(weights[0]), reachOf(weights[1]), reachOf(weights[2])),
        bytes_before_((reach_.x() + 7) / 8),
        row_(static_cast<std::size_t>(8 * (2 * bytes_before_ + 1))),
        along_x_(static_cast<std::size_t>((8 + 2 * reach_.y()) * (8 + 2 * reach_.z()))),
        along_y_(static_cast<std::size_t>(8 * (8 + 2 * reach_.z()))) {}

  /// Writes the shares of the leaf at `origin`, in the order of a leaf.
  void operator()(const Coord& origin, float* shares) {
    const int rows = 8 + 2 * reach_.y();
    const int layers = 8 + 2 * reach_.z();
    for (int z = 0; z < layers; ++z) {
      for (int y = 0; y < rows; ++y) {
        along_x_[static_cast<std::size_t>(z * rows + y)] =
            spreadRow(origin.x(), origin.y() + y - reach_.y(), origin.z() + z - reach_.z());
      }
      for (int y = 0; y < 8; ++y) {
        along_y_[static_cast<std::size_t>(z * 8 + y)] =
            weighted(weights_[1], &along_x_[static_cast<std::size_t>(z * rows + y)], 1);
      }
    }
    for (std::size_t z = 0; z < 8; ++z) {
      for (std::size_t y = 0; y < 8; ++y) {
        const Octet share = weighted(weights_[2], &along_y_[z * 8 + y], 8);
        for (std::size_t x = 0; x < 8; ++x) {
          const float value = share[x];
          shares[64 * x + 8 * y + z] = value < negligible       ? 0.0F
                                       : value > 1 - negligible ? 1.0F
                                                                : value;
        }
      }
    }
  }

 private:
  Octet spreadRow(int x, int y, int z) {
    bool any = false;
    bool all = true;
    for (int n = 0; n <= 2 * bytes_before_; ++n) {
      const std::uint8_t byte = occupancy_.byte(x + 8 * (n - bytes_before_), y, z);
      any = any || byte != 0;
      all = all && byte == 0xFF;
      for (int i = 0; i < 8; ++i)
        row_[static_cast<std::size_t>(8 * n + i)] = static_cast<float>(byte >> i & 1);
    }
    Octet sum{};
    if (!any) return sum;
    if (all) {
      sum.fill(1);
      return sum;
    }
    const float* values = row_.data() + 8 * bytes_before_ - reach_.x();
    for (const float weight : weights_[0]) {
      for (std::size_t i = 0; i < 8; ++i) sum[i] += weight * values[i];
      ++values;
    }
    return sum;
  }

  const Occupancy& occupancy_;
  const std::array<std::vector<float>, 3>& weights_;
  Coord reach_;
  int bytes_before_;
  std::vector<float> row_;
  std::vector<Octet> along_x_, along_y_;
};

}  // namespace

GaussianSpread::GaussianSpread(const openvdb::Vec3d& pitch_mm, const openvdb::Vec3d& sigma_mm)
    : weights_{weightsAlong(pitch_mm.x(), sigma_mm.x()), weightsAlong(pitch_mm.y(), sigma_mm.y()),
               weightsAlong(pitch_mm.z(), sigma_mm.z())} {}

Coord GaussianSpread::reach() const {
  return {reachOf(weights_[0]), reachOf(weights_[1]), reachOf(weights_[2])};
}

FloatGrid::Ptr GaussianSpread::run(const openvdb::BoolGrid& solid, const CoordBBox& box,
                                   ZRange core, ZRange valid) const {
  auto printed = makePrintedGrid(solid.transform());
  if (box.empty() || core.empty() || solid.empty()) return printed;
  const Occupancy occupancy(solid, box, valid);
  const CoordBBox within(Coord(box.min().x(), box.min().y(), core.begin),
                         Coord(box.max().x(), box.max().y(), core.end - 1));
  std::vector<Coord> mixed;
  std::vector<Coord> full;
  for (int x = within.min().x() & ~7; x <= within.max().x(); x += leaf_layers) {
    for (int y = within.min().y() & ~7; y <= within.max().y(); y += leaf_layers) {
      for (int z = within.min().z() & ~7; z <= within.max().z(); z += leaf_layers) {
        const Coord origin(x, y, z);
        const Content content = occupancy.around(origin, reach());
        if (content == Content::mixed) mixed.push_back(origin);
        if (content == Content::full) full.push_back(origin);
      }
    }
  }
  std::vector<std::unique_ptr<FloatLeaf>> made(mixed.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, mixed.size(), 8), [&](const auto& range) {
    LeafSpread spread(occupancy, weights_);
    for (std::size_t n = range.begin(); n != range.end(); ++n) {
      auto leaf = std::make_unique<FloatLeaf>(mixed[n], 0.0F);
      float* shares = leaf->buffer().data();
      spread(mixed[n], shares);
      for (openvdb::Index i = 0; i < FloatLeaf::SIZE; ++i) {
        if (shares[i] == 0) continue;
        if (within.isInside(leaf->offsetToGlobalCoord(i))) {
          leaf->setValueOn(i, shares[i]);
        } else {
          shares[i] = 0;
        }
      }
      if (!leaf->isEmpty()) made[n] = std::move(leaf);
    }
  });
  for (auto& leaf : made) {
    if (leaf) printed->tree().addLeaf(leaf.release());
  }
  for (const Coord& origin : full) {
    CoordBBox filled(origin, origin.offsetBy(leaf_layers - 1));
    filled.intersect(within);
    if (filled.volume() == FloatLeaf::SIZE) {
      printed->tree().addTile(1, origin, 1.0F, true);
    } else {
      printed->tree().fill(filled, 1.0F, true);
    }
  }
  openvdb::tools::prune(printed->tree());
  return printed;
}

FloatGrid::Ptr makePrintedGrid(const openvdb::math::Transform& transform) {
  auto grid = FloatGrid::create(0.0F);
  grid->setName(printed_grid);
  grid->setGridClass(openvdb::GRID_FOG_VOLUME);
  grid->setTransform(transform.copy());
  return grid;
}

}  // namespace vdbdither
