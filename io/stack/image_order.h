#pragma once

#include <functional>
#include <string>
#include <vector>

namespace vdbdither {

/// Returns the names of files without a manifest in the order of their numbers, as in slice_2
/// before slice_10. The number of a name is the one that counts up from file to file; names without
/// a number are left out unless there is only one name at all. Throws DataError, naming two files,
/// where names follow several patterns, where a number is missing, and where two files have the
/// same number.
/// @param names  of images, all in one folder, in any order
/// @param shown   what messages call the stack, without quotes
/// @param faults  where given, told of each number that is missing or there twice, in place of an
///                error
std::vector<std::string> inOrderOfNumbers(
    const std::vector<std::string>& names, const std::string& shown,
    const std::function<void(const std::string&)>& faults = {});

}  // namespace vdbdither
