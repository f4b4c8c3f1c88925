// Feeds the decoders of textures with whatever a fuzzer can think of: they return as many texels as
// they say or refuse in one line. The preset fuzz builds it; run it on a folder of small images.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "io/image/texture.h"
#include "tests/fuzz/sound_mesh.h"

namespace vdbdither {

static void decodeAndCheck(std::string_view bytes) {
  try {
    const Texture texture = decodeTexture(bytes, "texture 'a'");
    require(texture.width > 0 && texture.height > 0);
    require(texture.texels.size() == std::size_t{texture.width} * texture.height);
    for (const Texture::Texel& texel : texture.texels) {
      for (std::size_t i = 0; i < 3; ++i) require(texel[i] <= texel[3]);
    }
  } catch (const DataError& error) {
    require(isOneLine(error.what()));
  }
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::decodeAndCheck({reinterpret_cast<const char*>(data), size});
  return 0;
}
