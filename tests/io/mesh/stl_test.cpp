#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <regex>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/mesh_files.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/shapes.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;

TEST(Stl, WeldsEqualCornersAndNegativeZeroInOrderOfAppearance) {
  const Mesh apart{{{0.0, -0.0, 0.0}, {1, 0, 0}, {0, 1, 0}, {1, 0, 0}, {-0.0, 0.0, 0.0}, {0, 0, 1}},
                   {{0, 1, 2}, {3, 4, 5}}};
  for (const std::string& bytes : {binaryStl(apart), asciiStl(apart)}) {
    const Mesh mesh = parseQuietly(bytes);
    EXPECT_THAT(mesh.vertices,
                ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)));
    EXPECT_FALSE(std::signbit(mesh.vertices[0].y()));
    EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 1, 2}, Mesh::Triangle{1, 0, 3}));
  }
}

TEST(Stl, KeepsPositionsApartThatDifferInTheLastBit) {
  const double next = std::nextafter(1.0F, 2.0F);
  const Mesh apart{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {next, 0, 0}}, {{0, 1, 2}, {0, 3, 2}}};
  EXPECT_THAT(parseQuietly(binaryStl(apart)).vertices, testing::SizeIs(4));
}

TEST(Stl, WeldsManyVerticesLikeAMap) {
  std::mt19937 random(3);
  Mesh soup;
  for (std::uint32_t i = 0; i < 30000; ++i) {
    soup.vertices.emplace_back(random() % 20, random() % 20,
                               static_cast<double>(random() % 20) * 0.25);
    if (i % 3 == 2) soup.triangles.push_back({i - 2, i - 1, i});
  }
  const Mesh mesh = parseQuietly(binaryStl(soup));
  std::map<Vec3d, std::uint32_t> first;
  for (std::size_t i = 0; i < soup.triangles.size(); ++i) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto [place, is_new] = first.try_emplace(soup.vertices[soup.triangles[i][corner]],
                                                     static_cast<std::uint32_t>(first.size()));
      ASSERT_EQ(mesh.triangles[i][corner], place->second);
    }
  }
  EXPECT_EQ(mesh.vertices.size(), first.size());
}

TEST(Stl, ReadsABinaryFileThatStartsLikeAnAsciiOne) {
  const Mesh mesh = floatPart();
  expectSame(parseQuietly(binaryStl(mesh, "solid pretending to be text")), mesh);
  std::string longer = binaryStl(mesh, "solid pretending to be text") + "colour";
  Warnings warnings;
  expectSame(parse(longer, &warnings), mesh);
  EXPECT_THAT(warnings, ElementsAre("'part': ignored 6 bytes after the last triangle"));
}

TEST(Stl, ReadsAllTrianglesWhereTheCountWasNeverFilledIn) {
  const Mesh mesh = floatPart();
  for (const char filler : {'\0', '\xFF'}) {
    std::string bytes = binaryStl(mesh);
    std::fill_n(bytes.begin() + 80, 4, filler);
    Warnings warnings;
    expectSame(parse(bytes, &warnings, "part.STL"), mesh);
    EXPECT_THAT(warnings,
                ElementsAre(HasSubstr(" triangles, the file holds 80: read all of them")));
  }
}

TEST(Stl, ReadsAllTrianglesWhereTheHeaderAnnouncesFewer) {
  std::string bytes = binaryStl(floatPart());
  bytes[80] = 79;
  Warnings warnings;
  expectSame(parse(bytes, &warnings, "part.stl"), floatPart());
  EXPECT_THAT(warnings, ElementsAre("'part.stl': the header announces 79 triangles, the file holds "
                                    "80: read all of them"));
}

TEST(Stl, RefusesABinaryFileThatIsCutOff) {
  const std::string bytes = binaryStl(boxMesh({0, 0, 0}, {1, 1, 1}));
  EXPECT_EQ(refusal(bytes.substr(0, 384), "part.stl"),
            "'part.stl', byte 384: cut off: the header announces 12 triangles, the file holds 6; "
            "export or download it again");
  EXPECT_EQ(
      refusal("solid" + std::string(20, '\0')),
      "'part': cut off: a binary STL has at least 84 bytes, this one has 25; export it again");
}

/// A binary STL of which an attribute of as many bytes follows each record.
std::string withAttributes(const Mesh& mesh, const std::vector<std::size_t>& sizes) {
  const std::string plain = binaryStl(mesh);
  std::string bytes = plain.substr(0, 84);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::size_t size = sizes[i % sizes.size()];
    bytes += plain.substr(84 + 50 * i, 48);
    bytes += static_cast<char>(size % 256);
    bytes += static_cast<char>(size / 256);
    bytes.append(size, '\x5A');
  }
  return bytes;
}

TEST(Stl, SkipsTheAttributesThatTheSizeOfTheFileExplains) {
  const Mesh mesh = floatPart();
  Mesh open = mesh;
  open.triangles.pop_back();
  for (const std::vector<std::size_t>& sizes :
       std::vector<std::vector<std::size_t>>{{2}, {0, 0, 4}, {300}, {1}, {50}, {25, 25}}) {
    const std::string bytes = withAttributes(mesh, sizes);
    Warnings warnings;
    expectSame(parse(bytes, &warnings, "part.stl"), mesh);
    EXPECT_THAT(warnings, testing::IsEmpty());
    EXPECT_EQ(parse(withAttributes(open, sizes), nullptr, "part.stl").triangles, open.triangles);
  }
}

TEST(Stl, TakesAttributesForColoursWhereTheSizeLeavesNoRoom) {
  const Mesh mesh = floatPart();
  std::string bytes = binaryStl(mesh);
  for (std::size_t end = 84 + 50; end <= bytes.size(); end += 50) bytes[end - 2] = '\x1F';
  expectSame(parseQuietly(bytes), mesh);
}

TEST(Stl, BytesBehindAnOpenMeshMeanThatItWasMisread) {
  Mesh open = floatPart();
  open.triangles.pop_back();
  const std::string bytes = binaryStl(open);
  EXPECT_EQ(refusal(bytes + "colour", "part.stl"),
            "'part.stl', byte " + std::to_string(bytes.size()) +
                ": 6 bytes follow the last triangle and the triangles before do not close: the "
                "file is not as its header says; export it again");
  // Records of 52 bytes whose last two count nothing.
  std::string longer = bytes.substr(0, 84);
  for (std::size_t i = 0; i < open.triangles.size(); ++i)
    longer += bytes.substr(84 + 50 * i, 50) + "xy";
  EXPECT_THAT(refusal(longer, "part.stl"), HasSubstr("do not close"));
  EXPECT_THAT(refusal(bytes + std::string(50, 'x'), "part.stl"), HasSubstr("do not close"));
  for (const std::string& blank :
       {std::string("\r\n"), std::string(130, '\0'), std::string("\x1A")})
    EXPECT_EQ(parse(bytes + blank, nullptr, "part.stl").triangles, open.triangles);
}

TEST(Stl, ReadsBinaryFilesOneBehindAnother) {
  const Mesh box = boxMesh({0, 0, 0}, {1, 1, 1});
  const Mesh ball = floatPart();
  Warnings warnings;
  const Mesh mesh = parse(binaryStl(box) + binaryStl(ball), &warnings, "part.stl");
  EXPECT_EQ(mesh.triangles.size(), box.triangles.size() + ball.triangles.size());
  EXPECT_THAT(warnings,
              ElementsAre("'part.stl': read all of 2 binary STL files, one behind another"));
}

TEST(Stl, AHeaderThatAnnouncesFourBillionTrianglesIsRefused) {
  std::string bytes = binaryStl(boxMesh({0, 0, 0}, {1, 1, 1}));
  bytes[83] = '\x7F';
  EXPECT_THAT(refusal(bytes, "part.stl"), HasSubstr("announces 2130706444 triangles"));
}

TEST(Stl, RefusesCornersThatAreNotFinite) {
  Mesh mesh = boxMesh({0, 0, 0}, {1, 1, 1});
  mesh.vertices[7] = {0.5, std::nan(""), -std::numeric_limits<double>::infinity()};
  EXPECT_EQ(refusal(binaryStl(mesh)),
            "'part', byte 220: triangle 3 has a corner that is not finite (0.5 nan -inf); repair "
            "the mesh");
  EXPECT_EQ(refusal(asciiStl(mesh)),
            "'part', line 20: vertex is not finite (0.5 nan -inf); repair the mesh");
}

TEST(Stl, SeveralSolidsShareVertices) {
  const Mesh box = boxMesh({0, 0, 0}, {1, 1, 1});
  Mesh both = box;
  for (const Vec3d& vertex : box.vertices) both.vertices.push_back(vertex + Vec3d(1, 0, 0));
  for (const auto& [a, b, c] : box.triangles) both.triangles.push_back({a + 8, b + 8, c + 8});
  const Mesh mesh = parseQuietly(asciiStl(box) + "solid\nendsolid\n" +
                                 asciiStl(transformed(box, {0, 0, 0}, {1, 0, 0})));
  EXPECT_THAT(mesh.vertices, testing::SizeIs(12));
  expectSame(mesh, parseQuietly(binaryStl(both)));
}

TEST(Stl, ToleratesCapitalsTabsRemarksAndAMissingFinalNewline) {
  const Mesh mesh = parseQuietly(
      "\xEF\xBB\xBF  SOLID C:\\parts\\\n\tFacet Normal 0 0 1\nOUTER LOOP\n\n  Vertex +1 .5 0\n"
      "vertex\t1e0\t2.E1   3 \nvertex 0 -0 1e-400\nendloop foo\nENDFACET bar\nEndSolid no more");
  EXPECT_THAT(mesh.vertices, ElementsAre(Vec3d(1, 0.5, 0), Vec3d(1, 20, 3), Vec3d(0, 0, 0)));
}

TEST(Stl, ReadsTextByWordsAndNotByLines) {
  const Mesh mesh = floatPart();
  const std::string text = asciiStl(mesh);
  const auto with = [&](const std::string& from, const std::string& to) {
    return std::regex_replace(text, std::regex(from), to);
  };
  const std::map<std::string, std::string> texts{
      {"two words", with("end(loop|facet|solid)", "end $1")},
      {"two words, capitals", with("end(loop|facet|solid)", "END  $1")},
      {"a facet on a line", with("\\n +(outer|vertex|endloop|endfacet)", " $1")},
      {"all on a line", with("\\s+", " ")},
      {"a word on a line", with("(facet|normal|outer|loop|vertex) ", "$1\n")},
      {"a glued name", with("endsolid part", "endsolidpart")},
      {"no names", with("solid part", "solid")},
      {"a name like a keyword", with("solid part", "solid facet normal loop")},
      {"colours", with("(solid part|1?\\.0*e\\+00)\\n", "$1\n color 0.5 0.5 0.5\n")},
      {"remarks", with("\\n", " # a remark\n// another vertex\n; and one\ncomment more\n")},
      {"filled up", text + std::string("\x1A\0\0", 3)},
      {"a remark in front", "# made by hand\n" + text},
      {"no solid", with("(end)?solid part\\n", "")},
      {"no loops", with(" +(outer loop|endloop)\\n", "")},
      {"no ends of facets", with(" +endfacet\\n", "")},
      {"no ends of loops", with(" +endloop\\n", "")},
      {"no normals", with(" normal [^\\n]*", "")},
      {"normals that are no numbers", with("normal [^\\n]*", "normal -nan(ind) 1.#QNAN nan")}};
  for (const auto& [kind, changed] : texts) {
    SCOPED_TRACE(kind);
    ASSERT_NE(changed, text);
    expectSame(parseQuietly(changed), mesh);
  }
}

TEST(Stl, SolidsAreNamedParts) {
  const Mesh mesh = floatPart();
  const std::string solid = asciiStl(mesh);
  const auto parts = [](const std::string& text) {
    std::vector<std::pair<std::string, std::uint32_t>> named;
    for (const MeshPart& part : parse(text).parts) named.emplace_back(part.name, part.begin);
    return named;
  };
  const auto other = [&](const std::string& start) {
    return std::regex_replace(solid, std::regex("^solid part"), start);
  };
  EXPECT_THAT(parts(solid + solid), testing::IsEmpty());
  EXPECT_THAT(parts(solid + "solid empty\nendsolid\n"), testing::IsEmpty());
  EXPECT_THAT(parts(other("solid") + other("solid")), testing::IsEmpty());
  EXPECT_THAT(parts(solid + other("solid  the other one \t")),
              ElementsAre(std::pair("part", 0), std::pair("the other one", 80)));
  EXPECT_THAT(parts(other("SOLIDglued") + other("solid")),
              ElementsAre(std::pair("glued", 0), std::pair("", 80)));
  EXPECT_THAT(parts(solid.substr(0, solid.find("endsolid")) + other("solid b")),
              ElementsAre(std::pair("part", 0), std::pair("b", 80)));
}

TEST(Stl, WarnsOfTextThatMayBeCutOff) {
  const Mesh mesh = floatPart();
  const std::string text = asciiStl(mesh);
  Warnings warnings;
  expectSame(parse(text.substr(0, text.find("endsolid")), &warnings), mesh);
  EXPECT_THAT(warnings, ElementsAre("'part', line 562: the file ends without 'endsolid': it may "
                                    "have been cut off"));
}

TEST(Stl, RefusesAsciiThatIsNotAsItShouldBe) {
  const auto body = [](const std::string& lines) { return refusal("solid x\n" + lines); };
  const std::string loop = "facet normal 0 0 1\nouter loop\n";
  const std::string corners = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n";
  EXPECT_EQ(body(loop + corners),
            "'part', line 7: cut off: the file ends within a facet; export or download it again");
  EXPECT_EQ(body(loop + "vertex 0 0"),
            "'part', line 4: cut off: the file ends within a facet; export or download it again");
  EXPECT_EQ(body(loop + corners + "vertex 1 1 0\nendloop\n"),
            "'part', line 8: a facet has 4 corners instead of 3; export triangles only");
  EXPECT_EQ(body(loop + "vertex 0 0\nendloop\n"),
            "'part', line 4: a vertex is not three numbers; repair the line or export again");
  EXPECT_EQ(body(loop + "vertex 0 0,5 1\n"),
            "'part', line 4: a vertex is not three numbers; repair the line or export again");
  EXPECT_EQ(body(loop + "vertex 0 1e999 1\n"),
            "'part', line 4: vertex is not finite (0 inf 1); repair the mesh");
  EXPECT_EQ(body(corners), "'part', line 2: vertex outside of a loop; export it again");
  EXPECT_EQ(body(loop + corners + "facet normal 0 0 1\n"),
            "'part', line 7: the loop before is not closed; export it again");
  EXPECT_EQ(body(loop + corners + "endsolid\n"),
            "'part', line 7: the loop before is not closed; export it again");
  EXPECT_EQ(body(loop + "outer loop\n"),
            "'part', line 4: the loop before is not closed; export it again");
  EXPECT_EQ(body(loop + "vertex 0 0 0\nvertex 1 0 0\nendfacet\n"),
            "'part', line 6: a facet has 2 corners instead of 3; export triangles only");
  EXPECT_EQ(body(loop + "vertex 0 0 0 0\n"),
            "'part', line 4: a vertex is not three numbers; repair the line or export again");
  EXPECT_EQ(body("facets\n"),
            "'part', line 2: 'facets' is not a keyword of STL; repair the line or export again");
  EXPECT_EQ(body("end of it\n"),
            "'part', line 2: 'end of' is not a keyword of STL; repair the line or export again");
}

}  // namespace
}  // namespace vdbdither::test
