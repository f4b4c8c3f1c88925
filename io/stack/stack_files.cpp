#include "io/stack/stack_files.h"

#include <algorithm>
#include <limits>

#include "io/file/file_name.h"
#include "io/file/files_read.h"
#include "io/file/whole_file.h"
#include "io/stack/slice_format.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

StagedOutput::Kind kindOf(const fs::path& target) {
  return namesArchive(target) ? StagedOutput::Kind::file : StagedOutput::Kind::folder;
}

/// What slice-export wrote into `folder`, by its manifest.
std::set<std::string> filesOfStack(const fs::path& folder) {
  std::error_code none;
  if (!fs::exists(folder / manifest_name, none)) {
    throw UsageError("'" + folder.string() + "' holds no " + manifest_name +
                     ", so it is not a stack of slices to overwrite; name another folder");
  }
  try {
    std::set<std::string> names = filesNamedBy(StackInput(folder));
    names.insert({manifest_name, preview_name});
    return names;
  } catch (const DataError& error) {
    throw UsageError(std::string(error.what()) +
                     "; which files are the stack's is unknown, so delete the folder or name "
                     "another one");
  }
}

/// The same path without what follows the name of a folder.
fs::path unslashed(const fs::path& path) { return path.has_filename() ? path : path.parent_path(); }

}  // namespace

bool namesArchive(const fs::path& path) {
  return equalsIgnoringCase(unslashed(path).extension().string(), archive_ending) ||
         sliceFormatOfContainer(unslashed(path)) != nullptr;
}

void StackOutput::check(const fs::path& target, bool overwrite,
                        const std::function<void(const std::string&)>& warn) {
  if (kindOf(target) == StagedOutput::Kind::file) {
    StagedOutput::check(target, StagedOutput::Kind::file, overwrite);
  } else {
    StagedOutput::checkFolder(target, overwrite, filesOfStack, warn);
  }
}

StackOutput::StackOutput(const fs::path& target)
    : shown_(target), staged_(target, kindOf(target), filesOfStack) {
  if (kindOf(target) == StagedOutput::Kind::file)
    zip_ = std::make_unique<ZipWriter>(staged_.path(), target);
}

void StackOutput::write(const std::string& name, std::span<const std::uint8_t> bytes) {
  if (zip_) {
    if (const auto problem = relativePathProblem(name))
      throw DataError("cannot write '" + shown_.string() + "': the name '" + name + "' " +
                      *problem);
    zip_->add(name, bytes);
  } else {
    staged_.write(name, bytes);
  }
}

void StackOutput::copy(const std::string& name, const fs::path& from) {
  constexpr auto unlimited = std::numeric_limits<std::uint64_t>::max();
  if (zip_) {
    write(name, readWholeFile(from, "'" + from.string() + "'", unlimited));
  } else {
    staged_.link(name, from);
  }
}

void StackOutput::complete() {
  if (zip_) zip_->finish();
  staged_.complete();
}

StackInput::StackInput(const fs::path& path) : place_(path), manifest_name_(manifest_name) {
  std::error_code none;
  const fs::file_status status = fs::status(path, none);
  if (!fs::exists(status)) throw DataError("no such file or folder '" + path.string() + "'");
  if (!fs::is_directory(status) && equalsIgnoringCase(path.extension().string(), ".json")) {
    place_ = path.parent_path();
    manifest_name_ = path.filename().string();
  } else if (!fs::is_directory(status)) {
    zip_ = std::make_unique<ZipReader>(path);
  }
  if (contains(manifest_name_)) return;
  if (auto described = describedStack(*this)) {
    manifest_name_ = described->file;
    described_ = std::make_shared<const DescribedStack>(*std::move(described));
  } else {
    throw DataError("'" + path.string() + "' holds no " + manifest_name +
                    ", so it is not a stack made by slice-export");
  }
}

StackInput StackInput::withoutManifest(const fs::path& path) {
  StackInput input;
  input.place_ = path;
  std::error_code none;
  const fs::file_status status = fs::status(path.empty() ? "." : path, none);
  if (!fs::exists(status)) throw DataError("no such file or folder '" + path.string() + "'");
  if (!fs::is_directory(status)) input.zip_ = std::make_unique<ZipReader>(path);
  return input;
}

StackInput StackInput::putBack(const fs::path& path,
                               const std::function<void(const std::string&)>& warn) {
  std::error_code none;
  if (!path.empty() && fs::status(path, none).type() == fs::file_type::not_found)
    StagedOutput::putBack(path, warn);
  return StackInput(path);
}

std::string StackInput::shown(const std::string& name) const { return (place_ / name).string(); }

bool StackInput::contains(const std::string& name) const {
  std::error_code none;
  // What cannot be looked at is there until reading it tells why not.
  return zip_ ? zip_->contains(name)
              : fs::symlink_status(place_ / name, none).type() != fs::file_type::not_found;
}

std::vector<std::string> StackInput::names() const {
  if (zip_) return zip_->names();
  const fs::path folder = place_.empty() ? "." : place_;
  std::vector<std::string> names;
  std::error_code error;
  constexpr auto skip = fs::directory_options::skip_permission_denied;
  for (fs::recursive_directory_iterator entry(folder, skip, error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->symlink_status().type() != fs::file_type::directory)
      names.push_back(entry->path().lexically_relative(folder).string());
  }
  if (error) throw DataError("cannot read '" + folder.string() + "': " + error.message());
  std::sort(names.begin(), names.end());
  return names;
}

void StackInput::noteRead(const std::string& name) const {
  if (!zip_) noteFileRead(place_ / name);
}

/// Names do not climb out of the stack, so only links lead out.
void StackInput::refuseLinkOutside(const std::string& name) const {
  std::error_code error;
  for (fs::path part = name; !part.empty(); part = part.parent_path()) {
    if (!fs::is_symlink(fs::symlink_status(place_ / part, error))) continue;
    const fs::path stack = fs::canonical(place_.empty() ? "." : place_, error);
    const fs::path file = error ? fs::path() : fs::canonical(place_ / name, error);
    if (error) throw DataError("cannot read '" + shown(name) + "': " + error.message());
    if (std::mismatch(stack.begin(), stack.end(), file.begin(), file.end()).first == stack.end())
      return;
    throw DataError("'" + shown(name) + "' is a link to '" + file.string() +
                    "', which is outside the stack; copy the file into the stack");
  }
}

void StackInput::check(const std::string& name, std::uint64_t most_bytes) const {
  std::uint64_t bytes = 0;
  const std::string file = "'" + shown(name) + "'";
  if (zip_) {
    bytes = zip_->size(name);
  } else {
    refuseLinkOutside(name);
    std::error_code error;
    if (!fs::is_regular_file(fs::status(place_ / name, error)))
      throw DataError(file + " is not an ordinary file");
    bytes = fs::file_size(place_ / name, error);
    if (error) throw DataError("cannot read " + file + ": " + error.message());
  }
  if (bytes > most_bytes) throw DataError(tooLarge(file, bytes, most_bytes));
}

std::vector<std::uint8_t> StackInput::read(const std::string& name,
                                           std::uint64_t most_bytes) const {
  if (zip_) return zip_->read(name, most_bytes);
  refuseLinkOutside(name);
  return readWholeFile(place_ / name, "'" + shown(name) + "'", most_bytes);
}

}  // namespace vdbdither
