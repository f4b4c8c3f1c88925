#include "io/file/staged_output.h"

#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fcntl.h>
#include <mutex>
#include <set>
#include <shared_mutex>
#include <string>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

/// Without a trailing slash, so that it has a file name.
fs::path named(const fs::path& target) {
  const fs::path normal = target.lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

fs::path parentOf(const fs::path& target) {
  const fs::path parent = target.parent_path();
  return parent.empty() ? "." : parent;
}

std::string partialPrefix(const fs::path& target) {
  return "." + target.filename().string() + ".partial-";
}

[[noreturn]] void fail(const std::string& what, const fs::path& path, int error) {
  throw DataError("cannot " + what + " '" + path.string() +
                  "': " + std::generic_category().message(error));
}

/// The partial outputs of the process. Never destroyed, as a thread may end the process while
/// another destroys what is static.
struct Unfinished {
  std::mutex mutex;
  std::set<fs::path> paths;
  /// Held by each change of an output that makes a new name: by writers shared, by the one who
  /// abandons all outputs alone, for ever.
  std::shared_timed_mutex naming;

  static Unfinished& all() {
    static auto* const unfinished = new Unfinished;
    return *unfinished;
  }
};

}  // namespace

void StagedOutput::check(const fs::path& given, Kind kind, bool overwrite) {
  const fs::path target = named(given);
  const std::string name = "'" + given.string() + "'";
  if (target.empty() || target.filename() == "." || target.filename() == ".." ||
      !target.has_filename()) {
    throw UsageError("cannot write to " + name + ": give a folder or file a name of its own");
  }
  std::error_code ignored;
  const fs::file_status status = fs::status(target, ignored);
  if (!fs::exists(status)) {
    if (!fs::is_directory(parentOf(target), ignored)) {
      throw UsageError("cannot write to " + name + ": there is no folder '" +
                       parentOf(target).string() + "'");
    }
    return;
  }
  if (kind == Kind::folder && !fs::is_directory(status))
    throw UsageError(name + " exists and is not a folder");
  if (kind == Kind::file && fs::is_directory(status))
    throw UsageError(name + " is a folder; name a file in it");
  if (kind == Kind::file && !fs::is_regular_file(status))
    throw UsageError(name + " is not an ordinary file");
  if (kind == Kind::folder && fs::is_empty(target, ignored)) return;
  if (!overwrite) throw UsageError(name + " exists; --overwrite replaces it");
}

StagedOutput::StagedOutput(const fs::path& target, Kind kind) : target_(named(target)) {
  partial_ = parentOf(target_) / (partialPrefix(target_) + std::to_string(::getpid()));
  removeLeftovers();
  Unfinished& unfinished = Unfinished::all();
  {
    const std::lock_guard lock(unfinished.mutex);
    unfinished.paths.insert(partial_);
  }
  const std::shared_lock naming(unfinished.naming);
  if (kind == Kind::folder && ::mkdir(partial_.c_str(), 0777) != 0) {
    const int error = errno;
    forget();
    fail("make", target_, error);
  }
}

StagedOutput::~StagedOutput() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(partial_, ignored);
  forget();
}

void StagedOutput::forget() const {
  const std::lock_guard lock(Unfinished::all().mutex);
  Unfinished::all().paths.erase(partial_);
}

void StagedOutput::abandonAll(std::chrono::milliseconds patience) {
  Unfinished& unfinished = Unfinished::all();
  // Not to be unlocked again. A write to a dead network disk may hold it: then go on without.
  (void)unfinished.naming.try_lock_for(patience);
  std::set<fs::path> paths;
  {
    const std::lock_guard lock(unfinished.mutex);
    paths = unfinished.paths;
  }
  for (const fs::path& path : paths) {
    std::error_code ignored;
    // Another thread may remove the same files, which ends an attempt early.
    for (int attempt = 0; attempt < 10 && fs::exists(path, ignored); ++attempt)
      fs::remove_all(path, ignored);
  }
}

void StagedOutput::removeLeftovers() const {
  const std::string prefix = partialPrefix(target_);
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(parentOf(target_), ignored)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(prefix)) continue;
    pid_t owner = 0;
    const char* end = name.data() + name.size();
    const char* behind = std::from_chars(name.data() + prefix.size(), end, owner).ptr;
    // What goes with a partial output has its name and a word, as in .NAME.partial-PID.old.
    if (owner <= 0 || (behind != end && *behind != '.' && *behind != '-')) continue;
    if (owner == ::getpid() || (::kill(owner, 0) != 0 && errno == ESRCH))
      fs::remove_all(entry.path(), ignored);
  }
}

void StagedOutput::write(const fs::path& name, std::span<const std::uint8_t> bytes) const {
  const std::shared_lock naming(Unfinished::all().naming);
  const fs::path path = partial_ / name;
  std::error_code error;
  if (name.has_parent_path()) fs::create_directories(path.parent_path(), error);
  if (error) fail("make", target_ / name.parent_path(), error.value());
  writeFile(path, bytes, target_ / name);
}

void StagedOutput::commit() {
  throwIfInterrupted();
  const std::shared_lock naming(Unfinished::all().naming);
  // An exchange keeps a whole output in place all the time; where the file system has none, or
  // there is nothing to replace, the rename does.
  if (::renameat2(AT_FDCWD, partial_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) == 0) {
    committed_ = true;
    std::error_code ignored;
    fs::remove_all(partial_, ignored);
    return;
  }
  if (errno != ENOENT && fs::is_directory(target_)) {
    fs::path old = partial_;
    old += ".old";
    if (::rename(target_.c_str(), old.c_str()) != 0) fail("replace", target_, errno);
    std::error_code ignored;
    if (::rename(partial_.c_str(), target_.c_str()) != 0) {
      const int error = errno;
      fs::rename(old, target_, ignored);
      fail("replace", target_, error);
    }
    fs::remove_all(old, ignored);
  } else if (::rename(partial_.c_str(), target_.c_str()) != 0) {
    fail("write", target_, errno);
  }
  committed_ = true;
}

void writeFile(const fs::path& path, std::span<const std::uint8_t> bytes, const fs::path& shown) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file < 0) fail("write", shown, errno);
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      const int error = errno;
      ::close(file);
      fail("write", shown, error);
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  if (::close(file) != 0) fail("write", shown, errno);
}

}  // namespace vdbdither
