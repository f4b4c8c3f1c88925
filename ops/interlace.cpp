#include "ops/kernels/dither/interlace.h"

#include <cmath>

#include "ops/kernels/leaf/solid.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;

bool nearlyEqual(double a, double b) { return std::abs(a - b) <= 1e-9 * std::abs(b); }

/// `solid` from `surface`, alternate slices shifted by ± a quarter voxel in y.
class Interlace : public Filter {
 public:
  void declare(Options&) override {}

  /// A refined lattice gives way to the plain one, and the grids on it end here: only `solid` comes
  /// out.
  Schema plan(const Schema& in) override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    const openvdb::Vec3d& origin_mm = in.lattice.origin_mm;
    refined_ = origin_mm != openvdb::Vec3d(0.0);
    Schema out = withoutOutdated(in, solid_grid);
    if (refined_) {
      if (origin_mm.x() != 0 || origin_mm.z() != 0 ||
          !nearlyEqual(origin_mm.y(), -in.lattice.pitch_mm.y() / 2)) {
        throw DataError(
            "grid 'surface' is on a lattice that is neither plain nor refined by two in y");
      }
      out.lattice.pitch_mm.y() *= 2;
      out.lattice.origin_mm = openvdb::Vec3d(0.0);
      if (!in.lattice.box.empty()) {
        out.lattice.box.min().y() >>= 1;
        out.lattice.box.max().y() >>= 1;
      }
      out.footprint = in.footprint.scaled(0.5);
      out.grids.clear();
      plain_ = transformOf(out.lattice);
    } else {
      plain_ = surface->transform().copy();
    }
    out.grids[solid_grid] = makeSolidGrid(*plain_);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    return {{surface_grid, Reach::point()}};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::interlace_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    return {{solid_grid, refined_ ? interlacedByPicking(*surface, in.core, *plain_)
                                  : interlacedByInterpolation(*surface, in.core)}};
  }

 private:
  bool refined_ = false;
  openvdb::math::Transform::Ptr plain_;
};

}  // namespace

extern const OperatorInfo interlace;
const OperatorInfo interlace{
    "interlace",
    "The printed voxels by Kritchman's interlacing: alternate slices shifted by a quarter voxel in "
    "y",
    "mesh2sdf part.stl --printer mimaki-3duj-553 --refine-y 2 ! interlace ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Interlace>(); }};

}  // namespace vdbdither
