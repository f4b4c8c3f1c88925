#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "io/stack/slice_format.h"
#include "vdbdither/engine/options.h"
#include "vdbdither/model/printer.h"

namespace vdbdither {

/// Which part of the display or tray of a printer slices show.
enum class Tray { usual, none, placed, centred };

/// `--crop`, `--tray`, `--margin`, `--padding` and `--flip-x`, `--flip-y`: what surrounds the part
/// in slices.
struct FrameOptions {
  bool crop = false;
  Tray tray = Tray::usual;
  double margin_mm = 0;
  int padding = 0;
  bool flip_x = false;
  bool flip_y = false;

  void declare(Options& options);
};

/// Sets the layout of `stack`, whose lattice is known.
/// @param part     the voxels to show: those of the lattice, or those that are printed
/// @param printer  one that says nothing where there is none
/// @param warn     told where the display of a resin printer is not known
/// Throws UsageError where the printer or the format has no room for the slices.
void planFrame(const FrameOptions& options, const openvdb::CoordBBox& part,
               const SliceFormat& format, const PrinterProfile& printer,
               const std::function<void(const std::string&)>& warn, Manifest& stack);

/// Checks that the printer takes a job with as many materials and layers, and that the voxels of a
/// container are its own. Throws UsageError.
void checkPrinterTakes(const SliceFormat& format, const PrinterProfile& printer,
                       const Manifest& stack);

}  // namespace vdbdither
