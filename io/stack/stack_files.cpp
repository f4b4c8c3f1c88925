#include "io/stack/stack_files.h"

#include <cerrno>
#include <cstring>
#include <fstream>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

StagedOutput::Kind kindOf(const fs::path& target) {
  return target.extension() == ".zip" ? StagedOutput::Kind::file : StagedOutput::Kind::folder;
}

}  // namespace

void StackOutput::check(const fs::path& target, bool overwrite) {
  StagedOutput::check(target, kindOf(target), overwrite);
  if (kindOf(target) == StagedOutput::Kind::folder && fs::exists(target) && !fs::is_empty(target) &&
      !fs::exists(target / manifest_name)) {
    throw UsageError("'" + target.string() + "' holds no " + manifest_name +
                     ", so it is no stack of slices to overwrite; name another folder");
  }
}

StackOutput::StackOutput(const fs::path& target) : staged_(target, kindOf(target)) {
  if (kindOf(target) == StagedOutput::Kind::file)
    zip_ = std::make_unique<ZipWriter>(staged_.path(), target);
}

void StackOutput::write(const std::string& name, std::span<const std::uint8_t> bytes) {
  if (zip_) {
    zip_->add(name, bytes);
  } else {
    staged_.write(name, bytes);
  }
}

void StackOutput::commit() {
  if (zip_) zip_->finish();
  staged_.commit();
}

StackInput::StackInput(const fs::path& path) : place_(path) {
  std::error_code none;
  if (fs::is_directory(path, none)) {
    if (!fs::exists(path / manifest_name, none)) {
      throw DataError("'" + path.string() + "' holds no " + manifest_name +
                      ", so it is no stack made by slice-export");
    }
  } else if (!fs::exists(path, none)) {
    throw DataError("no such file or folder '" + path.string() + "'");
  } else if (path.extension() == ".json") {
    place_ = path.parent_path();
  } else {
    zip_ = std::make_unique<ZipReader>(path);
    if (!zip_->contains(manifest_name)) {
      throw DataError("'" + path.string() + "' holds no " + manifest_name +
                      ", so it is no stack made by slice-export");
    }
  }
}

std::string StackInput::shown(const std::string& name) const { return (place_ / name).string(); }

bool StackInput::contains(const std::string& name) const {
  std::error_code none;
  return zip_ ? zip_->contains(name) : fs::is_regular_file(place_ / name, none);
}

std::vector<std::uint8_t> StackInput::read(const std::string& name) const {
  if (zip_) return zip_->read(name);
  errno = 0;
  std::ifstream file(place_ / name, std::ios::binary | std::ios::ate);
  std::vector<std::uint8_t> bytes;
  if (file) {
    bytes.resize(static_cast<std::size_t>(file.tellg()));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  if (!file) throw DataError("cannot read '" + shown(name) + "': " + std::strerror(errno));
  return bytes;
}

}  // namespace vdbdither
