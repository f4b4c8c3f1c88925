// The printing process as a blur and the half-way level of the blur as the print: the low-pass of
// Morsy, Brunton, Urban: "Shape Dithering for 3D Printing", ACM Transactions on Graphics 41(4),
// 2022, who name its compensation as future work. The step is a fixed-point iteration for the
// distance, d ← d − e(d).

#include "ops/kernels/printing/detail_compensation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include <tbb/parallel_for.h>

#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/leaf_bits.h"
#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/leaf_window.h"
#include "ops/kernels/leaf/simple_point.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "ops/kernels/leaf/voxel_diameter.h"
#include "ops/kernels/printing/blur_quantile.h"
#include "ops/kernels/printing/gaussian_spread.h"
#include "vdbdither/model/half_space_share.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::CoordBBox;
using openvdb::FloatGrid;
using openvdb::FloatTree;
using openvdb::Vec3d;
using openvdb::Vec3s;

namespace {

/// In half voxel diameters k_D: where e counts whole, and where it has fallen to zero.
constexpr double whole_until = 3;
constexpr double zero_from = 7;
/// How far along the normal the medial axis is searched for: twice as far as it can limit e.
constexpr int search_steps = 8;
/// A shorter gradient is that of a voxel near the medial axis.
constexpr double minimum_slope = 0.5;
/// How often every voxel is asked whether it can change its side; in each sweep, a change depends
/// on voxels up to eight away.
constexpr int sweeps = 2;

/// A foot is at most zero_from / 2 voxels away along each axis, and interpolation takes two more.
constexpr int tap_halo = 6;
/// Search from the foot; k_D along a normal is at most half a voxel along each axis.
constexpr int search_halo = 9;

/// A voxel whose distance may change.
struct Detail {
  unsigned offset;
  float d_mm;
  Vec3s normal;
  float half_diameter_mm;
  Vec3s foot;      ///< in voxels from the leaf's origin
  float gain = 0;  ///< the share of what the print misses that counts
  float e_mm = 0;  ///< within the limits that follow
  float most_mm = 0;
  float least_mm = 0;

  [[nodiscard]] double corrected() const {
    const double beyond = std::abs(double{d_mm}) - whole_until * half_diameter_mm;
    const double share = 1 - beyond / ((zero_from - whole_until) * half_diameter_mm);
    return d_mm - e_mm * std::clamp(share, 0.0, 1.0);
  }
};

/// A voxel beside the band, which shares e with a detail.
struct Neighbour {
  unsigned offset;
  Detail as;
  Coord of;  ///< the detail's voxel
};

struct DetailLeaf {
  Coord origin;
  std::vector<Detail> details;
  std::vector<Neighbour> neighbours;
};

/// The unit gradient at a place of a window of distances, of which only those below the background
/// are known; zero where the gradient is too short.
Vec3d unitGradient(const float* at, const std::array<int, 3>& strides, float background,
                   const Vec3d& pitch_mm) {
  Vec3d slope;
  for (int axis = 0; axis < 3; ++axis) {
    const int stride = strides[static_cast<std::size_t>(axis)];
    const float below = at[-stride];
    const float above = at[stride];
    const bool has_below = std::abs(below) < background;
    const bool has_above = std::abs(above) < background;
    const double rise = double{has_above ? above : *at} - double{has_below ? below : *at};
    slope[axis] = rise / ((has_below && has_above ? 2 : 1) * pitch_mm[axis]);
  }
  const double length = slope.length();
  return length < minimum_slope ? Vec3d(0.0) : slope / length;
}

/// The sides of voxels while some of them change.
class Sides {
 public:
  /// Leaves of `changed` stand in for those of `surface`.
  Sides(const FloatTree& surface, const FloatTree& changed, ZRange valid)
      : surface_(surface), changed_(changed), valid_(valid) {}

  /// Returns the bits of the voxels around `ijk` that are inside.
  [[nodiscard]] std::uint32_t inside(const Coord& ijk) {
    std::uint32_t bits = 0;
    for (const Coord& step : CoordBBox(Coord(-1), Coord(1))) {
      const Coord there = ijk + step;
      if (!valid_.contains(there.z())) continue;
      const FloatLeaf* leaf = changed_.probeConstLeaf(there);
      const float side = leaf ? leaf->getValue(there) : surface_.getValue(there);
      bits |= std::uint32_t{side < 0} << neighbourBit(step.x(), step.y(), step.z());
    }
    return bits;
  }

 private:
  openvdb::tree::ValueAccessor<const FloatTree, false> surface_;
  openvdb::tree::ValueAccessor<const FloatTree, false> changed_;
  ZRange valid_;
};

/// The computation over one slab.
class Run {
 public:
  Run(const DetailCompensation& settings, const FloatGrid& surface, ZRange core, ZRange valid)
      : settings_(settings),
        pitch_mm_(settings.lattice.pitch_mm),
        surface_(surface),
        background_(surface.background()),
        core_(core),
        valid_(valid),
        spread_(pitch_mm_, settings.spread_mm),
        shares_(0.0F),
        corrections_(std::make_unique<FloatTree>(0.0F)) {}

  FloatGrid::Ptr operator()() {
    const int first_around = around(settings_.steps - 1);
    findDetails(layersAround(first_around));
    makeShares(layersAround(first_around + tap_halo + spread_.reach().z()));
    for (int left = settings_.steps - 1; left >= 0; --left) {
      const ZRange layers = layersAround(around(left));
      const bool first = left + 1 == settings_.steps;
      correct(quantiles(layers), layers, first);
      if (left == 0) keepTopology();
      corrections_ = treeOf([](const Detail& detail) { return detail.e_mm; }, 0);
      if (first) findNeighbours();
      updateNeighbours();
      if (left > 0) updateShares();
    }
    return result();
  }

  /// The layers around the core in which details are corrected `left` steps before the last. The
  /// topology makes a voxel depend on more, and a neighbour depends on one layer more.
  [[nodiscard]] int around(int left) const {
    return 1 + 8 * sweeps + left * (1 + tap_halo + spread_.reach().z());
  }
  [[nodiscard]] int reach() const {
    const int first = around(settings_.steps - 1);
    return first + std::max(tap_halo + spread_.reach().z(), search_halo) + 1;
  }

 private:
  [[nodiscard]] ZRange layersAround(int layers) const { return grownWithin(core_, layers, valid_); }
  [[nodiscard]] static bool isIn(ZRange layers, const Coord& origin, unsigned offset) {
    return layers.contains(origin.z() + static_cast<int>(offset % 8));
  }
  [[nodiscard]] static const float* at(const LeafWindow& window, unsigned offset) {
    const auto n = static_cast<int>(offset);
    return window.at(n / 64, n / 8 % 8, n % 8);
  }
  [[nodiscard]] static std::array<int, 3> stridesOf(const LeafWindow& window) {
    return {window.strideX(), window.strideY(), 1};
  }
  [[nodiscard]] Detail detailOf(unsigned offset, const Coord& local, float d_mm,
                                const Vec3d& normal) const {
    const auto half = static_cast<float>(halfVoxelDiameter(normal, pitch_mm_));
    const Vec3d foot = local.asVec3d() - normal * double{d_mm} / pitch_mm_;
    return {offset, d_mm, Vec3s(normal), half, Vec3s(foot)};
  }
  template <typename Do>
  void forEachLeaf(const Do& make_worker) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, leaves_.size(), 4),
                      [&](const auto& range) {
                        auto work = make_worker();
                        for (std::size_t n = range.begin(); n != range.end(); ++n) work(leaves_[n]);
                      });
  }

  void findDetails(ZRange layers) {
    const std::vector<const FloatLeaf*> sources = leavesIn(surface_.tree(), layers);
    leaves_.resize(sources.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, sources.size(), 4),
                      [&](const auto& range) {
                        LeafWindow near(surface_.tree(), Coord(1), valid_);
                        for (std::size_t n = range.begin(); n != range.end(); ++n)
                          leaves_[n] = detailsOf(*sources[n], layers, near);
                      });
  }

  DetailLeaf detailsOf(const FloatLeaf& leaf, ZRange layers, LeafWindow& near) const {
    DetailLeaf found{leaf.origin(), {}, {}};
    near.visit(leaf.origin());
    forEachBit(activeBits(leaf, rowWithin(leaf.origin().z(), layers)), [&](unsigned offset) {
      const float* d = at(near, offset);
      const Vec3d normal = unitGradient(d, stridesOf(near), background_, pitch_mm_);
      if (normal.isZero() ||
          std::abs(double{*d}) >= zero_from * halfVoxelDiameter(normal, pitch_mm_))
        return;
      found.details.push_back(detailOf(offset, FloatLeaf::offsetToLocalCoord(offset), *d, normal));
    });
    return found;
  }

  void makeShares(ZRange layers) {
    for (const CoordBBox& box : insideTiles(surface_.tree(), layers))
      shares_.sparseFill(box, 1.0F, false);
    addLeaves(shares_, leavesIn(surface_.tree(), layers), [&] {
      return
          [&, near = LeafWindow(surface_.tree(), Coord(1), valid_)](const FloatLeaf& leaf) mutable {
            near.visit(leaf.origin());
            auto made = std::make_unique<FloatLeaf>(leaf.origin(), 0.0F);
            float* out = made->buffer().data();
            for (unsigned offset = 0; offset < 512; ++offset) {
              const float* d = at(near, offset);
              const Vec3d normal = std::abs(*d) < background_
                                       ? unitGradient(d, stridesOf(near), background_, pitch_mm_)
                                       : Vec3d(0.0);
              out[offset] = static_cast<float>(halfSpaceShare(double{*d}, normal, pitch_mm_));
            }
            return made;
          };
    });
  }

  /// Returns Φ⁻¹ of the blurred shares, in the leaves that the details of `layers` interpolate in.
  FloatTree quantiles(ZRange layers) {
    std::vector<Coord> origins;
    for (const DetailLeaf& leaf : leaves_) {
      CoordBBox taps;
      for (const Detail& detail : leaf.details) {
        if (!isIn(layers, leaf.origin, detail.offset)) continue;
        const Coord cell = Coord::floor(Vec3d(detail.foot));
        taps.expand(cell.offsetBy(-1));
        taps.expand(cell.offsetBy(2));
      }
      if (taps.empty()) continue;
      taps.translate(leaf.origin);
      forEachLeafOrigin(CoordBBox(taps.min() & ~7, taps.max()),
                        [&](const Coord& origin) { origins.push_back(origin); });
    }
    sortOnce(origins);
    std::vector<std::unique_ptr<FloatLeaf>> made(origins.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size(), 4),
                      [&](const auto& range) {
                        LeafWindow window(shares_, spread_.reach(), valid_);
                        std::vector<float> along_x, along_y;
                        for (std::size_t n = range.begin(); n != range.end(); ++n) {
                          made[n] = std::make_unique<FloatLeaf>(origins[n], 0.0F);
                          window.visit(origins[n]);
                          blur(window, made[n]->buffer().data(), along_x, along_y);
                        }
                      });
    FloatTree tree(0.0F);
    for (auto& leaf : made) tree.addLeaf(leaf.release());
    return tree;
  }

  void blur(const LeafWindow& window, float* out, std::vector<float>& along_x,
            std::vector<float>& along_y) const {
    const Coord reach = spread_.reach();
    const auto height = static_cast<std::size_t>(8 + 2 * reach.z());
    const auto rows = static_cast<std::size_t>(8 + 2 * reach.y());
    along_x.assign(8 * rows * height, 0);
    along_y.assign(64 * height, 0);
    const auto add = [height](float* sum, float weight, const float* values) {
      for (std::size_t z = 0; z < height; ++z) sum[z] += weight * values[z];
    };
    for (std::size_t x = 0; x < 8; ++x) {
      for (std::size_t n = 0; n < spread_.weights(0).size(); ++n) {
        for (std::size_t y = 0; y < rows; ++y)
          add(&along_x[(x * rows + y) * height], spread_.weights(0)[n],
              window.at(static_cast<int>(x + n) - reach.x(), static_cast<int>(y) - reach.y(),
                        -reach.z()));
      }
      for (std::size_t y = 0; y < 8; ++y) {
        float* row = &along_y[(8 * x + y) * height];
        for (std::size_t n = 0; n < spread_.weights(1).size(); ++n)
          add(row, spread_.weights(1)[n], &along_x[(x * rows + y + n) * height]);
        std::array<float, 8> sum{};
        for (std::size_t n = 0; n < spread_.weights(2).size(); ++n) {
          for (std::size_t z = 0; z < 8; ++z) sum[z] += spread_.weights(2)[n] * row[n + z];
        }
        for (std::size_t z = 0; z < 8; ++z) out[64 * x + 8 * y + z] = quantile_(sum[z]);
      }
    }
  }

  /// Adds a step to e of the details of `layers`; the first step also sets gain and limits, and
  /// drops what does not change.
  void correct(const FloatTree& quantiles, ZRange layers, bool first) {
    forEachLeaf([&] {
      return [&, taps = LeafWindow(quantiles, Coord(tap_halo), valid_),
              distances = LeafWindow(surface_.tree(), Coord(search_halo), valid_)](
                 DetailLeaf& leaf) mutable {
        if (leaf.details.empty()) return;
        taps.visit(leaf.origin);
        bool has_distances = false;
        for (Detail& detail : leaf.details) {
          if (!isIn(layers, leaf.origin, detail.offset)) continue;
          const double sigma_mm = (Vec3d(detail.normal) * settings_.spread_mm).length();
          const double missed_mm = -sigma_mm * double{interpolated(taps, detail.foot)};
          if (first) {
            detail.gain =
                sigma_mm > 0 ? static_cast<float>(gainOf(std::abs(missed_mm) / sigma_mm)) : 0.0F;
            if (!(detail.gain > 0)) continue;
            if (!has_distances) distances.visit(leaf.origin);
            has_distances = true;
            limit(detail, distances);
          }
          detail.e_mm =
              static_cast<float>(std::clamp(detail.e_mm + detail.gain * missed_mm,
                                            double{detail.least_mm}, double{detail.most_mm}));
        }
        if (first) std::erase_if(leaf.details, [](const Detail& one) { return !(one.gain > 0); });
      };
    });
  }

  static double gainOf(double missed_share) {
    constexpr double quiet = DetailCompensation::quiet_share;
    const double t =
        std::clamp((missed_share - quiet) / (DetailCompensation::loud_share - quiet), 0.0, 1.0);
    return t * t * (3 - 2 * t);
  }

  void limit(Detail& detail, const LeafWindow& distances) const {
    // Just less than a diameter, so that no voxel outside the band changes its side.
    const double diameter_mm = 2 * (1 - 1e-3) * double{detail.half_diameter_mm};
    double rise_mm = 0;
    for (int axis = 0; axis < 3; ++axis)
      rise_mm += std::abs(double{detail.normal[axis]}) * pitch_mm_[axis];
    const auto limitTowards = [&](int side) {
      const double medial_mm = medialAxisMm(detail, distances, side);
      return std::max(0.0, std::min({diameter_mm, medial_mm / 2, medial_mm - rise_mm / 2}));
    };
    detail.most_mm = static_cast<float>(limitTowards(1));
    detail.least_mm = static_cast<float>(-limitTowards(-1));
  }

  /// Returns the distance from the foot to the medial axis on one side, which is infinite if it is
  /// farther than it can limit e. Between parallel faces, (t + d) / 2 at any point beyond the axis.
  [[nodiscard]] double medialAxisMm(const Detail& detail, const LeafWindow& distances,
                                    int side) const {
    const double half = double{detail.half_diameter_mm};
    const Vec3d outward = Vec3d(detail.normal) * side;
    double nearest = std::numeric_limits<double>::infinity();
    for (int step = 1; step <= search_steps; ++step) {
      const Vec3d place = Vec3d(detail.foot) + outward * (step * half) / pitch_mm_;
      const Coord voxel = Coord::floor(place + Vec3d(0.5));
      const double d = side * double{*distances.at(voxel.x(), voxel.y(), voxel.z())};
      if (std::abs(d) >= double{background_}) continue;
      const double away = outward.dot((voxel.asVec3d() - Vec3d(detail.foot)) * pitch_mm_);
      if (away - d > 0.5 * half) nearest = std::min(nearest, std::max(0.0, (away + d) / 2));
    }
    return nearest;
  }

  /// Returns a tree with a value for each detail.
  template <typename ValueOf>
  [[nodiscard]] std::unique_ptr<FloatTree> treeOf(const ValueOf& value_of, float background) const {
    auto tree = std::make_unique<FloatTree>(background);
    for (const DetailLeaf& leaf : leaves_) {
      if (leaf.details.empty()) continue;
      auto made = std::make_unique<FloatLeaf>(leaf.origin, background);
      for (const Detail& detail : leaf.details) made->setValueOn(detail.offset, value_of(detail));
      tree->addLeaf(made.release());
    }
    return tree;
  }

  /// Lets those voxels change their sides that are simple points, one after another, and leaves the
  /// distances of the others as they are. Voxels of equal parities of x, y and z do not touch, so
  /// that all of them can change at once.
  void keepTopology() {
    const auto changes = [](const Detail& one) {
      return (one.d_mm < 0) != (static_cast<float>(one.corrected()) < 0);
    };
    FloatTree sides(background_);
    for (const DetailLeaf& leaf : leaves_) {
      if (std::none_of(leaf.details.begin(), leaf.details.end(), changes)) continue;
      const FloatLeaf* before = surface_.tree().probeConstLeaf(leaf.origin);
      sides.addLeaf(new FloatLeaf(*before));
    }
    for (int turn = 0; turn < 8 * sweeps; ++turn) {
      forEachLeaf([&] {
        return [&, around = Sides(surface_.tree(), sides, valid_)](DetailLeaf& leaf) mutable {
          FloatLeaf* own = sides.probeLeaf(leaf.origin);
          if (!own) return;
          for (const Detail& detail : leaf.details) {
            const Coord ijk = leaf.origin + FloatLeaf::offsetToLocalCoord(detail.offset);
            const int parity = (ijk.x() & 1) * 4 + (ijk.y() & 1) * 2 + (ijk.z() & 1);
            float& side = own->buffer().data()[detail.offset];
            if (parity != turn % 8 || (side < 0) != (detail.d_mm < 0) || !changes(detail)) continue;
            if (isSimplePoint(around.inside(ijk))) side = static_cast<float>(detail.corrected());
          }
        };
      });
    }
    forEachLeaf([&] {
      return [&](DetailLeaf& leaf) {
        const FloatLeaf* own = sides.probeConstLeaf(leaf.origin);
        if (!own) return;
        for (Detail& detail : leaf.details) {
          if (changes(detail) && (own->getValue(detail.offset) < 0) == (detail.d_mm < 0))
            detail.e_mm = 0;
        }
      };
    });
  }

  /// Finds the voxels of unknown distance next to details.
  void findNeighbours() {
    std::vector<Coord> origins;
    for (const DetailLeaf& leaf : leaves_) {
      if (leaf.details.empty()) continue;
      CoordBBox box;
      for (const Detail& detail : leaf.details)
        box.expand(leaf.origin + FloatLeaf::offsetToLocalCoord(detail.offset));
      box.expand(1);
      forEachLeafOrigin(CoordBBox(box.min() & ~7, box.max()),
                        [&](const Coord& origin) { origins.push_back(origin); });
    }
    sortOnce(origins);
    std::vector<DetailLeaf> all(origins.size());
    std::sort(leaves_.begin(), leaves_.end(),
              [](const DetailLeaf& a, const DetailLeaf& b) { return a.origin < b.origin; });
    for (std::size_t n = 0, from = 0; n < origins.size(); ++n) {
      all[n].origin = origins[n];
      while (from < leaves_.size() && leaves_[from].origin < origins[n]) ++from;
      if (from < leaves_.size() && leaves_[from].origin == origins[n])
        all[n].details = std::move(leaves_[from].details);
    }
    leaves_ = std::move(all);
    forEachLeaf([&] {
      return [&, distances = LeafWindow(surface_.tree(), Coord(2), valid_),
              corrections = LeafWindow(*corrections_, Coord(1), valid_)](DetailLeaf& leaf) mutable {
        distances.visit(leaf.origin);
        corrections.visit(leaf.origin);
        for (unsigned offset = 0; offset < 512; ++offset) {
          if (std::abs(*at(distances, offset)) >= background_)
            addNeighbour(leaf, offset, distances, corrections);
        }
      };
    });
  }

  void addNeighbour(DetailLeaf& leaf, unsigned offset, const LeafWindow& distances,
                    const LeafWindow& corrections) const {
    const Coord local = FloatLeaf::offsetToLocalCoord(offset);
    const Coord ijk = leaf.origin + local;
    if (!settings_.lattice.box.isInside(ijk) || !valid_.contains(ijk.z())) return;
    const bool inside = *at(distances, offset) < 0;
    float nearest = background_;
    Coord of;
    for (const Coord& step : CoordBBox(Coord(-1), Coord(1))) {
      const Coord there = local + step;
      if (*corrections.at(there.x(), there.y(), there.z()) == 0) continue;
      const float d = *distances.at(there.x(), there.y(), there.z());
      if (std::abs(d) >= nearest || (d < 0) != inside) continue;
      nearest = std::abs(d);
      of = there;
    }
    if (nearest == background_) return;
    const float* d = distances.at(of.x(), of.y(), of.z());
    const Vec3d normal = unitGradient(d, stridesOf(distances), background_, pitch_mm_);
    if (normal.isZero()) return;
    const double flat_mm = double{*d} + normal.dot((local - of).asVec3d() * pitch_mm_);
    // The band holds a diameter.
    const double depth_mm =
        std::max(inside ? -flat_mm : flat_mm, 2 * halfVoxelDiameter(normal, pitch_mm_));
    if (depth_mm >= double{background_}) return;
    const auto d_mm = static_cast<float>(inside ? -depth_mm : depth_mm);
    leaf.neighbours.push_back({offset, detailOf(offset, local, d_mm, normal), leaf.origin + of});
  }

  void updateNeighbours() {
    forEachLeaf([&] {
      return [corrections = openvdb::tree::ValueAccessor<const FloatTree, false>(*corrections_)](
                 DetailLeaf& leaf) {
        for (Neighbour& one : leaf.neighbours) one.as.e_mm = corrections.getValue(one.of);
      };
    });
  }

  void updateShares() {
    for (const DetailLeaf& leaf : leaves_) {
      if (!leaf.details.empty() || !leaf.neighbours.empty()) shares_.touchLeaf(leaf.origin);
    }
    forEachLeaf([&] {
      return [&](DetailLeaf& leaf) {
        FloatLeaf* shares = shares_.probeLeaf(leaf.origin);
        if (!shares) return;
        const auto set = [&](const Detail& detail) {
          shares->buffer().data()[detail.offset] = static_cast<float>(
              halfSpaceShare(detail.corrected(), Vec3d(detail.normal), pitch_mm_));
        };
        for (const Detail& detail : leaf.details) set(detail);
        for (const Neighbour& one : leaf.neighbours) set(one.as);
      };
    });
  }

  FloatGrid::Ptr result() const {
    std::vector<Coord> origins;
    for (const FloatLeaf* leaf : leavesIn(surface_.tree(), core_))
      origins.push_back(leaf->origin());
    for (const DetailLeaf& leaf : leaves_) {
      if (rowWithin(leaf.origin.z(), core_) != 0 && !leaf.neighbours.empty())
        origins.push_back(leaf.origin);
    }
    sortOnce(origins);
    std::vector<LeafValues> values(origins.size());
    tbb::parallel_for(std::size_t{0}, origins.size(), [&](std::size_t n) {
      const openvdb::tree::ValueAccessor<const FloatTree, false> distances(surface_.tree());
      values[n] = LeafValues::of(distances, origins[n]);
      const auto found = std::lower_bound(
          leaves_.begin(), leaves_.end(), origins[n],
          [](const DetailLeaf& leaf, const Coord& origin) { return leaf.origin < origin; });
      if (found == leaves_.end() || found->origin != origins[n]) return;
      const auto set = [&](const Detail& detail) {
        if (detail.e_mm == 0) return;
        values[n].distance[detail.offset] = static_cast<float>(detail.corrected());
        values[n].active[detail.offset / 64] |= std::uint64_t{1} << (detail.offset % 64);
      };
      for (const Detail& detail : found->details) set(detail);
      for (const Neighbour& one : found->neighbours) set(one.as);
    });
    FloatGrid::Ptr made = surfaceOf(surface_, background_, core_, origins, values,
                                    insideTiles(surface_.tree(), core_));
    if (statesHeldBand(surface_)) {
      setHeldBandMm(*made, heldBandMm(surface_));
    }
    return made;
  }

  const DetailCompensation& settings_;
  Vec3d pitch_mm_;
  const FloatGrid& surface_;
  float background_;
  ZRange core_;
  ZRange valid_;
  GaussianSpread spread_;
  BlurQuantile quantile_;
  FloatTree shares_;
  std::unique_ptr<FloatTree> corrections_;  ///< e of the details
  std::vector<DetailLeaf> leaves_;          ///< by rising origin once the neighbours are found
};

}  // namespace

int DetailCompensation::reachLayers() const {
  return Run(*this, *FloatGrid::create(1.0F), {0, 0}, {0, 0}).reach();
}

FloatGrid::Ptr DetailCompensation::run(const FloatGrid& surface, ZRange core, ZRange valid) const {
  return Run(*this, surface, core, valid)();
}

}  // namespace vdbdither
