#include "ops/kernels/colour/seen_colours.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include <tbb/parallel_for.h>

#include "ops/kernels/colour/ink_mixture.h"
#include "ops/kernels/leaf/leaf_origins.h"
#include "ops/kernels/leaf/node_writer.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Int32Tree;
using openvdb::Vec3STree;

namespace {

/// Least weight of the printed voxels around a voxel that has a colour.
constexpr float least_weight = 1e-3F;

/// Sums of roots of colours, and of weights.
using Sum = std::array<float, 4>;

/// Returns x to the power n for 0 ≤ x ≤ 1 and n ≥ 1, by whole powers and roots.
double powerOf(double x, double n) {
  const int whole = static_cast<int>(n);
  double power = 1;
  for (int factor = 0; factor < whole; ++factor) power *= x;
  return n > whole ? power * rootOf(x, n - whole) : power;
}

}  // namespace

SeenColours::SeenColours(std::array<std::vector<float>, 3> weights,
                         std::vector<openvdb::Vec3d> linear_rgb, std::vector<bool> is_seen,
                         const openvdb::Vec3d& yule_nielsen)
    : weights_(std::move(weights)),
      roots_{openvdb::Vec3f(0.0F)},
      is_seen_(std::move(is_seen)),
      yule_nielsen_(yule_nielsen) {
  const InkMixture mixture(std::move(linear_rgb), yule_nielsen);
  for (const openvdb::Vec3d& root : mixture.roots()) roots_.emplace_back(root);
  is_seen_.insert(is_seen_.begin(), false);
}

double SeenColours::memoryBytes() const {
  double voxels = 1;
  for (const std::vector<float>& along : weights_)
    voxels *= leaf_layers + static_cast<double>(along.size());
  return 2 * voxels * sizeof(Sum);
}

/// Makes leaves, one after another. For one thread.
class SeenColours::Painter {
 public:
  Painter(const SeenColours& seen, const Int32Tree& material, ZRange valid)
      : seen_(seen), material_(material), valid_(valid) {
    for (int axis = 0; axis < 3; ++axis) {
      reach_[axis] = static_cast<int>(seen.weights_[static_cast<std::size_t>(axis)].size() / 2);
      size_[axis] = leaf_layers + 2 * reach_[axis];
    }
  }

  std::unique_ptr<Vec3STree::LeafNodeType> paint(const Coord& origin, std::uint8_t within) {
    gather(origin);
    // x, y, z: the sums of each pass are those of fewer voxels along its axis.
    blur(0, size_);
    blur(1, Coord(leaf_layers, size_.y(), size_.z()));
    blur(2, Coord(leaf_layers, leaf_layers, size_.z()));
    std::unique_ptr<Vec3STree::LeafNodeType> leaf(newLeaf<Vec3STree>(origin));
    std::fill_n(leaf->buffer().data(), Vec3STree::LeafNodeType::SIZE, openvdb::Vec3s(0.0F));
    for (unsigned offset = 0; offset < Vec3STree::LeafNodeType::SIZE; ++offset) {
      const Sum& sum = sums_[offset];
      if ((within >> offset % leaf_layers & 1U) == 0 || sum[3] < least_weight) continue;
      openvdb::Vec3s colour;
      for (int channel = 0; channel < 3; ++channel) {
        const double root = double{sum[static_cast<std::size_t>(channel)]} / double{sum[3]};
        colour[channel] =
            static_cast<float>(powerOf(std::min(root, 1.0), seen_.yule_nielsen_[channel]));
      }
      leaf->setValueOn(offset, colour);
    }
    return leaf;
  }

 private:
  /// Takes the materials around a leaf, z fastest.
  void gather(const Coord& origin) {
    sums_.assign(static_cast<std::size_t>(size_.x()) * static_cast<std::size_t>(size_.y()) *
                     static_cast<std::size_t>(size_.z()),
                 Sum{});
    std::size_t place = 0;
    const Coord low = origin - reach_;
    for (int x = low.x(); x < low.x() + size_.x(); ++x) {
      for (int y = low.y(); y < low.y() + size_.y(); ++y) {
        for (int z = low.z(); z < low.z() + size_.z(); ++z, ++place) {
          if (!valid_.contains(z)) continue;
          const std::int32_t number = material_.getValue(Coord(x, y, z));
          if (number < 1 || static_cast<std::size_t>(number) >= seen_.roots_.size() ||
              !seen_.is_seen_[static_cast<std::size_t>(number)])
            continue;
          const openvdb::Vec3f& root = seen_.roots_[static_cast<std::size_t>(number)];
          sums_[place] = {root[0], root[1], root[2], 1};
        }
      }
    }
  }

  /// Replaces sums of `size` voxels by weighted sums along `axis`, of a leaf's edge there.
  void blur(int axis, const Coord& size) {
    const std::vector<float>& weights = seen_.weights_[static_cast<std::size_t>(axis)];
    Coord to = size;
    to[axis] = leaf_layers;
    blurred_.assign(static_cast<std::size_t>(to.x()) * static_cast<std::size_t>(to.y()) *
                        static_cast<std::size_t>(to.z()),
                    Sum{});
    const std::array<std::size_t, 3> steps{
        static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(size.z()),
        static_cast<std::size_t>(size.z()), 1};
    const std::size_t step = steps[static_cast<std::size_t>(axis)];
    std::size_t place = 0;
    for (int x = 0; x < to.x(); ++x) {
      for (int y = 0; y < to.y(); ++y) {
        for (int z = 0; z < to.z(); ++z, ++place) {
          const Sum* from =
              &sums_[static_cast<std::size_t>(x) * steps[0] +
                     static_cast<std::size_t>(y) * steps[1] + static_cast<std::size_t>(z)];
          Sum& sum = blurred_[place];
          for (const float weight : weights) {
            for (std::size_t n = 0; n < sum.size(); ++n) sum[n] += weight * (*from)[n];
            from += step;
          }
        }
      }
    }
    sums_.swap(blurred_);
  }

  const SeenColours& seen_;
  openvdb::tree::ValueAccessor<const Int32Tree, false> material_;
  ZRange valid_;
  Coord reach_;
  Coord size_;
  std::vector<Sum> sums_;
  std::vector<Sum> blurred_;
};

openvdb::Vec3SGrid::Ptr SeenColours::run(const openvdb::Int32Grid& material,
                                         const openvdb::FloatGrid& where, ZRange core,
                                         ZRange valid) const {
  std::vector<Coord> origins;
  appendLeafOrigins(where.tree(), core, origins);
  std::vector<std::unique_ptr<Vec3STree::LeafNodeType>> made(origins.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, origins.size()), [&](const auto& range) {
    Painter painter(*this, material.tree(), valid);
    for (std::size_t n = range.begin(); n != range.end(); ++n)
      made[n] = painter.paint(origins[n], rowWithin(origins[n].z(), core));
  });
  auto grid = openvdb::Vec3SGrid::create(openvdb::Vec3s(0.0F));
  grid->setTransform(material.transform().copy());
  grid->setVectorType(openvdb::VEC_INVARIANT);
  for (auto& leaf : made)
    if (!leaf->isEmpty()) grid->tree().addLeaf(leaf.release());
  return grid;
}

}  // namespace vdbdither
