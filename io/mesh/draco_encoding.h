#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "io/mesh/mesh_encoder.h"
#include "vdbdither/model/mesh.h"

namespace draco {
class Mesh;
}  // namespace draco

namespace vdbdither {

/// A mesh on its way into Draco data.
class DracoEncoding {
 public:
  /// @param precision_mm  the maximum error of a coordinate; 0 rounds nothing and keeps the order
  explicit DracoEncoding(double precision_mm);
  DracoEncoding(const DracoEncoding&) = delete;
  DracoEncoding& operator=(const DracoEncoding&) = delete;
  ~DracoEncoding();

  void triangle(const Mesh::Triangle& triangle);

  /// Give all points a value each, in mm for positions. Return the id of the attribute in the data.
  std::uint32_t positions(const std::vector<openvdb::Vec3s>& values);
  std::uint32_t colours(const std::vector<std::array<std::uint8_t, 3>>& values);
  std::uint32_t colours(const std::vector<std::array<std::uint16_t, 4>>& values);
  std::uint32_t numbers(const std::vector<float>& values);

  /// Returns the data. Throws DataError where Draco cannot encode them, or the precision is too
  /// fine for the size of the mesh.
  /// @param points  their number
  [[nodiscard]] std::string encode(std::uint64_t points);

 private:
  double precision_mm_;
  double extent_mm_ = 0;  ///< the longest edge of the box of the positions
  std::unique_ptr<draco::Mesh> mesh_;
};

/// Keeps a mesh until it is whole: Draco encodes it as a whole.
class DracoMeshEncoder : public MeshEncoder {
 public:
  DracoMeshEncoder(const std::filesystem::path& path, const MeshEncoding& how)
      : MeshEncoder(path), extras_(how.extras), encoding_(how.draco_mm.value_or(0)) {}

  void vertex(const MeshVertex& vertex) override {
    positions_.push_back(vertex.position);
    if (extras_.colour) colours_.push_back(vertex.colour);
    if (extras_.quality) qualities_.push_back(vertex.quality);
  }
  void triangle(const Mesh::Triangle& triangle) override { encoding_.triangle(triangle); }

 protected:
  VertexExtras extras_;
  DracoEncoding encoding_;
  std::vector<openvdb::Vec3s> positions_;
  std::vector<std::array<std::uint8_t, 3>> colours_;  ///< sRGB
  std::vector<float> qualities_;
};

}  // namespace vdbdither
