#include "ops/kernels/distance/hollow.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/surface_leaves.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Vec3d;

/// `surface` of a shell, with holes to drain what it encloses.
class Hollow : public Filter {
 public:
  void declare(Options& options) override {
    options.length("thickness", thickness_mm_, Range::above(0, 1000),
                   "Thickness of the shell under the surface");
    options.required();
    options.texts("drain", drains_given_, "X,Y,Z:DX,DY,DZ:DIAMETER",
                  "A hole through the shell around a position in mm, along a direction, that "
                  "reaches twice the thickness either way; may be given several times");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    lattice_ = in.lattice;
    planBand(*surface);
    drains_.clear();
    for (const std::string& text : drains_given_) drains_.push_back(drainFrom(text));

    Schema out = withoutOutdated(in, surface_grid);
    // The band outside has served: what the box was larger for it would be empty layers.
    if (statesHeldBand(*surface)) {
      for (int axis = 0; axis < 3; ++axis) {
        const int steps = static_cast<int>(thickness_mm_ / lattice_.pitch_mm[axis]);
        out.lattice.box.min()[axis] += steps;
        out.lattice.box.max()[axis] -= steps;
      }
    }
    out.grids[surface_grid] = emptySurface(*surface, background_mm_);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    return {{surface_grid, Reach::stencil(1)}};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::hollow_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    return {{surface_grid, hollowed(*findGrid<FloatGrid>(in.grids, surface_grid), lattice_,
                                    thickness_mm_, drains_, background_mm_, in.core, in.valid)}};
  }

 private:
  /// The shell's own band is what the surface's leaves of it, and must do for the dither.
  void planBand(const FloatGrid& surface) {
    const double held_mm = heldBandMm(surface);
    const double needed_mm = thickness_mm_ + lattice_.diagonalMm();
    checkHolds(held_mm, needed_mm, "a shell of " + shortestText(thickness_mm_) + " mm needs");
    background_mm_ = static_cast<float>(std::max(held_mm - thickness_mm_, lattice_.diagonalMm()));
  }

  [[nodiscard]] Drain drainFrom(const std::string& text) const {
    const auto refuse = [&](const std::string& why) {
      return UsageError("--drain: '" + text + "' " + why);
    };
    std::array<double, 7> numbers{};
    std::istringstream stream(text);
    std::string word;
    std::size_t count = 0;
    for (const char end : {',', ',', ':', ',', ',', ':', '\0'}) {
      if (!std::getline(stream, word, end)) break;
      try {
        numbers[count] = parseLengthMm(word, {-1e6, 1e6});
      } catch (const UsageError&) {
        break;
      }
      ++count;
    }
    if (count < numbers.size())
      throw refuse("is not a position, a direction and a diameter, such as 10,5,0:0,0,1:3mm");
    Vec3d direction(numbers[3], numbers[4], numbers[5]);
    if (!(direction.length() > 0)) throw refuse("has no direction");
    direction.normalize();
    if (!(numbers[6] > 0)) throw refuse("has no diameter");
    const Drain drain{
        {numbers[0], numbers[1], numbers[2]}, direction, numbers[6] / 2, 2 * thickness_mm_};
    checkMeetsBox(drain, refuse);
    return drain;
  }

  template <typename Refuse>
  void checkMeetsBox(const Drain& drain, const Refuse& refuse) const {
    Vec3d low = lattice_.position(lattice_.box.min());
    Vec3d high = lattice_.position(lattice_.box.max());
    for (int axis = 0; axis < 3; ++axis) {
      // A cylinder's extent along an axis: of its length, and of its round.
      const double along = std::abs(drain.direction[axis]);
      const double reach = along * drain.half_length_mm +
                           std::sqrt(std::max(0.0, 1 - along * along)) * drain.radius_mm;
      if (drain.centre_mm[axis] + reach < low[axis] || drain.centre_mm[axis] - reach > high[axis]) {
        throw refuse("is nowhere near the part, which lies between " + text(low) + " and " +
                     text(high) + " mm");
      }
    }
  }

  static std::string text(const Vec3d& position) {
    std::string words;
    for (int axis = 0; axis < 3; ++axis)
      words += (axis ? "," : "") + shortestText(std::round(position[axis] * 100) / 100);
    return words;
  }

  double thickness_mm_ = 0;
  std::vector<std::string> drains_given_;

  Lattice lattice_;
  std::vector<Drain> drains_;
  float background_mm_ = 0;
};

}  // namespace

extern const OperatorInfo hollow;
const OperatorInfo hollow{
    "hollow", "A shell under the surface, with holes to drain it",
    "mesh2sdf part.stl --printer mimaki-3duj-553 --band 0.3mm ! hollow --thickness 0.2mm "
    "! dither ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Hollow>(); }};

}  // namespace vdbdither
