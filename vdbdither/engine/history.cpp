#include "vdbdither/engine/history.h"

#include "vdbdither/engine/version.h"
#include "vdbdither/model/known_grids.h"

namespace vdbdither {

void addToHistory(Schema& schema, std::string_view verb, const Options& options) {
  std::string& history = schema.metadata[history_key];
  if (!history.empty()) history += '\n';
  history += verb;
  if (const std::string arguments = options.canonical(); !arguments.empty())
    history.append(1, ' ').append(arguments);
  history.append(" # vdbdither ").append(version);
}

}  // namespace vdbdither
