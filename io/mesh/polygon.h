#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <openvdb/Types.h>

#include "io/mesh/mesh_file.h"
#include "vdbdither/model/mesh.h"

namespace vdbdither {

/// Cuts a polygon into `polygon.size() - 2` triangles and appends them to `triangles`. Where the
/// polygon, seen along its mean normal, does not cross itself, they cover it exactly and all turn
/// the same way; it may be concave and touch itself, as around a hole that a slit joins to the rim.
///
/// @param vertices  positions
/// @param polygon   3 to some thousand indices into `vertices`; the time grows with the square at
/// worst
/// @param places    if not null, gets the same triangles as positions in `polygon`
void triangulate(const std::vector<openvdb::Vec3d>& vertices,
                 std::span<const std::uint32_t> polygon, std::vector<Mesh::Triangle>& triangles,
                 std::vector<Mesh::Triangle>* places = nullptr);

/// Takes the faces of a polygon file into a mesh of triangles, and counts the ones that are none.
class PolygonCollector {
 public:
  PolygonCollector(const MeshFile& file, Mesh& mesh) : file_(file), mesh_(mesh) {}

  /// Corners are indices into the mesh's vertices, in range. `position` is where the file has them.
  void add(std::span<const std::uint32_t> corners, const char* position);

  /// Keeps the places of every polygon that is added from here on.
  void keepPlaces() { keeps_places_ = true; }
  /// The triangles of the polygon that was added last, in their order, as positions in it.
  [[nodiscard]] std::span<const Mesh::Triangle> places() const { return places_; }

  /// Warns of faces with fewer than three corners.
  void finish() const;

 private:
  static constexpr std::size_t most_corners = 4096;

  const MeshFile& file_;
  Mesh& mesh_;
  std::size_t incomplete_ = 0;
  bool keeps_places_ = false;
  std::vector<Mesh::Triangle> places_;
};

}  // namespace vdbdither
