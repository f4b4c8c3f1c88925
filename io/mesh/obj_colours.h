#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/encoded_colours.h"
#include "io/mesh/mesh_file.h"
#include "io/mesh/mesh_textures.h"
#include "io/mesh/mtl.h"
#include "io/mesh/text_cursor.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// What an OBJ file says of colours, gathered while it is read. The most specific colour of a
/// triangle counts: a texture times Kd, else the colours of its vertices, else Kd. Exporters write
/// the others too, as copies or as defaults.
class ObjColours {
 public:
  static constexpr auto none = std::numeric_limits<std::uint32_t>::max();

  explicit ObjColours(const MeshFile& file);

  /// Takes what follows the position of a vertex: a weight, or red, green, blue and, at times, the
  /// opacity.
  void addVertex(std::size_t vertex, TextCursor& text);
  /// Takes the numbers of a vt.
  void addCoordinates(const char* line, TextCursor& text);
  /// Takes the names of a mtllib.
  void addLibraries(std::string_view line) { libraries_.push_back(line); }

  /// Of the usemtl before a face; the material of faces before the first is `default_material`.
  std::uint32_t materialNamed(std::string_view name);
  static constexpr std::uint32_t default_material = 0;

  /// Returns the index of the texture coordinates of a corner like "v/vt/vn", counted from 0, or
  /// `none`. They need not be in range.
  [[nodiscard]] std::uint32_t coordinatesOf(std::string_view corner) const;

  /// Takes the triangles of a face.
  /// @param places       see PolygonCollector::places
  /// @param coordinates  by corner of the face
  void addFace(std::span<const Mesh::Triangle> places, std::span<const std::uint32_t> coordinates,
               std::uint32_t material);

  /// @param mesh  all faces, before vertices are dropped. Returns null where it has no colours.
  std::shared_ptr<const Appearance> finish(const Mesh& mesh);

 private:
  /// What the colour of a triangle is.
  enum class Source { texture, vertices, material };

  [[nodiscard]] bool hasColours(const Mesh::Triangle& triangle) const;
  /// Refuses coordinates out of range if there is a texture that needs them.
  [[nodiscard]] bool hasCoordinates(std::size_t triangle, const std::string& texture) const;
  void readLibraries();
  void readLibrary(std::string_view path);
  void readNamedLibraries(std::string_view line, std::set<std::string_view>& named);
  std::uint32_t variant(std::uint32_t material, Source source, Appearance& appearance);
  [[nodiscard]] Appearance::Coordinates placed(std::size_t triangle,
                                               const MtlMaterial& material) const;
  void warnOfWhatIsMissing() const;

  const MeshFile& file_;
  MeshTextures textures_;
  std::vector<std::string_view> libraries_;  ///< lines
  std::size_t missing_libraries_ = 0;
  std::string first_missing_library_;
  std::uint64_t library_bytes_left_ = std::uint64_t{1} << 26;  ///< some hundred are a material
  std::map<std::string_view, std::uint32_t> material_indices_;
  std::vector<std::string_view> material_names_;  ///< in the order of their first use
  std::map<std::string, MtlMaterial, std::less<>> defined_;
  std::vector<const MtlMaterial*> materials_;  ///< by index; null where a name is not defined
  std::map<std::pair<std::uint32_t, Source>, std::uint32_t> variants_;

  EncodedColours vertex_colours_;
  std::vector<openvdb::Vec2d> coordinates_;
  std::vector<Mesh::Triangle> corners_;  ///< by triangle, indices of coordinates
  std::vector<std::uint32_t> material_;  ///< by triangle
  std::size_t lost_textures_ = 0;        ///< triangles without coordinates
};

}  // namespace vdbdither
