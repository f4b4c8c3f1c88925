#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/profile/printer_profile.h"
#include "ops/kernels/dither/refinement.h"
#include "ops/kernels/leaf/held_band.h"
#include "ops/kernels/leaf/solid.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::Vec3d;

enum class Guard { walls, none };
constexpr std::array<Choice<Guard>, 2> guards{
    {{Guard::walls, "walls", "Leaves walls and gaps that are too thin as they are"},
     {Guard::none, "none", "Refines everything"}}};

/// `solid` from `solid` and `surface`: direct binary search.
class Refine : public Filter {
 public:
  void declare(Options& options) override {
    options.integer("sweeps", sweeps_, {1, 8}, "How often every voxel of the surface is visited");
    options.choice("guard", guard_, guards, "What is left unrefined");
    options.lengths("spread", spread_mm_, "LENGTH|X,Y,Z", {least_spread_mm, most_spread_mm},
                    "Standard deviation of the blur of the printing process; by default that of "
                    "the printer's profile, or else 50um");
  }

  Schema plan(const Schema& in) override {
    const auto surface = findGrid<openvdb::FloatGrid>(in.grids, surface_grid);
    findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    has_normals_ = in.grids.contains(normal_grid);
    if (has_normals_) findGrid<openvdb::Vec3SGrid>(in.grids, normal_grid);
    if (!spread_mm_) spread_mm_ = pointSpreadMmOf(in);
    const Vec3d& pitch_mm = in.lattice.pitch_mm;
    checkHolds(surface->background(), pitch_mm.length(), "'refine' needs");
    refinement_.emplace(pitch_mm, *spread_mm_, guard_ == Guard::walls, sweeps_);
    Schema out = withoutOutdated(in, solid_grid);
    out.grids[solid_grid] = makeSolidGrid(surface->transform());
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    const Reach reach = Reach::stencil(refinement_->reachLayers());
    std::vector<Read> reads{{surface_grid, reach}, {solid_grid, reach}};
    if (has_normals_) reads.push_back({normal_grid, reach});
    return reads;
  }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_surface_leaf = cost::refine_us + cost::refine_us_per_sweep * sweeps_};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto surface = findGrid<openvdb::FloatGrid>(in.grids, surface_grid);
    const auto solid = findGrid<openvdb::BoolGrid>(in.grids, solid_grid);
    const auto normals =
        has_normals_ ? findGrid<openvdb::Vec3SGrid>(in.grids, normal_grid) : nullptr;
    return {{solid_grid, refinement_->run(*surface, normals.get(), *solid, in.core, in.valid)}};
  }

 private:
  int sweeps_ = 2;
  Guard guard_{};
  std::optional<Vec3d> spread_mm_;
  bool has_normals_ = false;
  std::optional<Refinement> refinement_;
};

}  // namespace

extern const OperatorInfo refine;
const OperatorInfo refine{
    "refine", "Fewer errors of the printed surface: printed voxels, changed one by one",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! refine ! slice-export out",
    []() -> std::unique_ptr<Operator> { return std::make_unique<Refine>(); }};

}  // namespace vdbdither
