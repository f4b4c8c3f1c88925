#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include <openvdb/Types.h>

#include "io/mesh/mesh_file.h"

namespace vdbdither {

/// Colours as a file has them, by vertex or face: red, green, blue as sRGB and the opacity.
class EncodedColours {
 public:
  /// @param unit  the value that means 1: of bytes and long integers 255, of short ones 65535, of
  ///              reals 1
  explicit EncodedColours(double unit = 1) : unit_(unit) {}

  [[nodiscard]] bool isEmpty() const { return colours_.empty(); }
  [[nodiscard]] bool has(std::size_t index) const {
    return index < colours_.size() && colours_[index][3] >= 0;
  }
  /// Linear, once they are decoded.
  [[nodiscard]] const openvdb::Vec4f& operator[](std::size_t index) const {
    return colours_[index];
  }

  /// Gives all up to `count` no colour that have none yet.
  void padTo(std::size_t count);
  /// In units; NaN counts as 0.
  void add(const std::array<double, 3>& colour);
  void add(const std::array<double, 3>& colour, double opacity);

  /// Makes linear light of them. Where the unit does not fit the greatest value, they count as 0 to
  /// 255 or to 65535, with a warning: reals beyond 1, long integers beyond 255, short ones below.
  /// @param what  "vertices"
  void decode(const MeshFile& file, const std::string& what);

 private:
  double unit_;
  double greatest_ = 0;
  std::vector<openvdb::Vec4f> colours_;  ///< opacity below 0: none
};

}  // namespace vdbdither
