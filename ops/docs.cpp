#include <filesystem>

#include "io/file/staged_output.h"
#include "vdbdither/engine/manual.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// Writes the manuals that are made from what operators and commands declare.
class Docs : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("kind", kind_, "markdown, man or completion");
    options.positional("folder", folder_, "Where the files go; those there are replaced");
  }

  void run() override {
    if (kind_ == "markdown") {
      write(markdownFiles());
    } else if (kind_ == "man") {
      write(manualFiles());
    } else if (kind_ == "completion") {
      write(completionFiles());
    } else {
      throw UsageError("kind: '" + kind_ + "' is none of markdown, man, completion");
    }
  }

 private:
  void write(const std::vector<std::pair<std::string, std::string>>& files) const {
    for (const auto& [name, text] : files) {
      const std::filesystem::path path = std::filesystem::path(folder_) / name;
      std::error_code error;
      std::filesystem::create_directories(path.parent_path(), error);
      writeFile(path, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, path);
    }
  }

  std::string kind_;
  std::string folder_;
};

}  // namespace

extern const ToolInfo docs;
const ToolInfo docs{"docs", "Writes the manuals", "docs markdown docs/operators",
                    []() -> std::unique_ptr<Tool> { return std::make_unique<Docs>(); }, true};

}  // namespace vdbdither
