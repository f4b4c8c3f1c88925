// Feeds the mesh parsers with whatever a fuzzer can think of: they return a sound mesh or refuse in
// one line. The preset fuzz builds it; run it on a folder of small meshes.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tests/fuzz/sound_mesh.h"

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  // The ending settles what the content leaves open: a binary STL of a wrong size.
  for (const auto colours : {vdbdither::MeshColours::skip, vdbdither::MeshColours::read})
    vdbdither::requireSoundMesh("no such folder/fuzz.stl", bytes, colours);
  return 0;
}
