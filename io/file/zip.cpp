#include "io/file/zip.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <memory>
#include <minizip/unzip.h>
#include <minizip/zip.h>
#include <utility>
#include <zlib.h>

#include "io/file/file_name.h"
#include "io/file/files_read.h"
#include "io/file/whole_file.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::size_t largest_piece = std::size_t{1} << 30;

/// Archives of more files are not read. The tallest stacks have half as many.
constexpr std::uint64_t most_members = 1 << 18;

/// A member larger than this may not inflate by more than that.
constexpr std::uint64_t always_inflated = std::uint64_t{16} << 20;
constexpr std::uint64_t most_inflation = 200;

/// A bit of the flags of a member.
constexpr std::uint64_t is_encrypted = 1;

/// Bytes in memory, as minizip reads a file.
struct MemoryFile {
  std::span<const std::uint8_t> bytes;
  std::uint64_t at = 0;
};

MemoryFile& memoryFile(void* stream) { return *static_cast<MemoryFile*>(stream); }

uLong readMemory(void* /*opaque*/, void* stream, void* to, uLong count) {
  MemoryFile& file = memoryFile(stream);
  const std::size_t taken = std::min<std::uint64_t>(count, file.bytes.size() - file.at);
  std::copy_n(file.bytes.begin() + static_cast<std::ptrdiff_t>(file.at), taken,
              static_cast<std::uint8_t*>(to));
  file.at += taken;
  return taken;
}

long seekMemory(void* /*opaque*/, void* stream, ZPOS64_T offset, int origin) {
  MemoryFile& file = memoryFile(stream);
  const std::uint64_t size = file.bytes.size();
  const std::uint64_t from = origin == ZLIB_FILEFUNC_SEEK_SET   ? 0
                             : origin == ZLIB_FILEFUNC_SEEK_CUR ? file.at
                                                                : size;
  if (offset > size - from) return -1;
  file.at = from + offset;
  return 0;
}

zlib_filefunc64_def memoryFunctions(std::span<const std::uint8_t>& bytes) {
  zlib_filefunc64_def functions{};
  functions.zopen64_file = [](void* opaque, const void* /*name*/, int /*mode*/) -> void* {
    return std::make_unique<MemoryFile>(
               MemoryFile{*static_cast<std::span<const std::uint8_t>*>(opaque)})
        .release();
  };
  functions.zread_file = readMemory;
  functions.zwrite_file = [](void*, void*, const void*, uLong) -> uLong { return 0; };
  functions.ztell64_file = [](void*, void* stream) -> ZPOS64_T { return memoryFile(stream).at; };
  functions.zseek64_file = seekMemory;
  functions.zclose_file = [](void*, void* stream) {
    const std::unique_ptr<MemoryFile> closed(&memoryFile(stream));
    return 0;
  };
  functions.zerror_file = [](void*, void*) { return 0; };
  functions.opaque = &bytes;
  return functions;
}

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

ZipReader::ZipReader(const std::filesystem::path& path) : shown_("'" + path.string() + "'") {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none))
    throw DataError(shown_ + " is not an ordinary file");
  noteFileRead(path);
  takeOver(unzOpen64(path.c_str()));
}

ZipReader::ZipReader(std::span<const std::uint8_t> bytes, std::string shown)
    : shown_(std::move(shown)) {
  zlib_filefunc64_def functions = memoryFunctions(bytes);
  takeOver(unzOpen2_64("", &functions));
}

void ZipReader::takeOver(void* opened) {
  file_ = opened;
  if (!file_) throw DataError(shown_ + " is not a readable zip archive");
  try {
    readDirectory();
  } catch (...) {
    unzClose(file_);
    throw;
  }
}

ZipReader::~ZipReader() { unzClose(file_); }

void ZipReader::readDirectory() {
  unz_global_info64 all{};
  if (unzGetGlobalInfo64(file_, &all) != UNZ_OK)
    throw DataError(shown_ + " is not a readable zip archive");
  if (all.number_entry > most_members) {
    throw DataError(shown_ + " has " + std::to_string(all.number_entry) + " members; at most " +
                    std::to_string(most_members) + " are read");
  }
  // The number has 16 bits in an archive without a zip64 record, and is this one for all from
  // there.
  constexpr std::uint64_t uncounted = 0xffff;
  for (std::uint64_t i = 0; i < all.number_entry || all.number_entry == uncounted; ++i) {
    std::array<char, 4096> text{};
    unz_file_info64 information{};
    unz64_file_pos place{};
    if ((i == 0 ? unzGoToFirstFile(file_) : unzGoToNextFile(file_)) != UNZ_OK ||
        unzGetCurrentFileInfo64(file_, &information, text.data(), text.size() - 1, nullptr, 0,
                                nullptr, 0) != UNZ_OK ||
        unzGetFilePos64(file_, &place) != UNZ_OK) {
      if (all.number_entry == uncounted && i >= uncounted) return;
      throw DataError(shown_ + " is damaged: its directory ends after " + std::to_string(i) +
                      " of " + std::to_string(all.number_entry) + " members");
    }
    std::string name(text.data(), std::min<std::size_t>(information.size_filename, text.size()));
    const bool is_folder = name.size() > 1 && name.ends_with('/');
    if (is_folder) name.pop_back();
    const auto refuse = [&](const std::string& why) {
      throw DataError(shown_ + ": its member '" + name + "' " + why + "; pack it again");
    };
    if (const auto problem = relativePathProblem(name))
      refuse("has no proper name: it " + *problem);
    if (is_folder) continue;
    if ((information.flag & is_encrypted) != 0) refuse("is encrypted");
    if (information.compression_method != 0 && information.compression_method != Z_DEFLATED)
      refuse("is neither stored nor deflated");
    if (information.uncompressed_size > always_inflated &&
        information.uncompressed_size / most_inflation > information.compressed_size)
      refuse("inflates more than 200 to 1");
    if (members_.size() == most_members) refuse("is one too many");
    const Member member{place.pos_in_zip_directory, place.num_of_file,
                        information.uncompressed_size};
    if (!members_.emplace(name, member).second) refuse("is there twice");
  }
}

std::vector<std::string> ZipReader::names() const {
  std::vector<std::string> names;
  for (const auto& [name, member] : members_) names.push_back(name);
  return names;
}

std::string ZipReader::shown(const std::string& name) const {
  return shown_ + ": its file '" + name + "'";
}

const ZipReader::Member& ZipReader::member(const std::string& name) const {
  const auto found = members_.find(name);
  if (found == members_.end()) throw DataError(shown_ + " holds no file '" + name + "'");
  return found->second;
}

std::vector<std::uint8_t> ZipReader::read(const std::string& name, std::uint64_t most_bytes) {
  std::vector<std::uint8_t> bytes;
  // Room grows with what comes: a damaged length must not ask for all of memory.
  constexpr std::uint64_t step = 1 << 20;
  read(name, most_bytes, [&](std::span<const std::uint8_t> piece) {
    if (bytes.capacity() - bytes.size() < piece.size())
      bytes.reserve(std::min(std::max(2 * bytes.size(), step), size(name)));
    bytes.insert(bytes.end(), piece.begin(), piece.end());
  });
  return bytes;
}

void ZipReader::read(const std::string& name, std::uint64_t most_bytes,
                     const std::function<void(std::span<const std::uint8_t>)>& take) {
  const Member& found = member(name);
  if (found.bytes > most_bytes) throw DataError(tooLarge(shown(name), found.bytes, most_bytes));
  const std::lock_guard lock(mutex_);
  unz64_file_pos place{found.offset, found.number};
  const auto failed = [&] { return DataError(shown(name) + " is damaged"); };
  if (unzGoToFilePos64(file_, &place) != UNZ_OK || unzOpenCurrentFile(file_) != UNZ_OK)
    throw failed();
  std::vector<std::uint8_t> piece(std::size_t{1} << 16);
  std::uint64_t left = found.bytes;
  for (int count = 1; count > 0;) {
    const auto wanted = static_cast<unsigned>(std::min<std::uint64_t>(piece.size(), left));
    count = unzReadCurrentFile(file_, piece.data(), wanted);
    if (count < 0) throw failed();
    left -= static_cast<unsigned>(count);
    if (count > 0) take(std::span(piece).first(static_cast<std::size_t>(count)));
  }
  if (unzCloseCurrentFile(file_) != UNZ_OK || left != 0) throw failed();
}

}  // namespace vdbdither
