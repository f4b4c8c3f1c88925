#pragma once

namespace vdbdither {

/// Sets standard output aside for data and points file descriptor 1 at standard error, because the
/// logging of libraries prints there. Called once, first of all.
void setStandardOutputAside();

/// The descriptor of the real standard output.
int dataOutput();

/// Writes all of a text there, in the form of `printableLines`. Throws DataError.
void printData(const char* given);

}  // namespace vdbdither
