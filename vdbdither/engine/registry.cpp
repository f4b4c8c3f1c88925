#include "vdbdither/engine/registry.h"

#include <string>
#include <vector>

#include "vdbdither/model/errors.h"

namespace vdbdither {

const OperatorInfo& findOperator(std::string_view name) {
  std::vector<std::string> names;
  for (const OperatorInfo* info : registeredOperators()) {
    if (info->name == name) return *info;
    names.emplace_back(info->name);
  }
  std::string message = "no operator '" + std::string(name) + "'";
  if (const std::string near = nearestWord(name, names); !near.empty()) {
    message += "; did you mean '" + near + "'?";
  } else {
    message += "; the operators are";
    for (const std::string& known : names) message += " " + known;
  }
  throw UsageError(message);
}

const ToolInfo* findTool(std::string_view name) {
  for (const ToolInfo* info : registeredTools()) {
    if (info->name == name) return info;
  }
  return nullptr;
}

}  // namespace vdbdither
