// Feeds the decoders of slices and of height maps with whatever a fuzzer can think of: they return
// sound images or refuse in one line. A seed is a small PNG, TIFF, BMP or EXR; checksums of PNG are
// mended.

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "io/image/bmp.h"
#include "io/image/colour_image.h"
#include "io/image/exr.h"
#include "io/image/grey_image.h"
#include "io/image/tiff.h"
#include "tests/fuzz/png_parts.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/sound_slice.h"

namespace vdbdither {

namespace {

template <class Decode>
void requireSoundOrRefused(const Decode& decode) {
  const auto image = decodedOrRefused(decode);
  if (image) requireSound(*image);
}

void readHeightMap(std::span<const std::uint8_t> bytes) {
  const ScratchFile file(bytes);
  decodedOrRefused([&](const SizeCheck&) {
    const GreyImage image = readGreyImage(file.path());
    require(image.width > 0 && image.height > 0);
    require(image.values.size() ==
            static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
    for (const float value : image.values) require(std::isfinite(value));
    return true;
  });
}

void decode(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (text.starts_with("BM")) {
    requireSoundOrRefused([&](const SizeCheck& check) { return decodeBmp(bytes, check); });
  } else if (text.starts_with("\x76\x2f\x31\x01")) {
    requireSoundOrRefused(
        [&](const SizeCheck& check) { return decodeExr(bytes, "material", check); });
    readHeightMap(bytes);
  } else if (text.starts_with(png_signature)) {
    requireSoundOrRefused(
        [&](const SizeCheck& check) { return decodePngImage(bytes, check).pixels; });
    readHeightMap(bytes);
  } else {
    requireSoundOrRefused([&](const SizeCheck& check) { return decodeTiff(bytes, check); });
    requireSoundOrRefused(
        [&](const SizeCheck& check) { return decodeTiffImage(bytes, check).pixels; });
  }
}

}  // namespace

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::decode(vdbdither::mendedPng({data, size}));
  return 0;
}
