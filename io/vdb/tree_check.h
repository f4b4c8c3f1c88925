#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "io/vdb/byte_cursor.h"

namespace vdbdither {

/// Thrown where bytes cannot be what they stand for. `what` continues "the grid is damaged: ".
struct DamagedBytes {
  std::string what;
};

/// How the trees of a type of grid lie in an archive, and what they take in memory.
struct TreeLayout {
  enum class Leaf { values, flags, mask };
  Leaf leaf = Leaf::values;
  std::uint32_t value_bytes = 0;
  std::uint32_t half_bytes = 0;  ///< of a value that is saved as half floats; 0 if none is
  std::uint64_t upper_memory = 0;
  std::uint64_t lower_memory = 0;
  std::uint64_t leaf_memory = 0;
};

/// Returns the layout of a type of grid that slabs can carry, and nothing of any other.
std::optional<TreeLayout> treeLayoutOf(const std::string& type);

/// How the values of one grid are packed.
struct TreePacking {
  std::uint32_t compression = 0;  ///< flags of openvdb::io
  bool as_half = false;
};

/// Passes over a tree, the way OpenVDB reads it, without reading its values, and returns the bytes
/// of memory that it will take. OpenVDB trusts what is checked here: places of nodes, sizes of
/// packed values, and values of bool.
///
/// \param stream  the stream of `cursor`
/// Throws DamagedBytes, and std::ios::failure where the bytes end too early.
std::uint64_t passTree(ByteCursor& cursor, std::istream& stream, const TreeLayout& layout,
                       TreePacking packing);

}  // namespace vdbdither
