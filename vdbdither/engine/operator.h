#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "vdbdither/engine/options.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// How many layers around its core a filter reads.
struct Reach {
  int below = 0;
  int above = 0;
  bool whole = false;  ///< a barrier: needs every layer at once

  static Reach point() { return {}; }
  static Reach stencil(int radius) { return {radius, radius, false}; }
  static Reach everything() { return {0, 0, true}; }
};

/// A grid that a filter or a sink reads, and how far around the core.
struct Read {
  std::string grid;
  Reach reach;
};

/// Words that an operator has for the user while it works. Safe to call from many threads.
class Reporter {
 public:
  virtual ~Reporter() = default;
  /// A line that the user should see whatever --quiet says.
  virtual void warn(const std::string& text) = 0;
  /// A figure for --json and --verbose: `repaired_edges`, 12.
  virtual void count(const std::string& name, double value) = 0;
  /// How far a long computation inside one call is, 0 … 1. Throws when the user wants to stop.
  virtual void progress(double fraction) = 0;
  /// What the operator is there to tell, in whole lines: to standard output, or to standard error
  /// where voxels leave by standard output.
  virtual void print(const std::string& /*text*/) {}
};

/// What an operator's computing costs, as CPU time of one thread of the machine it was measured on
/// (docs/performance.md).
struct Work {
  double us_per_leaf = 0;       ///< of those at the surface
  double us_per_held_leaf = 0;  ///< of all, for who looks at every distance of the band
  double us_per_layer = 0;
  double seconds = 0;  ///< once, whatever the layers
};

/// One verb. `declare` binds the options; `plan` makes every check that can be made before the
/// first voxel.
class Operator {
 public:
  virtual ~Operator() = default;
  virtual void declare(Options& options) = 0;
  /// Bytes that the operator holds besides its slabs, known after `plan`.
  [[nodiscard]] virtual double memoryBytes() const { return 0; }

  /// What its `run` or `write` and `finish` will cost, for --explain; nothing where nobody has
  /// measured it. Asked after `plan`.
  [[nodiscard]] virtual std::optional<Work> work() const { return std::nullopt; }

  /// Whether it holds the whole volume at once, which --explain announces and --stream refuses.
  /// Asked after `plan`.
  [[nodiscard]] virtual bool isBarrier() const { return false; }

  /// The .vdb that it names itself, to be read where it begins a chain in place of --input. Asked
  /// once the options are read.
  [[nodiscard]] virtual std::string inputFile() const { return ""; }

  /// Reads what it is fed, besides slabs, to the end. Called once every layer that the run wants
  /// has passed and before a sink publishes, in a thread of its own: who writes a pipe is to end
  /// well although not all of it was wanted, and when he does not, that must be known by then.
  virtual void drain() {}

  void setReporter(Reporter* reporter) { reporter_ = reporter; }

 protected:
  [[nodiscard]] Reporter& report() const;

 private:
  Reporter* reporter_ = nullptr;
};

/// Makes any range of layers on demand.
class Source : public Operator {
 public:
  virtual Schema plan() = 0;
  /// The grids of the schema over `core`: a multiple of eight layers unless cut at the job's box.
  /// Const, in any order, many at once.
  [[nodiscard]] virtual Grids run(ZRange core) const = 0;
};

/// Maps slab to slab. Const, in any order, many at once.
class Filter : public Operator {
 public:
  /// Checks `in` and returns what will come out. A grid left out of the result ends here.
  virtual Schema plan(const Schema& in) = 0;
  /// The grids it reads; `run` gets these and no others. Asked after `plan`.
  [[nodiscard]] virtual std::vector<Read> reads() const = 0;
  /// The grids it makes over in.core (what lies outside the core is cut off). Grids of the planned
  /// schema that are not returned pass on unchanged.
  [[nodiscard]] virtual Grids run(const Slab& in) const = 0;
};

/// What a sink will put on a disk.
struct OutputEstimate {
  std::string path;  ///< empty: nothing, or not on a disk
  double bytes = 0;  ///< about; 0 where unknown
};

/// Takes slabs in rising z. In the middle of a chain it sees the slabs and they pass on.
class Sink : public Operator {
 public:
  virtual void plan(const Schema& in) = 0;
  /// The names of the grids it looks at, where it does not look at all of them: grids that nobody
  /// looks at any more are let go early. Asked after `plan`.
  [[nodiscard]] virtual std::optional<std::vector<std::string>> reads() const {
    return std::nullopt;
  }
  virtual void write(const Slab& in) = 0;
  /// Publishes. Before it returns, nothing exists under the name that the user gave.
  virtual void finish() = 0;
  /// Asked after `plan`.
  [[nodiscard]] virtual OutputEstimate output() const { return {}; }
  /// Whether the voxels leave by standard output. Asked once the options are read.
  [[nodiscard]] virtual bool writesToStandardOutput() const { return false; }
  /// Whether it works on files that it names itself and no slab is to come: it is then planned with
  /// an empty schema, finished, and the whole of its chain. Asked once the options are read.
  [[nodiscard]] virtual bool standsAlone() const { return false; }
};

/// What the registry holds of an operator: `extern const OperatorInfo material_assign` in
/// ops/material_assign.cpp.
struct OperatorInfo {
  std::string_view name;     ///< the verb, kebab-case
  std::string_view summary;  ///< one sentence, no full stop
  /// A whole chain that runs in a folder with a `part.stl`, or several, a line each, of which the
  /// last shows the verb.
  std::string_view example;
  std::unique_ptr<Operator> (*make)();
  /// Moves grids without changing them (read, write): leaves no line in the history.
  bool transport = false;
};

}  // namespace vdbdither
