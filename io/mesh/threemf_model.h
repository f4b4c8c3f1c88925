#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/appearance.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

// What the reader of 3MF keeps of a model part, the XML file that describes objects. Lengths are in
// mm. Ids and indices are as in the file, not checked, where nothing else is said.

/// An affine map. Rows are the images of the axes and of the origin: p becomes (p, 1) · rows.
struct ThreemfTransform {
  std::array<openvdb::Vec3d, 4> rows{openvdb::Vec3d(1, 0, 0), openvdb::Vec3d(0, 1, 0),
                                     openvdb::Vec3d(0, 0, 1), openvdb::Vec3d(0, 0, 0)};

  [[nodiscard]] bool isIdentity() const { return rows == ThreemfTransform().rows; }
  [[nodiscard]] openvdb::Vec3d of(const openvdb::Vec3d& p) const;
  /// The map that applies this one first and `next` then.
  [[nodiscard]] ThreemfTransform then(const ThreemfTransform& next) const;
  [[nodiscard]] double determinant() const { return rows[0].dot(rows[1].cross(rows[2])); }
};

/// A placed object: a component of another one, or an item of what is printed.
struct ThreemfUse {
  std::string path;  ///< of the object's model part; empty for the same one
  std::uint32_t object = 0;
  ThreemfTransform transform;
};

/// The properties of a triangle's corners, or of an object's triangles.
struct ThreemfProperty {
  static constexpr std::uint32_t no_group = ~std::uint32_t{0};

  std::uint32_t group = no_group;
  std::array<std::uint32_t, 3> index{};
};

struct ThreemfObject {
  std::uint32_t id = 0;
  std::string name;                         ///< printable; may be empty
  bool is_printed = true;                   ///< a model or a surface, no support
  std::vector<openvdb::Vec3d> vertices;     ///< finite
  std::vector<Mesh::Triangle> triangles;    ///< indices in range
  ThreemfProperty property;                 ///< of triangles that have none
  std::vector<ThreemfProperty> properties;  ///< of the first triangles; the others have none
  std::vector<ThreemfUse> components;
};

/// Red, green, blue in sRGB, and the opacity.
using ThreemfColour = std::array<std::uint8_t, 4>;

struct ThreemfBaseMaterial {
  std::string name;  ///< printable
  ThreemfColour colour{255, 255, 255, 255};
};

struct ThreemfTexture {
  std::string path;  ///< in the archive
  std::array<TextureWrap, 2> wrap{TextureWrap::repeat, TextureWrap::repeat};
  bool is_smooth = true;
};

/// A list that properties index. At most one of its vectors has elements.
struct ThreemfGroup {
  std::vector<ThreemfBaseMaterial> materials;
  std::vector<ThreemfColour> colours;
  std::uint32_t texture = 0;
  std::vector<openvdb::Vec2f> coordinates;  ///< v from top to bottom
  bool is_read = true;                      ///< or of a kind that is passed over
};

struct ThreemfPart {
  std::string name;  ///< in the archive
  std::vector<ThreemfObject> objects;
  std::map<std::uint32_t, std::size_t> object_of_id;  ///< indices of `objects`
  std::map<std::uint32_t, ThreemfGroup> groups;
  std::map<std::uint32_t, ThreemfTexture> textures;
  std::vector<ThreemfUse> items;
  std::size_t left_out = 0;  ///< items that the file marks as not printable
};

}  // namespace vdbdither
