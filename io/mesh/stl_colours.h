#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <unordered_map>

#include "vdbdither/model/appearance.h"

namespace vdbdither {

/// The colours in the attributes of a binary STL, by one of two conventions. VisCAM and SolidView
/// set the highest bit of a triangle that has a colour, with blue in the lowest bits. Materialise
/// Magics writes "COLOR=" and the colour of the part into the header, sets the highest bit of a
/// triangle that has this colour, and else has red in the lowest bits.
class StlColours {
 public:
  /// @param header  the 80 bytes before the triangles that follow
  void begin(std::string_view header);
  void add(std::uint16_t attribute);

  /// Returns null where no triangle has a colour.
  std::shared_ptr<const Appearance> finish();

 private:
  /// A colour as one number; 0: none.
  using Key = std::uint64_t;
  [[nodiscard]] Key keyOf(std::uint16_t attribute) const;

  Key part_ = 0;  ///< the colour in the header; 0: it has none
  bool has_colours_ = false;
  std::unordered_map<Key, std::uint32_t> materials_;
  Appearance appearance_;
};

}  // namespace vdbdither
