#include <map>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include "io/frames.h"
#include "io/staged_output.h"
#include "io/standard_streams.h"
#include "io/vdb.h"
#include "vdbdither/errors.h"
#include "vdbdither/layers.h"
#include "vdbdither/operator.h"

namespace vdbdither {

namespace {

/// Slabs into one .vdb file, or as frames on a pipe. Stands in at the end of a chain that ends
/// without a sink; in the middle it archives the stage.
class WriteOperator : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to write; - or nothing is standard output", false);
    options.choice("codec", codec_, {"blosc", "mask", "none"}, "How a file's voxels are packed");
    options.flag("half", half_, "A file's distances, normals and the like take 16 bits, not 32");
    options.flag("overwrite", overwrite_, "Replace the file if it is there");
  }

  void plan(const Schema& in) override {
    schema_ = in;
    if (in.grids.empty()) throw UsageError("there is no grid to write");
    if (!isPipe()) {
      StagedOutput::check(path_, StagedOutput::Kind::file, overwrite_);
      output_.emplace(path_, StagedOutput::Kind::file);
    } else if (::isatty(dataOutput())) {
      throw UsageError(
          "VDB data is not for a terminal; name a file with -o, or pipe it into another operator");
    } else {
      frames_.emplace(dataOutput());
    }
  }

  [[nodiscard]] bool isBarrier() const override { return !isPipe(); }
  [[nodiscard]] OutputEstimate output() const override {
    if (isPipe()) return {};
    // Measured on spheres: what is active, packed.
    constexpr double share = 0.2;
    double bytes = 0;
    for (const auto& [name, grid] : schema_.grids)
      bytes += share * schema_.leaves * leafBytes(grid) * (half_ ? 0.7 : 1);
    return {path_, bytes};
  }
  [[nodiscard]] bool writesToStandardOutput() const override { return isPipe(); }

  void write(const Slab& in) override {
    if (frames_) {
      beginFrames();
      frames_->slab(in);
    } else {
      if (written_.empty()) written_.begin = in.core.begin;
      written_.end = in.core.end;
      for (const auto& [name, grid] : in.grids) pieces_[name].push_back({grid, in.core});
    }
  }

  void finish() override {
    if (frames_) {
      beginFrames();
      frames_->end();
      return;
    }
    Grids grids;
    for (auto& [name, pieces] : pieces_) {
      grids[name] = pruned(joinLayers(pieces, schema_.lattice.layers()));
      pieces.clear();
    }
    if (grids.empty()) grids = schema_.grids;
    VdbContents contents = contentsOf(schema_, grids);
    if (written_ != schema_.lattice.layers()) {
      contents.metadata[layers_key] =
          std::to_string(written_.begin) + " " + std::to_string(written_.end);
    }
    const VdbCodec codec = codec_ == "none"   ? VdbCodec::none
                           : codec_ == "mask" ? VdbCodec::mask
                                              : VdbCodec::blosc;
    writeVdb(output_->path(), contents, codec, path_, half_);
    output_->commit();
  }

 private:
  [[nodiscard]] bool isPipe() const { return path_.empty() || path_ == "-"; }

  void beginFrames() {
    if (!std::exchange(begun_, true)) frames_->head(schema_);
  }

  std::string path_;
  std::string codec_ = "blosc";
  bool half_ = false;
  bool overwrite_ = false;
  Schema schema_;
  std::optional<FrameWriter> frames_;
  bool begun_ = false;
  std::optional<StagedOutput> output_;
  ZRange written_;
  std::map<std::string, std::vector<Layers>> pieces_;
};

}  // namespace

extern const OperatorInfo write{
    "write", "Grids into a .vdb file or to standard output",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! write surface.vdb ! dither -o solid.vdb",
    [] { return std::unique_ptr<Operator>(std::make_unique<WriteOperator>()); }, true};

}  // namespace vdbdither
