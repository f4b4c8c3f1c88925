// Direct binary search: Analoui, Allebach: Model-based halftoning using direct binary search, SPIE
// 1666, 1992. Here the pixels are the voxels of a surface, and the eye is the printing process.

#include "ops/kernels/dither/refinement.h"

#include <algorithm>
#include <array>

#include "ops/kernels/dither/open_surroundings.h"
#include "ops/kernels/leaf/solid.h"
#include "ops/kernels/leaf/true_bits.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Vec3d;

namespace {

/// The share that the blur of 2σ has in the objective. The hills of 2σ are wide: more of them would
/// leave more error after the blur of σ than they take away after the other.
constexpr double wide_share = 0.1;

/// The maximum distance of two voxels that count for each other, in σ.
constexpr double reach_in_spreads = 6;

/// The voxels of a block while they are changed.
class RefinedBlock {
 public:
  RefinedBlock(const OpenLeaves::Settings& settings, const HeightKernel& kernel,
               const BlockOrder& order)
      : kernel_(kernel),
        order_(order),
        step_(settings.pitch_mm / settings.spread_mm),
        edges_(order.edges()),
        numbers_(static_cast<std::size_t>(edges_.x() * edges_.y() * edges_.z())),
        around_(kernel, order) {
    for (const HeightKernel::Hill& hill : kernel.hills()) own_weight_ += hill.factor;
  }

  void refine(OpenLeaves::Block leaves, OpenLeaves::Finder& find) {
    gather(leaves, find);
    for (std::size_t n = 0; n < voxels_.size(); ++n) improve(n);
    writeBack(leaves);
  }

 private:
  struct Voxel {
    Coord at;  ///< within the block
    bool free;
    bool printed;
    float error;
  };

  /// What `apply` reads and changes of each voxel, in arrays of their own.
  struct Places {
    std::vector<float> x, y, z, depth, sum;
    void clear() {
      for (auto* values : {&x, &y, &z, &depth, &sum}) values->clear();
    }
    void pad() {
      for (auto* values : {&x, &y, &z, &depth, &sum}) values->resize((values->size() + 3) / 4 * 4);
    }
  };

  void gather(OpenLeaves::Block leaves, OpenLeaves::Finder& find) {
    voxels_.clear();
    places_.clear();
    std::fill(numbers_.begin(), numbers_.end(), none);
    around_.visit(leaves, find);
    const Coord corner = order_.cornerOf(leaves.front()->origin);
    for (OpenLeaf* leaf : leaves) {
      leaf->forEachOpen([&](unsigned offset, const OpenVoxel& open) {
        const Coord ijk = leaf->origin + FloatLeaf::offsetToLocalCoord(offset);
        const Coord at = ijk - corner;
        numbers_[indexOf(at)] = static_cast<std::int16_t>(voxels_.size());
        voxels_.push_back(
            {at, bitAt(leaf->free, offset), bitAt(leaf->printed, offset), open.error});
        places_.x.push_back(static_cast<float>(at.x()) * step_.x());
        places_.y.push_back(static_cast<float>(at.y()) * step_.y());
        places_.z.push_back(static_cast<float>(at.z()) * step_.z());
        places_.depth.push_back(open.depth);
        places_.sum.push_back(around_.sum(ijk, open.depth));
      });
    }
    places_.pad();
  }

  /// Makes the best change of a voxel, if one reduces the error.
  void improve(std::size_t n) {
    const Voxel& voxel = voxels_[n];
    if (!voxel.free) return;
    const float change = voxel.printed ? -1.0F : 1.0F;
    float best = own_weight_ + 2 * change * places_.sum[n];
    std::size_t partner = n;
    const Coord low = Coord::maxComponent(voxel.at.offsetBy(-1), Coord(0));
    const Coord high = Coord::minComponent(voxel.at.offsetBy(1), edges_.offsetBy(-1));
    for (int x = low.x(); x <= high.x(); ++x) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int z = low.z(); z <= high.z(); ++z) {
          const std::int16_t number = numbers_[indexOf({x, y, z})];
          if (number == none) continue;
          const auto m = static_cast<std::size_t>(number);
          const Voxel& other = voxels_[m];
          if (!other.free || other.printed == voxel.printed) continue;
          const float both =
              2 * own_weight_ + 2 * change * (places_.sum[n] - places_.sum[m]) - 2 * weight(n, m);
          if (both < best) {
            best = both;
            partner = m;
          }
        }
      }
    }
    if (best >= -least_gain * own_weight_) return;
    apply(n, change);
    if (partner != n) apply(partner, -change);
  }

  void apply(std::size_t n, float change) {
    Voxel& voxel = voxels_[n];
    voxel.printed = change > 0;
    voxel.error += change;
    for (std::size_t m = 0; m < places_.sum.size(); m += 4)
      storeFloats(&places_.sum[m], loadFloats(&places_.sum[m]) + change * weights(n, m));
  }

  [[nodiscard]] float weight(std::size_t n, std::size_t m) const {
    return weights(n, m & ~std::size_t{3})[m % 4];
  }

  /// Of the voxel n with the four from m on.
  [[nodiscard]] Floats weights(std::size_t n, std::size_t m) const {
    const Floats x = places_.x[n] - loadFloats(&places_.x[m]);
    const Floats y = places_.y[n] - loadFloats(&places_.y[m]);
    const Floats z = places_.z[n] - loadFloats(&places_.z[m]);
    const Floats deeper = places_.depth[n] - loadFloats(&places_.depth[m]);
    const Floats lateral2 = x * x + y * y + z * z - deeper * deeper;
    Floats sum{};
    for (const HeightKernel::Hill& hill : kernel_.hills()) {
      Floats w;
      hill.weigh(lateral2, w);
      sum += w;
    }
    return sum;
  }

  void writeBack(OpenLeaves::Block leaves) {
    const Voxel* voxel = voxels_.data();
    for (OpenLeaf* leaf : leaves) {
      leaf->forEachOpen([&](unsigned offset, OpenVoxel& open) {
        setBit(leaf->printed, offset, voxel->printed);
        open.error = voxel->error;
        ++voxel;
      });
    }
  }

  [[nodiscard]] std::size_t indexOf(const Coord& at) const {
    return static_cast<std::size_t>((at.x() * edges_.y() + at.y()) * edges_.z() + at.z());
  }

  static constexpr std::int16_t none = -1;
  /// Changes that gain less are left, so that rounding decides nothing.
  static constexpr float least_gain = 1e-3F;

  const HeightKernel& kernel_;
  const BlockOrder& order_;
  openvdb::Vec3f step_;  ///< the pitch in σ
  Coord edges_;
  float own_weight_ = 0;
  std::vector<std::int16_t> numbers_;  ///< of the voxels by their places in the block
  std::vector<Voxel> voxels_;
  Places places_;
  OpenSurroundings around_;
};

/// Takes over which voxels of `solid` are printed.
void begin(OpenLeaf& leaf,
           const openvdb::tree::ValueAccessor<const openvdb::BoolTree, false>& solid) {
  leaf.printed = trueBits(solid, leaf.origin);
  leaf.forEachOpen([&](unsigned offset, OpenVoxel& open) {
    open.setPrinted(bitAt(leaf.printed, offset), bitAt(leaf.free, offset));
  });
  leaf.decided = true;
}

}  // namespace

Refinement::Refinement(const Vec3d& pitch_mm, const Vec3d& spread_mm, bool guarded, int sweeps)
    : settings_{pitch_mm, spread_mm, guarded},
      sweeps_(sweeps),
      kernel_(pitch_mm, spread_mm, {{1, 1}, {2, wide_share}}, reach_in_spreads),
      order_(kernel_.reach()) {}

int Refinement::reachLayers() const {
  return order_.reachLayers(sweeps_) + order_.edges().z() +
         OpenLeaves::reachLayers(settings_.guarded);
}

openvdb::BoolGrid::Ptr Refinement::run(const openvdb::FloatGrid& surface,
                                       const openvdb::Vec3SGrid* normals,
                                       const openvdb::BoolGrid& solid, ZRange core,
                                       ZRange valid) const {
  // The first sweep also reads, but does not change, the layers of blocks beside the outermost.
  const ZRange held = grownWithin(order_.needed(core, sweeps_), order_.edges().z(), valid);
  OpenLeaves leaves(surface, normals, settings_, order_, held, valid);
  leaves.visitAtOnce([&](OpenLeaf& leaf) {
    openvdb::tree::ValueAccessor<const openvdb::BoolTree, false> printed(solid.tree());
    begin(leaf, printed);
  });
  for (int sweep = 0; sweep < sweeps_; ++sweep) {
    leaves.visitInOrder(order_.needed(core, sweeps_ - sweep), [&] {
      return [find = OpenLeaves::Finder(leaves),
              refined = RefinedBlock(settings_, kernel_, order_)](OpenLeaves::Block block) mutable {
        refined.refine(block, find);
      };
    });
  }
  return makeSolidGrid(surface.transform(), leaves.printed(core),
                       insideTiles(surface.tree(), core));
}

}  // namespace vdbdither
