#include <array>
#include <filesystem>

#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "vdbdither/engine/manual.h"
#include "vdbdither/engine/tool.h"

namespace vdbdither {

namespace {

enum class Kind { markdown, man, completion };
constexpr std::array<Choice<Kind>, 3> kinds{
    {{Kind::markdown, "markdown", "The pages of docs/operators"},
     {Kind::man, "man", "Manual pages"},
     {Kind::completion, "completion", "Completion for bash, zsh and fish"}}};

/// Writes the manuals that are made from what operators and commands declare.
class Docs : public Tool {
 public:
  void declare(Options& options) override {
    options.positional("kind", kind_, kinds, "What to write");
    options.positional("folder", folder_,
                       "Folder for the files, which replace those of the same name");
  }

  void run() override {
    switch (kind_) {
      case Kind::markdown:
        return write(markdownFiles());
      case Kind::man:
        return write(manualFiles());
      case Kind::completion:
        return write(completionFiles());
    }
  }

 private:
  void write(const std::vector<std::pair<std::string, std::string>>& files) const {
    for (const auto& [name, text] : files) {
      const std::filesystem::path path = std::filesystem::path(folder_) / name;
      std::error_code error;
      std::filesystem::create_directories(path.parent_path(), error);
      writeFile(path, textBytes(text), path);
    }
  }

  Kind kind_ = Kind::markdown;
  std::string folder_;
};

}  // namespace

extern const ToolInfo docs;
const ToolInfo docs{"docs", "Writes the manuals", "docs markdown docs/operators",
                    []() -> std::unique_ptr<Tool> { return std::make_unique<Docs>(); }, true};

}  // namespace vdbdither
