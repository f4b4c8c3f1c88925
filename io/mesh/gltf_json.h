#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <nlohmann/json_fwd.hpp>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// A value in the JSON text of a glTF file, or its absence, and its path, by which messages call
/// it: "accessors[3].count". Every function refuses a value of another type.
class GltfValue {
 public:
  /// @param json  null for a value that is absent
  GltfValue(const MeshFile& file, const nlohmann::json* json, std::string path)
      : file_(&file), json_(json), path_(std::move(path)) {}

  [[nodiscard]] bool exists() const { return json_ != nullptr; }
  [[nodiscard]] const std::string& path() const { return path_; }

  /// The member of an object; absent where the object is.
  [[nodiscard]] GltfValue operator[](std::string_view key) const;
  /// Whether the object has a member.
  [[nodiscard]] bool has(std::string_view key) const { return (*this)[key].exists(); }
  /// The length of an array; 0 where it is absent.
  [[nodiscard]] std::size_t size() const;
  /// An element of an array. Refuses an index that is out of range.
  [[nodiscard]] GltfValue at(std::uint64_t index) const;

  /// A whole number from 0 to 2⁵³. Refuses absence.
  [[nodiscard]] std::uint64_t count() const;
  [[nodiscard]] std::uint64_t count(std::uint64_t otherwise) const;
  /// Finite.
  [[nodiscard]] double number(double otherwise) const;
  [[nodiscard]] std::string_view text() const;
  [[nodiscard]] bool flag() const;  ///< false where it is absent

  /// "PATH WHY; export the file again"
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  const MeshFile* file_;
  const nlohmann::json* json_;
  std::string path_;
};

/// The parsed text.
class GltfJson {
 public:
  /// Refuses what is no JSON, nested too deeply or of too many values.
  /// @param text  part of the bytes of `file`
  GltfJson(const MeshFile& file, std::string_view text);
  GltfJson(const GltfJson&) = delete;
  GltfJson& operator=(const GltfJson&) = delete;
  ~GltfJson();

  [[nodiscard]] GltfValue root() const;

 private:
  const MeshFile& file_;
  std::unique_ptr<nlohmann::json> json_;
};

}  // namespace vdbdither
