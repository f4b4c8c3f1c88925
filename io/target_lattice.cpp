#include "io/target_lattice.h"

#include "io/printer_profile.h"
#include "vdbdither/comma_list.h"
#include "vdbdither/errors.h"
#include "vdbdither/options.h"

namespace vdbdither {

using openvdb::Vec3d;

Vec3d targetPitchMm(const std::string& printer, const std::string& pitch, Schema& schema) {
  if (printer.empty() == pitch.empty())
    throw UsageError(
        "give either --printer NAME (vdbdither printers lists them) or --pitch DX,DY,DZ");
  if (!printer.empty()) {
    const PrinterProfile profile = readPrinterProfile(printer);
    schema.metadata["vdbdither:printer"] = toJson(profile);
    return profile.pitch_mm;
  }
  const std::vector<std::string> lengths = commaList(pitch);
  if (lengths.size() != 3)
    throw UsageError("--pitch: '" + pitch + "' is not three lengths such as 42um,84um,22um");
  Vec3d pitch_mm;
  for (int axis = 0; axis < 3; ++axis) {
    pitch_mm[axis] = parseLengthMm(lengths[static_cast<std::size_t>(axis)]);
    if (!(pitch_mm[axis] >= 1e-3 && pitch_mm[axis] <= 10))
      throw UsageError("--pitch: '" + pitch + "' is not between 1 um and 10 mm in every axis");
  }
  return pitch_mm;
}

}  // namespace vdbdither
