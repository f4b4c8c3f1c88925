#include "io/file/whole_file.h"

#include <cerrno>
#include <fcntl.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

#include "io/file/files_read.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

class Descriptor {
 public:
  // Without O_NONBLOCK, opening a named pipe would wait for its writer.
  explicit Descriptor(const std::filesystem::path& path)
      : number_(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  [[nodiscard]] int number() const { return number_; }

 private:
  int number_;
};

}  // namespace

std::string tooLarge(const std::string& shown, std::uint64_t bytes, std::uint64_t most_bytes) {
  return shown + " has " + std::to_string(bytes) + " bytes; at most " + std::to_string(most_bytes) +
         " are read";
}

std::vector<std::uint8_t> readWholeFile(const std::filesystem::path& path, const std::string& shown,
                                        std::uint64_t most_bytes) {
  const auto failed = [&] {
    return DataError("cannot read " + shown + ": " + std::generic_category().message(errno));
  };
  const Descriptor file(path);
  struct stat status {};
  if (file.number() < 0 || ::fstat(file.number(), &status) != 0) throw failed();
  if (!S_ISREG(status.st_mode)) throw DataError(shown + " is not an ordinary file");
  const auto size = static_cast<std::uint64_t>(status.st_size);
  if (size > most_bytes) throw DataError(tooLarge(shown, size, most_bytes));
  noteFileRead(path);
  std::vector<std::uint8_t> bytes(size);
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t count = ::read(file.number(), bytes.data() + at, bytes.size() - at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw failed();
    if (count == 0) bytes.resize(at);
    at += static_cast<std::size_t>(count);
  }
  return bytes;
}

}  // namespace vdbdither
