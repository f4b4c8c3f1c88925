#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "vdbdither/model/mesh.h"

namespace draco {
class Mesh;
}  // namespace draco

namespace vdbdither {

/// A mesh on its way into Draco data.
class DracoEncoding {
 public:
  /// @param precision_mm  the maximum error of a coordinate. Of 0, nothing is rounded, and all
  /// stays
  ///     in its order.
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

}  // namespace vdbdither
