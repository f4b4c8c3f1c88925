#include "io/file/staged_output.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <fcntl.h>
#include <map>
#include <mutex>
#include <shared_mutex>
#include <spawn.h>
#include <sys/stat.h>
#include <system_error>
#include <unistd.h>
#include <utility>
#include <vector>

#include "io/file/file_name.h"
#include "io/file/files_read.h"
#include "io/file/staging_name.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

std::string quoted(const fs::path& path) { return "'" + path.string() + "'"; }

[[noreturn]] void fail(const std::string& what, const fs::path& path, int error) {
  throw DataError("cannot " + what + " " + quoted(path) + ": " +
                  std::generic_category().message(error));
}

/// Without what may follow the name of a folder, so that it has a file name. Nothing else is
/// simplified: `..` behind a link leads elsewhere than the text says.
fs::path named(const fs::path& target) {
  std::string text = target.string();
  while (text.size() > 1 && (text.ends_with('/') || text.ends_with("/.")))
    text.resize(text.size() - 1);
  return text;
}

fs::path parentOf(const fs::path& target) {
  const fs::path parent = target.parent_path();
  return parent.empty() ? "." : parent;
}

bool isThere(const fs::path& path) {
  std::error_code none;
  return fs::exists(fs::symlink_status(path, none));
}

bool isLink(const fs::path& path) {
  std::error_code none;
  return fs::is_symlink(fs::symlink_status(path, none));
}

/// Whether a path is the name of a descriptor, such as /proc/self/fd/1, which the program may have
/// pointed elsewhere.
bool namesDescriptor(const fs::path& path) {
  std::error_code error;
  return fs::equivalent(parentOf(path), "/proc/self/fd", error);
}

/// What `given` names, behind symbolic links. Whether it is there does not matter.
fs::path destination(const fs::path& given) {
  constexpr int most_links = 40;
  fs::path path = named(given);
  for (int links = 0;; ++links) {
    if (namesDescriptor(path))
      throw UsageError(quoted(given) +
                       " stands for an open file of the program; name the file itself");
    if (!isLink(path)) return path;
    std::error_code error;
    const fs::path next = fs::read_symlink(path, error);
    if (error || links == most_links)
      throw UsageError("cannot write to " + quoted(given) + ": the link leads nowhere");
    path = named(path.parent_path() / next);
  }
}

/// Renames as renameat2 does, with these flags. Returns whether it worked, or sets errno.
bool renamed(const fs::path& from, const fs::path& to, unsigned flags = 0) {
  return ::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), flags) == 0;
}

/// The outputs that this process is writing: the target of each and its partial path. Two of one
/// target would share a partial path. Never destroyed, because a thread may end the process while
/// another destroys static objects.
class Written {
 public:
  static Written& all() {
    static auto* const written = new Written;
    return *written;
  }
  /// Returns false if the target is being written already.
  bool insert(const fs::path& target, const fs::path& partial) {
    const std::lock_guard lock(mutex_);
    return partials_.emplace(keyOf(target), partial).second;
  }
  void erase(const fs::path& target) {
    const std::lock_guard lock(mutex_);
    partials_.erase(keyOf(target));
  }
  /// Keeps the target, but not its partial path: that one may hold the replaced output now.
  void forgetPartial(const fs::path& target) {
    const std::lock_guard lock(mutex_);
    partials_[keyOf(target)].clear();
  }
  /// What is still to be removed of a target that has its name.
  void rememberRemains(const fs::path& target, const fs::path& remains) {
    const std::lock_guard lock(mutex_);
    partials_[keyOf(target)] = remains;
  }
  bool contains(const fs::path& target) {
    const std::lock_guard lock(mutex_);
    return partials_.contains(keyOf(target));
  }
  /// Whether the target may take the place of what appears there, as `StagedOutput::check` was told
  /// last.
  void setReplacing(const fs::path& target, bool replaces) {
    const std::lock_guard lock(mutex_);
    if (replaces) {
      kept_.erase(keyOf(target));
    } else {
      kept_.insert(keyOf(target));
    }
  }
  bool replaces(const fs::path& target) {
    const std::lock_guard lock(mutex_);
    return !kept_.contains(keyOf(target));
  }
  std::vector<fs::path> partials() {
    const std::lock_guard lock(mutex_);
    std::vector<fs::path> paths;
    for (const auto& [target, partial] : partials_)
      if (!partial.empty()) paths.push_back(partial);
    return paths;
  }

  /// Held during each change that makes a new name: shared by writers; exclusively, and for ever,
  /// by the thread that abandons all outputs.
  std::shared_timed_mutex naming;

 private:
  static fs::path keyOf(const fs::path& target) {
    std::error_code none;
    return fs::weakly_canonical(parentOf(target), none) / target.filename();
  }

  std::mutex mutex_;
  std::map<fs::path, fs::path> partials_;
  std::set<fs::path> kept_;
};

std::atomic<bool> flushes = true;
std::atomic<bool> accepts_existing = false;

bool isMountPoint(const fs::path& path) {
  struct statx status {};
  return ::statx(AT_FDCWD, path.c_str(), 0, 0, &status) == 0 &&
         (status.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
}

/// Everything below `folder`, links not followed.
std::vector<fs::directory_entry> entriesBelow(const fs::path& folder) {
  std::vector<fs::directory_entry> entries;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error))
    entries.push_back(*entry);
  if (error) fail("read", folder, error.value());
  return entries;
}

/// Removes a file or folder, or as much of it as can be removed until then.
void removeUntil(const fs::path& path, std::chrono::steady_clock::time_point end) {
  std::error_code error;
  fs::recursive_directory_iterator entry(path, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (std::chrono::steady_clock::now() > end) return;
    std::error_code ignored;
    if (entry->symlink_status(ignored).type() != fs::file_type::directory)
      fs::remove(entry->path(), ignored);
  }
  // Another thread may remove the same files, which ends an attempt early.
  for (int attempt = 0; attempt < 10 && isThere(path); ++attempt) fs::remove_all(path, error);
}

/// Lets a process of its own remove what is left, which goes on when this one has ended. Returns
/// false if there is none.
bool removedBehind(const std::vector<fs::path>& paths) {
  std::vector<std::string> words{"rm", "-rf", "--"};
  for (const fs::path& path : paths) words.push_back(path.string());
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawnattr_init(&attributes);
  // Whoever waits for the end of the standard streams waits for this program, not for that one.
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    ::posix_spawn_file_actions_addopen(&files, stream, "/dev/null", O_RDWR, 0);
  ::posix_spawn_file_actions_addclosefrom_np(&files, STDERR_FILENO + 1);
  // Out of reach of the next Ctrl-C.
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID);
  return ::posix_spawnp(nullptr, "rm", &files, &attributes, arguments.data(), environ) == 0;
}

bool isFolder(const fs::directory_entry& entry) {
  std::error_code none;
  return entry.symlink_status(none).type() == fs::file_type::directory;
}

/// The first path below `folder` that `own` does not name, or nothing. A folder is named by what
/// is in it, an empty one by its name and '/'.
fs::path foreignIn(const fs::path& folder, const std::set<std::string>& own) {
  std::vector<fs::path> foreign;
  for (const fs::directory_entry& entry : entriesBelow(folder)) {
    fs::path path = entry.path().lexically_relative(folder);
    const std::string name = path.string();
    bool is_own = own.contains(name);
    if (isFolder(entry)) {
      const auto below = own.lower_bound(name + "/");
      is_own = below != own.end() && below->starts_with(name + "/");
    }
    if (!is_own) foreign.push_back(std::move(path));
  }
  return foreign.empty() ? fs::path() : *std::min_element(foreign.begin(), foreign.end());
}

/// Gives the folder that a killed run had put aside its name again, if there is one.
bool foundAside(const fs::path& target) {
  if (isThere(target)) return false;
  std::error_code none;
  for (const fs::directory_entry& entry : fs::directory_iterator(parentOf(target), none)) {
    const auto name = parseStagingName(target, entry.path().filename().string());
    if (name && name->is_put_aside && renamed(entry.path(), target)) return true;
  }
  return false;
}

void writeBytes(int file, std::span<const std::uint8_t> bytes, const fs::path& shown) {
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

/// Waits until what was written to a file, or to the file system of a folder, is on the disk.
/// Returns 0 or the error. What cannot be flushed, as some file systems cannot, is not waited for.
int flushed(const fs::path& path, int (*flush)(int)) {
  if (!flushes) return 0;
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return errno;
  int error = 0;
  while (flush(file) != 0) {
    error = errno;
    if (error != EINTR) break;
    error = 0;
  }
  ::close(file);
  return error == EINVAL || error == ENOTSUP || error == ENOSYS || error == EROFS ? 0 : error;
}

}  // namespace

void StagedOutput::check(const fs::path& given, Kind kind, bool overwrite) {
  const fs::path target = destination(given);
  const std::string name = quoted(given);
  if (target.empty() || target.filename() == "." || target.filename() == ".." ||
      !target.has_filename()) {
    throw UsageError("cannot write to " + name + ": give a folder or file a name of its own");
  }
  if (Written::all().contains(target))
    throw UsageError(name + " is written by another step already");
  Written::all().setReplacing(target, overwrite);
  std::error_code ignored;
  const fs::file_status status = fs::status(target, ignored);
  if (!fs::exists(status)) {
    if (target.filename().string().size() > longest_file_name) {
      throw UsageError("cannot write to " + name + ": a name has at most " +
                       std::to_string(longest_file_name) + " bytes");
    }
    if (!fs::is_directory(parentOf(target), ignored)) {
      throw UsageError("cannot write to " + name + ": there is no folder " +
                       quoted(parentOf(target)));
    }
    if (::access(parentOf(target).c_str(), W_OK | X_OK) != 0) fail("write", given, errno);
    return;
  }
  if (kind == Kind::folder && !fs::is_directory(status))
    throw UsageError(name + " exists and is not a folder");
  if (kind == Kind::file && fs::is_directory(status))
    throw UsageError(name + " is a folder; name a file in it");
  if (kind == Kind::file && !fs::is_regular_file(status))
    throw UsageError(name + " is not an ordinary file");
  if (isMountPoint(target))
    throw UsageError(name + " is a mount point, which cannot be replaced; name something in it");
  if (kind == Kind::folder && fs::equivalent(target, ".", ignored))
    throw UsageError(name + " is the current folder, which cannot be replaced; go to another one");
  if (::access(parentOf(target).c_str(), W_OK | X_OK) != 0 ||
      (kind == Kind::folder && ::access(target.c_str(), R_OK | W_OK | X_OK) != 0))
    fail("replace", given, errno);
  if (kind == Kind::folder && fs::is_empty(target, ignored)) return;
  if (!overwrite && !accepts_existing) throw UsageError(name + " exists; --overwrite replaces it");
}

void StagedOutput::putBack(const fs::path& target,
                           const std::function<void(const std::string&)>& warn) {
  if (foundAside(destination(target))) {
    warn(quoted(target) +
         " was being replaced when a run was killed; the folder before it is put back");
  }
}

void StagedOutput::checkFolder(const fs::path& given, bool overwrite, const OwnFiles& own,
                               const std::function<void(const std::string&)>& warn) {
  putBack(given, warn);
  const fs::path target = destination(given);
  check(given, Kind::folder, overwrite);
  std::error_code none;
  if (!overwrite || !isThere(target) || fs::is_empty(target, none)) return;
  const ReadsUnnoted of_old_output;
  const fs::path foreign = foreignIn(target, own(target));
  if (!foreign.empty()) {
    throw UsageError(quoted(given) + " holds " + quoted(foreign) +
                     ", which was not written with the rest; move it elsewhere, or name another "
                     "folder");
  }
}

StagedOutput::StagedOutput(const fs::path& target, Kind kind, OwnFiles own)
    : shown_(named(target)),
      target_(destination(target)),
      partial_(stagingPath(target_)),
      kind_(kind),
      own_(std::move(own)) {
  if (!Written::all().insert(target_, partial_))
    throw UsageError(quoted(target) + " is written by another step already");
  try {
    begin();
  } catch (...) {
    Written::all().erase(target_);
    throw;
  }
}

void StagedOutput::begin() {
  removeLeftovers();
  const std::shared_lock naming(Written::all().naming);
  if (kind_ == Kind::folder && ::mkdir(partial_.c_str(), 0777) != 0) fail("make", shown_, errno);
}

StagedOutput::~StagedOutput() {
  std::error_code ignored;
  if (!committed_) fs::remove_all(partial_, ignored);
  Written::all().erase(target_);
}

void StagedOutput::leaveFlushOut() { flushes = false; }

void StagedOutput::acceptExisting() { accepts_existing = true; }

void StagedOutput::abandonAll(std::chrono::milliseconds patience) {
  // Never unlocked. A write to a network disk that does not answer may hold it: then go on without.
  (void)Written::all().naming.try_lock_for(patience);
  const std::vector<fs::path> paths = Written::all().partials();
  const auto end = std::chrono::steady_clock::now() + patience;
  for (const fs::path& path : paths) removeUntil(path, end);
  // A disk may take milliseconds for each of thousands of slices.
  if (std::none_of(paths.begin(), paths.end(), isThere) || removedBehind(paths)) return;
  for (const fs::path& path : paths)
    removeUntil(path, std::chrono::steady_clock::time_point::max());
}

void StagedOutput::removeLeftovers() const {
  std::error_code ignored;
  for (const fs::directory_entry& entry : fs::directory_iterator(parentOf(target_), ignored)) {
    const auto name = parseStagingName(target_, entry.path().filename().string());
    if (name && name->abandoned) fs::remove_all(entry.path(), ignored);
  }
}

fs::path StagedOutput::placeOf(const std::string& name) const {
  if (const auto problem = relativePathProblem(name))
    throw DataError("cannot write " + quoted(shown_ / name) + ": the name " + *problem);
  fs::path path = partial_ / name;
  std::error_code error;
  if (path.parent_path() != partial_) fs::create_directories(path.parent_path(), error);
  if (error) fail("make", (shown_ / name).parent_path(), error.value());
  return path;
}

void StagedOutput::link(const std::string& name, const fs::path& from) const {
  const std::shared_lock naming(Written::all().naming);
  const fs::path path = placeOf(name);
  std::error_code error;
  fs::create_hard_link(from, path, error);
  if (error && error != std::errc::file_exists) fs::copy_file(from, path, error);
  if (error) fail("write", shown_ / name, error.value());
}

void StagedOutput::write(const std::string& name, std::span<const std::uint8_t> bytes) const {
  const std::shared_lock naming(Written::all().naming);
  const fs::path path = placeOf(name);
  writeBytes(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666), bytes,
             shown_ / name);
}

void StagedOutput::complete() {
  throwIfInterrupted();
  const std::shared_lock naming(Written::all().naming);
  // Before the output has its name: a machine that loses power must not leave an empty one. One
  // call for a whole folder, whose files one by one take some 8 ms each.
  if (const int error = flushed(partial_, kind_ == Kind::folder ? ::syncfs : ::fsync))
    fail("write", shown_, error);
  completed_ = true;
}

void StagedOutput::commit() {
  if (!completed_) complete();
  const std::shared_lock naming(Written::all().naming);
  Written::all().forgetPartial(target_);
  if (kind_ == Kind::folder) {
    commitFolder();
  } else {
    commitFile();
  }
  committed_ = true;
  // The name itself. The output is whole with or without it.
  flushed(parentOf(target_), ::fsync);
}

void StagedOutput::commitFile() {
  if (!Written::all().replaces(target_)) {
    if (renamed(partial_, target_, RENAME_NOREPLACE)) return;
    const int error = errno;
    if (isThere(target_)) keepBeside(EEXIST);
    const bool knows_the_flag = error != EINVAL && error != ENOSYS;
    if (knows_the_flag) fail("write", shown_, error);
  }
  if (!renamed(partial_, target_)) fail("write", shown_, errno);
}

void StagedOutput::commitFolder() {
  std::error_code ignored;
  if (!isThere(target_)) {
    if (renamed(partial_, target_)) return;
    if (errno != ENOTEMPTY && errno != EEXIST) fail("write", shown_, errno);
  }
  if (!fs::is_directory(target_, ignored)) keepBeside(ENOTDIR);
  if (!Written::all().replaces(target_) && !fs::is_empty(target_, ignored)) keepBeside(EEXIST);
  if (renamed(partial_, target_, RENAME_EXCHANGE)) {
    committed_ = true;
    retire(partial_);
    return;
  }
  fs::path old = partial_;
  old += put_aside;
  if (!renamed(target_, old)) keepBeside(errno);
  if (!renamed(partial_, target_)) {
    const int error = errno;
    renamed(old, target_);
    keepBeside(error);
  }
  committed_ = true;
  retire(old);
}

/// A run of hours is not lost because its output cannot take its place: some file systems refuse
/// only now.
void StagedOutput::keepBeside(int error) {
  fs::path kept = target_;
  kept += ".new";
  if (isThere(kept) || !renamed(partial_, kept)) fail("replace", shown_, error);
  committed_ = true;
  throw DataError("cannot replace " + quoted(shown_) + ": " +
                  std::generic_category().message(error) + "; the new one is " + quoted(kept));
}

/// Moves files of others from the folder that was replaced to where they were, then deletes it.
/// They are moved first: what remains if the process is killed is the program's own.
void StagedOutput::retire(const fs::path& old) const {
  std::error_code ignored;
  std::set<std::string> own;
  try {
    if (own_) own = own_(old);
  } catch (const Error&) {
    // It cannot be known any more which files these are, so all of them stay.
  }
  std::vector<fs::path> folders{old};
  for (const fs::directory_entry& entry : entriesBelow(old)) {
    const fs::path name = entry.path().lexically_relative(old);
    if (isFolder(entry)) {
      folders.push_back(entry.path());
    } else if (!own.contains(name.string()) && !isThere(target_ / name)) {
      fs::create_directories((target_ / name).parent_path(), ignored);
      fs::rename(entry.path(), target_ / name, ignored);
    }
  }
  Written::all().rememberRemains(target_, old);
  for (const fs::directory_entry& entry : entriesBelow(old)) {
    // Own files, and those that a file of the new output replaces.
    const fs::path name = entry.path().lexically_relative(old);
    if (!isFolder(entry) && (own.contains(name.string()) || isThere(target_ / name)))
      fs::remove(entry.path(), ignored);
  }
  std::reverse(folders.begin(), folders.end());
  for (const fs::path& folder : folders) fs::remove(folder, ignored);
}

void writeFile(const fs::path& path, std::span<const std::uint8_t> bytes, const fs::path& shown) {
  writeBytes(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666), bytes, shown);
}

}  // namespace vdbdither
