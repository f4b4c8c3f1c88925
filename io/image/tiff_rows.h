#pragma once

#include <cstddef>
#include <cstdint>
#include <tiffio.h>
#include <vector>

#include "io/image/texture_builder.h"

namespace vdbdither {

inline constexpr const char* damaged_tiff =
    "is not a readable TIFF: it is damaged or cut short; save it again";

/// What the tags of a TIFF say of its pixels.
struct TiffHead {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint16_t bits = 1;
  std::uint16_t samples = 1;
  std::uint16_t meaning = PHOTOMETRIC_MINISBLACK;
  std::uint16_t planes = PLANARCONFIG_CONTIG;
  std::uint16_t number_type = SAMPLEFORMAT_UINT;
  std::uint16_t packing = COMPRESSION_NONE;
  std::uint16_t orientation = ORIENTATION_TOPLEFT;
  SampleLayout::Opacity opacity = SampleLayout::Opacity::none;
};

/// Returns what the tags of an open TIFF say, with the defaults of the format.
TiffHead tiffHeadOf(TIFF* tiff);

/// Whether the way of packing is one that libtiff unpacks within bounds.
bool isPackedInAKnownWay(const TiffHead& head);

/// Reads the rows of an image of 8, 16 or 32 bits a sample from the top, each with all samples of a
/// pixel together. Throws DataError in words that go on from the file's name.
class TiffRows {
 public:
  /// @param head  of `tiff`, checked; both must outlive the object
  TiffRows(TIFF* tiff, const TiffHead& head);

  /// Returns the row `y`. Rows must be read in rising order; each is valid until the next call.
  const std::uint8_t* row(std::uint32_t y);

 private:
  void readBand(std::uint32_t top);
  void readBlock(std::uint32_t left, std::uint32_t top, std::uint16_t plane);
  void copyBlock(std::uint32_t left, std::uint32_t top, std::size_t plane);

  TIFF* tiff_;
  const TiffHead& head_;
  std::size_t sample_bytes_ = 1;
  std::size_t pixel_bytes_ = 1;
  bool is_tiled_ = false;
  bool is_by_row_ = false;
  std::uint32_t block_width_ = 0;
  std::uint32_t block_height_ = 0;
  std::vector<std::uint8_t> block_;
  std::vector<std::uint8_t> band_;
};

}  // namespace vdbdither
