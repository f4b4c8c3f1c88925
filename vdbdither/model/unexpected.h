#pragma once

#include <exception>
#include <string>

namespace vdbdither {

/// Returns what to tell the user of an exception that is not an Error: the path and reason of a
/// failed system call, else that the program is at fault. The words of libraries are not shown,
/// because they do not say what to do.
std::string unexpectedText(const std::exception& error);

}  // namespace vdbdither
