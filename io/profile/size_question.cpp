#include "io/profile/size_question.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "io/profile/printer_profile.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

double longestOf(const Vec3d& size) { return std::max({size.x(), size.y(), size.z()}); }

std::string rounded(double mm) { return shortestText(std::round(mm * 1e4) / 1e4); }

std::string partIs(const Vec3d& size_mm) {
  return "the part is " + rounded(size_mm.x()) + " x " + rounded(size_mm.y()) + " x " +
         rounded(size_mm.z()) + " mm";
}

/// Of the other units the one that brings the part nearest to the size of a hand.
std::string likelierUnit(double longest_mm, const PlacementOptions& placement, bool is_fitted) {
  constexpr double hand_mm = 100;
  std::string_view likelier;
  double best_mm = 0;
  for (const auto& [unit, name, meaning] : length_units) {
    const double mm = longest_mm / mmOf(placement.unit) * mmOf(unit);
    const bool nearer =
        best_mm == 0 || std::abs(std::log(mm / hand_mm)) < std::abs(std::log(best_mm / hand_mm));
    if ((mm < longest_mm) == (longest_mm > hand_mm) && mm != longest_mm && nearer) {
      likelier = name;
      best_mm = mm;
    }
  }
  if (likelier.empty() || is_fitted) return "is that meant?";
  const std::string unit(likelier);
  return "are the file's numbers " + unit + "? --unit " + unit + " makes its longest side " +
         shortestText(std::round(best_mm * 100) / 100) + " mm";
}

}  // namespace

std::optional<std::string> sizeQuestion(const Vec3d& size_mm, const PlacementOptions& placement,
                                        bool is_fitted, const Schema& schema,
                                        const std::string& remedy) {
  // 3 m and 0.1 mm, as far as floats of a file tell.
  constexpr double largest_mm = 3000 * (1 - 1e-6);
  constexpr double minimum_mm = 0.1 * (1 + 1e-6);
  const Vec3d build_mm = printerProfileOf(schema).build_mm;
  const double longest_mm = longestOf(size_mm);
  if (longest_mm >= largest_mm || (longest_mm > 0 && longest_mm <= minimum_mm))
    return partIs(size_mm) + "; " + likelierUnit(longest_mm, placement, is_fitted);
  if (build_mm != Vec3d(0, 0, 0) &&
      (size_mm.x() > build_mm.x() || size_mm.y() > build_mm.y() || size_mm.z() > build_mm.z())) {
    return partIs(size_mm) + ", more than the " + rounded(build_mm.x()) + " x " +
           rounded(build_mm.y()) + " x " + rounded(build_mm.z()) + " mm that the printer builds; " +
           remedy;
  }
  return std::nullopt;
}

std::optional<std::string> fewVoxelsQuestion(const Vec3d& size_mm,
                                             const PlacementOptions& placement, bool is_fitted,
                                             const Vec3d& pitch_mm) {
  constexpr double few = 10;
  if (longestOf(size_mm / pitch_mm) >= few) return std::nullopt;
  return partIs(size_mm) + ", fewer than 10 voxels along its longest side; " +
         likelierUnit(longestOf(size_mm), placement, is_fitted);
}

}  // namespace vdbdither
