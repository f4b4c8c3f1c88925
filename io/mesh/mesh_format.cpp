#include "io/mesh/mesh_format.h"

#include <vector>

#include "io/mesh/text_cursor.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

const MeshFormat* meshFormatNamedBy(const std::filesystem::path& path) {
  const std::string ending = path.extension().string();
  for (const MeshFormat* format : meshFormats()) {
    if (equalsIgnoringCase(ending, format->ending)) return format;
  }
  return nullptr;
}

std::string meshFormatNames() {
  std::vector<std::string> names;
  for (const MeshFormat* format : meshFormats()) names.emplace_back(format->name);
  return alternatives(names);
}

std::string meshEndings(const std::function<bool(const MeshFormat&)>& choose) {
  std::vector<std::string> endings;
  for (const MeshFormat* format : meshFormats()) {
    if (format->write != nullptr && (!choose || choose(*format)))
      endings.emplace_back(format->ending);
  }
  return alternatives(endings);
}

}  // namespace vdbdither
