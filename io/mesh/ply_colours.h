#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "io/mesh/encoded_colours.h"
#include "io/mesh/mesh_file.h"
#include "io/mesh/ply_header.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// The colours of a PLY file, gathered while its elements are read. The properties are those that
/// MeshLab and other programs write; the format names none. The most specific colour of a triangle
/// counts: a texture, else the colours of its vertices, else that of its face.
class PlyColours {
 public:
  PlyColours(const MeshFile& file, const PlyHeader& header);

  /// Starts with the vertices, or with an element of faces.
  void begin(const PlyElement& element);
  /// Whether a scalar is one of a colour's, or a list that of texture coordinates.
  [[nodiscard]] bool takes(std::size_t property) const { return slots_[property] != Slot::none; }
  /// Takes the scalar, or an item of the list.
  void take(std::size_t property, double value);
  void endVertex();
  /// @param places     see PolygonCollector::places; empty for strips
  /// @param corners    how many the face has
  /// @param triangles  how many were made of it
  void endFace(std::span<const Mesh::Triangle> places, std::size_t corners, std::size_t triangles);

  /// @param mesh  before vertices are dropped. Returns null where it has no colours.
  std::shared_ptr<const Appearance> finish(const Mesh& mesh);

 private:
  enum class Slot : std::uint8_t { red, green, blue, opacity, u, v, texture, coordinates, none };
  static constexpr std::uint32_t no_texture = SurfaceMaterial::no_texture;

  [[nodiscard]] static Slot slotOf(const PlyProperty& property);
  void addColour(std::optional<EncodedColours>& colours, std::size_t index);
  [[nodiscard]] bool hasSlot(Slot slot) const;
  [[nodiscard]] std::optional<Appearance::Coordinates> coordinatesOf(const Mesh& mesh,
                                                                     std::size_t triangle) const;

  const MeshFile& file_;
  const std::vector<std::string>& texture_files_;
  std::vector<Slot> slots_;  ///< by property of the element
  std::array<double, 7> record_{};
  double unit_ = 1;          ///< of the element's colours
  double opacity_unit_ = 1;  ///< the same of its opacities
  bool has_colours_ = false;
  bool has_opacity_ = false;
  bool has_coordinates_ = false;
  std::vector<double> list_;

  std::size_t vertices_ = 0;
  std::optional<EncodedColours> vertex_colours_;
  std::vector<openvdb::Vec2f> vertex_coordinates_;
  std::optional<EncodedColours> face_colours_;    ///< by triangle
  std::vector<std::uint32_t> texture_;            ///< by triangle
  std::vector<Appearance::Coordinates> corners_;  ///< by triangle; NaN where a face has none
  std::size_t lost_textures_ = 0;
};

}  // namespace vdbdither
