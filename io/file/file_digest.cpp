#include "io/file/file_digest.h"

#include <cerrno>
#include <fstream>
#include <system_error>
#include <vector>

#include "io/file/digest.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

FileDigest digestOfFile(const std::filesystem::path& path) {
  const auto failed = [&] {
    return DataError("cannot read '" + path.string() +
                     "': " + std::generic_category().message(errno));
  };
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) throw failed();
  constexpr std::size_t piece_bytes = std::size_t{1} << 16;
  std::vector<char> piece(piece_bytes);
  Digest digest;
  FileDigest result;
  while (file) {
    throwIfInterrupted();
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto count = static_cast<std::size_t>(file.gcount());
    digest.update(piece.data(), count);
    result.bytes += count;
  }
  if (file.bad()) throw failed();
  result.sha256 = hexText(digest.finish());
  return result;
}

}  // namespace vdbdither
