#include "tests/support/numbered_layers.h"

#include <limits>
#include <memory>
#include <mutex>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither::test {

namespace {

using openvdb::Coord;
using openvdb::Int32Grid;

Notes& mutableNotes() {
  static Notes notes;
  return notes;
}

void note(const std::string& call) {
  static std::mutex mutex;
  const std::lock_guard lock(mutex);
  mutableNotes().calls.push_back(call);
}

std::string layersText(ZRange layers) {
  return std::to_string(layers.begin) + ":" + std::to_string(layers.end);
}

int valueAt(const Int32Grid& grid, int z) { return grid.tree().getValue({0, 0, z}); }

/// `value(z)` in the voxel of each layer.
template <typename Value>
GridConstPtr gridOf(ZRange layers, const Value& value) {
  const auto grid = Int32Grid::create(0);
  for (int z = layers.begin; z < layers.end; ++z) grid->tree().setValue({0, 0, z}, value(z));
  return grid;
}

Schema schemaOver(ZRange layers) {
  Schema schema;
  schema.lattice.box = {Coord(0, 0, layers.begin), Coord(7, 7, layers.end - 1)};
  schema.grids["n"] = Int32Grid::create(0);
  const double rows = alignedToLeaves(layers).size() / double{leaf_layers};
  schema.footprint = {1, rows, rows};
  return schema;
}

struct LayerRange {
  int bottom = 0;
  int top = 16;

  void declare(Options& options) {
    options.integer("bottom", bottom, {-1000, 1000}, "The lowest layer");
    options.integer("top", top, {-1000, 1000}, "The layer above the highest");
  }
  [[nodiscard]] ZRange layers() const { return {bottom, top}; }
};

class Numbers : public Source {
 public:
  void declare(Options& options) override { range_.declare(options); }
  Schema plan() override { return schemaOver(range_.layers()); }
  [[nodiscard]] std::optional<Work> work() const override { return Work{.us_per_layer = 1e6}; }
  [[nodiscard]] Grids run(ZRange core) const override {
    note("numbers " + layersText(core));
    return {{"n", gridOf(core, [](int z) { return z + 100; })}};
  }

 private:
  LayerRange range_;
};

class Sum : public Filter {
 public:
  void declare(Options& options) override {
    options.integer("below", below_, {0, 100}, "Layers below");
    options.integer("above", above_, {0, 100}, "Layers above");
    options.integer("fail-at", fail_at_, {0, 1000}, "The layer to fail on");
  }
  Schema plan(const Schema& in) override { return in; }
  [[nodiscard]] std::vector<Read> reads() const override { return {{"n", {below_, above_}}}; }
  [[nodiscard]] Grids run(const Slab& in) const override {
    note("sum " + layersText(in.core));
    if (in.core.contains(fail_at_)) throw DataError("layer " + std::to_string(fail_at_));
    const auto n = findGrid<Int32Grid>(in.grids, "n");
    return {{"n", gridOf(in.core, [&](int z) {
               int sum = 0;
               for (int at = z - below_; at <= z + above_; ++at) {
                 if (in.valid.contains(at)) sum += valueAt(*n, at);
               }
               return sum;
             })}};
  }

 private:
  int below_ = 0;
  int above_ = 0;
  int fail_at_ = 1000;
};

class Enlarge : public Filter {
 public:
  void declare(Options& options) override {
    options.integer("by", by_, {0, 100}, "Layers at both ends");
  }
  Schema plan(const Schema& in) override {
    Schema out = in;
    out.lattice.box.min().z() -= by_;
    out.lattice.box.max().z() += by_;
    out.grids["seen"] = Int32Grid::create(0);
    return out;
  }
  [[nodiscard]] std::vector<Read> reads() const override { return {{"n", Reach::point()}}; }
  [[nodiscard]] Grids run(const Slab& in) const override {
    note("enlarge " + layersText(in.core));
    return {{"seen", in.grids.at("n")}};
  }

 private:
  int by_ = 0;
};

/// z + 1000 in every layer of a range.
class NumberedInput : public Input {
 public:
  NumberedInput(ZRange layers, bool is_pipe) : is_pipe_(is_pipe), schema_(schemaOver(layers)) {}

  [[nodiscard]] const std::string& path() const override { return path_; }
  [[nodiscard]] bool isPipe() const override { return is_pipe_; }
  [[nodiscard]] const Schema& schema() const override { return schema_; }
  [[nodiscard]] double memoryBytes() const override { return 5e6; }
  Grids read(ZRange core) override {
    note("input read " + layersText(core));
    return {{"n", gridOf(core, [](int z) { return z + 1000; })}};
  }
  void readToEnd() override { note("input end"); }

 private:
  std::string path_ = "second.vdb";
  bool is_pipe_;
  Schema schema_;
};

class Join : public Filter {
 public:
  void declare(Options& options) override {
    range_.declare(options);
    options.flag("pipe", is_pipe_, "The input is a pipe");
  }
  Schema plan(const Schema& in) override {
    input_ = std::make_unique<NumberedInput>(range_.layers(), is_pipe_);
    return in;
  }
  [[nodiscard]] std::vector<Read> reads() const override { return {{"n", Reach::point()}}; }
  [[nodiscard]] std::vector<Input*> inputs() override { return {input_.get()}; }
  [[nodiscard]] double memoryBytes() const override { return 1e6; }
  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto first = findGrid<Int32Grid>(in.grids, "n");
    const Grids& others = in.inputs.at(0);
    const auto second = others.empty() ? Int32Grid::create(0) : findGrid<Int32Grid>(others, "n");
    return {
        {"n", gridOf(in.core, [&](int z) { return valueAt(*first, z) + valueAt(*second, z); })}};
  }

 private:
  LayerRange range_;
  bool is_pipe_ = false;
  std::unique_ptr<NumberedInput> input_;
};

class Keep : public Sink {
 public:
  void declare(Options& options) override {
    options.text("file", file_, "NAME", "Name of the output");
    options.flag("fail-to-finish", fails_to_finish_, "Fails when it finishes");
    options.flag("fail-to-publish", fails_to_publish_, "Fails when it publishes");
  }
  void plan(const Schema&) override {}
  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    return std::vector<std::string>{"n"};
  }
  [[nodiscard]] std::optional<Work> work() const override {
    return Work{.us_per_held_leaf = 10, .seconds = 1};
  }
  [[nodiscard]] OutputEstimate output() const override { return {file_, 1000}; }
  void write(const Slab& in) override {
    note("keep " + layersText(in.core));
    const auto n = findGrid<Int32Grid>(in.grids, "n");
    for (int z = in.core.begin; z < in.core.end; ++z)
      mutableNotes().kept.emplace_back(z, valueAt(*n, z));
  }
  void finish() override {
    if (fails_to_finish_) throw DataError("cannot finish");
    note("keep finish");
  }
  void publish() override {
    if (fails_to_publish_) throw DataError("cannot publish");
    note("publish " + file_);
  }

 private:
  std::string file_ = "kept.txt";
  bool fails_to_finish_ = false;
  bool fails_to_publish_ = false;
};

template <typename Type>
std::unique_ptr<Operator> made() {
  return std::make_unique<Type>();
}

}  // namespace

const OperatorInfo& findNumbered(std::string_view name) {
  static const std::vector<OperatorInfo> infos{{"numbers", "", "", made<Numbers>},
                                               {"sum", "", "", made<Sum>},
                                               {"enlarge", "", "", made<Enlarge>},
                                               {"join", "", "", made<Join>},
                                               {"keep", "", "", made<Keep>}};
  for (const OperatorInfo& info : infos) {
    if (info.name == name) return info;
  }
  return findOperator(name);
}

const Notes& notes() { return mutableNotes(); }
void clearNotes() { mutableNotes() = {}; }

}  // namespace vdbdither::test
