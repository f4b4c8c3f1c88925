#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include <openvdb/Types.h>

#include "io/mesh/mesh_format.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// A mesh on its way into a file of one of the `meshFormats`, by the ending of its name. It comes
/// in pieces, and only what later pieces still need is kept in memory. Coordinates are floats. The
/// file appears when it is committed.
class MeshWriter {
 public:
  /// Checks that `path` names a mesh file that can be written. Throws UsageError.
  static void check(const std::filesystem::path& path, bool overwrite);

  /// @param how  a format passes over extras that it does not hold, and over Draco
  /// Throws DataError.
  explicit MeshWriter(const std::filesystem::path& path, const MeshEncoding& how = {});

  /// Adds vertices (mm) behind those before, and triangles that count them all. Throws DataError
  /// when the disk is full or the format cannot count so many.
  /// @param colours    sRGB of each of the vertices, where the extras have a colour
  /// @param qualities  a number for each of the vertices, where the extras have one
  /// @param open_from  no later triangle has a vertex before this
  void add(std::span<const openvdb::Vec3d> vertices, std::span<const Mesh::Triangle> triangles,
           std::uint32_t open_from, std::span<const std::array<std::uint8_t, 3>> colours = {},
           std::span<const float> qualities = {});

  /// Completes the file. Throws DataError.
  void complete();
  /// Gives the file its name, once it is complete. Throws DataError.
  void commit();

  [[nodiscard]] std::uint64_t vertices() const { return vertices_; }
  [[nodiscard]] std::uint64_t triangles() const { return triangles_; }

 private:
  const MeshFormat& format_;
  std::unique_ptr<MeshEncoder> encoder_;
  std::uint64_t vertices_ = 0;
  std::uint64_t triangles_ = 0;
  bool completed_ = false;
};

}  // namespace vdbdither
