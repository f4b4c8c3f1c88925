#include "io/mesh/file_bytes.h"

#include <algorithm>
#include <cerrno>
#include <fcntl.h>
#include <filesystem>
#include <sys/mman.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>

#include "io/file/files_read.h"
#include "io/mesh/mesh_file.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace {

constexpr std::size_t head_size = std::size_t{64} << 10;
constexpr std::size_t step_size = std::size_t{8} << 20;  ///< read between looks at signals

std::size_t physicalMemory() {
  return static_cast<std::size_t>(::sysconf(_SC_PHYS_PAGES)) *
         static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

std::string reason() { return std::generic_category().message(errno); }

}  // namespace

FileBytes::FileBytes(std::string path) : path_(std::move(path)) {
  try {
    open();
  } catch (...) {
    close();
    throw;
  }
}

FileBytes::~FileBytes() { close(); }

void FileBytes::close() {
  if (bytes_ != nullptr) ::munmap(bytes_, size_);
  if (file_ >= 0) ::close(file_);
}

void FileBytes::open() {
  // Without O_NONBLOCK a named pipe would block right here.
  file_ = ::open(path_.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (file_ < 0) refuse(errno == ENOENT ? "no such file" : "cannot be opened: " + reason());
  struct stat status {};
  if (::fstat(file_, &status) != 0) refuse("cannot be read: " + reason());
  if (S_ISDIR(status.st_mode))
    refuse("a folder; name the meshes in it, as in " +
           (std::filesystem::path(path_) / "*.stl").string());
  if (!S_ISREG(status.st_mode))
    refuse("a pipe or device; mesh input needs a regular file, save it first");
  noteFileRead(path_);
  size_ = static_cast<std::size_t>(status.st_size);
  changed_ = status.st_mtim;
  if (size_ == 0) return;
  // Addresses for all of the file, which take no memory until they are written to.
  void* bytes = ::mmap(nullptr, size_, PROT_READ | PROT_WRITE,
                       MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (bytes == MAP_FAILED) refuseSize();
  bytes_ = static_cast<char*>(bytes);
  readUpTo(std::min(size_, head_size));
}

std::string_view FileBytes::head() const { return {bytes_, std::min(size_, head_size)}; }

std::string_view FileBytes::all() {
  if (read_ < size_) {
    if (size_ > physicalMemory()) refuseSize();
    readUpTo(size_);
    struct stat status {};
    if (::fstat(file_, &status) != 0) refuse("cannot be read: " + reason());
    if (static_cast<std::size_t>(status.st_size) != size_ ||
        status.st_mtim.tv_sec != changed_.tv_sec || status.st_mtim.tv_nsec != changed_.tv_nsec)
      refuse("was written to while it was read; try again once it is complete");
  }
  return {bytes_, size_};
}

void FileBytes::readUpTo(std::size_t end) {
  while (read_ < end) {
    throwIfInterrupted();
    const ssize_t count =
        ::pread(file_, bytes_ + read_, std::min(end - read_, step_size), static_cast<off_t>(read_));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) refuse("cannot be read: " + reason());
    if (count == 0)
      refuse("was cut off while it was read, at byte " + std::to_string(read_) + " of " +
             std::to_string(size_) + "; try again once it is complete");
    read_ += static_cast<std::size_t>(count);
  }
}

void FileBytes::refuseSize() const {
  refuse("its " + std::to_string(size_) + " bytes do not fit into memory; split the part");
}

void FileBytes::refuse(const std::string& why) const { MeshFile(path_, {}, {}).refuse(why); }

}  // namespace vdbdither
