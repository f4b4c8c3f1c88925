#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/job/open_job.h"
#include "io/job/piece_numbers.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/engine/tool_watcher.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Joins the pieces of a job into what one run of its chain would have written, byte for byte.
class Merge : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("job", folder_, "Folder of the job");
    overwrite_.declare(options, "each output");
  }

  void run() override {
    const OpenJob opened(folder_);
    checkPieces(opened);
    checkInputs(opened.job());
    ToolWatcher watcher(report());
    watcher.expect(share_of_check, 1 - share_of_check);
    Pipeline pipeline(overwrite_.overwrite ? opened.stepsThatOverwrite() : opened.steps({}));
    const JobPlan& plan = pipeline.plan(watcher);
    opened.checkLattice(plan);
    checkReads(opened.job());
    std::vector<Piece> pieces;
    for (std::size_t number = 0; number < opened.job().pieces.size(); ++number) {
      const ZRange layers = opened.job().pieces[number].layers;
      pieces.push_back({{plan.layers.begin + layers.begin, plan.layers.begin + layers.end},
                        pieceFolder(opened.folder(), number)});
    }
    pipeline.join(pieces);
    report().print("'" + folder_ + "': " + std::to_string(pieces.size()) +
                   (pieces.size() == 1 ? " piece is" : " pieces are") + " joined\n");
    report().count("pieces", static_cast<double>(pieces.size()));
  }

 private:
  /// Of the time, about.
  static constexpr double share_of_check = 0.5;

  void checkPieces(const OpenJob& opened) {
    const std::size_t count = opened.job().pieces.size();
    std::vector<std::size_t> unsound;
    std::string why;
    for (std::size_t number = 0; number < count; ++number) {
      report().progress(share_of_check * static_cast<double>(number) / static_cast<double>(count));
      const auto problem =
          pieceProblem(pieceFolder(opened.folder(), number), opened.pieceOf(number));
      if (!problem) continue;
      if (unsound.empty()) why = "piece " + std::to_string(number) + " " + *problem;
      unsound.push_back(number);
    }
    if (unsound.empty()) return;
    throw DataError("'" + folder_ + "': " + why + "; make it with: vdbdither piece " +
                    quotedForShell(folder_) + " " + numbersText(unsound));
  }

  std::string folder_;
  OverwriteOption overwrite_;
};

}  // namespace

extern const ToolInfo merge;
const ToolInfo merge{
    .name = "merge",
    .summary = "Joins the pieces of a job into what one run would have written",
    .example =
        "plan \"mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\" "
        "--pieces 2\npiece job 0-1\nmerge job",
    .make = []() -> std::unique_ptr<Tool> { return std::make_unique<Merge>(); },
    .takes_run_options = true};

}  // namespace vdbdither
