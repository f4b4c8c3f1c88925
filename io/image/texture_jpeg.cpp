// JPEG: ITU-T T.81; ICC profiles in it: ICC.1:2022, annex B.4; the Adobe marker: ITU-T T.872.

#include <array>
#include <memory>
#include <new>
#include <string_view>
#include <turbojpeg.h>
#include <vector>

#include "io/image/texture_builder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

using namespace std::string_view_literals;

namespace {

using Bytes = std::span<const std::uint8_t>;

/// What the markers of a JPEG tell, which the decoder does not.
struct JpegMarkers {
  std::vector<Bytes> profile_pieces;  ///< by number; empty where one is missing
  bool is_adobe = false;              ///< CMYK is stored as the light that the inks leave
  std::size_t scans = 0;
};

bool startsWith(Bytes bytes, std::string_view text) {
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())
      .starts_with(text);
}

void noteSegment(std::uint8_t marker, Bytes content, JpegMarkers& markers) {
  constexpr std::uint8_t app2 = 0xE2;
  constexpr std::uint8_t app14 = 0xEE;
  constexpr std::uint8_t start_of_scan = 0xDA;
  constexpr auto icc_name = "ICC_PROFILE\0"sv;
  if (marker == start_of_scan) ++markers.scans;
  if (marker == app14 && startsWith(content, "Adobe") && content.size() >= 12)
    markers.is_adobe = true;
  if (marker != app2 || !startsWith(content, icc_name) || content.size() < icc_name.size() + 2)
    return;
  const std::size_t number = content[icc_name.size()];
  const std::size_t count = content[icc_name.size() + 1];
  if (number == 0 || number > count) return;
  if (markers.profile_pieces.empty()) markers.profile_pieces.resize(count);
  if (markers.profile_pieces.size() == count)
    markers.profile_pieces[number - 1] = content.subspan(icc_name.size() + 2);
}

/// Walks from marker to marker; between scans, over the coded data, in which 0xFF comes before 0.
JpegMarkers markersOf(Bytes bytes) {
  JpegMarkers markers;
  for (std::size_t at = 2; at + 4 <= bytes.size();) {
    const std::uint8_t marker = bytes[at + 1];
    if (bytes[at] != 0xFF || marker == 0 || marker == 0xFF || (marker >= 0xD0 && marker <= 0xD8)) {
      ++at;
      continue;
    }
    if (marker == 0xD9) break;
    const std::size_t length = static_cast<std::size_t>(bytes[at + 2] << 8 | bytes[at + 3]);
    if (length < 2 || at + 2 + length > bytes.size()) break;
    noteSegment(marker, bytes.subspan(at + 4, length - 2), markers);
    at += 2 + length;
  }
  return markers;
}

std::vector<std::uint8_t> profileOf(const JpegMarkers& markers) {
  std::vector<std::uint8_t> profile;
  for (const Bytes piece : markers.profile_pieces) {
    if (piece.empty()) return {};
    profile.insert(profile.end(), piece.begin(), piece.end());
  }
  return profile;
}

struct JpegKind {
  int channels;
  TJPF format;
};

JpegKind kindOf(int colour_space) {
  switch (colour_space) {
    case TJCS_GRAY:
      return {1, TJPF_GRAY};
    case TJCS_CMYK:
    case TJCS_YCCK:
      return {4, TJPF_CMYK};
    default:
      return {3, TJPF_RGB};
  }
}

/// Whether what the decoder complains of leaves all pixels as they were meant: bytes between two
/// markers, and versions that it does not know. It keeps its first complaint.
bool isHarmless(tjhandle decoder) {
  if (tjGetErrorCode(decoder) != TJERR_WARNING) return false;
  const std::string_view complaint = tjGetErrorStr2(decoder);
  const auto says = [&](std::string_view words) {
    return complaint.find(words) != std::string_view::npos;
  };
  return says("extraneous bytes before marker") || says("unknown JFIF revision") ||
         says("Unknown Adobe color transform") || says("Invalid SOS parameters");
}

}  // namespace

Texture decodeJpegTexture(Bytes bytes, TextureOpacity opacity) {
  const std::unique_ptr<void, decltype(&tjDestroy)> decoder(tjInitDecompress(), tjDestroy);
  if (decoder == nullptr) throw std::bad_alloc();
  int width = 0;
  int height = 0;
  int subsampling = 0;
  int colour_space = 0;
  const int header = tjDecompressHeader3(decoder.get(), bytes.data(), bytes.size(), &width, &height,
                                         &subsampling, &colour_space);
  if ((header != 0 && !isHarmless(decoder.get())) || width < 1 || height < 1)
    throw DataError("is not a readable JPEG: it is damaged or of a rare kind; save it again");
  checkTextureSize(static_cast<std::uint64_t>(width), static_cast<std::uint64_t>(height), 4,
                   bytes.size());
  const JpegMarkers markers = markersOf(bytes);
  // Each takes time for all of the image, though it may be a few bytes long.
  constexpr std::size_t most_scans = 100;
  if (markers.scans > most_scans)
    throw DataError("is a JPEG of more than 100 scans; save it again");

  const JpegKind kind = kindOf(colour_space);
  SampleLayout layout;
  layout.colours = kind.channels;
  const std::size_t row_bytes = static_cast<std::size_t>(width) * layout.bytesPerPixel();
  std::vector<std::uint8_t> rows(row_bytes * static_cast<std::size_t>(height));
  if (tjDecompress2(decoder.get(), bytes.data(), bytes.size(), rows.data(), width, 0, height,
                    kind.format, TJFLAG_ACCURATEDCT | TJFLAG_LIMITSCANS) != 0 &&
      !isHarmless(decoder.get()))
    throw DataError("is not a readable JPEG: it is damaged or cut short; save it again");

  const bool is_inverted = kind.channels == 4 && markers.is_adobe;
  TextureBuilder builder(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height),
                         layout, {profileOf(markers), {}, {}}, opacity);
  for (int y = 0; y < height; ++y) {
    std::uint8_t* row = rows.data() + static_cast<std::size_t>(y) * row_bytes;
    for (std::size_t i = 0; is_inverted && i < row_bytes; ++i)
      row[i] = static_cast<std::uint8_t>(255 - row[i]);
    builder.row(row);
  }
  return builder.take();
}

}  // namespace vdbdither
