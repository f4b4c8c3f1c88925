#include "ops/kernels/leaf/held_band.h"

#include <cmath>
#include <string>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/number_text.h"

namespace vdbdither {

void checkHolds(double held_mm, double needed_mm, const std::string& who_needs) {
  // A band of exactly the width needed, rounded to single precision.
  constexpr double tolerance = 1 + 1e-6;
  if (held_mm * tolerance >= needed_mm) return;
  const double missing_mm = std::ceil((needed_mm - held_mm) * 1e3) / 1e3;
  const auto text = [](double mm) { return numberText(std::round(mm * 1e4) / 1e4) + " mm"; };
  throw DataError("grid 'surface' holds distances up to " + text(held_mm) + ", and " + who_needs +
                  " " + text(needed_mm) + ": widen --band of mesh2sdf or resample by " +
                  text(missing_mm));
}

}  // namespace vdbdither
