#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/gltf_buffers.h"
#include "io/mesh/gltf_json.h"

namespace vdbdither {

/// An accessor whose data lie within the bytes of the file.
struct GltfAccessor {
  enum class Type : std::uint16_t {
    int8 = 5120,
    uint8 = 5121,
    int16 = 5122,
    uint16 = 5123,
    uint32 = 5125,
    float32 = 5126,
  };

  std::string path;  ///< "accessors[3]"
  Type type = Type::float32;
  std::uint32_t components = 1;
  std::uint64_t count = 0;
  bool is_normalized = false;
  const char* data = nullptr;  ///< null: all zeros
  std::uint64_t stride = 0;
  /// Elements that replace some of the data: their indices, ascending, and the elements, packed.
  std::vector<std::uint32_t> sparse_indices;
  const char* sparse_data = nullptr;
};

/// The accessors of a glTF file.
class GltfAccessors {
 public:
  GltfAccessors(const MeshFile& file, const GltfValue& root, GltfBuffers& buffers)
      : file_(file), root_(root), buffers_(buffers) {}

  /// Refuses one that does not exist, has no possible type or reaches beyond its data. The result
  /// stays valid.
  const GltfAccessor& at(std::uint64_t index);

 private:
  GltfAccessor read(std::uint64_t index);
  void readSparse(const GltfValue& json, GltfAccessor& accessor);

  const MeshFile& file_;
  GltfValue root_;
  GltfBuffers& buffers_;
  std::map<std::uint64_t, GltfAccessor> accessors_;
};

/// Returns the components of the elements with these indices, in their order; normalized integers
/// as −1 … 1.
/// @param elements  each less than the count
std::vector<double> elementsOf(const GltfAccessor& accessor,
                               std::span<const std::uint32_t> elements);

/// Returns the first component of all elements of unsigned integers, as indices are stored.
std::vector<std::uint32_t> indicesOf(const GltfAccessor& accessor);

}  // namespace vdbdither
