// Feeds the decoders of textures with whatever a fuzzer can think of: they return as many texels as
// they say or refuse in one line. The preset fuzz builds it; run it on a folder of small images.

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "io/image/texture.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

static void requireTexture(bool condition) {
  if (!condition) std::abort();
}

static void decodeAndCheck(std::string_view bytes) {
  try {
    const Texture texture = decodeTexture(bytes, "texture 'a'");
    requireTexture(texture.width > 0 && texture.height > 0);
    requireTexture(texture.texels.size() == std::size_t{texture.width} * texture.height);
    for (const Texture::Texel& texel : texture.texels) {
      for (std::size_t i = 0; i < 3; ++i) requireTexture(texel[i] <= texel[3]);
    }
  } catch (const DataError& error) {
    requireTexture(std::string_view(error.what()).find_first_of("\r\n") == std::string_view::npos);
  }
}

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::decodeAndCheck({reinterpret_cast<const char*>(data), size});
  return 0;
}
