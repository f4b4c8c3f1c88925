#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {

/// Compares the number of materials that --parts gives with that of the parts. Throws UsageError;
/// warns where the grid does not tell its number.
/// \param others  what becomes of parts beyond those: "take the last one"
void checkPartCount(const openvdb::Int32Grid& part, std::size_t given, const std::string& others,
                    const std::function<void(const std::string&)>& warn);

/// Replaces the active voxels of `values` by the value of the part that they belong to.
/// \param part  counts parts from 1; 0 is no part
/// \param of_part  the value of each part; 0 keeps what is there
/// \param of_others  the same of voxels of no part, and of parts beyond those
/// Returns how many these were.
std::uint64_t takeParts(openvdb::Int32Tree& values, const openvdb::Int32Tree& part,
                        std::span<const std::int32_t> of_part, std::int32_t of_others);

}  // namespace vdbdither
