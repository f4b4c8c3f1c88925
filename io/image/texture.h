#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// What becomes of the opacity of an image.
enum class TextureOpacity { keep, ignore };

/// Decodes a PNG, JPEG, WebP, TIFF or OpenEXR image; its first bytes tell which it is. The colours
/// are converted from the image's own space: an embedded ICC profile, sRGB and gAMA chunks of PNG,
/// sRGB where it states none, linear light in OpenEXR and in TIFF of floats. Values outside of
/// 0 … 1 are clipped.
///
/// The number of texels is limited to `most_texels`, before memory is taken for them, and above
/// 2²⁴ to 64 for each byte.
///
/// @param bytes  the whole file
/// @param shown  what messages call it
/// @throws DataError for an image that cannot be decoded, and for kinds that are not read (KTX2,
/// Basis, DDS, GIF and others, by name)
Texture decodeTexture(std::string_view bytes, const std::string& shown,
                      TextureOpacity opacity = TextureOpacity::keep);

/// Throws DataError, in words that go on from "its textures", where textures of one mesh have too
/// many texels together, or more than so many bytes hold of pictures.
/// @param texels, file_bytes  sums over all textures so far
void checkTexturesTogether(std::uint64_t texels, std::uint64_t file_bytes);

inline constexpr std::uint64_t most_texels = std::uint64_t{1} << 28;
/// The maximum size of an image file, for those who read it.
inline constexpr std::uint64_t most_texture_bytes = std::uint64_t{1} << 31;

}  // namespace vdbdither
