#include "vdbdither/engine/comma_list.h"

namespace vdbdither {

std::vector<std::string> commaList(std::string_view text) {
  std::vector<std::string> pieces(1);
  for (const char c : text) {
    if (c == ',') {
      pieces.emplace_back();
    } else {
      pieces.back() += c;
    }
  }
  return pieces;
}

}  // namespace vdbdither
