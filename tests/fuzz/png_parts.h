#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>
#include <zlib.h>

// PNG (third edition, 5) for fuzzers, which do not guess checksums.

namespace vdbdither {

inline constexpr std::string_view png_signature = "\x89PNG\r\n\x1a\n";

inline void putBigEndian(std::vector<std::uint8_t>& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(value >> shift));
}

inline void putChunk(std::vector<std::uint8_t>& bytes, std::string_view name,
                     std::span<const std::uint8_t> data) {
  putBigEndian(bytes, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = bytes.size();
  bytes.insert(bytes.end(), name.begin(), name.end());
  bytes.insert(bytes.end(), data.begin(), data.end());
  putBigEndian(bytes,
               static_cast<std::uint32_t>(crc32_z(0, bytes.data() + begin, bytes.size() - begin)));
}

/// Returns the bytes of a PNG with the right checksum behind each chunk, and those of anything else
/// as they are.
/// @param with_unknown  adds a chunk that has no meaning behind the first one
inline std::vector<std::uint8_t> mendedPng(std::span<const std::uint8_t> bytes,
                                           bool with_unknown = false) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with(png_signature)) return {bytes.begin(), bytes.end()};
  std::vector<std::uint8_t> mended(png_signature.begin(), png_signature.end());
  constexpr std::size_t around = 12;
  std::size_t at = png_signature.size();
  while (at + around <= bytes.size()) {
    std::size_t size = 0;
    for (std::size_t i = 0; i < 4; ++i) size = size << 8 | bytes[at + i];
    if (size > bytes.size() - at - around) break;
    putChunk(mended, text.substr(at + 4, 4), bytes.subspan(at + 8, size));
    if (with_unknown && at == png_signature.size()) putChunk(mended, "zzZz", {});
    at += around + size;
  }
  mended.insert(mended.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end());
  return mended;
}

}  // namespace vdbdither
