#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/file/staged_output.h"
#include "io/job/open_job.h"
#include "io/job/piece_numbers.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/engine/tool_watcher.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

namespace fs = std::filesystem;

/// A folder that is there, and stays if something is in it: pieces, or what a run that was stopped
/// is still removing behind itself.
class PiecesFolder {
 public:
  explicit PiecesFolder(fs::path path) : path_(std::move(path)) {
    std::error_code error;
    fs::create_directory(path_, error);
    if (error) throw DataError("cannot make '" + path_.string() + "': " + error.message());
  }
  PiecesFolder(const PiecesFolder&) = delete;
  PiecesFolder& operator=(const PiecesFolder&) = delete;
  ~PiecesFolder() {
    std::error_code not_empty;
    fs::remove(path_, not_empty);
  }

 private:
  fs::path path_;
};

/// Makes pieces of a job that plan wrote. A piece that is there, whole, is left as it is.
class PieceTool : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("job", folder_, "Folder of the job");
    options.positional("numbers", numbers_, "Numbers of pieces, such as 7, 0-15 or 1,4-6");
  }

  void run() override {
    const OpenJob opened(folder_);
    checkInputs(opened.job());
    const std::vector<std::size_t> numbers = pieceNumbers(numbers_, opened.job().pieces.size());
    const PiecesFolder pieces(opened.folder() / pieces_name);
    std::size_t kept = 0;
    ToolWatcher watcher(report());
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      const double share = 1.0 / static_cast<double>(numbers.size());
      watcher.expect(static_cast<double>(i) * share, share);
      const std::string shown = "piece " + std::to_string(numbers[i]);
      if (!pieceProblem(pieceFolder(opened.folder(), numbers[i]), opened.pieceOf(numbers[i]))) {
        report().print(shown + " is there\n");
        ++kept;
        continue;
      }
      make(opened, numbers[i], watcher);
      report().print(shown + " is made\n");
    }
    report().count("made", static_cast<double>(numbers.size() - kept));
    report().count("kept", static_cast<double>(kept));
  }

 private:
  void make(const OpenJob& opened, std::size_t number, ToolWatcher& watcher) const {
    const fs::path folder = pieceFolder(opened.folder(), number);
    // Whatever is there is not the piece.
    const auto replaceAll = [](const fs::path& old) {
      std::set<std::string> names;
      for (const fs::directory_entry& entry : fs::recursive_directory_iterator(old)) {
        if (!entry.is_directory()) names.insert(entry.path().lexically_relative(old).string());
      }
      return names;
    };
    StagedOutput output(folder, StagedOutput::Kind::folder, replaceAll);
    const PieceOf piece = opened.pieceOf(number);
    Pipeline pipeline(opened.steps(
        {"--layers", std::to_string(piece.layers.begin) + ":" + std::to_string(piece.layers.end),
         "--slab", std::to_string(opened.job().slab_layers)}));
    pipeline.makePiece(output.path());
    opened.checkLattice(pipeline.plan(watcher));
    checkReads(opened.job());
    pipeline.run();
    writePieceRecord(output.path(), piece);
    output.commit();
  }

  std::string folder_;
  std::string numbers_;
};

}  // namespace

extern const ToolInfo piece;
const ToolInfo piece{
    .name = "piece",
    .summary = "Makes pieces of a job, unless they are there",
    .example =
        "plan \"mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! slice-export out\" "
        "--pieces 2\npiece job 0-1",
    .make = []() -> std::unique_ptr<Tool> { return std::make_unique<PieceTool>(); },
    .takes_run_options = true};

}  // namespace vdbdither
