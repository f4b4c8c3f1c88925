#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include <openvdb/Types.h>

#include "io/file/buffered_file.h"
#include "io/file/staged_output.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// What the vertices of a mesh file carry besides their positions.
struct VertexExtras {
  bool colour = false;   ///< red, green, blue, sRGB
  bool quality = false;  ///< a scalar, which MeshLab calls quality
  std::string comment;   ///< a line that explains them
};

/// How a mesh file is to be written.
struct MeshEncoding {
  VertexExtras extras;
  /// Compression by Draco, of formats that take it, and the maximum error of a coordinate in mm. Of
  /// 0, nothing is rounded.
  std::optional<double> draco_mm;
};

struct MeshVertex {
  openvdb::Vec3s position;               ///< mm
  std::array<std::uint8_t, 3> colour{};  ///< where the extras have one
  float quality = 0;                     ///< where the extras have one
};

/// Writes a mesh in one format as its vertices and triangles come. The file appears under its name
/// when it is committed. Every function throws DataError where the file cannot be written.
class MeshEncoder {
 public:
  explicit MeshEncoder(const std::filesystem::path& path);
  virtual ~MeshEncoder() = default;

  virtual void vertex(const MeshVertex& vertex) = 0;
  /// @param triangle  indices of vertices that came before it, counted from 0
  virtual void triangle(const Mesh::Triangle& triangle) = 0;
  /// Says that no later triangle has a vertex before this one.
  virtual void forgetBefore(std::uint32_t /*vertex*/) {}

  /// Completes the file.
  /// @param vertices, triangles  how many came
  void complete(std::uint64_t vertices, std::uint64_t triangles);
  /// Gives the complete file its name.
  void commit() { staged_.commit(); }

 protected:
  /// Writes what can be written only at the end.
  virtual void finish(std::uint64_t vertices, std::uint64_t triangles) = 0;

  StagedOutput staged_;
  BufferedFile file_;
};

/// An encoder of a format with all vertices before all faces. The faces wait in a second file,
/// which has no name; `finish` must append it to the first.
class IndexedMeshEncoder : public MeshEncoder {
 public:
  explicit IndexedMeshEncoder(const std::filesystem::path& path);

 protected:
  BufferedFile faces_;

 private:
  [[nodiscard]] std::filesystem::path facesPath() const;
};

}  // namespace vdbdither
