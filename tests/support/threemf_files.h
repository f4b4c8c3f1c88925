#pragma once

#include <string>
#include <utility>
#include <vector>

namespace vdbdither::test {

/// Names and contents of the files in an archive.
using Members = std::vector<std::pair<std::string, std::string>>;

/// The bytes of a zip archive with these files, deflated.
std::string zipOf(const Members& members);

/// The bytes of a 3MF file whose model part is `model`, with more files.
std::string threemfOf(const std::string& model, const Members& more = {});

/// A model part in millimetres with these resources and items of the build.
/// @param attributes  of the model
std::string threemfModel(const std::string& resources, const std::string& build,
                         const std::string& attributes = "unit=\"millimeter\"");

/// A mesh of the corner of a cube: three edges of 1 along the axes, four triangles.
/// @param triangle_attributes  of each of the four triangles
std::string threemfCorner(const std::vector<std::string>& triangle_attributes = {});

}  // namespace vdbdither::test
