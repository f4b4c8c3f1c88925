#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/file/zip.h"
#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// The zip archive of a 3MF file. Throws DataError naming the file.
class ThreemfPackage {
 public:
  /// @param file  must outlive the object
  explicit ThreemfPackage(const MeshFile& file);

  /// The name of the model part that the archive's relationships start from.
  [[nodiscard]] std::string root();

  /// Returns the name of the member that `path` leads to. Upper and lower case are the same, and
  /// `%20` is a blank.
  /// @param kind  what messages call it: "model"
  [[nodiscard]] std::string find(std::string_view kind, std::string_view path) const;
  [[nodiscard]] bool contains(std::string_view path) const;
  [[nodiscard]] std::string shown(const std::string& member) const;

  /// Passes a model part on in pieces. Refuses encrypted ones, and archives whose model parts
  /// inflate too much.
  void readModel(const std::string& member,
                 const std::function<void(std::span<const std::uint8_t>)>& take);
  [[nodiscard]] std::vector<std::uint8_t> read(const std::string& member, std::uint64_t most_bytes);

 private:
  const MeshFile& file_;
  ZipReader zip_;
  std::map<std::string, std::string, std::less<>> member_of_path_;
  std::uint64_t inflated_ = 0;
};

}  // namespace vdbdither
