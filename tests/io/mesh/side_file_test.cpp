#include "io/mesh/side_file.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using testing::HasSubstr;

/// A mesh in a folder of its own, with files in it and beside it.
class SideFiles : public testing::Test {
 protected:
  SideFiles() {
    std::filesystem::create_directories(scratch_ / "mesh/sub");
    scratch_.write("mesh/a.png", "in the folder");
    scratch_.write("mesh/sub/b.png", "below");
    scratch_.write("secret.png", "outside");
    std::filesystem::create_symlink(scratch_ / "secret.png", scratch_ / "mesh/link.png");
  }

  [[nodiscard]] MeshFile mesh() const { return {(scratch_ / "mesh/part.obj").string(), "", {}}; }
  [[nodiscard]] std::string read(const std::string& path, std::uint64_t most_bytes = 100) const {
    return std::string(readSideFile(mesh(), "texture", path, most_bytes).text());
  }
  [[nodiscard]] std::string refusal(const std::string& path, std::uint64_t most = 100) const {
    try {
      return "read: " + read(path, most);
    } catch (const DataError& error) {
      return error.what();
    }
  }

  ScratchFolder scratch_;
};

TEST_F(SideFiles, AreFoundByRelativeAndForeignPaths) {
  EXPECT_EQ(read("a.png"), "in the folder");
  EXPECT_EQ(read("./sub/../a.png"), "in the folder");
  EXPECT_EQ(read("sub\\b.png"), "below");
  EXPECT_EQ(read("C:\\Users\\me\\a.png"), "in the folder");
  EXPECT_EQ(read("/home/me/a.png"), "in the folder");
}

TEST_F(SideFiles, AreRefusedOutsideOfTheFolder) {
  EXPECT_THAT(refusal("../secret.png"),
              HasSubstr("texture '../secret.png' lies outside of the folder of the mesh"));
  EXPECT_THAT(refusal("link.png"), HasSubstr("texture 'link.png' leads outside of the folder"));
  EXPECT_THAT(refusal("none.png"), HasSubstr("texture 'none.png': no such file in the folder"));
  EXPECT_THAT(refusal("a\n.png"), HasSubstr("texture 'a?.png': the name contains"));
  EXPECT_THAT(refusal(""), HasSubstr("the name is empty"));
  EXPECT_THAT(refusal("a.png", 5), HasSubstr("'a.png'"));
}

TEST_F(SideFiles, AreThereExactlyWhereTheyCanBeRead) {
  for (const char* path : {"a.png", "sub/b.png", "C:\\a.png"})
    EXPECT_TRUE(hasSideFile(mesh(), path)) << path;
  for (const char* path : {"../secret.png", "link.png", "none.png", "sub", "", "a\n.png"})
    EXPECT_FALSE(hasSideFile(mesh(), path)) << path;
}

}  // namespace
}  // namespace vdbdither::test
