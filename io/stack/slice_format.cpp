#include "io/stack/slice_format.h"

#include <algorithm>

#include "io/file/text_bytes.h"
#include "io/image/png_spans.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

void SliceEncoder::plan(const Manifest& stack, const Grids& /*grids*/) { stack_ = stack; }

void SliceEncoder::finish(const Manifest& stack, const SpanImage& preview,
                          StackOutput& output) const {
  output.write(preview_name, encodePng(preview, {}));
  const std::string text = textOf(stack);
  output.write(manifest_name, textBytes(text));
}

std::vector<std::uint32_t> SliceEncoder::palette() const {
  std::vector<std::uint32_t> colours{rgba(stack_.background)};
  for (const Material& material : stack_.materials) colours.push_back(rgba(material.rgba));
  return colours;
}

std::vector<SliceFile> SliceEncoder::forEachMaterial(
    const SliceLayer& layer, std::string_view ending,
    const std::function<std::vector<std::uint8_t>(std::uint32_t)>& bytes) const {
  std::vector<SliceFile> files;
  for (std::uint32_t i = 1; i <= stack_.materials.size(); ++i) {
    const std::string& name = stack_.materials[i - 1].name;
    files.push_back({name + "/" + layer.name + std::string(ending), name, bytes(i)});
  }
  return files;
}

const SliceFormat* findSliceFormat(std::string_view name) {
  for (const SliceFormat* format : sliceFormats()) {
    if (format->name == name) return format;
  }
  return nullptr;
}

const SliceFormat* sliceFormatOfContainer(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  for (const SliceFormat* format : sliceFormats()) {
    if (!ending.empty() && equalsIgnoringCase(ending, format->container_ending)) return format;
  }
  return nullptr;
}

std::optional<DescribedStack> describedStack(const StackInput& files) {
  for (const SliceFormat* format : sliceFormats()) {
    if (format->describe == nullptr) continue;
    if (auto described = format->describe(files)) return described;
  }
  return std::nullopt;
}

bool namesSlice(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  return std::any_of(sliceFormats().begin(), sliceFormats().end(), [&](const SliceFormat* format) {
    return equalsIgnoringCase(ending, format->ending) ||
           (!ending.empty() && equalsIgnoringCase(ending, format->other_ending));
  });
}

std::string sliceFormatNames(const std::function<bool(const SliceFormat&)>& choose) {
  std::vector<std::string> names;
  for (const SliceFormat* format : sliceFormats()) {
    if (!choose || choose(*format)) names.emplace_back(format->name);
  }
  return alternatives(names);
}

}  // namespace vdbdither
