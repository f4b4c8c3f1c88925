#include "ops/kernels/measure/grid_difference.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>
#include <type_traits>

#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

using openvdb::Coord;
using openvdb::Index;

namespace {

/// The order of a stack of slices: z first.
auto order(const Coord& at) { return std::tuple(at.z(), at.y(), at.x()); }

template <typename T>
double distance(const T& a, const T& b) {
  if constexpr (openvdb::VecTraits<T>::IsVec) {
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const double between = distance(a[axis], b[axis]);
      if (!(between <= largest)) largest = between;
    }
    return largest;
  } else if constexpr (std::is_floating_point_v<T>) {
    if (a == b || (std::isnan(a) && std::isnan(b))) return 0;
    return std::abs(static_cast<double>(a) - static_cast<double>(b));
  } else {
    return std::abs(static_cast<double>(a) - static_cast<double>(b));
  }
}

/// Walks two trees together, from their roots down to where both are tiles or leaves.
template <typename TreeT>
class Walk {
 public:
  using Value = typename TreeT::ValueType;
  using Leaf = typename TreeT::LeafNodeType;

  explicit Walk(double tolerance) : tolerance_(tolerance) {}

  GridDifference run(const TreeT& a, const TreeT& b) {
    std::set<Coord> origins;
    for (const TreeT* tree : {&a, &b}) {
      for (auto entry = tree->root().cbeginChildAll(); entry; ++entry)
        origins.insert(entry.getCoord());
    }
    for (const Coord& origin : origins) node(branch(a, origin), branch(b, origin), origin);
    return found_;
  }

 private:
  using Top = typename TreeT::RootNodeType::ChildNodeType;

  /// A node of a tree, or the tile in its place.
  template <typename Node>
  struct Place {
    const Node* node = nullptr;
    Value value{};
    bool active = false;
  };

  static Place<Top> branch(const TreeT& tree, const Coord& origin) {
    Place<Top> place;
    place.node = tree.template probeConstNode<Top>(origin);
    if (!place.node) place.active = tree.probeValue(origin, place.value);
    return place;
  }

  template <typename Node>
  static auto child(const Place<Node>& place, Index n) {
    Place<typename Node::ChildNodeType> below;
    if (!place.node) {
      below.value = place.value;
      below.active = place.active;
    } else if (place.node->getChildMask().isOn(n)) {
      below.node = place.node->getTable()[n].getChild();
    } else {
      below.value = place.node->getTable()[n].getValue();
      below.active = place.node->getValueMask().isOn(n);
    }
    return below;
  }

  template <typename Node>
  void node(const Place<Node>& a, const Place<Node>& b, const Coord& origin) {
    if (!a.node && !b.node) {
      hold(a.value, a.active, b.value, b.active, origin, Node::NUM_VOXELS);
    } else if constexpr (Node::LEVEL == 0) {
      leaf(a, b, origin);
    } else {
      const Node& any = a.node ? *a.node : *b.node;
      for (Index n = 0; n < Node::NUM_VALUES; ++n)
        node(child(a, n), child(b, n), any.offsetToGlobalCoord(n));
    }
  }

  void leaf(const Place<Leaf>& a, const Place<Leaf>& b, const Coord& origin) {
    for (Index n = 0; n < Leaf::SIZE; ++n) {
      hold(a.node ? a.node->getValue(n) : a.value, a.node ? a.node->isValueOn(n) : a.active,
           b.node ? b.node->getValue(n) : b.value, b.node ? b.node->isValueOn(n) : b.active,
           origin + Leaf::offsetToLocalCoord(n), 1);
    }
  }

  void hold(const Value& a, bool a_active, const Value& b, bool b_active, const Coord& at,
            std::uint64_t voxels) {
    const double apart = distance(a, b);
    if (a_active == b_active && apart <= tolerance_) return;
    // The difference from nan is infinite.
    found_.add({voxels, at, std::isnan(apart) ? std::numeric_limits<double>::infinity() : apart});
  }

  double tolerance_;
  GridDifference found_;
};

}  // namespace

void GridDifference::add(const GridDifference& other) {
  if (other.voxels == 0) return;
  if (voxels == 0 || order(other.first) < order(first)) first = other.first;
  voxels += other.voxels;
  largest = std::max(largest, other.largest);
}

GridDifference gridDifference(const openvdb::GridBase& a, const openvdb::GridBase& b,
                              double tolerance) {
  GridDifference found;
  visitGrid(a, [&](const auto& typed) {
    using GridT = std::decay_t<decltype(typed)>;
    found = Walk<typename GridT::TreeType>(tolerance).run(typed.tree(),
                                                          static_cast<const GridT&>(b).tree());
  });
  return found;
}

}  // namespace vdbdither
