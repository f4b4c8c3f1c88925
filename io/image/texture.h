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
/// sRGB where it states none, linear light in OpenEXR. Values outside of 0 … 1 are clipped.
///
/// The number of texels is limited to `most_texels`, before memory is taken for them.
///
/// @param bytes  the whole file
/// @param shown  what messages call it
/// @throws DataError for an image that cannot be decoded, and for kinds that are not read (KTX2,
/// Basis, DDS, GIF and others, by name)
Texture decodeTexture(std::string_view bytes, const std::string& shown,
                      TextureOpacity opacity = TextureOpacity::keep);

inline constexpr std::uint64_t most_texels = std::uint64_t{1} << 28;
/// The maximum size of an image file, for those who read it.
inline constexpr std::uint64_t most_texture_bytes = std::uint64_t{1} << 31;

}  // namespace vdbdither
