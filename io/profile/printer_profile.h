#pragma once

#include <string>
#include <vector>

#include "vdbdither/model/printer.h"
#include "vdbdither/model/schema.h"

namespace vdbdither {

/// The minimum and maximum spread of droplets along an axis.
inline constexpr double least_spread_mm = 0.001;
inline constexpr double most_spread_mm = 1;

/// Reads the profile called `name_or_path`: a file when it ends in `.json`, else
/// `printers/NAME.json` of the data folder. Throws UsageError when there is none (naming those
/// there are), DataError when it is malformed.
PrinterProfile readPrinterProfile(const std::string& name_or_path);

/// The findings about a profile. Each text begins with its line; texts are in the order of lines.
struct ProfileFindings {
  std::vector<std::string> problems;  ///< a profile with any is refused
  std::vector<std::string> remarks;   ///< of a proper profile
};

/// Returns the findings about the profile called `name_or_path`. Throws UsageError when there is
/// none.
ProfileFindings printerProfileFindings(const std::string& name_or_path);

/// The profile in one line of JSON, as grids carry it under `vdbdither:printer`; and back.
std::string toJson(const PrinterProfile& profile);
PrinterProfile printerProfileFromJson(const std::string& text);

/// The profile in the metadata of `schema`, or one that says nothing. Throws DataError.
PrinterProfile printerProfileOf(const Schema& schema);

/// How far a droplet of the printer spreads: the standard deviation of a Gaussian along each axis,
/// as the profile in the metadata of `schema` states it, or 50 µm by convention. Throws DataError.
openvdb::Vec3d pointSpreadMmOf(const Schema& schema);

/// The names of the profiles in the data folder, sorted. Their schema, schema.json, is none.
std::vector<std::string> installedPrinters();

}  // namespace vdbdither
