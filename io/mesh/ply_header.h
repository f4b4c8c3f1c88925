#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// The type of a number.
enum class PlyScalar {
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat32,
  kFloat64
};
/// How a body holds its numbers.
enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

/// The size of a binary scalar, bytes.
std::size_t sizeOf(PlyScalar type);

/// The bits of a binary scalar of `size` bytes.
std::uint64_t bitsAt(const char* at, std::size_t size, PlyEncoding encoding);

struct PlyProperty {
  std::string name;
  PlyScalar type = PlyScalar::kFloat32;
  std::optional<PlyScalar> count_type;  ///< set for a list
};

struct PlyElement {
  std::string name;
  const char* line = nullptr;  ///< of the header, for messages
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  /// The position of the property with one of these names, or −1.
  [[nodiscard]] int find(std::initializer_list<std::string_view> names) const;
  /// The minimum number of bytes of one of them: a list may have no items, and a number of a text
  /// takes a digit and a blank.
  [[nodiscard]] std::uint64_t leastBytes(PlyEncoding encoding) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> texture_files{};  ///< "comment TextureFile", by number
  std::size_t body = 0;                      ///< where it begins in the file
};

/// Parses the header of a PLY file. Refuses what is wrong with it, and counts that are more than
/// the file holds before it is read.
PlyHeader parsePlyHeader(const MeshFile& file);

}  // namespace vdbdither
