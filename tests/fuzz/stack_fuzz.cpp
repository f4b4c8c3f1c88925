// Feeds the readers and the checks of stacks and containers of slices with archives that a fuzzer
// thinks of: they return sound layers, or refuse, or tell what is wrong. A unit is a zip archive,
// or the text of its members, which needs no checksums: each behind a line of `@@ ` and its name.
// Checksums of PNG are mended.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "io/file/zip.h"
#include "io/stack/checked_stack.h"
#include "io/stack/container.h"
#include "io/stack/image_stack.h"
#include "io/stack/stack_reader.h"
#include "tests/fuzz/png_parts.h"
#include "tests/fuzz/scratch_file.h"
#include "tests/fuzz/sound_slice.h"

namespace vdbdither {

namespace {

constexpr std::string_view mark = "\n@@ ";

/// Writes the archive of the members that stand in `text`. Returns false where there are none.
bool pack(std::string_view text, const std::filesystem::path& path) {
  std::size_t at = text.find(mark);
  if (at == text.npos) return false;
  ZipWriter zip(path, path);
  while (at != text.npos) {
    at += mark.size();
    const std::size_t next = text.find(mark, at);
    const std::string_view member = text.substr(at, next == text.npos ? next : next - at);
    const std::size_t name = member.find('\n');
    if (name != member.npos) {
      const std::string_view bytes = member.substr(name + 1);
      zip.add(std::string(member.substr(0, name)),
              mendedPng({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()}));
    }
    at = next;
  }
  zip.finish();
  return true;
}

void readStack(const std::filesystem::path& path, EditedStack edited) {
  try {
    const StackReader reader(path, edited, [](const std::string&) {});
    const Manifest& manifest = reader.manifest();
    const ZRange known = manifest.knownLayers();
    require(known.begin <= manifest.layers.begin && manifest.layers.end <= known.end);
    for (int z = manifest.layers.begin; z < manifest.layers.end; ++z) {
      const SpanImage image = reader.layer(z);
      requireSound(image);
      require(image.width == manifest.layout.width() && image.height == manifest.layout.height());
      for (const Span& span : image.spans)
        require(span.value <= std::max<std::size_t>(1, manifest.materials.size()));
    }
  } catch (const DataError&) {
  }
}

void readImages(const std::filesystem::path& path) {
  try {
    const ImageStack stack(path, [](const std::string&) {});
    for (int z = 0; z < stack.layers(); ++z) requireSound(stack.layer(z));
  } catch (const DataError&) {
  }
}

/// Reads all layers as `verify` does: faults are found, not refused.
void checkStack(const CheckedStack& stack, Findings& findings) {
  const Manifest& manifest = stack.manifest();
  StackTotals totals;
  for (int z = manifest.layers.begin; z < manifest.layers.end; ++z) {
    CheckedLayer layer = stack.layer(z);
    if (layer.image) {
      requireSound(*layer.image);
      require(layer.image->width == manifest.layout.width() &&
              layer.image->height == manifest.layout.height());
    }
    totals.add(layer, stack.shown(z), findings);
  }
  stack.finish(totals, findings);
  checkPrinter(stack, totals, printerOf(manifest), findings);
}

void verifyStack(const std::filesystem::path& path, bool is_foreign) {
  Findings findings;
  try {
    const auto stack =
        is_foreign ? openImages(path, {}, findings) : openDescribedStack(path, findings);
    checkStack(*stack, findings);
  } catch (const DataError&) {
  }
  for (const Finding& finding : findings.kept()) require(isOneLine(textOf(finding)));
}

void readArchive(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const bool is_archive = text.starts_with("PK");
  const ScratchFile file(is_archive ? bytes : std::span<const std::uint8_t>());
  const std::filesystem::path path = file.path();
  if (!is_archive && !pack(text, path)) return;
  readStack(path, EditedStack::refused);
  readStack(path, EditedStack::taken);
  const bool is_foreign = ImageStack::isAt(path);
  if (is_foreign) readImages(path);
  verifyStack(path, is_foreign);
}

}  // namespace

}  // namespace vdbdither

// NOLINTNEXTLINE(readability-identifier-naming): the fuzzer calls it so
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vdbdither::readArchive({data, size});
  return 0;
}
