#include "io/stack/stack_piece.h"

#include <algorithm>
#include <string_view>

#include "io/file/little_endian.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::string_view magic = "vdbdither stack piece 1\n";
constexpr int number_bytes = 8;

}  // namespace

std::vector<std::uint8_t> bytesOf(const StackPiece& piece) {
  std::vector<std::uint8_t> bytes(magic.begin(), magic.end());
  putLittleEndian(bytes, static_cast<std::uint64_t>(piece.layers.begin), number_bytes);
  putLittleEndian(bytes, static_cast<std::uint64_t>(piece.layers.size()), number_bytes);
  putLittleEndian(bytes, piece.materials, number_bytes);
  for (const std::uint64_t count : piece.voxels) putLittleEndian(bytes, count, number_bytes);
  bytes.insert(bytes.end(), piece.preview.begin(), piece.preview.end());
  return bytes;
}

StackPiece stackPieceOf(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < magic.size() || !std::equal(magic.begin(), magic.end(), bytes.begin()))
    throw DataError("is not of a piece of a stack");
  LittleEndianReader reader(bytes.subspan(magic.size()));
  const auto number = [&] { return reader.take(number_bytes); };
  StackPiece piece;
  constexpr std::int64_t farthest = 1 << 29;
  constexpr std::uint64_t most_layers = 1 << 30;
  const auto begin = static_cast<std::int64_t>(number());
  if (begin < -farthest || begin > farthest) throw DataError("begins at a layer that none can be");
  piece.layers.begin = static_cast<int>(begin);
  const std::uint64_t layers = number();
  piece.materials = number();
  const std::size_t left = reader.rest().size();
  if (layers > most_layers || piece.materials > left ||
      layers * piece.materials > left / number_bytes)
    throw DataError("is cut short");
  piece.layers.end = piece.layers.begin + static_cast<int>(layers);
  piece.voxels.resize(layers * piece.materials);
  for (std::uint64_t& count : piece.voxels) count = number();
  piece.preview.assign(reader.rest().begin(), reader.rest().end());
  return piece;
}

}  // namespace vdbdither
