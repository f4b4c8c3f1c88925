#include "vdbdither/model/unexpected.h"

#include <filesystem>
#include <ios>
#include <stdexcept>
#include <system_error>

#include <gtest/gtest.h>

namespace vdbdither {
namespace {

TEST(Unexpected, AFailedSystemCallIsToldByPathAndReason) {
  const auto denied = std::make_error_code(std::errc::permission_denied);
  EXPECT_EQ(unexpectedText(std::filesystem::filesystem_error("cannot remove", "out/a", denied)),
            "cannot use 'out/a': Permission denied");
  EXPECT_EQ(unexpectedText(std::system_error(
                std::make_error_code(std::errc::resource_unavailable_try_again), "thread")),
            "the system refuses: Resource temporarily unavailable; try fewer --threads");
}

TEST(Unexpected, WordsOfLibrariesAreNotShown) {
  EXPECT_EQ(unexpectedText(std::ios::failure("basic_ios::clear")),
            "a file could not be read or written to its end; check that nobody changes it");
  EXPECT_EQ(unexpectedText(std::runtime_error("vector::_M_range_check")),
            "failed in a way that is not foreseen, which is a fault of the program; report the "
            "command line and the input");
}

}  // namespace
}  // namespace vdbdither
