#include <unistd.h>

#include "io/vdb/slab_reader.h"
#include "ops/kernels/contour/inside_signs.h"
#include "ops/kernels/leaf/held_band.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/known_grids.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

/// Slabs of a .vdb file, or frames of a pipe. Begins every chain without another source.
class ReadOperator : public Source {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to read; standard input if missing or -", false);
    grids_.declare(options);
  }

  Schema plan() override {
    if (path_.empty()) path_ = "-";
    if (path_ == "-" && ::isatty(STDIN_FILENO)) {
      throw UsageError(
          "nothing is piped in; name a source first (mesh2sdf part.stl), or a file: -i part.vdb");
    }
    reader_ = std::make_unique<SlabReader>(path_, grids_.list());
    refuseForeign();
    return reader_->schema();
  }

  [[nodiscard]] bool isBarrier() const override { return !reader_->isPipe(); }
  [[nodiscard]] std::vector<Input*> inputs() override { return {reader_.get()}; }
  [[nodiscard]] std::optional<Work> work() const override {
    double bytes = 0;
    for (const auto& [name, grid] : reader_->schema().grids) bytes += leafBytes(grid);
    return Work{.us_per_held_leaf = cost::read_us_per_byte * bytes};
  }

  [[nodiscard]] Grids run(ZRange core) const override { return reader_->read(core); }

 private:
  /// Refuses what other tools call a surface and would print as something else: fog, and level sets
  /// with their inside at +background, which would be hollow.
  void refuseForeign() const {
    const Schema& schema = reader_->schema();
    if (reader_->isPipe() || schema.metadata.contains(history_key)) return;
    for (const auto& [name, prototype] : schema.grids) {
      if (name == surface_grid && prototype->getGridClass() == openvdb::GRID_FOG_VOLUME) {
        throw DataError(
            "grid 'surface' is fog and holds no distances; resample --grid surface makes "
            "them");
      }
      const auto grid = openvdb::gridConstPtrCast<openvdb::FloatGrid>(reader_->held(name));
      if (!grid || grid->getGridClass() != openvdb::GRID_LEVEL_SET || statesHeldBand(*grid) ||
          withInsideSigns(grid).signs == InsideSigns::given)
        continue;
      throw DataError("grid '" + name +
                      "' is a level set with its inside at +background, as if it were hollow; "
                      "resample --grid " +
                      quotedForShell(name) + " fills it if its surface is closed");
    }
  }

  std::string path_;
  GridListOption grids_;
  std::unique_ptr<SlabReader> reader_;
};

}  // namespace

extern const OperatorInfo read{
    "read", "Grids from a .vdb file or from standard input",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! write surface.vdb ! normals -o normals.vdb",
    [] { return std::unique_ptr<Operator>(std::make_unique<ReadOperator>()); }, true};

}  // namespace vdbdither
