#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace draco {
class Mesh;
class PointAttribute;
}  // namespace draco

namespace vdbdither {

/// Why Draco data are refused, in words that continue "the Draco data …".
class DracoError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One attribute of a decoded mesh. Every point has a value of its own or shares it with others.
struct DracoValues {
  int components = 0;
  bool is_integer = false;
  /// Of an integer type: the value that stands for 1 where its values are normalized.
  double one = 1;
  std::vector<double> values;           ///< `components` of each value
  std::vector<std::uint32_t> of_point;  ///< by point: the index of its value, in range
};

enum class DracoAttribute { position, colour, texture_coordinates };

/// A mesh that Draco's decoder has read. All indices are in range.
class DracoMesh {
 public:
  /// The memory that decoding takes is limited by the size of `bytes`. Throws DracoError.
  explicit DracoMesh(std::string_view bytes);
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;
  ~DracoMesh();

  /// Indices of points.
  [[nodiscard]] std::vector<Mesh::Triangle> triangles() const;
  [[nodiscard]] std::uint32_t points() const;

  /// The first attribute of the kind. Empty where there is none. Throws DracoError.
  [[nodiscard]] DracoValues values(DracoAttribute kind) const;
  /// The attribute that a glTF file names. Throws DracoError where there is none.
  [[nodiscard]] DracoValues valuesOf(std::uint32_t unique_id) const;

 private:
  [[nodiscard]] DracoValues valuesOf(const draco::PointAttribute& attribute) const;

  std::unique_ptr<draco::Mesh> mesh_;
};

}  // namespace vdbdither
