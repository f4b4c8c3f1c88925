#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "vdbdither/engine/estimate.h"
#include "vdbdither/engine/input.h"
#include "vdbdither/engine/reach.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// A verb of a chain. `plan` makes every check that needs no voxel; all other functions are called
/// after it.
class Operator : public Verb {
 public:
  /// Whether it holds the whole volume at once, which --explain announces and --stream refuses.
  [[nodiscard]] virtual bool isBarrier() const { return false; }

  /// The files and pipes that it reads while the chain runs, besides its slabs. --explain lists
  /// them, and the engine reads pipes to their end before any sink finishes. A filter gets their
  /// grids in `Slab::inputs`; sources and sinks read them on their own.
  [[nodiscard]] virtual std::vector<Input*> inputs() { return {}; }

  /// Whether it added to the history in `plan` what made its grids, so that its own line is left
  /// out. For an operator that leaves its work to another. Asked after `plan`.
  [[nodiscard]] virtual bool keepsHistory() const { return false; }

  /// Bytes that it holds besides slabs and inputs.
  [[nodiscard]] virtual double memoryBytes() const { return 0; }

  /// The cost of its `run`, or of `write` and `finish`, for --explain; nothing if nobody has
  /// measured it.
  [[nodiscard]] virtual std::optional<Work> work() const { return std::nullopt; }
};

/// Makes any range of layers on demand.
class Source : public Operator {
 public:
  virtual Schema plan() = 0;
  /// The grids of the schema over `core`: a multiple of 8 layers unless cut at the job's box.
  /// Called in any order and from many threads.
  [[nodiscard]] virtual Grids run(ZRange core) const = 0;
};

/// Maps slab to slab.
class Filter : public Operator {
 public:
  /// Checks `in` and returns the schema of the result. A grid that it leaves out ends here.
  virtual Schema plan(const Schema& in) = 0;
  /// The grids it reads; `run` gets these and no others.
  [[nodiscard]] virtual std::vector<Read> reads() const = 0;
  /// The grids it makes over in.core; voxels outside the core are cut off. Grids of the planned
  /// schema that are not returned pass on unchanged. Called in any order and from many threads.
  [[nodiscard]] virtual Grids run(const Slab& in) const = 0;
};

/// Takes slabs in rising z. In the middle of a chain the slabs pass on.
class Sink : public Operator {
 public:
  virtual void plan(const Schema& in) = 0;
  /// The grids it reads, or nothing if it reads all. Grids that no later stage reads are released
  /// early.
  [[nodiscard]] virtual std::optional<std::vector<std::string>> reads() const {
    return std::nullopt;
  }
  virtual void write(const Slab& in) = 0;
  /// Completes the output, on the disk and checked, while nothing of it exists under the name that
  /// the user gave.
  virtual void finish() = 0;
  /// Gives the output its name. Called once every sink of the chain has finished, so that a sink
  /// that fails leaves the outputs of all others as they were before the run.
  virtual void publish() {}
  /// Where its output goes, and how large it will be.
  [[nodiscard]] virtual OutputEstimate output() const { return {}; }

  /// Makes `publish` publish a piece of the output: files in `folder`, which the sink makes when it
  /// writes. Called before `plan`, with the options read. Throws UsageError where the output cannot
  /// be made in pieces, as that of most sinks.
  virtual void makePiece(const std::filesystem::path& folder);
  /// Takes the piece that `makePiece` made of the layers `core` in another run of the chain, in
  /// place of their slabs. Pieces come in rising z, and the output is the same, byte for byte.
  /// Throws DataError.
  virtual void takePiece(const std::filesystem::path& folder, ZRange core);
};

/// The registry's entry for an operator: `extern const OperatorInfo material_assign` in
/// ops/material_assign.cpp.
struct OperatorInfo {
  std::string_view name;     ///< the verb, kebab-case
  std::string_view summary;  ///< one sentence, no full stop
  /// A whole chain that runs in a folder with a `part.stl`, and a `part.ply` with colours; or
  /// several, one per line. The last one shows the verb.
  std::string_view example;
  std::unique_ptr<Operator> (*make)();
  /// Moves grids without changing them (read, write): leaves no line in the history.
  bool transport = false;
  /// Its own first positional is a .vdb, too: `compare a.vdb` compares what comes with a.vdb, and
  /// `compare b.vdb a.vdb` reads b.vdb as the input of the chain.
  bool names_vdb = false;
  FileTool on_file = {};
};

}  // namespace vdbdither
