#include "io/file/zip.h"

#include <algorithm>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/file/staged_output.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using Bytes = std::vector<std::uint8_t>;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::uint64_t any = 1 << 30;

Bytes bytesOf(const std::string& text) { return {text.begin(), text.end()}; }

TEST(Zip, FilesComeBackByName) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("one.txt", bytesOf("first"));
  writer.add("folder/zwei-ä.bin", Bytes(100000, 7));
  writer.add("empty", {});
  writer.finish();
  ZipReader reader(scratch / "a.zip");
  EXPECT_EQ(reader.read("folder/zwei-ä.bin", any), Bytes(100000, 7));
  EXPECT_EQ(reader.read("one.txt", any), bytesOf("first"));
  EXPECT_EQ(reader.read("empty", any), Bytes());
  EXPECT_FALSE(reader.contains("two"));
  EXPECT_THAT([&] { static_cast<void>(reader.read("two", any)); },
              ThrowsMessage<DataError>(HasSubstr("holds no file 'two'")));
}

TEST(Zip, SameFilesGiveTheSameBytesAndAreStored) {
  const test::ScratchFolder scratch;
  for (const char* name : {"a.zip", "b.zip"}) {
    ZipWriter writer(scratch / name, name);
    writer.add("x", bytesOf("not packed any more"));
    writer.finish();
  }
  const Bytes bytes = test::fileBytes(scratch / "a.zip");
  EXPECT_EQ(bytes, test::fileBytes(scratch / "b.zip"));
  const std::string text(bytes.begin(), bytes.end());
  EXPECT_THAT(text, HasSubstr("not packed any more"));
  // Bit 3 of the flags would put lengths behind the files.
  EXPECT_EQ(bytes[6] & 8, 0);
}

TEST(Zip, HoldsMoreFilesThanSixteenBitsCount) {
  const test::ScratchFolder scratch;
  constexpr int count = 70000;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  for (int i = 0; i < count; ++i) writer.add(std::to_string(i), {});
  writer.finish();
  const ZipReader reader(scratch / "a.zip");
  for (int i = 0; i < count; ++i) ASSERT_TRUE(reader.contains(std::to_string(i))) << i;
}

TEST(Zip, DamageIsFound) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("x", bytesOf("some text"));
  writer.finish();
  Bytes bytes = test::fileBytes(scratch / "a.zip");
  const std::string text(bytes.begin(), bytes.end());
  bytes[text.find("some")] ^= 1;
  writeFile(scratch / "a.zip", bytes, "a.zip");
  ZipReader reader(scratch / "a.zip");
  EXPECT_THAT([&] { static_cast<void>(reader.read("x", any)); },
              ThrowsMessage<DataError>(HasSubstr("its file 'x' is damaged")));
  std::ofstream(scratch / "b.zip") << "no archive";
  EXPECT_THAT([&] { ZipReader(scratch / "b.zip"); },
              ThrowsMessage<DataError>(HasSubstr("b.zip' is not a readable zip archive")));
}

/// An archive of empty files with these names.
std::filesystem::path archiveOf(const test::ScratchFolder& scratch,
                                const std::vector<std::string>& names) {
  ZipWriter writer(scratch / "a.zip", "a.zip");
  for (const std::string& name : names) writer.add(name, {});
  writer.finish();
  return scratch / "a.zip";
}

TEST(Zip, RefusesNamesThatLeaveTheFolderAndNamesThatAreThereTwice) {
  const test::ScratchFolder scratch;
  const std::vector<std::pair<std::string, std::string>> refusals{
      {"../x", "has no proper name: it has a folder whose name is '..'"},
      {"a/../../x", "has no proper name: it has a folder whose name is '..'"},
      {"/etc/x", "has no proper name: it is an absolute path"},
      {"C:\\x", "has no proper name: it contains '\\'"},
      {"a\nb", "has no proper name: it contains the unprintable character U+000A"},
      {"..", "has no proper name: it is '..'"},
      {"", "has no proper name: it is empty"},
      {"one", "is there twice"},
      {std::string(300, 'a'), "has no proper name: it has 300 bytes; the maximum is 255"}};
  for (const auto& [name, why] : refusals) {
    const std::filesystem::path archive = archiveOf(scratch, {"one", name});
    EXPECT_THAT([&] { ZipReader{archive}; },
                ThrowsMessage<DataError>(
                    HasSubstr(": its member '" + name + "' " + why + "; pack it again")));
  }
}

TEST(Zip, PassesOverFolders) {
  const test::ScratchFolder scratch;
  const ZipReader reader(archiveOf(scratch, {"white/", "white/a"}));
  EXPECT_THAT(reader.names(), testing::ElementsAre("white/a"));
}

TEST(Zip, RefusesFilesByTheirStatedSize) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("x", bytesOf("some text"));
  writer.finish();
  ZipReader reader(scratch / "a.zip");
  EXPECT_EQ(reader.size("x"), 9U);
  EXPECT_EQ(reader.read("x", 9), bytesOf("some text"));
  EXPECT_THAT([&] { static_cast<void>(reader.read("x", 8)); },
              ThrowsMessage<DataError>(HasSubstr("'x' has 9 bytes; at most 8 are read")));
}

TEST(Zip, ADirectoryThatDoesNotHoldWhatItStatesIsDamaged) {
  const test::ScratchFolder scratch;
  Bytes bytes = test::fileBytes(archiveOf(scratch, {"one", "two"}));
  // The number of entries, in the record at the end.
  constexpr std::size_t end_record = 22;
  bytes[bytes.size() - end_record + 8] = bytes[bytes.size() - end_record + 10] = 200;
  writeFile(scratch / "a.zip", bytes, "a.zip");
  EXPECT_THAT(
      [&] { ZipReader(scratch / "a.zip"); },
      ThrowsMessage<DataError>(HasSubstr("is damaged: its directory ends after 2 of 200 members")));
}

TEST(Zip, RefusesVeryManyMembersWhateverTheArchiveStates) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  for (int i = 0; i <= 1 << 18; ++i) writer.add(std::to_string(i), {});
  writer.finish();
  EXPECT_THAT([&] { ZipReader(scratch / "a.zip"); },
              ThrowsMessage<DataError>(HasSubstr("its member '262144' is one too many; pack")));
}

/// An archive whose directory states that its only member is deflated and has these sizes.
std::filesystem::path archiveStating(const test::ScratchFolder& scratch, std::uint32_t packed,
                                     std::uint32_t inflated) {
  Bytes bytes = test::fileBytes(archiveOf(scratch, {"one"}));
  const Bytes signature{'P', 'K', 1, 2};
  const auto entry = std::search(bytes.begin(), bytes.end(), signature.begin(), signature.end());
  EXPECT_NE(entry, bytes.end());
  const auto state = [&](std::ptrdiff_t at, int size, std::uint32_t value) {
    for (int i = 0; i < size; ++i) *(entry + at + i) = static_cast<std::uint8_t>(value >> 8 * i);
  };
  constexpr std::uint32_t deflated = 8;
  state(10, 2, deflated);
  state(20, 4, packed);
  state(24, 4, inflated);
  writeFile(scratch / "a.zip", bytes, "a.zip");
  return scratch / "a.zip";
}

TEST(Zip, LargeMembersInflateByTwoHundredAtMost) {
  const test::ScratchFolder scratch;
  const auto refused =
      ThrowsMessage<DataError>(HasSubstr(": its member 'one' inflates more than 200 to 1; pack"));
  const std::uint32_t packed = 100000;
  EXPECT_NO_THROW(ZipReader(archiveStating(scratch, packed, 200 * packed)));
  EXPECT_THAT([&] { ZipReader(archiveStating(scratch, packed, 200 * packed + 200)); }, refused);
  EXPECT_NO_THROW(ZipReader(archiveStating(scratch, 1, 16 << 20)));
  EXPECT_THAT([&] { ZipReader(archiveStating(scratch, 1, (16 << 20) + 1)); }, refused);
}

TEST(Zip, ReadsAnArchiveInMemory) {
  const test::ScratchFolder scratch;
  ZipWriter writer(scratch / "a.zip", "a.zip");
  writer.add("one", bytesOf("first"));
  writer.add("long", Bytes(200000, 7));
  writer.finish();
  Bytes bytes = test::fileBytes(scratch / "a.zip");
  ZipReader reader(bytes, "'it'");
  EXPECT_EQ(reader.read("one", any), bytesOf("first"));
  std::size_t pieces = 0;
  Bytes joined;
  reader.read("long", any, [&](std::span<const std::uint8_t> piece) {
    ++pieces;
    joined.insert(joined.end(), piece.begin(), piece.end());
  });
  EXPECT_EQ(joined, Bytes(200000, 7));
  EXPECT_EQ(pieces, 4U);
  bytes.resize(bytes.size() - 30);
  EXPECT_THAT([&] { ZipReader(bytes, "'it'"); },
              ThrowsMessage<DataError>("'it' is not a readable zip archive"));
}

TEST(Zip, IsAnOrdinaryFile) {
  EXPECT_THAT([] { ZipReader("/dev/zero"); },
              ThrowsMessage<DataError>("'/dev/zero' is not an ordinary file"));
}

}  // namespace
}  // namespace vdbdither
