#include "io/stack/checked_stack.h"

#include <algorithm>
#include <cmath>

#include "io/stack/pixel_meanings.h"
#include "vdbdither/engine/option_values.h"

namespace vdbdither {

void PixelTally::add(const PixelTally& later) {
  if (pixels == 0) {
    *this = later;
    return;
  }
  pixels += later.pixels;
  slices += later.slices;
}

void StackTotals::add(CheckedLayer& layer, const std::string& file, Findings& findings) {
  ++layers;
  for (Finding& finding : layer.findings) findings.add(std::move(finding));
  for (const auto& [value, count] : layer.voxels) {
    const bool is_told = voxels.size() < most_strays || voxels.contains(value);
    voxels[is_told ? value : stray_value] += count;
    if (is_told) first_of[value].add({count, 1, layer.z, file, {}});
  }
  for (const auto& [colour, tally] : layer.strays) {
    if (strays.size() < most_strays || strays.contains(colour)) {
      strays[colour].add(tally);
    } else {
      other_strays.add(tally);
    }
  }
  if (layer.other_strays.pixels > 0) other_strays.add(layer.other_strays);
  if (layer.grey.pixels > 0) grey.add(layer.grey);
  if (layer.image) expandByPrinted(printed, *layer.image, layer.z);
}

namespace {

/// Lengths that a file rounds are the same.
bool isNear(double a_mm, double b_mm) {
  constexpr double tolerance = 0.005;
  return std::abs(a_mm / b_mm - 1) <= tolerance;
}

std::string mmText(double mm) {
  constexpr double nanometres = 1e6;
  return shortestText(std::round(mm * nanometres) / nanometres) + " mm";
}

/// How many of the values are materials.
std::uint64_t coloursOf(const StackTotals& totals) {
  return static_cast<std::uint64_t>(std::count_if(
      totals.voxels.begin(), totals.voxels.end(),
      [](const auto& entry) { return entry.first != 0 && entry.first != stray_value; }));
}

/// Where a printer takes fewer colours than images have, the rarest ones are probably strays.
void tellRarest(const CheckedStack& stack, const StackTotals& totals, const PrinterProfile& printer,
                Findings& findings) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> rarest;
  for (const auto& [colour, count] : totals.voxels) {
    if (colour != stray_value) rarest.emplace_back(count, colour);
  }
  std::sort(rarest.begin(), rarest.end());
  rarest.resize(rarest.size() - std::min<std::size_t>(rarest.size(), printer.maximum_colours));
  for (const auto& [count, colour] : rarest) {
    const PixelTally& tally = totals.first_of.at(colour);
    findings.add({"stray-colour", Finding::Severity::error,
                  "the colour " + colourText(colour) + " is in " + counted(count, "pixel") +
                      " of " + counted(tally.slices, "slice") +
                      " alone; give them one of a material, and mind that smoothing makes new "
                      "colours",
                  tally.file, stack.numberOf(tally.layer), std::nullopt, count});
  }
}

void checkVoxels(const Manifest& stack, const PrinterProfile& printer, Findings& findings) {
  const openvdb::Vec3d& pitch_mm = stack.lattice.pitch_mm;
  for (int axis = 0; axis < 2; ++axis) {
    if (isNear(pitch_mm[axis], printer.pitch_mm[axis])) continue;
    findings.error("pitch", std::string("along ") + "xy"[axis] + " a voxel is " +
                                mmText(pitch_mm[axis]) + " long, and those of the printer " +
                                mmText(printer.pitch_mm[axis]) +
                                "; make the stack for the printer, or name the one it is for");
  }
  const double layer_mm = pitch_mm.z();
  if (printer.layer_mm) {
    const openvdb::Vec2d& range = *printer.layer_mm;
    if ((layer_mm >= range[0] && layer_mm <= range[1]) || isNear(layer_mm, range[0]) ||
        isNear(layer_mm, range[1]))
      return;
    findings.error("layer-height", "a layer is " + mmText(layer_mm) +
                                       " high, and the printer takes from " + mmText(range[0]) +
                                       " to " + mmText(range[1]) +
                                       "; make the stack with another --layer");
  } else if (!isNear(layer_mm, printer.pitch_mm.z())) {
    findings.error("layer-height", "a layer is " + mmText(layer_mm) +
                                       " high, and those of the printer " +
                                       mmText(printer.pitch_mm.z()) +
                                       "; make the stack for the printer, or name its profile "
                                       "for layers of this height");
  }
}

void checkDisplay(const CheckedStack& stack, const PrinterProfile& printer, Findings& findings) {
  const SliceLayout& layout = stack.manifest().layout;
  const openvdb::Vec2i& size = printer.slice_px;
  if (size.x() > 0 && (static_cast<std::uint32_t>(size.x()) != layout.width() ||
                       static_cast<std::uint32_t>(size.y()) != layout.height())) {
    findings.error("display-size",
                   "slices have " + std::to_string(layout.width()) + " x " +
                       std::to_string(layout.height()) + " pixels, and the display " +
                       std::to_string(size.x()) + " x " + std::to_string(size.y()) +
                       "; make the stack with slice-export --tray placed or centred");
  }
  if (!stack.hasColours() &&
      (layout.flip_x != printer.mirror_x || layout.flip_y != printer.mirror_y)) {
    findings.warning("mirrored",
                     "the slices are mirrored otherwise than the printer takes them, so the print "
                     "may be a mirror image; make the stack without --flip-x and --flip-y");
  }
}

}  // namespace

void checkPrinter(const CheckedStack& stack, const StackTotals& totals,
                  const PrinterProfile& printer, Findings& findings) {
  if (printer.name.empty()) return;
  const Manifest& manifest = stack.manifest();
  checkVoxels(manifest, printer, findings);
  const std::uint64_t slices = static_cast<std::uint64_t>(std::max(0, manifest.layers.size()));
  if (slices < static_cast<std::uint64_t>(printer.minimum_slices)) {
    findings.error("too-few-slices",
                   "there are " + grouped(slices) + ", and the printer takes no fewer than " +
                       std::to_string(printer.minimum_slices) +
                       "; export empty slices too with --keep-blank, or make the part "
                       "higher");
  }
  const std::uint64_t colours = coloursOf(totals);
  if (printer.maximum_colours > 0 &&
      colours > static_cast<std::uint64_t>(printer.maximum_colours)) {
    findings.error("too-many-colours", "there are " + grouped(colours) +
                                           (stack.hasColours() ? " colours" : " materials") +
                                           ", and the printer takes " +
                                           std::to_string(printer.maximum_colours) +
                                           " in a job; assign fewer");
    if (stack.hasColours()) tellRarest(stack, totals, printer, findings);
  }
  if (stack.showsDisplay()) checkDisplay(stack, printer, findings);
  for (int axis = 0; axis < 3 && !totals.printed.empty(); ++axis) {
    const double length_mm = totals.printed.dim()[axis] * manifest.lattice.pitch_mm[axis];
    // The last voxel may reach beyond by a fraction.
    if (printer.build_mm[axis] <= 0 ||
        length_mm <= printer.build_mm[axis] + manifest.lattice.pitch_mm[axis])
      continue;
    findings.error("build-volume", std::string("along ") + "xyz"[axis] + " the part has " +
                                       mmText(length_mm) + ", and the printer " +
                                       mmText(printer.build_mm[axis]) +
                                       "; turn the part or make it smaller");
  }
}

Finding pixelKindFinding(const std::string& file, int number) {
  return {"pixel-kind", Finding::Severity::error,
          "the PNG is not of 32 bits, colour and opacity; save it so", file, number};
}

}  // namespace vdbdither
