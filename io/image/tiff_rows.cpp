// TIFF: TIFF revision 6.0 (Adobe, 1992), with the supplement for associated opacity.

#include "io/image/tiff_rows.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::uint64_t most_band_bytes = std::uint64_t{1} << 27;

}  // namespace

TiffHead tiffHeadOf(TIFF* tiff) {
  TiffHead head;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &head.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &head.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &head.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &head.samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &head.planes);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &head.number_type);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_COMPRESSION, &head.packing);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ORIENTATION, &head.orientation);
  if (TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &head.meaning) == 0)
    head.meaning = head.samples >= 3 ? PHOTOMETRIC_RGB : PHOTOMETRIC_MINISBLACK;
  std::uint16_t extra_count = 0;
  const std::uint16_t* extra = nullptr;
  if (TIFFGetField(tiff, TIFFTAG_EXTRASAMPLES, &extra_count, &extra) != 0 && extra_count > 0) {
    if (extra[0] == EXTRASAMPLE_ASSOCALPHA) head.opacity = SampleLayout::Opacity::associated;
    if (extra[0] == EXTRASAMPLE_UNASSALPHA) head.opacity = SampleLayout::Opacity::straight;
  }
  return head;
}

bool isPackedInAKnownWay(const TiffHead& head) {
  constexpr std::array<std::uint16_t, 11> known{
      COMPRESSION_NONE,      COMPRESSION_LZW,  COMPRESSION_ADOBE_DEFLATE, COMPRESSION_DEFLATE,
      COMPRESSION_PACKBITS,  COMPRESSION_JPEG, COMPRESSION_CCITTRLE,      COMPRESSION_CCITTFAX3,
      COMPRESSION_CCITTFAX4, COMPRESSION_LZMA, COMPRESSION_ZSTD};
  return std::find(known.begin(), known.end(), head.packing) != known.end();
}

TiffRows::TiffRows(TIFF* tiff, const TiffHead& head) : tiff_(tiff), head_(head) {
  sample_bytes_ = head.bits / 8;
  pixel_bytes_ = sample_bytes_ * head.samples;
  is_tiled_ = TIFFIsTiled(tiff) != 0;
  if (is_tiled_) {
    TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &block_width_);
    TIFFGetField(tiff, TIFFTAG_TILELENGTH, &block_height_);
  } else {
    block_width_ = head.width;
    TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &block_height_);
    block_height_ = std::min(block_height_, head.height);
    // Rows one by one, so that a strip may be as large as it likes.
    is_by_row_ = head.planes == PLANARCONFIG_CONTIG;
    if (is_by_row_) block_height_ = 1;
  }
  if (block_width_ == 0 || block_height_ == 0) throw DataError(damaged_tiff);
  const auto block_bytes = static_cast<std::uint64_t>(is_by_row_  ? TIFFScanlineSize64(tiff)
                                                      : is_tiled_ ? TIFFTileSize64(tiff)
                                                                  : TIFFStripSize64(tiff));
  const std::uint64_t rows_held = std::min(block_height_, head.height);
  const std::uint64_t band_bytes = rows_held * head.width * pixel_bytes_;
  if (block_bytes > most_band_bytes || band_bytes > most_band_bytes)
    throw DataError("is a TIFF of tiles or strips that are too large; save it again");
  const std::uint64_t planes = head.planes == PLANARCONFIG_CONTIG ? 1 : head.samples;
  if (block_bytes * planes < std::uint64_t{block_width_} * block_height_ * pixel_bytes_)
    throw DataError(damaged_tiff);
  block_.resize(block_bytes);
  band_.resize(band_bytes);
}

const std::uint8_t* TiffRows::row(std::uint32_t y) {
  if (y % block_height_ == 0) readBand(y);
  return band_.data() + std::size_t{y % block_height_} * head_.width * pixel_bytes_;
}

void TiffRows::readBand(std::uint32_t top) {
  if (is_by_row_) {
    if (TIFFReadScanline(tiff_, block_.data(), top) != 1) throw DataError(damaged_tiff);
    std::copy_n(block_.begin(), band_.size(), band_.begin());
    return;
  }
  const int planes = head_.planes == PLANARCONFIG_CONTIG ? 1 : head_.samples;
  for (int plane = 0; plane < planes; ++plane) {
    for (std::uint32_t left = 0; left < head_.width; left += block_width_) {
      readBlock(left, top, static_cast<std::uint16_t>(plane));
      copyBlock(left, top, static_cast<std::size_t>(plane));
      if (block_width_ >= head_.width - left) break;
    }
  }
}

void TiffRows::readBlock(std::uint32_t left, std::uint32_t top, std::uint16_t plane) {
  const auto size = static_cast<tmsize_t>(block_.size());
  const tmsize_t read =
      is_tiled_
          ? TIFFReadEncodedTile(tiff_, TIFFComputeTile(tiff_, left, top, 0, plane), block_.data(),
                                size)
          : TIFFReadEncodedStrip(tiff_, TIFFComputeStrip(tiff_, top, plane), block_.data(), size);
  if (read < 0) throw DataError(damaged_tiff);
}

void TiffRows::copyBlock(std::uint32_t left, std::uint32_t top, std::size_t plane) {
  const std::uint32_t rows = std::min(block_height_, head_.height - top);
  const std::uint32_t columns = std::min(block_width_, head_.width - left);
  const bool is_together = head_.planes == PLANARCONFIG_CONTIG;
  const std::size_t from_bytes = is_together ? pixel_bytes_ : sample_bytes_;
  for (std::uint32_t y = 0; y < rows; ++y) {
    const std::uint8_t* from = block_.data() + std::size_t{y} * block_width_ * from_bytes;
    std::uint8_t* to =
        band_.data() + (std::size_t{y} * head_.width + left) * pixel_bytes_ + plane * sample_bytes_;
    if (is_together) {
      std::memcpy(to, from, columns * pixel_bytes_);
      continue;
    }
    for (std::uint32_t x = 0; x < columns; ++x)
      std::memcpy(to + x * pixel_bytes_, from + x * sample_bytes_, sample_bytes_);
  }
}

}  // namespace vdbdither
