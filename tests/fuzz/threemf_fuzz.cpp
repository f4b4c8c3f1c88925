// Feeds the reader of 3MF with model parts, and with whole archives, that a fuzzer thinks of: it
// returns a sound mesh with a sound appearance or refuses in one line. A seed is the text of a
// model part, or a small 3MF file.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <zlib.h>

#include "tests/fuzz/sound_mesh.h"

namespace vdbdither {

/// A zip archive of one file, stored: APPNOTE.TXT of PKWARE, 4.3.
static std::string archiveOf(std::string_view name, std::string_view content) {
  const auto number = [](std::uint64_t value, int bytes) {
    std::string text;
    for (; bytes > 0; --bytes, value >>= 8) text += static_cast<char>(value & 0xFF);
    return text;
  };
  const auto checksum =
      ::crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()));
  // Version, flags, method, time and date; checksum and sizes; the length of the name, extra bytes.
  const std::string shared = number(20, 2) + number(0, 8) + number(checksum, 4) +
                             number(content.size(), 4) + number(content.size(), 4) +
                             number(name.size(), 2) + number(0, 2);
  const std::string begin = "PK\x03\x04" + shared + std::string(name) + std::string(content);
  const std::string directory =
      "PK\x01\x02" + number(20, 2) + shared + number(0, 14) + std::string(name);
  return begin + directory + "PK\x05\x06" + number(0, 4) + number(1, 2) + number(1, 2) +
         number(directory.size(), 4) + number(begin.size(), 4) + number(0, 2);
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const bool is_archive = bytes.starts_with("PK");
  const std::string archive =
      is_archive ? std::string(bytes) : vdbdither::archiveOf("3D/3dmodel.model", bytes);
  const vdbdither::Mesh mesh =
      vdbdither::requireSoundMesh("no such folder/fuzz.3mf", archive, vdbdither::MeshColours::read);
  for (const vdbdither::MeshPart& part : mesh.parts)
    vdbdither::require(vdbdither::isOneLine(part.name));
  return 0;
}
