#include "ops/kernels/distance/gradient.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;

/// `N` from `surface`, unless it is already there.
class Normals : public Filter {
 public:
  void declare(Options&) override {}

  Schema plan(const Schema& in) override {
    Schema out = in;
    pitch_mm_ = in.lattice.pitch_mm;
    given_ = in.grids.contains(normal_grid);
    if (given_) return out;
    out.grids[normal_grid] =
        makeNormalGrid(findGrid<FloatGrid>(in.grids, surface_grid)->transform());
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    return given_ ? std::vector<Read>{} : std::vector<Read>{{surface_grid, Reach::stencil(1)}};
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = given_ ? 0 : cost::normals_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    if (given_) return {};
    return {{normal_grid, outwardNormals(*findGrid<FloatGrid>(in.grids, surface_grid), pitch_mm_,
                                         in.core, in.valid)}};
  }

 private:
  openvdb::Vec3d pitch_mm_;
  bool given_ = false;
};

}  // namespace

extern const OperatorInfo normals;
const OperatorInfo normals{
    "normals", "Unit outward normals from the gradient of the distance",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! normals -o part.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Normals>(); }};

}  // namespace vdbdither
