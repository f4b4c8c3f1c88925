#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Slices that follow each other, packed together for a page (docs/viewer.md has the format).
struct SliceGroup {
  std::uint32_t slices = 0;
  /// The pixels that are not 0 in all of them lie here.
  std::uint32_t left = 0, top = 0, width = 0, height = 0;
  std::vector<std::uint8_t> bytes;  ///< a deflate stream (RFC 1951)
};

/// Packs slices of one size, of which there is at least one. Same slices, same bytes.
/// @param values  greatest value of a pixel, 1 … 255
/// @param base    for each slice another that is like it, or empty: each is predicted from the one
///                before it
SliceGroup packSlices(std::span<const SpanImage* const> slices, std::uint32_t values,
                      std::span<const SpanImage* const> base = {});

/// Returns the slices of `group` again.
/// @param base  the same as when they were packed
std::vector<SpanImage> unpackSlices(const SliceGroup& group, std::uint32_t width,
                                    std::uint32_t height, std::uint32_t values,
                                    std::span<const SpanImage* const> base = {});

/// Returns the pieces, one after the other, as a deflate stream. Each has blocks, and so codes, of
/// its own.
std::vector<std::uint8_t> deflated(std::span<const std::span<const std::uint8_t>> pieces);

}  // namespace vdbdither
