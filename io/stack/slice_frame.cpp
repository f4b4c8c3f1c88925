#include "io/stack/slice_frame.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr std::array<Choice<Tray>, 4> trays{
    {{Tray::usual, "usual",
      "For sl1 and uvj the display if the profile states its size, the part in the middle; for "
      "others the part alone"},
     {Tray::none, "none", "The part alone"},
     {Tray::placed, "placed", "The whole display or tray, the part where its coordinates say"},
     {Tray::centred, "centred", "The whole display or tray, the part in the middle"}}};

/// A lattice reaches beyond its part by the narrow band.
constexpr int empty_voxels = 16;

/// Columns and rows of the display or tray, or nothing.
std::optional<openvdb::Vec2i> traySize(const PrinterProfile& printer) {
  if (printer.slice_px.x() > 0) return printer.slice_px;
  if (printer.build_mm.x() <= 0 || printer.build_mm.y() <= 0) return std::nullopt;
  constexpr double tolerance = 1e-6;
  return openvdb::Vec2i(
      static_cast<int>(std::floor(printer.build_mm.x() / printer.pitch_mm.x() + tolerance)),
      static_cast<int>(std::floor(printer.build_mm.y() / printer.pitch_mm.y() + tolerance)));
}

/// Whether `box` lies in `frame` along x and y, but for `margin` voxels.
bool liesWithin(const openvdb::CoordBBox& box, const openvdb::CoordBBox& frame, int margin) {
  for (int axis = 0; axis < 2; ++axis) {
    if (box.min()[axis] < frame.min()[axis] - margin ||
        box.max()[axis] > frame.max()[axis] + margin)
      return false;
  }
  return true;
}

/// The tray in voxels of the lattice, the part where its coordinates say.
openvdb::CoordBBox placedTray(const Lattice& lattice, const openvdb::CoordBBox& part,
                              const openvdb::Vec2i& size, const PrinterProfile& printer) {
  openvdb::CoordBBox frame = part;
  for (int axis = 0; axis < 2; ++axis) {
    const double first = -lattice.origin_mm[axis] / lattice.pitch_mm[axis] -
                         (printer.origin == "centre" ? size[axis] / 2 : 0);
    frame.min()[axis] = static_cast<int>(std::lround(first));
    frame.max()[axis] = frame.min()[axis] + size[axis] - 1;
  }
  return frame;
}

/// The same, the part in the middle.
openvdb::CoordBBox centredTray(const openvdb::CoordBBox& part, const openvdb::Vec2i& size) {
  openvdb::CoordBBox frame = part;
  for (int axis = 0; axis < 2; ++axis) {
    const int empty = size[axis] - part.dim()[axis];
    frame.min()[axis] = part.min()[axis] - static_cast<int>(std::floor(empty / 2.0));
    frame.max()[axis] = frame.min()[axis] + size[axis] - 1;
  }
  return frame;
}

std::string lengths(const openvdb::Vec2i& size, const openvdb::Vec3d& pitch_mm) {
  const auto text = [&](int axis) {
    constexpr double hundredth_mm = 100;
    return shortestText(std::round(size[axis] * pitch_mm[axis] * hundredth_mm) / hundredth_mm);
  };
  return text(0) + " x " + text(1) + " mm";
}

openvdb::CoordBBox trayBox(Tray tray, const PrinterProfile& printer, const Lattice& lattice,
                           const openvdb::CoordBBox& box, const openvdb::Vec2i& size) {
  const openvdb::Coord part = box.dim();
  if (part.x() > size.x() + 2 * empty_voxels || part.y() > size.y() + 2 * empty_voxels) {
    throw UsageError("--tray: the part needs " + lengths({part.x(), part.y()}, lattice.pitch_mm) +
                     ", and the printer has " + lengths(size, lattice.pitch_mm) +
                     "; turn it with mesh2sdf --rotate, or make it smaller with --fit");
  }
  if (tray != Tray::placed) return centredTray(box, size);
  const openvdb::CoordBBox placed = placedTray(lattice, box, size, printer);
  if (!liesWithin(box, placed, empty_voxels)) {
    throw UsageError(
        "--tray: by its coordinates the part lies outside of the display or tray, whose " +
        printer.origin + " is at x = y = 0; give --tray centred");
  }
  return placed;
}

}  // namespace

void FrameOptions::declare(Options& options) {
  options.flag("crop", crop,
               "Shows only what is printed; the slices are kept on the disk until all are known");
  options.choice("tray", tray, trays, "What slices show");
  options.length("margin", margin_mm, {0, 1000},
                 "Empty space added on each side in x and y, up to whole voxels");
  options.integer("padding", padding, {0, 100000},
                  "Empty voxels added on each side in x and y, beyond the margin");
  options.flag("flip-x", flip_x,
               "Mirrors left to right; by default a slice is seen from above, with x to the right, "
               "and sl1 and uvj are mirrored where the profile of the printer says so");
  options.flag("flip-y", flip_y, "Mirrors top to bottom; by default the maximum y is the top row");
}

void planFrame(const FrameOptions& options, const openvdb::CoordBBox& part,
               const SliceFormat& format, const PrinterProfile& printer,
               const std::function<void(const std::string&)>& warn, Manifest& stack) {
  SliceLayout& layout = stack.layout;
  layout = {part, options.padding, options.flip_x != (format.shows_display && printer.mirror_x),
            options.flip_y != (format.shows_display && printer.mirror_y)};
  const std::optional<openvdb::Vec2i> size = traySize(printer);
  const bool is_asked = options.tray == Tray::placed || options.tray == Tray::centred;
  if (is_asked && !size) {
    throw UsageError(
        "--tray: the size of the display or tray is not known; make the part for a --printer whose "
        "profile states slice_px or build_mm");
  }
  const bool shows_tray = is_asked || (options.tray == Tray::usual && format.shows_display && size);
  if (shows_tray) {
    if (options.margin_mm > 0 || options.padding > 0)
      throw UsageError(
          "--margin and --padding: the slices show the whole display or tray; leave "
          "them out, or give --tray none");
    layout.box = trayBox(options.tray, printer, stack.lattice, part, *size);
  } else if (format.shows_display && options.tray == Tray::usual) {
    warn(std::string(format.name) +
         ": the slices show the part alone; no --printer tells the size of the display");
  }
  std::array<std::int64_t, 2> pixels{};
  for (int axis = 0; axis < 2; ++axis) {
    const int margin =
        static_cast<int>(std::ceil(options.margin_mm / stack.lattice.pitch_mm[axis] - 1e-6));
    layout.box.min()[axis] -= margin;
    layout.box.max()[axis] += margin;
    pixels[axis] = layout.box.dim()[axis] + std::int64_t{2} * options.padding;
  }
  const int over = static_cast<int>(pixels[0] % format.width_multiple);
  if (over > 0) layout.box.max().x() += format.width_multiple - over;
  constexpr std::int64_t widest = 1 << 24;
  if (std::max(pixels[0], pixels[1]) + format.width_multiple - 1 > widest)
    throw UsageError("slices would be more than 16777216 voxels wide");
}

void checkPrinterTakes(const SliceFormat& format, const PrinterProfile& printer,
                       const Manifest& stack) {
  const auto refuse = [&](const std::string& what, const std::string& remedy) {
    throw UsageError("--format: " + printer.title + " takes " + what + "; " + remedy);
  };
  const int colours = static_cast<int>(stack.materials.size());
  const bool holds_materials = format.pixel != SlicePixel::printed;
  if (holds_materials && printer.maximum_colours > 0 && colours > printer.maximum_colours) {
    refuse("at most " + std::to_string(printer.maximum_colours) + " materials, and there are " +
               std::to_string(colours),
           "assign fewer with material-assign");
  }
  const int layers = stack.lattice.layers().size();
  if (layers < printer.minimum_slices) {
    refuse("at least " + std::to_string(printer.minimum_slices) + " slices, and there are " +
               std::to_string(layers),
           "the part is too low");
  }
}

}  // namespace vdbdither
