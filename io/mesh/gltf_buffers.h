#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh/gltf_json.h"
#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// Bytes that a glTF file or a file beside it holds.
struct GltfBytes {
  std::string_view bytes;
  std::string shown;  ///< what messages call them
};

/// The buffers and buffer views of a glTF file. They are read and decompressed when they are
/// needed, each once, and what is returned stays valid. Nothing outside of the folder of the file
/// is read.
class GltfBuffers {
 public:
  struct View {
    std::string_view bytes;
    std::uint64_t stride = 0;  ///< between elements; 0 if they are packed
  };

  /// @param binary_chunk  of a GLB, where it has one
  GltfBuffers(const MeshFile& file, const GltfValue& root,
              std::optional<std::string_view> binary_chunk)
      : file_(file), root_(root), binary_chunk_(binary_chunk) {}

  /// Throws DataError for a view that does not exist or lies outside of its buffer.
  View view(std::uint64_t index);

  /// What a URI leads to. Refuses what lies elsewhere.
  /// @param kind  what messages call it: "texture"
  GltfBytes resource(std::string_view kind, const GltfValue& uri, std::uint64_t most_bytes);

  /// Accounts for memory that the file asks for beyond its own bytes. Refuses a file that asks for
  /// much more than its size justifies: an accessor or a mesh can be used any number of times.
  void takeMemory(std::uint64_t bytes);

 private:
  std::string_view buffer(std::uint64_t index);
  /// Bytes of a buffer that `range`, a view or an extension of one, names.
  std::string_view bytesOf(const GltfValue& range);
  View decompressed(std::uint64_t index, const GltfValue& compression);
  std::string_view keep(std::vector<std::uint8_t> bytes);

  const MeshFile& file_;
  GltfValue root_;
  std::optional<std::string_view> binary_chunk_;
  std::map<std::uint64_t, std::string_view> buffers_;
  std::map<std::uint64_t, View> decompressed_;
  std::map<std::string, GltfBytes, std::less<>> files_;  ///< by path
  std::vector<std::vector<std::uint8_t>> kept_;
  std::uint64_t bytes_read_ = 0;
  std::uint64_t memory_ = 0;
};

}  // namespace vdbdither
