// Feeds the reader of 3MF with model parts, and with whole archives, that a fuzzer thinks of: it
// returns a sound mesh with a sound appearance or refuses in one line. A seed is the text of a
// model part, with the settings of a slicer behind the line "@@", or a small 3MF file.

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>
#include <zlib.h>

#include "tests/fuzz/sound_mesh.h"

namespace vdbdither {

/// Names and contents.
using Files = std::vector<std::pair<std::string, std::string_view>>;

/// A zip archive of files, stored: APPNOTE.TXT of PKWARE, 4.3.
static std::string archiveOf(const Files& files) {
  const auto number = [](std::uint64_t value, int bytes) {
    std::string text;
    for (; bytes > 0; --bytes, value >>= 8) text += static_cast<char>(value & 0xFF);
    return text;
  };
  std::string archive;
  std::string directory;
  for (const auto& [name, content] : files) {
    const auto checksum = ::crc32(0, reinterpret_cast<const Bytef*>(content.data()),
                                  static_cast<uInt>(content.size()));
    // Version, flags, method, time and date; checksum and sizes; the length of the name, extra
    // bytes.
    const std::string shared = number(20, 2) + number(0, 8) + number(checksum, 4) +
                               number(content.size(), 4) + number(content.size(), 4) +
                               number(name.size(), 2) + number(0, 2);
    directory +=
        "PK\x01\x02" + number(20, 2) + shared + number(0, 10) + number(archive.size(), 4) + name;
    archive += "PK\x03\x04" + shared + name + std::string(content);
  }
  return archive + directory + "PK\x05\x06" + number(0, 4) + number(files.size(), 2) +
         number(files.size(), 2) + number(directory.size(), 4) + number(archive.size(), 4) +
         number(0, 2);
}

/// The archive of a model, and of a slicer's settings behind the line "@@".
static std::string projectOf(std::string_view text) {
  constexpr std::string_view line = "\n@@\n";
  const std::size_t at = text.find(line);
  if (at == text.npos) return archiveOf({{"3D/3dmodel.model", text}});
  const std::string_view settings = text.substr(at + line.size());
  return archiveOf({{"3D/3dmodel.model", text.substr(0, at)},
                    {"Metadata/Slic3r_PE_model.config", settings},
                    {"Metadata/model_settings.config", settings}});
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const bool is_archive = bytes.starts_with("PK");
  const std::string archive = is_archive ? std::string(bytes) : vdbdither::projectOf(bytes);
  const vdbdither::Mesh mesh =
      vdbdither::requireSoundMesh("no such folder/fuzz.3mf", archive, vdbdither::MeshColours::read);
  for (const vdbdither::MeshPart& part : mesh.parts)
    vdbdither::require(vdbdither::isOneLine(part.name));
  return 0;
}
