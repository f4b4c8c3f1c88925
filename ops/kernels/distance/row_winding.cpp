#include "ops/kernels/distance/row_winding.h"

#include <vector>

namespace vdbdither {

LeafBits RowWinding::advance(const LeafDistances& noted, std::size_t slot) {
  LeafBits inside;
  inside.fill(bits_);
  if (!noted.noted(slot)) return inside;
  // The rows that enter and leave in each plane; crossings of the few rows with more than one are
  // kept in `again`.
  std::array<LeafBits, 2> once{};
  std::vector<std::uint32_t> again;
  noted.visitNotes(slot, [&](std::uint32_t crossing) {
    const std::uint32_t plane = crossing >> 7;
    const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
    if (once[~crossing & 1][plane] & row) {
      once[~crossing & 1][plane] ^= row;
    } else if (once[crossing & 1][plane] & row) {
      again.push_back(crossing);
    } else {
      once[crossing & 1][plane] |= row;
    }
  });
  for (std::size_t plane = 0; plane < inside.size(); ++plane) {
    if ((once[0][plane] | once[1][plane]) != 0 || !again.empty()) {
      lower(once[0][plane]);
      raise(once[1][plane]);
      for (const std::uint32_t crossing : again) {
        if (crossing >> 7 != plane) continue;
        const std::uint64_t row = 1ULL << ((crossing >> 1) & 63);
        (crossing & 1) ? raise(row) : lower(row);
      }
      bits_ = 0;
      for (const std::uint64_t digit : digits_) bits_ |= digit;
    }
    inside[plane] = bits_;
  }
  return inside;
}

void RowWinding::raise(std::uint64_t rows) {
  for (std::uint64_t& digit : digits_) {
    if (rows == 0) break;
    digit ^= rows;
    rows &= ~digit;
  }
}

void RowWinding::lower(std::uint64_t rows) {
  for (std::uint64_t& digit : digits_) {
    if (rows == 0) break;
    digit ^= rows;
    rows &= digit;
  }
}

}  // namespace vdbdither
