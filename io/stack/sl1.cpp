// SL1, the archive that PrusaSlicer writes for resin printers and that UVtools turns into the
// formats of other makers. After the writer of PrusaSlicer 2.5 and the reader of UVtools.

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "io/file/key_values.h"
#include "io/image/png_decoder.h"
#include "io/stack/resin_slices.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

constexpr const char* job_name = "config.ini";
constexpr const char* slicer_name = "prusaslicer.ini";
constexpr std::array<const char*, 2> thumbnail_names{"thumbnail/thumbnail400x400.png",
                                                     "thumbnail/thumbnail800x480.png"};
constexpr int number_digits = 5;
const SliceNames sl1_names{"slice", number_digits, 0};

class Sl1Slices : public ResinSlices {
 public:
  Sl1Slices() : ResinSlices("sl1") {}

  void finish(const Manifest& stack, const SpanImage& preview, StackOutput& output) const override {
    writeText(output, job_name, job(stack));
    writeText(output, slicer_name, slicer(stack));
    output.write(thumbnail_names[0], encodePicture(thumbnailOf(preview, 400, 400)));
    output.write(thumbnail_names[1], encodePicture(thumbnailOf(preview, 800, 480)));
  }

 private:
  [[nodiscard]] std::string job(const Manifest& stack) const {
    double voxels = 0;
    for (const std::uint64_t count : stack.voxels) voxels += static_cast<double>(count);
    const int layers = stack.layers.size();
    const int bottom = std::min(bottomLayers(), layers);
    std::ostringstream text;
    text << "action = print\njobDir = " << sl1_names.prefix
         << "\nexpTime = " << shortestText(exposureSeconds())
         << "\nexpTimeFirst = " << shortestText(bottomExposureSeconds())
         << "\nexpUserProfile = 0"
         // The same part makes the same bytes on any day.
         << "\nfileCreationTimestamp = 1980-01-01 at 00:00:00 UTC"
         << "\nhollow = 0\nlayerHeight = " << shortestText(pitchMm().z())
         << "\nmaterialName = " << line(stack.materials.front().name) << "\nnumFade = " << bottom
         << "\nnumFast = " << layers << "\nnumSlow = 0\nprintProfile = vdbdither\nprintTime = "
         << shortestText(bottom * bottomExposureSeconds() + (layers - bottom) * exposureSeconds())
         << "\nprinterModel = SL1\nprinterProfile = "
         << line(printer().name.empty() ? "vdbdither" : printer().name)
         << "\nprinterVariant = default\nprusaSlicerVersion = vdbdither " << version
         << "\nusedMaterial = " << shortestText(voxels * pitchMm().product() / 1000) << "\n";
    return text.str();
  }

  [[nodiscard]] std::string slicer(const Manifest& stack) const {
    const SliceLayout& layout = stack.layout;
    std::ostringstream text;
    text << "display_height = " << shortestText(layout.height() * pitchMm().y())
         << "\ndisplay_mirror_x = " << printer().mirror_x
         << "\ndisplay_mirror_y = " << printer().mirror_y
         << "\ndisplay_orientation = landscape\ndisplay_pixels_x = " << layout.width()
         << "\ndisplay_pixels_y = " << layout.height()
         << "\ndisplay_width = " << shortestText(layout.width() * pitchMm().x())
         << "\nexposure_time = " << shortestText(exposureSeconds())
         << "\nfaded_layers = " << std::min(bottomLayers(), stack.layers.size())
         << "\ngamma_correction = 1\ninitial_exposure_time = "
         << shortestText(bottomExposureSeconds())
         << "\ninitial_layer_height = " << shortestText(pitchMm().z())
         << "\nlayer_height = " << shortestText(pitchMm().z())
         << "\nmax_print_height = " << shortestText(printer().build_mm.z())
         << "\nprinter_notes = " << line(printer().printer_notes) << "\nprinter_technology = SLA\n";
    return text.str();
  }

  /// `text` as the value of a key: line ends as slicers write them.
  static std::string line(const std::string& text) {
    std::string result;
    for (const char c : text) result += c == '\n' ? std::string("\\n") : std::string(1, c);
    return printable(result);
  }
};

KeyValues valuesOf(const StackInput& files, const char* name) {
  return KeyValues(files.read(name, most_configuration_bytes), "'" + files.shown(name) + "'");
}

/// Tells where the configurations of the job and of the slicer contradict each other.
void checkSl1(const StackInput& files, const DescribedStack& /*stack*/,
              std::span<const std::uint64_t> /*voxels*/, Findings& findings) {
  const KeyValues job = valuesOf(files, job_name);
  const KeyValues slicer = valuesOf(files, slicer_name);
  using Severity = Finding::Severity;
  const auto compare = [&](const char* key, const char* other, const char* id, Severity severity,
                           const char* what) {
    const auto a = slicer.find(key);
    const auto b = job.find(other);
    if (!a || !b || *a == *b) return;
    constexpr double most = 1e9;
    constexpr double tolerance = 1e-6;
    if (std::abs(slicer.number(key, 0, most) - job.number(other, 0, most)) <= tolerance) return;
    findings.add(
        {id, severity,
         std::string(key) + " is " + *a + ", and " + other + " of " + job_name + " is " + *b + what,
         files.shown(slicer_name)});
  };
  constexpr const char* again = "; make the stack again";
  compare("layer_height", "layerHeight", "layer-height", Severity::error, again);
  compare("initial_layer_height", "layerHeight", "layer-height", Severity::warning,
          "; the lowest layer has another height than the others");
  compare("exposure_time", "expTime", "exposure", Severity::warning, again);
  compare("initial_exposure_time", "expTimeFirst", "exposure", Severity::warning, again);
  compare("faded_layers", "numFade", "exposure", Severity::warning, again);
  tellMissingPictures(files, thumbnail_names, findings);
}

std::optional<DescribedStack> describeSl1(const StackInput& files) {
  if (!files.contains(job_name) || !files.contains(slicer_name)) return std::nullopt;
  const KeyValues job = valuesOf(files, job_name);
  const KeyValues slicer = valuesOf(files, slicer_name);
  constexpr int most = 1 << 24;
  constexpr double longest_mm = 1e5;
  ContainerContents contents;
  contents.format = "sl1";
  contents.configuration = job_name;
  contents.shown = "'" + files.shown(job_name) + "'";
  contents.width = slicer.integer("display_pixels_x", 1, most);
  contents.height = slicer.integer("display_pixels_y", 1, most);
  contents.pitch_mm = {
      slicer.number("display_width", 0, longest_mm) / static_cast<double>(contents.width),
      slicer.number("display_height", 0, longest_mm) / static_cast<double>(contents.height),
      job.number("layerHeight", 0, longest_mm)};
  contents.layers = job.integer("numFast", 0, most) + job.integer("numSlow", 0, most);
  contents.flip_x = slicer.find("display_mirror_x") == "1";
  contents.flip_y = slicer.find("display_mirror_y") == "1";
  contents.materials = resinTable();
  contents.file_name = [prefix = job.text("jobDir")](int layer, std::size_t /*material*/) {
    return prefix + zeroPadded(layer, number_digits) + ".png";
  };
  return describedBy(contents, files);
}

}  // namespace

extern const SliceFormat sl1;
const SliceFormat sl1{.name = "sl1",
                      .summary = "Archive for resin printers, as PrusaSlicer writes it",
                      .ending = ".png",
                      .pixel = SlicePixel::printed,
                      .encoder = makeSliceEncoder<Sl1Slices>,
                      .decode = decodePng,
                      .decodes_colours = true,
                      .bytes_per_leaf = 80,
                      .container_ending = ".sl1",
                      .describe = describeSl1,
                      .check = checkSl1,
                      .names = &sl1_names,
                      .shows_display = true};

}  // namespace vdbdither
