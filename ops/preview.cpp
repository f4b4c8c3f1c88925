#include <algorithm>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "io/stack/stack_page.h"
#include "io/stack/stack_reader.h"
#include "vdbdither/engine/option_groups.h"
#include "vdbdither/engine/tool.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

/// A page to look at a stack of slices.
class Preview : public Tool {
 public:
  void declare(Options& options) override {
    options.positional(
        "stack", stack_,
        "Stack of slices: its folder, its manifest, its zip archive, or a container");
    options.positional("page", page_,
                       "Page to write (.html); by default it is called like the stack", false);
    options.file("against", against_, "STACK", "Another stack, whose differences the page shows");
    options.flag("edited", edited_,
                 "Takes stacks whose manifest or slices changed after slice-export wrote them");
    overwrite_.declare(options, "the file");
  }

  void run() override {
    const std::filesystem::path target =
        page_.empty() ? defaultPage() : std::filesystem::path(page_);
    StackPage::check(target, overwrite_.overwrite);
    const auto warn = [this](const std::string& text) { report().warn(text); };
    const EditedStack edited = edited_ ? EditedStack::taken : EditedStack::refused;
    const StackReader shown(stack_, edited, warn);
    std::optional<StackReader> other;
    if (!against_.empty()) other.emplace(against_, edited, warn);

    ZRange layers = shown.manifest().knownLayers();
    if (other) {
      const ZRange known = other->manifest().knownLayers();
      layers = {std::min(layers.begin, known.begin), std::max(layers.end, known.end)};
    }
    StackPage page(layers, shownStack(stack_, shown),
                   other ? std::optional(shownStack(against_, *other)) : std::nullopt);
    const int together = tbb::this_task_arena::max_concurrency();
    for (int begin = layers.begin; begin < layers.end; begin += together) {
      report().progress(static_cast<double>(begin - layers.begin) / layers.size());
      const int end = std::min(begin + together, layers.end);
      std::vector<std::vector<SpanImage>> slices(static_cast<std::size_t>(end - begin));
      tbb::parallel_for(begin, end, [&](int z) {
        std::vector<SpanImage>& images = slices[static_cast<std::size_t>(z - begin)];
        images.push_back(shown.layer(z));
        if (other) images.push_back(other->layer(z));
      });
      for (int z = begin; z < end; ++z)
        page.add(z, std::move(slices[static_cast<std::size_t>(z - begin)]));
    }
    page.finish(target);
    page.commit();
    if (const std::string text = page.warning(); !text.empty()) warn(text);
  }

 private:
  static PageStack shownStack(const std::string& path, const StackReader& reader) {
    PageStack stack = pageStack(path, reader.manifest());
    if (reader.format().pixel == SlicePixel::printed && stack.manifest.materials.size() > 1)
      stack.manifest.materials = {{"printed", {240, 240, 240, 255}}};
    return stack;
  }

  /// Beside the stack: out.html for out, out.zip and out/manifest.json.
  [[nodiscard]] std::filesystem::path defaultPage() const {
    std::filesystem::path path = std::filesystem::path(stack_).lexically_normal();
    if (!path.has_filename() || path.filename() == manifest_name) path = path.parent_path();
    return (namesArchive(path) ? path.replace_extension() : path).concat(".html");
  }

  std::string stack_;
  std::string page_;
  std::string against_;
  bool edited_ = false;
  OverwriteOption overwrite_;
};

}  // namespace

extern const ToolInfo preview;
const ToolInfo preview{
    .name = "preview",
    .summary = "A page to look through a stack of slices, in one HTML file",
    .example =
        "mesh2sdf part.stl --printer mimaki-3duj-553 ! dither ! material-assign ! slice-export "
        "out\n"
        "preview out out.html",
    .make = []() -> std::unique_ptr<Tool> { return std::make_unique<Preview>(); },
    .takes_run_options = true};

}  // namespace vdbdither
