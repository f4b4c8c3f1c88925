#include "ops/kernels/distance/csg.h"

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "io/vdb/slab_reader.h"
#include "ops/kernels/colour/csg_colours.h"
#include "ops/kernels/leaf/part_index.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

namespace {

using openvdb::FloatGrid;
using openvdb::Int32Grid;
using openvdb::Vec3SGrid;

enum class Priority { first, second };
constexpr std::array<Choice<Priority>, 2> priorities{
    {{Priority::first, "first", "That of the volume that reaches this step"},
     {Priority::second, "second", "That of the file"}}};

std::string latticeText(const Lattice& lattice) {
  std::string text;
  for (int axis = 0; axis < 3; ++axis)
    text += (axis ? " x " : "") + shortestText(lattice.pitch_mm[axis]);
  return text + " mm";
}

/// `surface`, and `part`, of two operands: what comes, and a second archive in step.
class CsgOperator : public Filter {
 public:
  void declare(Options& options) override {
    options.file("union", unite_, "FILE.vdb", "Adds the surface of this file or named pipe");
    options.file("intersection", intersect_, "FILE.vdb", "Keeps what also lies in this one");
    options.file("difference", subtract_, "FILE.vdb", "Removes this one");
    options.choice("priority", priority_, priorities,
                   "Whose part, material and colour a union has where both are");
  }

  Schema plan(const Schema& in) override {
    const int given = !unite_.empty() + !intersect_.empty() + !subtract_.empty();
    if (given != 1) throw UsageError("give one of --union, --intersection and --difference");
    operation_ = !unite_.empty()       ? Csg::unite
                 : !intersect_.empty() ? Csg::intersect
                                       : Csg::subtract;
    const std::string& path = unite_ + intersect_ + subtract_;
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    other_ = std::make_unique<SlabReader>(path, std::vector<std::string>{});
    const Schema& second = other_->schema();
    checkLattices(in.lattice, second.lattice, path);
    try {
      empty_ = findGrid<FloatGrid>(second.grids, surface_grid);
    } catch (const DataError& error) {
      throw DataError("'" + path + "': " + error.what());
    }

    Schema out = withoutOutdated(in, surface_grid);
    out.grids[surface_grid] = emptyCombined(*surface, *empty_);
    out.footprint = in.footprint + second.footprint;
    if (operation_ == Csg::unite) {
      out.lattice.box.expand(second.lattice.box);
      planParts(in, second, path);
      out.grids[part_grid] = emptyParts(*surface);
    }
    planValues<Vec3SGrid>(colour_grid, in.grids, second.grids, out.grids);
    planValues<FloatGrid>(opacity_grid, in.grids, second.grids, out.grids);
    return out;
  }

  [[nodiscard]] std::vector<Read> reads() const override {
    std::vector<Read> reads{{surface_grid, Reach::point()}};
    if (first_has_parts_) reads.push_back({part_grid, Reach::point()});
    for (const std::string& name : first_values_) reads.push_back({name, Reach::point()});
    return reads;
  }

  [[nodiscard]] std::vector<Input*> inputs() override { return {other_.get()}; }

  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = cost::csg_us};
  }

  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto surface = findGrid<FloatGrid>(in.grids, surface_grid);
    const Grids& second = in.inputs.at(0);
    const auto others =
        second.contains(surface_grid) ? findGrid<FloatGrid>(second, surface_grid) : empty_;
    Grids out{{surface_grid, combined(*surface, *others, operation_, in.core)}};
    addValues<Vec3SGrid>(colour_grid, in, *surface, *others, out);
    addValues<FloatGrid>(opacity_grid, in, *surface, *others, out);
    if (operation_ != Csg::unite) return out;
    const auto parts = first_has_parts_ ? findGrid<Int32Grid>(in.grids, part_grid) : nullptr;
    const auto others_parts = second_has_parts_ && second.contains(part_grid)
                                  ? findGrid<Int32Grid>(second, part_grid)
                                  : nullptr;
    const auto united = unitedParts(*surface, *others, parts.get(), others_parts.get(),
                                    first_parts_, priority_ == Priority::second, in.core);
    united->insertMeta(*emptyParts(*surface));
    out[part_grid] = united;
    return out;
  }

 private:
  /// Plans `Cd` or `Alpha`, which the result has if an operand has it.
  template <class GridT>
  void planValues(const char* name, const Grids& first, const Grids& second, Grids& out) {
    if (first.contains(name)) {
      findGrid<GridT>(first, name);
      first_values_.emplace_back(name);
    } else if (second.contains(name)) {
      out[name] = findGrid<GridT>(second, name);
      empty_values_[name] = out[name];
    }
  }

  template <class GridT>
  void addValues(const char* name, const Slab& in, const FloatGrid& surface,
                 const FloatGrid& others, Grids& out) const {
    const auto find = [name](const Grids& grids) {
      return grids.contains(name) ? findGrid<GridT>(grids, name) : nullptr;
    };
    const Grids& second = in.inputs.at(0);
    const auto mine = find(in.grids);
    const auto theirs = find(second.contains(name) ? second : empty_values_);
    if (!mine && !theirs) return;
    out[name] = combinedValues<GridT>(surface, others, mine.get(), theirs.get(), operation_,
                                      priority_ == Priority::second, in.core);
  }

  static void checkLattices(const Lattice& first, const Lattice& second, const std::string& path) {
    if (first.pitch_mm == second.pitch_mm && first.origin_mm == second.origin_mm) return;
    if (first.pitch_mm == second.pitch_mm)
      throw DataError("'" + path + "' lies on a shifted lattice; make both with one --refine-y");
    throw DataError("'" + path + "' lies on a lattice of " + latticeText(second) +
                    ", and what comes on one of " + latticeText(first) +
                    "; make both for one printer");
  }

  void planParts(const Schema& first, const Schema& second, const std::string& path) {
    first_has_parts_ = first.grids.contains(part_grid);
    second_has_parts_ = second.grids.contains(part_grid);
    first_parts_ = first_has_parts_ ? partsOf(first.grids, "what comes") : 1;
    parts_ = first_parts_ + (second_has_parts_ ? partsOf(second.grids, "'" + path + "'") : 1);
  }

  static int partsOf(const Grids& grids, const std::string& where) {
    const auto count =
        findGrid<Int32Grid>(grids, part_grid)->getMetadata<openvdb::Int32Metadata>(part_count_key);
    if (!count)
      throw DataError(where + ": grid 'part' does not say how many there are (its metadata " +
                      part_count_key + "); make it again");
    return count->value();
  }

  [[nodiscard]] Int32Grid::Ptr emptyParts(const FloatGrid& surface) const {
    auto grid = Int32Grid::create(0);
    grid->setName(part_grid);
    grid->setTransform(surface.transform().copy());
    grid->insertMeta(part_count_key, openvdb::Int32Metadata(parts_));
    return grid;
  }

  std::string unite_;
  std::string intersect_;
  std::string subtract_;
  Priority priority_ = Priority::first;

  Csg operation_ = Csg::unite;
  std::unique_ptr<SlabReader> other_;
  FloatGrid::ConstPtr empty_;              ///< the second operand's where it has no layers
  std::vector<std::string> first_values_;  ///< the grids of colours that come
  Grids empty_values_;  ///< those that only the second operand has, where it has no layers
  bool first_has_parts_ = false;
  bool second_has_parts_ = false;
  int first_parts_ = 1;
  int parts_ = 2;
};

}  // namespace

extern const OperatorInfo csg;
const OperatorInfo csg{
    "csg", "Union, intersection or difference of two surfaces",
    "mesh2sdf part.stl --printer mimaki-3duj-553 --scale 0.6 -o core.vdb\nmesh2sdf "
    "part.stl --printer mimaki-3duj-553 ! csg --difference core.vdb -o rind.vdb",
    []() -> std::unique_ptr<Operator> { return std::make_unique<CsgOperator>(); }};

}  // namespace vdbdither
