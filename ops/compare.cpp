#include <array>
#include <cstdio>
#include <sstream>

#include <nlohmann/json.hpp>

#include "io/vdb/slab_reader.h"
#include "ops/kernels/measure/grid_difference.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/layers.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;
using openvdb::GridBase;

/// Compares what comes with a second archive, slab by slab.
class Compare : public Sink {
 public:
  void declare(Options& options) override {
    options.positional("file", path_, "The .vdb or named pipe to compare with");
    options.number("tolerance", tolerance_, {.min = 0}, "Maximum difference of equal values");
    grids_.declare(options);
    json_.declare(options);
  }

  void plan(const Schema& in) override {
    schema_ = in;
    other_ = std::make_unique<Other>(*this, path_);
    std::vector<std::string> names = grids_.list();
    if (names.empty()) {
      for (const Grids* grids : {&in.grids, &other_->schema().grids}) {
        for (const auto& [name, grid] : *grids) names.push_back(name);
      }
    }
    for (const std::string& name : names) {
      Finding& finding = findings_[name];
      finding.apart = whatDiffers(in.grids, other_->schema().grids, name);
    }
  }

  [[nodiscard]] std::vector<Input*> inputs() override { return {other_.get()}; }

  [[nodiscard]] std::optional<Work> work() const override {
    double us = 0;
    for (const auto& [name, finding] : findings_) {
      if (finding.apart.empty())
        us += cost::compare_us_per_grid +
              cost::compare_us_per_byte * leafBytes(other_->schema().grids.at(name));
    }
    return Work{.us_per_held_leaf = us};
  }

  [[nodiscard]] std::optional<std::vector<std::string>> reads() const override {
    std::vector<std::string> names;
    for (const auto& [name, finding] : findings_) names.push_back(name);
    return names;
  }

  void write(const Slab& in) override {
    const ZRange others = other_->schema().lattice.layers();
    // The boxes may differ where the voxels do not: what only the other has must be empty.
    if (in.core.begin == schema_.lattice.layers().begin)
      compare({}, {others.begin, std::min(in.core.begin, others.end)});
    compare(in.grids, in.core);
    end_ = in.core.end;
  }

  void finish() override {
    std::string summary;
    for (const auto& [name, finding] : findings_) {
      if (!finding.equal()) summary += (summary.empty() ? "" : "; ") + finding.text(name);
    }
    report().print(json_.json ? inJson() : summary.empty() ? "equal\n" : "");
    if (!summary.empty()) throw DataError("not equal to '" + path_ + "': " + summary);
  }

 private:
  /// The second archive. The layers that it has above the last slab are compared while all pipes
  /// are read to their end: one writer may feed this one and that of the chain.
  class Other : public SlabReader {
   public:
    Other(Compare& compare, const std::string& path) : SlabReader(path, {}), compare_(compare) {}
    void readToEnd() override {
      compare_.compareAbove();
      SlabReader::readToEnd();
    }

   private:
    Compare& compare_;
  };

  /// The result for one grid.
  struct Finding {
    std::string apart;  ///< in words, where voxels cannot be compared
    GridDifference difference;

    [[nodiscard]] bool equal() const { return apart.empty() && difference.voxels == 0; }
    [[nodiscard]] std::string text(const std::string& name) const {
      if (!apart.empty()) return "grid '" + name + "' " + apart;
      std::array<char, 32> largest{};
      std::snprintf(largest.data(), largest.size(), "%.6g", difference.largest);
      const openvdb::Coord& at = difference.first;
      return "grid '" + name + "' in " + std::to_string(difference.voxels) + " voxels, first at " +
             std::to_string(at.x()) + " " + std::to_string(at.y()) + " " + std::to_string(at.z()) +
             ", by at most " + largest.data();
    }
  };

  static std::string whatDiffers(const Grids& ours, const Grids& others, const std::string& name) {
    const auto a = ours.find(name);
    const auto b = others.find(name);
    if (a == ours.end() && b == others.end()) throw UsageError("no grid '" + name + "' in either");
    if (b == others.end()) return "is missing there";
    if (a == ours.end()) return "is there alone";
    const GridBase& first = *a->second;
    const GridBase& second = *b->second;
    if (first.type() != second.type())
      return "is of " + first.valueType() + ", there of " + second.valueType();
    if (first.transform() != second.transform()) return "lies on another lattice";
    if (first.getGridClass() != second.getGridClass()) {
      return "is of class " + GridBase::gridClassToString(first.getGridClass()) + ", there of " +
             GridBase::gridClassToString(second.getGridClass());
    }
    return "";
  }

  /// A grid of a slab, or the empty one of its schema.
  static GridConstPtr gridOf(const std::string& name, const Grids& grids, const Schema& schema) {
    const auto found = grids.find(name);
    return found == grids.end() ? schema.grids.at(name) : found->second;
  }

  /// What only the other has above the last layer of the job must be empty.
  void compareAbove() {
    if (!end_ || *end_ != schema_.lattice.layers().end) return;
    const ZRange others = other_->schema().lattice.layers();
    compare({}, {std::max(*end_, others.begin), others.end});
  }

  void compare(const Grids& ours, ZRange layers) {
    if (layers.empty()) return;
    const ZRange others = other_->schema().lattice.layers();
    const ZRange asked = other_->isPipe() ? intersection(layers, others) : layers;
    const Grids theirs = asked.empty() ? Grids() : other_->read(asked);
    for (auto& [name, finding] : findings_) {
      if (!finding.apart.empty()) continue;
      const GridConstPtr here = gridOf(name, ours, schema_);
      const GridConstPtr there = gridOf(name, theirs, other_->schema());
      finding.difference.add(gridDifference(*here, *there, tolerance_));
    }
  }

  [[nodiscard]] std::string inJson() const {
    ordered_json json;
    bool equal = true;
    for (const auto& [name, finding] : findings_) equal &= finding.equal();
    json["equal"] = equal;
    json["grids"] = ordered_json::array();
    for (const auto& [name, finding] : findings_) {
      ordered_json entry = {{"name", name}, {"equal", finding.equal()}};
      if (!finding.apart.empty()) {
        entry["difference"] = finding.apart;
      } else {
        entry["voxels"] = finding.difference.voxels;
        if (finding.difference.voxels > 0) {
          const openvdb::Coord& at = finding.difference.first;
          entry["first"] = {at.x(), at.y(), at.z()};
          entry["largest"] = finding.difference.largest;
        }
      }
      json["grids"].push_back(std::move(entry));
    }
    return jsonText(json) + "\n";
  }

  std::string path_;
  double tolerance_ = 0;
  GridListOption grids_;
  JsonOption json_;
  Schema schema_;
  std::unique_ptr<Other> other_;
  std::map<std::string, Finding> findings_;
  std::optional<int> end_;  ///< of the layers that came
};

}  // namespace

extern const OperatorInfo compare;
const OperatorInfo compare{
    .name = "compare",
    .summary = "Whether two .vdb hold the same voxels, and where not; exits with 1 where not",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 -o surface.vdb\n"
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! compare surface.vdb",
    .make = []() -> std::unique_ptr<Operator> { return std::make_unique<Compare>(); },
    .names_vdb = true};

}  // namespace vdbdither
