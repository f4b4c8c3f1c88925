#pragma once

namespace vdbdither {

/// Opens those of the three standard descriptors that are closed, so that no file of the program
/// gets their numbers. To read or write them fails, as before. Called once, before any other file
/// is opened.
void openStandardDescriptors();

/// Sets standard output aside for data and points file descriptor 1 at standard error, because the
/// logging of libraries prints there. Called once, before anything is printed.
void setStandardOutputAside();

/// The descriptor of the real standard output.
int dataOutput();

/// Writes all of a text to the real standard output, in the form of `printableLines`. Throws
/// DataError.
void printData(const char* given);

}  // namespace vdbdither
