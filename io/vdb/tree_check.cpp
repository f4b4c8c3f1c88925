#include "io/vdb/tree_check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <istream>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include <openvdb/io/Compression.h>

#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

using openvdb::Coord;

namespace {

/// What a map of OpenVDB takes for an entry: its node, key and value.
constexpr std::uint64_t root_entry_memory = 96;

/// One bit for each place in a node with 2^log2_dim places along each axis.
template <int log2_dim>
class Mask {
 public:
  static constexpr std::size_t bytes = (std::size_t{1} << (3 * log2_dim)) / 8;

  void load(ByteCursor& cursor) { std::memcpy(words_.data(), cursor.take(bytes), bytes); }

  [[nodiscard]] std::uint32_t countOn() const {
    int count = 0;
    for (const std::uint64_t word : words_) count += std::popcount(word);
    return static_cast<std::uint32_t>(count);
  }

  [[nodiscard]] bool meets(const Mask& other) const {
    for (std::size_t i = 0; i < words_.size(); ++i) {
      if ((words_[i] & other.words_[i]) != 0) return true;
    }
    return false;
  }

  template <typename Function>
  void forEachOn(const Function& function) const {
    for (std::size_t i = 0; i < words_.size(); ++i) {
      for (std::uint64_t word = words_[i]; word != 0; word &= word - 1)
        function(static_cast<int>(64 * i) + std::countr_zero(word));
    }
  }

 private:
  std::array<std::uint64_t, bytes / sizeof(std::uint64_t)> words_{};
};

class TreePass {
 public:
  TreePass(ByteCursor& cursor, std::istream& stream, const TreeLayout& layout, TreePacking packing)
      : cursor_(cursor), stream_(stream), layout_(layout), packing_(packing) {
    if (layout.half_bytes == 0) packing_.as_half = false;
  }

  std::uint64_t pass() {
    cursor_.skip(sizeof(std::int32_t));  // the number of buffers, which is not used any more
    passRoot();
    passLeaves();
    return memory_;
  }

 private:
  static constexpr int leaf_log2 = 3;
  static constexpr int lower_log2 = 4;
  static constexpr int upper_log2 = 5;
  static constexpr int lower_total = leaf_log2 + lower_log2;
  static constexpr int upper_total = lower_total + upper_log2;

  /// A child of the root. Its leaves are numbered in the order of their topology.
  struct Branch {
    Coord origin;
    std::size_t first_leaf;
    std::size_t leaves;
  };

  void passRoot() {
    passValue();
    const auto tiles = cursor_.take<std::uint32_t>();
    const auto children = cursor_.take<std::uint32_t>();
    for (std::uint32_t i = 0; i < tiles; ++i) {
      passOrigin();
      passValue();
      requireFlags(cursor_.take(1), 1);
    }
    for (std::uint32_t i = 0; i < children; ++i) {
      const Coord origin = passOrigin();
      const std::size_t first_leaf = leaves_;
      passUpper(origin);
      branches_.push_back({origin, first_leaf, leaves_ - first_leaf});
    }
  }

  Coord takeCoord() {
    std::array<std::int32_t, 3> place{};
    std::memcpy(place.data(), cursor_.take(sizeof place), sizeof place);
    return Coord(place.data());
  }

  Coord passOrigin() {
    const Coord origin = takeCoord();
    if (origin != (origin & ~((1 << upper_total) - 1)))
      throw DamagedBytes{"a node lies where none can lie"};
    if (!origins_.insert(origin).second) throw DamagedBytes{"two nodes lie at one place"};
    memory_ += root_entry_memory;
    return origin;
  }

  void passUpper(const Coord& origin) {
    memory_ += layout_.upper_memory;
    passInner<upper_log2, lower_total>(origin, [&](const Coord& place) {
      memory_ += layout_.lower_memory;
      passInner<lower_log2, leaf_log2>(place, [&](const Coord& leaf) { passLeafMask(leaf); });
    });
  }

  /// Passes over an inner node, and calls `pass_child` with the place of each child.
  template <int log2_dim, int child_total, typename Function>
  void passInner(const Coord& origin, const Function& pass_child) {
    Mask<log2_dim> children;
    Mask<log2_dim> active;
    children.load(cursor_);
    active.load(cursor_);
    if (children.meets(active)) throw DamagedBytes{"a node is a child and a tile"};
    passValues<log2_dim>(active);
    children.forEachOn([&](int n) {
      constexpr int dim = 1 << log2_dim;
      const Coord offset(n / dim / dim, n / dim % dim, n % dim);
      pass_child(origin + (offset << child_total));
    });
  }

  void passLeafMask(const Coord& origin) {
    memory_ += layout_.leaf_memory;
    ++leaves_;
    if (layout_.leaf != TreeLayout::Leaf::values) leaf_origins_.push_back(origin);
    cursor_.skip(Mask<leaf_log2>::bytes);
  }

  /// The second part of a tree, in the order in which OpenVDB keeps the children of the root.
  void passLeaves() {
    std::sort(branches_.begin(), branches_.end(),
              [](const Branch& a, const Branch& b) { return a.origin < b.origin; });
    for (const Branch& branch : branches_) {
      for (std::size_t n = branch.first_leaf; n < branch.first_leaf + branch.leaves; ++n)
        passLeaf(n);
    }
  }

  void passLeaf(std::size_t n) {
    Mask<leaf_log2> active;
    active.load(cursor_);
    if (layout_.leaf == TreeLayout::Leaf::values) return passValues<leaf_log2>(active);
    if (takeCoord() != leaf_origins_[n]) throw DamagedBytes{"a leaf lies elsewhere than its node"};
    if (layout_.leaf == TreeLayout::Leaf::flags) cursor_.skip(Mask<leaf_log2>::bytes);
  }

  /// How many values of inactive voxels stand before those of a node that is packed so.
  static int inactiveValues(int kind) {
    switch (kind) {
      case openvdb::io::NO_MASK_OR_INACTIVE_VALS:
      case openvdb::io::NO_MASK_AND_MINUS_BG:
      case openvdb::io::NO_MASK_AND_ALL_VALS:
      case openvdb::io::MASK_AND_NO_INACTIVE_VALS:
        return 0;
      case openvdb::io::NO_MASK_AND_ONE_INACTIVE_VAL:
      case openvdb::io::MASK_AND_ONE_INACTIVE_VAL:
        return 1;
      case openvdb::io::MASK_AND_TWO_INACTIVE_VALS:
        return 2;
      default:
        throw DamagedBytes{"its values are packed in an unknown way"};
    }
  }

  /// The values of a node, as openvdb::io::readCompressedValues takes them.
  template <int log2_dim>
  void passValues(const Mask<log2_dim>& active) {
    const auto kind = cursor_.take<std::int8_t>();
    for (int values = inactiveValues(kind); values > 0; --values) passValue();
    const bool has_selection = kind == openvdb::io::MASK_AND_NO_INACTIVE_VALS ||
                               kind == openvdb::io::MASK_AND_ONE_INACTIVE_VAL ||
                               kind == openvdb::io::MASK_AND_TWO_INACTIVE_VALS;
    if (has_selection) cursor_.skip(Mask<log2_dim>::bytes);
    const bool only_active = (packing_.compression & openvdb::io::COMPRESS_ACTIVE_MASK) != 0 &&
                             kind != openvdb::io::NO_MASK_AND_ALL_VALS;
    passPacked(only_active ? active.countOn() : std::uint32_t{1} << (3 * log2_dim));
  }

  void passPacked(std::uint32_t count) {
    if (packing_.as_half && count == 0) return;
    const std::uint64_t begin = cursor_.position();
    const std::uint64_t bytes =
        std::uint64_t{count} * (packing_.as_half ? layout_.half_bytes : layout_.value_bytes);
    if ((packing_.compression & openvdb::io::COMPRESS_BLOSC) != 0) {
      passChunk(bytes, [this](std::uint64_t packed, std::uint64_t unpacked) {
        requireBlosc(packed, unpacked);
      });
    } else if ((packing_.compression & openvdb::io::COMPRESS_ZIP) != 0) {
      passChunk(bytes, [](std::uint64_t, std::uint64_t) {});
    } else {
      cursor_.skip(bytes);
    }
    if (isOfFlags()) requireFlagsAt(begin, count);
  }

  /// Passes over `bytes` that may be packed. Their size stands before them, negative if they are
  /// not.
  template <typename Function>
  void passChunk(std::uint64_t bytes, const Function& require_packed) {
    const auto stated = cursor_.take<std::int64_t>();
    if (stated > 0) {
      cursor_.require(static_cast<std::uint64_t>(stated));
      require_packed(static_cast<std::uint64_t>(stated), bytes);
      cursor_.skip(static_cast<std::uint64_t>(stated));
    } else {
      if (std::uint64_t{0} - static_cast<std::uint64_t>(stated) != bytes)
        throw DamagedBytes{"packed values have another size than they state"};
      cursor_.skip(bytes);
    }
  }

  /// Blosc reads and writes as many bytes as its header states.
  void requireBlosc(std::uint64_t packed, std::uint64_t unpacked) {
    constexpr std::size_t header_bytes = 16;
    constexpr std::size_t unpacked_at = 4;
    constexpr std::size_t packed_at = 12;
    const auto stated = [&](std::size_t at) {
      std::uint32_t size = 0;
      std::memcpy(&size, cursor_.view(header_bytes) + at, sizeof size);
      return size;
    };
    if (packed < header_bytes || stated(packed_at) != packed || stated(unpacked_at) != unpacked)
      throw DamagedBytes{"packed values have another size than they state"};
  }

  [[nodiscard]] bool isOfFlags() const { return layout_.leaf != TreeLayout::Leaf::values; }

  void passValue() {
    const char* bytes = cursor_.take(layout_.value_bytes);
    if (isOfFlags()) requireFlags(bytes, layout_.value_bytes);
  }

  /// A bool that is neither true nor false has no meaning.
  static void requireFlags(const char* bytes, std::size_t count) {
    const bool sound =
        std::all_of(bytes, bytes + count, [](char byte) { return byte == 0 || byte == 1; });
    if (!sound) throw DamagedBytes{"it holds a value that is neither true nor false"};
  }

  /// The same of values that may be packed, and whose sizes are sound.
  void requireFlagsAt(std::uint64_t begin, std::uint32_t count) {
    if (count == 0) return;
    std::vector<char> flags(count);
    stream_.seekg(static_cast<std::streamoff>(begin));
    openvdb::io::readData(stream_, flags.data(), count, packing_.compression);
    requireFlags(flags.data(), flags.size());
  }

  ByteCursor& cursor_;
  std::istream& stream_;
  TreeLayout layout_;
  TreePacking packing_;
  std::uint64_t memory_ = 0;
  std::set<Coord> origins_;
  std::vector<Branch> branches_;
  std::size_t leaves_ = 0;
  std::vector<Coord> leaf_origins_;  ///< of leaves whose place is stated a second time
};

template <typename GridT>
TreeLayout layoutOf() {
  using Upper = typename GridT::TreeType::RootNodeType::ChildNodeType;
  using Lower = typename Upper::ChildNodeType;
  using Leaf = typename Lower::ChildNodeType;
  using Value = typename Leaf::ValueType;
  using Half = openvdb::io::RealToHalf<Value>;
  static_assert(Upper::LOG2DIM == 5 && Lower::LOG2DIM == 4 && Leaf::LOG2DIM == 3);
  TreeLayout layout;
  layout.value_bytes = sizeof(Value);
  if constexpr (Half::isReal) layout.half_bytes = sizeof(typename Half::HalfT);
  layout.upper_memory = sizeof(Upper);
  layout.lower_memory = sizeof(Lower);
  layout.leaf_memory = sizeof(Leaf);
  if constexpr (std::is_same_v<typename Leaf::BuildType, openvdb::ValueMask>) {
    layout.leaf = TreeLayout::Leaf::mask;
  } else if constexpr (std::is_same_v<Value, bool>) {
    layout.leaf = TreeLayout::Leaf::flags;
  } else {
    layout.leaf_memory += Leaf::SIZE * sizeof(Value);
  }
  return layout;
}

template <typename... Grids>
std::optional<TreeLayout> layoutAmong(const std::string& type, openvdb::TypeList<Grids...>) {
  std::optional<TreeLayout> layout;
  const auto take = [&]<typename GridT>(const GridT*) {
    if (type == GridT::gridType()) layout = layoutOf<GridT>();
  };
  (take(static_cast<const Grids*>(nullptr)), ...);
  return layout;
}

}  // namespace

std::optional<TreeLayout> treeLayoutOf(const std::string& type) {
  return layoutAmong(type, CarriedGrids());
}

std::uint64_t passTree(ByteCursor& cursor, std::istream& stream, const TreeLayout& layout,
                       TreePacking packing) {
  return TreePass(cursor, stream, layout, packing).pass();
}

}  // namespace vdbdither
