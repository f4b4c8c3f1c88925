#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>

#include "io/mesh/mesh_file.h"
#include "io/mesh/mesh_textures.h"
#include "io/mesh/threemf_model.h"
#include "io/mesh/threemf_package.h"

namespace vdbdither {

/// Collects the colours of triangles from the properties of 3MF objects.
class ThreemfAppearance {
 public:
  /// All parameters must outlive the object.
  /// @param unread  gets the kinds of properties that are passed over
  ThreemfAppearance(const MeshFile& file, ThreemfPackage& package, std::set<std::string>& unread)
      : file_(file), package_(package), unread_(unread), textures_(file) {}

  /// Adds the triangles of an object behind those that came before.
  /// @param is_turned  whether the second and third corner of each triangle are swapped
  void add(const ThreemfPart& part, const ThreemfObject& object, bool is_turned);

  /// Returns what was collected, or null where no triangle has a colour.
  std::shared_ptr<const Appearance> take();

 private:
  using Key = std::pair<const ThreemfPart*, std::uint32_t>;

  void addTriangle(const ThreemfPart& part, const ThreemfObject& object,
                   const ThreemfProperty& property, bool is_turned);
  void checkIndices(const ThreemfObject& object, const ThreemfProperty& property,
                    std::size_t count) const;
  std::uint32_t plainMaterial();
  std::uint32_t baseMaterial(const ThreemfPart& part, const ThreemfGroup& group,
                             const ThreemfProperty& property);
  std::uint32_t textureMaterial(const ThreemfPart& part, const ThreemfGroup& group);
  std::uint32_t textureOf(const ThreemfTexture& texture);
  std::uint32_t addMaterial(SurfaceMaterial material);
  template <class Value>
  void setForTriangle(std::vector<Value>& values, const Value& value, const Value& before);

  const MeshFile& file_;
  ThreemfPackage& package_;
  std::set<std::string>& unread_;
  Appearance appearance_;
  std::uint64_t triangles_ = 0;
  MeshTextures textures_;
  std::map<std::pair<Key, std::uint32_t>, std::uint32_t> material_of_base_;
  std::map<Key, std::uint32_t> material_of_texture_;
  std::map<std::string, std::uint32_t> texture_of_member_;
  Key last_key_{nullptr, 0};
  const ThreemfGroup* last_group_ = nullptr;
};

}  // namespace vdbdither
