#include <algorithm>
#include <mutex>
#include <sstream>
#include <unistd.h>
#include <vector>

#include "io/frames.h"
#include "io/vdb.h"
#include "vdbdither/errors.h"
#include "vdbdither/layers.h"
#include "vdbdither/openvdb.h"
#include "vdbdither/operator.h"

namespace vdbdither {

namespace {

/// Slabs of a .vdb file, or frames of a pipe. Stands in at the head of a chain that begins without
/// a source.
class ReadOperator : public Source {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb to read; - or nothing is standard input", false);
    options.text("grids", names_, "NAME,NAME", "Only these grids");
  }

  Schema plan() override {
    if (isPipe() && ::isatty(STDIN_FILENO)) {
      throw UsageError(
          "nothing is piped in; name a source first (mesh2sdf part.stl), or a file: -i part.vdb");
    }
    Schema schema;
    if (isPipe()) {
      frames_ = std::make_unique<FrameReader>(STDIN_FILENO, "standard input");
      schema = frames_->schema();
    } else {
      VdbContents contents = readVdb(path_);
      schema = schemaOf(contents, "'" + path_ + "'");
      // Where the file does not say, every layer counts: its box may be smaller than what it holds.
      ZRange held{std::numeric_limits<int>::min(), std::numeric_limits<int>::max()};
      if (const auto some = schema.metadata.extract(layers_key)) {
        std::istringstream(some.mapped()) >> held.begin >> held.end;
      }
      slabs_.push_back({held, held, std::move(contents.grids)});
    }
    first_layer_ = schema.lattice.layers().begin;
    keepNamed(schema.grids);
    kept_ = schema.grids;
    return schema;
  }

  [[nodiscard]] bool isBarrier() const override { return !isPipe(); }

  [[nodiscard]] double memoryBytes() const override {
    double bytes = 0;
    for (const Slab& slab : slabs_) {
      for (const auto& [name, grid] : slab.grids) bytes += sizeOf(grid).bytes;
    }
    return bytes;
  }

  [[nodiscard]] Grids run(ZRange core) const override {
    const std::lock_guard lock(mutex_);
    if (isPipe()) takeFrames(core);
    checkCovered(core);
    Grids result;
    for (const auto& [name, prototype] : kept_) {
      std::vector<Layers> pieces;
      for (const Slab& slab : slabs_) {
        const auto found = slab.grids.find(name);
        if (found != slab.grids.end()) pieces.push_back({found->second, slab.core});
      }
      if (!pieces.empty()) result[name] = joinLayers(pieces, core);
    }
    return result;
  }

 private:
  [[nodiscard]] bool isPipe() const { return path_.empty() || path_ == "-"; }

  /// Frames come in rising z and so do the cores asked of a pipe: what lies below is dropped, what
  /// is missing is fetched.
  void takeFrames(ZRange core) const {
    std::erase_if(slabs_, [&](const Slab& slab) { return slab.core.end <= core.begin; });
    while (!ended_ && (slabs_.empty() || slabs_.back().core.end < core.end)) {
      std::optional<Slab> slab = frames_->next();
      ended_ = !slab;
      if (slab && slab->core.end > core.begin) slabs_.push_back(std::move(*slab));
    }
    // The closing frame must be seen before anything downstream is published.
    if (core.end >= frames_->schema().lattice.layers().end && !ended_) ended_ = !frames_->next();
  }

  /// What was made with --layers lacks the others, which are not empty.
  void checkCovered(ZRange core) const {
    int covered = core.begin;
    for (const Slab& slab : slabs_) {
      if (slab.core.begin <= covered) covered = std::max(covered, slab.core.end);
    }
    if (covered < core.end) {
      throw DataError((isPipe() ? "standard input" : "'" + path_ + "'") + " lacks layer " +
                      std::to_string(covered - first_layer_) +
                      "; where only some layers are wanted, give --layers to the last operator of "
                      "the chain alone");
    }
  }

  void keepNamed(Grids& grids) const {
    if (names_.empty()) return;
    Grids kept;
    for (std::size_t begin = 0; begin <= names_.size();) {
      const std::size_t comma = std::min(names_.find(',', begin), names_.size());
      const std::string name = names_.substr(begin, comma - begin);
      const auto found = grids.find(name);
      if (found == grids.end()) {
        std::string message = "--grids: no grid '" + name + "'; there are";
        for (const auto& [known, grid] : grids) message += " " + known;
        throw UsageError(message);
      }
      kept.insert(*found);
      begin = comma + 1;
    }
    grids = kept;
  }

  std::string path_;
  std::string names_;
  Grids kept_;
  int first_layer_ = 0;
  std::unique_ptr<FrameReader> frames_;
  mutable std::mutex mutex_;
  mutable std::vector<Slab> slabs_;
  mutable bool ended_ = false;
};

}  // namespace

extern const OperatorInfo read{
    "read", "Grids from a .vdb file or from standard input",
    "mesh2sdf part.stl --printer mimaki-3duj-553 ! write surface.vdb ! normals -o normals.vdb",
    [] { return std::unique_ptr<Operator>(std::make_unique<ReadOperator>()); }, true};

}  // namespace vdbdither
