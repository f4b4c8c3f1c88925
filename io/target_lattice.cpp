#include "io/target_lattice.h"

#include <string_view>

#include "io/printer_profile.h"
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
  Vec3d pitch_mm;
  std::size_t begin = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t comma = pitch.find(',', begin);
    if ((comma == std::string::npos) != (axis == 2))
      throw UsageError("--pitch: '" + pitch + "' is not three lengths such as 42um,84um,22um");
    pitch_mm[axis] = parseLengthMm(std::string_view(pitch).substr(begin, comma - begin));
    if (!(pitch_mm[axis] >= 1e-3 && pitch_mm[axis] <= 10))
      throw UsageError("--pitch: '" + pitch + "' is not between 1 um and 10 mm in every axis");
    begin = comma + 1;
  }
  return pitch_mm;
}

}  // namespace vdbdither
