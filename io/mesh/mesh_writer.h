#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// What the vertices of a mesh file carry besides their positions. STL and OBJ carry nothing.
struct VertexExtras {
  bool colour = false;   ///< PLY's red, green, blue
  bool quality = false;  ///< PLY's quality, as MeshLab calls a scalar per vertex
  std::string comment;   ///< a line of PLY's header
};

/// A mesh on its way into a file: binary STL, OBJ or binary little-endian PLY, by the name's
/// extension. It comes in pieces, and only what later pieces still need is kept in memory.
/// Coordinates are floats. The file appears when it is complete.
class MeshWriter {
 public:
  /// Whether `path` names a mesh file that can be written. Throws UsageError.
  static void check(const std::filesystem::path& path, bool overwrite);

  /// Throws DataError.
  explicit MeshWriter(const std::filesystem::path& path, VertexExtras extras = {});
  MeshWriter(const MeshWriter&) = delete;
  MeshWriter& operator=(const MeshWriter&) = delete;
  ~MeshWriter();

  /// Adds vertices (mm) behind those before, and triangles that count them all. Throws DataError
  /// when the disk is full or the format cannot count so many.
  /// @param colours    sRGB of each of the vertices, where the extras have a colour
  /// @param qualities  a number for each of the vertices, where the extras have one
  /// @param open_from  no later triangle has a vertex before this
  void add(std::span<const openvdb::Vec3d> vertices, std::span<const Mesh::Triangle> triangles,
           std::uint32_t open_from, std::span<const std::array<std::uint8_t, 3>> colours = {},
           std::span<const float> qualities = {});

  /// Completes the file and gives it its name.
  void commit();

  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }

 private:
  class Format;
  class Indexed;
  class Stl;
  class Obj;
  class Ply;

  std::unique_ptr<Format> format_;
  std::uint64_t vertices_ = 0;
  std::uint64_t triangles_ = 0;
};

}  // namespace vdbdither
