#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include <openvdb/io/Compression.h>
#include <openvdb/tools/Prune.h>
#include <openvdb/tree/LeafManager.h>

#include "io/file/staged_output.h"
#include "io/file/standard_streams.h"
#include "io/mesh/mesh_format.h"
#include "io/stack/slice_format.h"
#include "io/vdb/frames.h"
#include "io/vdb/slab_reader.h"
#include "io/vdb/vdb.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"
#include "vdbdither/model/visit_grid.h"

namespace vdbdither {

namespace {

constexpr std::array<Choice<VdbCodec>, 3> codecs{
    {{VdbCodec::blosc, "blosc", "Active voxels, compressed by Blosc"},
     {VdbCodec::mask, "mask", "Active voxels, uncompressed"},
     {VdbCodec::none, "none", "All voxels of each leaf, uncompressed"}}};

/// Rounds all values of a tree as an archive of half floats does. Values of other types stay.
template <typename Tree>
void roundToHalf(Tree& tree) {
  using Value = typename Tree::ValueType;
  if constexpr (openvdb::io::RealToHalf<Value>::isReal) {
    const auto round = [](const Value& value) { return openvdb::io::truncateRealToHalf(value); };
    auto tile = tree.beginValueAll();
    tile.setMaxDepth(Tree::ValueAllIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) tile.setValue(round(*tile));
    openvdb::tree::LeafManager<Tree> leaves(tree);
    leaves.foreach ([&](auto& leaf, std::size_t) {
      auto* values = leaf.buffer().data();
      std::transform(values, values + leaf.buffer().size(), values, round);
    });
  }
}

/// All slabs of a grid in one, in canonical form; `pieces` is empty then. What is constant only
/// once it is rounded becomes a tile as well, as it does where rounded pieces are joined.
GridConstPtr whole(std::vector<GridLayers>& pieces, ZRange layers, bool as_half) {
  const GridConstPtr joined = joinLayers(pieces, layers);
  const bool is_own = joined != pieces.front().grid;
  pieces.clear();
  if (!is_own && !as_half) return pruned(joined);
  // Joined just now, so nobody else's: it needs no copy to be changed.
  const auto own =
      is_own ? std::const_pointer_cast<openvdb::GridBase>(joined) : joined->deepCopyGrid();
  visitGrid(*own, [&](const auto& typed) {
    auto& tree = openvdb::gridPtrCast<std::decay_t<decltype(typed)>>(own)->tree();
    if (as_half) roundToHalf(tree);
    openvdb::tools::prune(tree);
  });
  return own;
}

/// Slabs into one .vdb file, or as frames on a pipe. Ends every chain without another sink; in the
/// middle of a chain it archives the stage.
class WriteOperator : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to write; standard output if missing or -", false);
    options.choice("codec", codec_, codecs, "Compression of the voxels in a file");
    options.flag("half", half_,
                 "Stores distances, normals and other fractional numbers of a file in 16 bits, not "
                 "32");
    overwrite_.declare(options, "the file");
  }

  void makePiece(const std::filesystem::path& folder) override {
    if (isPipe())
      throw UsageError("what goes into a pipe cannot be made in pieces; name a file with -o");
    piece_ = folder;
  }

  void plan(const Schema& in) override {
    schema_ = in;
    if (in.grids.empty()) throw UsageError("there is no grid to write");
    if (piece_) return;
    if (!isPipe()) {
      refuseOtherFormats();
      StagedOutput::check(path_, StagedOutput::Kind::file, overwrite_.overwrite);
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
    if (isPipe()) return {"-", 0};
    // Measured on spheres and bunnies: what is active, packed. Bits are not packed, and noise
    // cannot be, which a grid of no class may hold.
    double per_leaf = 0;
    for (const auto& [name, grid] : schema_.grids) {
      const bool bits = grid->isType<openvdb::BoolGrid>() || grid->isType<openvdb::MaskGrid>();
      const bool noise =
          grid->isType<openvdb::FloatGrid>() && grid->getGridClass() == openvdb::GRID_UNKNOWN;
      const double packed = half_ ? 0.14 : 0.2;
      const double unpacked = half_ ? 0.5 : 1;
      per_leaf += leafBytes(grid) * (bits ? 1.1 : noise ? unpacked : packed);
    }
    return {piece_ ? piece_->string() : path_, schema_.footprint.total * per_leaf};
  }
  [[nodiscard]] std::optional<Work> work() const override {
    double bytes = 0;
    for (const auto& [name, grid] : schema_.grids) bytes += leafBytes(grid);
    return Work{.us_per_held_leaf = cost::write_us_per_byte * bytes};
  }

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

  void takePiece(const std::filesystem::path& folder, ZRange core) override {
    SlabReader piece((folder / piece_name).string(), {});
    if (written_.empty()) written_.begin = core.begin;
    written_.end = core.end;
    for (const auto& [name, grid] : piece.read(core)) pieces_[name].push_back({grid, core});
  }

  void finish() override {
    if (frames_) {
      beginFrames();
      return;
    }
    Grids grids;
    for (auto& [name, pieces] : pieces_)
      grids[name] = whole(pieces, schema_.lattice.layers(), half_);
    if (grids.empty()) grids = schema_.grids;
    VdbContents contents = contentsOf(schema_, grids);
    if (written_ != schema_.lattice.layers()) {
      contents.metadata[layers_key] =
          std::to_string(written_.begin) + " " + std::to_string(written_.end);
    }
    if (piece_) {
      std::filesystem::create_directory(*piece_);
      writeVdb(*piece_ / piece_name, contents, codec_, *piece_ / piece_name, half_);
    } else {
      writeVdb(output_->path(), contents, codec_, path_, half_);
      output_->complete();
    }
  }

  void publish() override {
    if (frames_) frames_->end();
    if (output_) output_->commit();
    output_.reset();
  }

 private:
  /// The file of a piece.
  static constexpr const char* piece_name = "piece.vdb";

  [[nodiscard]] bool isPipe() const {
    return path_.empty() || path_ == "-" || path_ == "/dev/stdout";
  }

  void refuseOtherFormats() const {
    if (meshFormatNamedBy(path_) != nullptr)
      throw UsageError("'" + path_ +
                       "' is a mesh by its name, and this is a .vdb; mesh-export "
                       "writes meshes");
    if (namesSlice(path_) || namesArchive(path_))
      throw UsageError("'" + path_ +
                       "' holds pictures by its name, and this is a .vdb; "
                       "slice-export writes slices and render a picture");
  }

  void beginFrames() {
    if (!std::exchange(begun_, true)) frames_->head(schema_);
  }

  std::string path_;
  VdbCodec codec_ = VdbCodec::blosc;
  bool half_ = false;
  OverwriteOption overwrite_;
  std::optional<std::filesystem::path> piece_;  ///< the folder of a piece to make
  Schema schema_;
  std::optional<FrameWriter> frames_;
  bool begun_ = false;
  std::optional<StagedOutput> output_;
  ZRange written_;
  std::map<std::string, std::vector<GridLayers>> pieces_;
};

}  // namespace

extern const OperatorInfo write{
    .name = "write",
    .summary = "Grids into a .vdb file or to standard output",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! write surface.vdb ! dither -o solid.vdb",
    .make = []() -> std::unique_ptr<Operator> { return std::make_unique<WriteOperator>(); },
    .transport = true,
    .names_vdb = true};

}  // namespace vdbdither
