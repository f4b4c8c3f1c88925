#include "vdbdither/model/unexpected.h"

#include <filesystem>
#include <ios>
#include <system_error>

namespace vdbdither {

std::string unexpectedText(const std::exception& error) {
  if (const auto* of_path = dynamic_cast<const std::filesystem::filesystem_error*>(&error)) {
    return "cannot use '" + of_path->path1().string() +
           "': " + std::generic_category().message(of_path->code().value());
  }
  if (dynamic_cast<const std::ios::failure*>(&error))
    return "a file could not be read or written to its end; check that nobody changes it";
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&error)) {
    return "the system refuses: " + std::generic_category().message(of_system->code().value()) +
           "; try fewer --threads";
  }
  return "failed in a way that is not foreseen, which is a fault of the program; report the "
         "command line and the input";
}

}  // namespace vdbdither
