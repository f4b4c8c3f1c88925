#include "io/stack/zip.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <minizip/unzip.h>
#include <minizip/zip.h>
#include <utility>
#include <zlib.h>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::size_t largest_piece = std::size_t{1} << 30;

}  // namespace

ZipWriter::ZipWriter(const std::filesystem::path& path, std::filesystem::path shown)
    : shown_(std::move(shown)) {
  errno = 0;
  file_ = zipOpen64(path.c_str(), APPEND_STATUS_CREATE);
  if (!file_) fail();
}

ZipWriter::~ZipWriter() {
  if (file_) zipClose(file_, nullptr);
}

void ZipWriter::fail() const {
  throw DataError("cannot write '" + shown_.string() + "': " + std::strerror(errno ? errno : EIO));
}

void ZipWriter::add(const std::string& name, std::span<const std::uint8_t> bytes) {
  // The earliest date that the format knows: an archive tells nothing of when it was made.
  constexpr uLong first_of_1980 = 0x00210000;
  constexpr uLong names_are_utf8 = 1 << 11;
  zip_fileinfo information{};
  information.dosDate = first_of_1980;
  errno = 0;
  const bool large = bytes.size() >= 0xffffffff;
  if (zipOpenNewFileInZip4_64(file_, name.c_str(), &information, nullptr, 0, nullptr, 0, nullptr, 0,
                              0, 0, -MAX_WBITS, DEF_MEM_LEVEL, Z_DEFAULT_STRATEGY, nullptr, 0, 0,
                              names_are_utf8, large) != ZIP_OK) {
    fail();
  }
  while (!bytes.empty()) {
    const auto piece = bytes.first(std::min(bytes.size(), largest_piece));
    if (zipWriteInFileInZip(file_, piece.data(), static_cast<unsigned>(piece.size())) != ZIP_OK)
      fail();
    bytes = bytes.subspan(piece.size());
  }
  if (zipCloseFileInZip(file_) != ZIP_OK) fail();
}

void ZipWriter::finish() {
  errno = 0;
  if (zipClose(std::exchange(file_, nullptr), nullptr) != ZIP_OK) fail();
}

ZipReader::ZipReader(const std::filesystem::path& path) : path_(path) {
  file_ = unzOpen64(path.c_str());
  if (!file_) throw DataError("'" + path.string() + "' is not a readable zip archive");
  for (int state = unzGoToFirstFile(file_); state == UNZ_OK; state = unzGoToNextFile(file_)) {
    std::array<char, 4096> name{};
    unz64_file_pos place{};
    if (unzGetCurrentFileInfo64(file_, nullptr, name.data(), name.size() - 1, nullptr, 0, nullptr,
                                0) != UNZ_OK ||
        unzGetFilePos64(file_, &place) != UNZ_OK) {
      break;
    }
    places_[name.data()] = {place.pos_in_zip_directory, place.num_of_file};
  }
}

ZipReader::~ZipReader() { unzClose(file_); }

std::vector<std::uint8_t> ZipReader::read(const std::string& name) {
  const auto found = places_.find(name);
  if (found == places_.end())
    throw DataError("'" + path_.string() + "' holds no file '" + name + "'");
  const std::lock_guard lock(mutex_);
  unz64_file_pos place{found->second.offset, found->second.number};
  const auto failed = [&] {
    return DataError("'" + path_.string() + "': its file '" + name + "' is damaged");
  };
  if (unzGoToFilePos64(file_, &place) != UNZ_OK || unzOpenCurrentFile(file_) != UNZ_OK)
    throw failed();
  std::vector<std::uint8_t> bytes;
  // Room grows with what comes: a damaged length must not ask for all of memory.
  constexpr std::size_t step = 1 << 20;
  for (int count = 1; count > 0;) {
    const std::size_t begin = bytes.size();
    bytes.resize(begin + step);
    count = unzReadCurrentFile(file_, bytes.data() + begin, step);
    bytes.resize(begin + static_cast<std::size_t>(std::max(count, 0)));
    if (count < 0) throw failed();
  }
  if (unzCloseCurrentFile(file_) != UNZ_OK) throw failed();
  return bytes;
}

}  // namespace vdbdither
