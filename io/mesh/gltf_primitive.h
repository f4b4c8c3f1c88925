#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "io/mesh/gltf_accessors.h"
#include "io/mesh/gltf_buffers.h"
#include "io/mesh/gltf_json.h"
#include "io/mesh/gltf_materials.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// A joint that moves a vertex, and its share.
struct GltfBone {
  std::uint16_t joint = 0;
  float weight = 0;
};

/// Triangles with one material, as a glTF file has them.
struct GltfPrimitive {
  std::vector<openvdb::Vec3d> positions;  ///< finite, in the units of the file
  std::vector<Mesh::Triangle> triangles;  ///< indices into the positions, in range
  // By vertex, where the primitive has them.
  std::vector<openvdb::Vec2f> coordinates;
  std::vector<openvdb::Vec4f> colours;
  std::vector<std::array<GltfBone, 4>> bones;
  std::uint32_t material = 0;
  bool is_plain = true;  ///< of the default material, without colours and coordinates
};

/// What was passed over, to be warned of once.
struct GltfOmissions {
  std::uint64_t points_and_lines = 0;     ///< primitives
  std::uint64_t morph_targets = 0;        ///< primitives with some
  std::uint64_t missing_coordinates = 0;  ///< primitives whose texture has no coordinates
  std::uint64_t wild_coordinates = 0;     ///< texture coordinates and colours that are not finite
};

/// Reads the primitives of meshes.
class GltfPrimitives {
 public:
  GltfPrimitives(const MeshFile& file, const GltfValue& root, GltfBuffers& buffers,
                 GltfMaterials& materials)
      : file_(file), buffers_(buffers), materials_(materials), accessors_(file, root, buffers) {}

  /// Returns a primitive without triangles for points and lines.
  GltfPrimitive read(const GltfValue& json);

  [[nodiscard]] const GltfOmissions& omissions() const { return omissions_; }
  [[nodiscard]] GltfAccessors& accessors() { return accessors_; }

 private:
  /// Components of each vertex; none where the primitive does not have them.
  struct Values {
    std::uint32_t components = 0;
    std::vector<double> values;
  };
  /// Reads the attribute of this name. Integers of a fraction, such as a colour, count
  /// as normalized.
  using Source = std::function<Values(const std::string& name, bool is_fraction)>;

  GltfPrimitive readPlain(const GltfValue& json, std::uint64_t mode);
  GltfPrimitive readDraco(const GltfValue& json, const GltfValue& compression);
  /// All that belongs to the vertices of `primitive`, which has only triangles.
  void readVertices(const GltfValue& json, const Source& source, GltfPrimitive& primitive);
  static void readBones(const GltfValue& json, const Source& source, GltfPrimitive& primitive);
  void readLook(const GltfValue& json, const Source& source, GltfPrimitive& primitive);
  void readCoordinates(const Values& values, const GltfTextureTransform& transform,
                       GltfPrimitive& primitive);
  void readColours(const Values& values, bool has_opacity, GltfPrimitive& primitive);
  std::vector<std::uint32_t> cornersOf(const GltfValue& json, std::uint64_t vertices);
  /// @param vertices  which of the `count` vertices
  Values fromAccessor(const GltfValue& attribute, std::span<const std::uint32_t> vertices,
                      std::uint64_t count, bool is_fraction);

  const MeshFile& file_;
  GltfBuffers& buffers_;
  GltfMaterials& materials_;
  GltfAccessors accessors_;
  GltfOmissions omissions_;
};

}  // namespace vdbdither
