#pragma once

#include <cstddef>
#include <string>

namespace vdbdither {

/// Opens a named pipe for reading, without waiting for its writer: the first read does. Close it.
/// Throws DataError, which calls the pipe `where`.
int openNamedPipe(const std::string& path, const std::string& where);

/// Reads up to `size` bytes of `descriptor`, at least one unless it has ended, and returns how
/// many. While nothing comes the user can stop the run. Safe in any thread. Throws DataError, which
/// calls the descriptor `where`, and Interrupted.
std::size_t readSome(int descriptor, char* bytes, std::size_t size, const std::string& where);

}  // namespace vdbdither
