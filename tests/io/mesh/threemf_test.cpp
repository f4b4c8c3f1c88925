#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/image/picture.h"
#include "io/image/srgb.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/mesh_reader.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/parsed_meshes.h"
#include "tests/support/threemf_files.h"
#include "vdbdither/model/errors.h"

namespace vdbdither::test {
namespace {

using openvdb::Vec3d;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

std::string object(int id, const std::string& content, const std::string& attributes = "") {
  return "<object id=\"" + std::to_string(id) + "\" " + attributes + ">" + content + "</object>";
}

std::string item(int object_id, const std::string& attributes = "") {
  return "<item objectid=\"" + std::to_string(object_id) + "\" " + attributes + "/>";
}

std::string component(int object_id, const std::string& attributes = "") {
  return "<component objectid=\"" + std::to_string(object_id) + "\" " + attributes + "/>";
}

std::string components(const std::string& content) {
  return "<components>" + content + "</components>";
}

/// A file with one object, whose content and attributes are given.
std::string oneObject(const std::string& content, const std::string& attributes = "",
                      const std::string& resources = "") {
  return threemfOf(threemfModel(resources + object(1, content, attributes), item(1)));
}

std::shared_ptr<const Appearance> appearanceOf(const std::string& bytes,
                                               Warnings* warnings = nullptr) {
  return parseMesh(MeshFile(
                       "part", bytes,
                       [&](const std::string& warning) {
                         if (warnings != nullptr) warnings->push_back(warning);
                       },
                       MeshColours::read))
      .appearance;
}

std::string colourRefusal(const std::string& bytes) {
  try {
    appearanceOf(bytes);
  } catch (const DataError& error) {
    return error.what();
  }
  return "read";
}

std::vector<std::string> partNames(const Mesh& mesh) {
  std::vector<std::string> names;
  for (const MeshPart& part : mesh.parts) names.push_back(part.name);
  return names;
}

float linear(int byte) { return linearOfSrgbBytes().at(static_cast<std::size_t>(byte)); }

TEST(Threemf, ReadsAMesh) {
  const Mesh mesh = parseQuietly(oneObject(threemfCorner()));
  EXPECT_THAT(mesh.vertices,
              ElementsAre(Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1)));
  EXPECT_THAT(mesh.triangles, ElementsAre(Mesh::Triangle{0, 2, 1}, Mesh::Triangle{0, 1, 3},
                                          Mesh::Triangle{1, 2, 3}, Mesh::Triangle{0, 3, 2}));
  EXPECT_THAT(mesh.parts, IsEmpty());
  EXPECT_EQ(mesh.appearance, nullptr);
}

TEST(Threemf, LengthsBecomeMillimetres) {
  const std::vector<std::pair<std::string, double>> units{{"micron", 0.001},  {"millimeter", 1},
                                                          {"centimeter", 10}, {"inch", 25.4},
                                                          {"foot", 304.8},    {"meter", 1000}};
  for (const auto& [unit, mm] : units) {
    const Mesh mesh = parseQuietly(threemfOf(
        threemfModel(object(1, threemfCorner()), item(1, "transform=\"1 0 0 0 1 0 0 0 1 2 0 0\""),
                     "unit=\"" + unit + "\"")));
    EXPECT_EQ(mesh.vertices.at(1), Vec3d(mm + 2 * mm, 0, 0)) << unit;
  }
  EXPECT_EQ(
      parseQuietly(threemfOf(threemfModel(object(1, threemfCorner()), item(1), ""))).vertices.at(1),
      Vec3d(1, 0, 0));
  EXPECT_THAT(refusal(threemfOf(threemfModel("", "", "unit=\"mile\""))),
              HasSubstr("line 2: the unit 'mile' is not one of micron, millimeter, centimeter, "
                        "inch, foot and meter"));
}

TEST(Threemf, TransformsOfComponentsApplyFromTheInsideOut) {
  // Moved by 10 along x, then turned by a quarter about z.
  const Mesh mesh = parseQuietly(threemfOf(threemfModel(
      object(1, threemfCorner()) +
          object(2, components(component(1, "transform=\"1 0 0 0 1 0 0 0 1 10 0 0\""))),
      item(2, "transform=\"0 1 0 -1 0 0 0 0 1 0 0 5\""))));
  EXPECT_EQ(mesh.vertices.at(0), Vec3d(0, 10, 5));
  EXPECT_EQ(mesh.vertices.at(1), Vec3d(0, 11, 5));
  EXPECT_EQ(mesh.vertices.at(2), Vec3d(-1, 10, 5));
}

TEST(Threemf, MirroredObjectsKeepTheirInside) {
  const Mesh mesh = parseQuietly(threemfOf(
      threemfModel(object(1, threemfCorner()), item(1, "transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\""))));
  EXPECT_EQ(mesh.vertices.at(1), Vec3d(-1, 0, 0));
  EXPECT_NEAR(volumeOf(mesh), 1.0 / 6, 1e-12);
}

TEST(Threemf, OnlyItemsOfTheBuildArePrinted) {
  Warnings warnings;
  const Mesh mesh = parse(threemfOf(threemfModel(object(1, threemfCorner(), "name=\"a\"") +
                                                     object(2, threemfCorner(), "name=\"b\"") +
                                                     object(3, threemfCorner(), "name=\"c\""),
                                                 item(3) + item(1) + item(2, "printable=\"0\""))),
                          &warnings);
  EXPECT_THAT(partNames(mesh), ElementsAre("c", "a"));
  EXPECT_EQ(mesh.parts.at(1).begin, 4U);
  EXPECT_THAT(warnings, ElementsAre("'part': leaves out 1 item that is marked as not printable"));
}

TEST(Threemf, WithoutItemsAllObjectsArePrintedOnce) {
  Warnings warnings;
  const Mesh mesh =
      parse(threemfOf(threemfModel(object(1, threemfCorner(), "name=\"a\"") +
                                       object(2, components(component(1)), "name=\"b\"") +
                                       object(3, threemfCorner(), "name=\"c\""),
                                   "")),
            &warnings);
  EXPECT_THAT(partNames(mesh), ElementsAre("a", "c"));
  EXPECT_THAT(warnings, ElementsAre("'part': says not what is to be printed (its build has no "
                                    "items); takes all objects"));
}

TEST(Threemf, ObjectsThatAreNoModelsAreLeftOut) {
  Warnings warnings;
  const Mesh mesh =
      parse(threemfOf(threemfModel(object(1, threemfCorner(), "type=\"model\"") +
                                       object(2, threemfCorner(), "type=\"support\"") +
                                       object(3, threemfCorner(), "type=\"solidsupport\"") +
                                       object(4, threemfCorner(), "type=\"other\"") +
                                       object(5, threemfCorner(), "type=\"surface\""),
                                   item(1) + item(2) + item(3) + item(4) + item(5))),
            &warnings);
  EXPECT_THAT(partNames(mesh), ElementsAre("object 1", "object 5"));
  EXPECT_THAT(warnings, ElementsAre("'part': leaves out 3 objects that are no model: supports and "
                                    "others"));
}

TEST(Threemf, PartsHaveTheNamesOfTheirObjectsOnce) {
  const Mesh mesh = parseQuietly(threemfOf(threemfModel(
      object(1, threemfCorner(), "name=\"wheel\"") + object(2, threemfCorner()) +
          object(3, components(component(1) + component(1) + component(2)), "name=\"car\""),
      item(3) + item(2))));
  EXPECT_THAT(partNames(mesh), ElementsAre("wheel", "wheel 2", "car", "object 2"));
}

TEST(Threemf, ReadsOtherModelPartsInTheirOwnUnit) {
  const std::string inches = threemfModel(object(7, threemfCorner()), "", "unit=\"inch\"");
  const Mesh mesh = parseQuietly(threemfOf(
      threemfModel(object(1, components(component(7, "p:path=\"/3D/My%20Part.model\""))),
                   item(1) + item(7, "p:path=\"/3D/my part.model\""), "requiredextensions=\"p\""),
      {{"3D/My Part.model", inches}}));
  EXPECT_EQ(mesh.triangles.size(), 8U);
  EXPECT_EQ(mesh.vertices.at(1), Vec3d(25.4, 0, 0));
  EXPECT_THAT(
      refusal(threemfOf(threemfModel("", item(1, "p:path=\"/3D/../x.model\"")))),
      HasSubstr("names the model '/3D/../x.model', but holds no such file; export it again"));
}

TEST(Threemf, BaseMaterialsColourTriangles) {
  const std::string materials =
      "<basematerials id=\"5\"><base name=\"red&#10;\" displaycolor=\"#FF0000\"/>"
      "<base name=\"glass\" displaycolor=\"#01804080\"/></basematerials>";
  const auto appearance = appearanceOf(
      oneObject(threemfCorner({"", "pid=\"5\" p1=\"1\""}), "pid=\"5\" pindex=\"0\"", materials));
  ASSERT_NE(appearance, nullptr);
  EXPECT_THAT(appearance->material, ElementsAre(1, 2, 1, 1));
  EXPECT_EQ(appearance->materials.at(1).name, "red\\n");
  EXPECT_EQ(appearance->materials.at(1).colour, openvdb::Vec4f(1, 0, 0, 1));
  EXPECT_EQ(appearance->materials.at(2).name, "glass");
  EXPECT_EQ(appearance->materials.at(2).colour,
            openvdb::Vec4f(linear(1), linear(0x80), linear(0x40), 128.0F / 255));
  EXPECT_THAT(appearance->colours, IsEmpty());
  EXPECT_THAT(appearance->coordinates, IsEmpty());
}

std::string colourGroup() {
  return "<m:colorgroup id=\"6\"><m:color color=\"#FF0000\"/><m:color color=\"#00FF00\"/>"
         "<m:color color=\"#0000FF\"/></m:colorgroup>";
}

const openvdb::Vec4f red(1, 0, 0, 1);
const openvdb::Vec4f green(0, 1, 0, 1);
const openvdb::Vec4f blue(0, 0, 1, 1);
const openvdb::Vec4f white(1, 1, 1, 1);

TEST(Threemf, ColourGroupsColourCorners) {
  const auto appearance = appearanceOf(
      oneObject(threemfCorner({"", "pid=\"6\" p1=\"0\" p2=\"1\" p3=\"2\"", "pid=\"6\" p1=\"1\""}),
                "", colourGroup()));
  ASSERT_NE(appearance, nullptr);
  EXPECT_THAT(appearance->colours, ElementsAre(Appearance::Colours{white, white, white},
                                               Appearance::Colours{red, green, blue},
                                               Appearance::Colours{green, green, green},
                                               Appearance::Colours{white, white, white}));
  EXPECT_THAT(appearance->material, ElementsAre(0, 0, 0, 0));
  EXPECT_EQ(appearance->materials.size(), 1U);
}

TEST(Threemf, MirroredTrianglesKeepTheirCornersColours) {
  const auto appearance = appearanceOf(threemfOf(threemfModel(
      colourGroup() +
          object(1, threemfCorner({"p1=\"0\" p2=\"1\" p3=\"2\""}), "pid=\"6\" pindex=\"2\""),
      item(1, "transform=\"1 0 0 0 1 0 0 0 -1 0 0 0\""))));
  EXPECT_THAT(appearance->colours, testing::Contains(Appearance::Colours{red, blue, green}));
}

std::string texture(const std::string& attributes) {
  return "<m:texture2d id=\"8\" path=\"/3D/t.png\" contenttype=\"image/png\" " + attributes +
         "/><m:texture2dgroup id=\"9\" texid=\"8\"><m:tex2coord u=\"0.25\" v=\"0.75\"/>"
         "<m:tex2coord u=\"1\" v=\"0\"/><m:tex2coord u=\"-1\" v=\"2\"/></m:texture2dgroup>";
}

std::string textured(const std::string& attributes, const std::string& image) {
  return threemfOf(
      threemfModel(texture(attributes) + object(1, threemfCorner({"p1=\"0\" p2=\"1\" p3=\"2\""}),
                                                "pid=\"9\" pindex=\"0\""),
                   item(1)),
      {{"3D/t.png", image}});
}

std::string redAndGreen() {
  const auto bytes = encodePicture({2, 1, {0xFF0000FF, 0xFF00FF00}});
  return {bytes.begin(), bytes.end()};
}

TEST(Threemf, TexturesAreReadWithVFromTheTop) {
  const auto appearance = appearanceOf(textured("", redAndGreen()));
  ASSERT_NE(appearance, nullptr);
  ASSERT_EQ(appearance->textures.size(), 1U);
  EXPECT_EQ(appearance->textures[0].width, 2U);
  EXPECT_EQ(appearance->textures[0].texels.at(1), (Texture::Texel{0, 65535, 0, 65535}));
  using openvdb::Vec2f;
  EXPECT_EQ(appearance->coordinates.at(0),
            (Appearance::Coordinates{Vec2f(0.25F, 0.25F), Vec2f(1, 1), Vec2f(-1, -1)}));
  EXPECT_EQ(
      appearance->coordinates.at(3),
      (Appearance::Coordinates{Vec2f(0.25F, 0.25F), Vec2f(0.25F, 0.25F), Vec2f(0.25F, 0.25F)}));
  const SurfaceMaterial& material = appearance->materials.at(appearance->material.at(0));
  EXPECT_EQ(material.texture, 0U);
  EXPECT_EQ(material.colour, white);
  EXPECT_TRUE(material.is_smooth);
  EXPECT_EQ(material.wrap, (std::array{TextureWrap::repeat, TextureWrap::repeat}));
}

TEST(Threemf, TexturesTileAndInterpolateAsStated) {
  Warnings warnings;
  const auto mirrored = appearanceOf(
      textured("tilestyleu=\"mirror\" tilestylev=\"clamp\" filter=\"nearest\"", redAndGreen()),
      &warnings);
  const SurfaceMaterial& material = mirrored->materials.at(mirrored->material.at(0));
  EXPECT_EQ(material.wrap, (std::array{TextureWrap::mirror, TextureWrap::clamp}));
  EXPECT_FALSE(material.is_smooth);
  EXPECT_THAT(warnings, IsEmpty());
  const auto single = appearanceOf(textured("tilestyleu=\"none\"", redAndGreen()), &warnings);
  EXPECT_EQ(single->materials.at(single->material.at(0)).wrap[0], TextureWrap::clamp);
  EXPECT_THAT(warnings, ElementsAre("'part': passes over the border of textures without tiles (it "
                                    "is stretched)"));
  EXPECT_THAT(colourRefusal(textured("tilestyleu=\"twist\"", redAndGreen())),
              HasSubstr("the tilestyleu 'twist' is not one of wrap, mirror, clamp and none"));
}

TEST(Threemf, ColoursAreNotLookedAtWhereTheyAreNotWanted) {
  const std::string bytes = textured("tilestyleu=\"twist\"", "no image");
  EXPECT_EQ(parseQuietly(bytes).triangles.size(), 4U);
  EXPECT_NE(colourRefusal(bytes), "read");
}

TEST(Threemf, RefusesTexturesThatAreNotThereOrNoImages) {
  EXPECT_THAT(colourRefusal(textured("", "no image")), HasSubstr("'part': its file '3D/t.png'"));
  EXPECT_THAT(colourRefusal(oneObject(threemfCorner(), "pid=\"9\" pindex=\"0\"", texture(""))),
              HasSubstr("names the texture '/3D/t.png', but holds no such file"));
  EXPECT_THAT(colourRefusal(oneObject(threemfCorner(), "pid=\"9\" pindex=\"0\"",
                                      "<m:texture2dgroup id=\"9\" texid=\"8\"><m:tex2coord u=\"0\" "
                                      "v=\"0\"/></m:texture2dgroup>")),
              HasSubstr("its texture coordinates name the texture 8, which there is not"));
  EXPECT_THAT(
      colourRefusal(oneObject(threemfCorner(), "",
                              "<m:texture2dgroup id=\"9\" texid=\"8\"><m:tex2coord u=\"nan\" "
                              "v=\"0\"/></m:texture2dgroup>")),
      HasSubstr("tex2coord 0 is not finite"));
}

TEST(Threemf, RefusesPropertiesOutOfRange) {
  EXPECT_THAT(
      colourRefusal(oneObject(threemfCorner({"pid=\"6\" p1=\"3\""}), "name=\"a\"", colourGroup())),
      HasSubstr("'part': object 1 ('a') has property 3 of the group 6, which counts 3, "
                "from 0; export it again"));
  EXPECT_THAT(colourRefusal(oneObject(threemfCorner(), "pid=\"4\" pindex=\"0\"", colourGroup())),
              HasSubstr("object 1 has properties of the group 4, which there is not"));
  EXPECT_THAT(colourRefusal(oneObject(threemfCorner(), "pid=\"5\" pindex=\"0\"",
                                      "<basematerials id=\"5\"/>")),
              HasSubstr("has property 0 of the group 5, which counts 0"));
  EXPECT_THAT(colourRefusal(oneObject(threemfCorner(), "", colourGroup() + colourGroup())),
              HasSubstr("has a second property group with the id 6"));
}

TEST(Threemf, RefusesColoursThatAreNone) {
  for (const std::string text : {"red", "#12345", "#1234567", "#12345G", "#123456789", ""}) {
    EXPECT_THAT(colourRefusal(oneObject(
                    threemfCorner(), "",
                    "<m:colorgroup id=\"6\"><m:color color=\"" + text + "\"/></m:colorgroup>")),
                HasSubstr("color: its color '" + text +
                          "' is not a colour; #RRGGBB and #RRGGBBAA are read"));
  }
}

TEST(Threemf, NamesWhatItPassesOver) {
  Warnings warnings;
  parse(oneObject(threemfCorner() + "<b:beamlattice radius=\"1\"/><other:thing/>"), &warnings);
  EXPECT_THAT(warnings, ElementsAre("'part': passes over beam lattices"));
  warnings.clear();
  EXPECT_EQ(appearanceOf(oneObject(threemfCorner({"pid=\"3\" p1=\"0\""}), "",
                                   "<m:compositematerials id=\"3\" matid=\"1\" matindices=\"0\">"
                                   "<m:composite values=\"1\"/></m:compositematerials>"),
                         &warnings),
            nullptr);
  EXPECT_THAT(warnings, ElementsAre("'part': passes over colours of composite materials and "
                                    "multiproperties"));
}

TEST(Threemf, RefusesRequiredExtensionsThatItDoesNotRead) {
  const auto with = [](const std::string& prefixes) {
    return refusal(threemfOf(threemfModel(object(1, threemfCorner()), item(1),
                                          "requiredextensions=\"" + prefixes + "\"")));
  };
  EXPECT_EQ(with("m p"), "read");
  EXPECT_THAT(with("m b"),
              HasSubstr("requires beam lattices, which is not read; export a mesh without"));
  EXPECT_THAT(with("other"), HasSubstr("requires the extension 'http://example.com/other', which"));
  EXPECT_THAT(with("q"), HasSubstr("requires the extension 'q', which"));
}

TEST(Threemf, RefusesCyclesOfComponents) {
  EXPECT_EQ(
      refusal(threemfOf(threemfModel(
          object(1, components(component(2))) + object(2, components(component(1))), item(1)))),
      "'part': the object 1 is a component of itself; export it again");
}

/// `levels` objects, each of which consists of `copies` of the one before.
std::string nested(int levels, int copies, const std::string& innermost) {
  std::string resources = object(1, innermost);
  for (int level = 2; level <= levels; ++level) {
    std::string content;
    for (int copy = 0; copy < copies; ++copy) content += component(level - 1);
    resources += object(level, components(content));
  }
  return threemfOf(threemfModel(resources, item(levels)));
}

TEST(Threemf, ReadsComponentsInUpTo32Levels) {
  EXPECT_EQ(refusal(nested(32, 1, threemfCorner())), "read");
  EXPECT_THAT(refusal(nested(33, 1, threemfCorner())),
              HasSubstr("has components within components, deeper than 32"));
  EXPECT_THAT(refusal(nested(5000, 1, threemfCorner())), HasSubstr("deeper than 32"));
}

TEST(Threemf, CountsWhatComponentsMultiplyBeforeItIsMade) {
  EXPECT_EQ(parse(nested(5, 10, threemfCorner())).triangles.size(), 40000U);
  EXPECT_EQ(refusal(nested(30, 10, threemfCorner())),
            "'part': places more than 262144 objects; print fewer at a time");
  EXPECT_EQ(refusal(nested(30, 10, "")),
            "'part': places more than 262144 objects; print fewer at a time");
  std::string large;
  for (int i = 0; i < 1000; ++i) large += "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/>";
  std::string mesh = threemfCorner();
  mesh.insert(mesh.find("</triangles>"), large);
  EXPECT_EQ(refusal(nested(5, 10, mesh)),
            "'part': its components make more than 4000000 triangles or vertices; print fewer at "
            "a time");
}

TEST(Threemf, RefusesObjectsThatAreNotThereOrTwice) {
  EXPECT_EQ(refusal(threemfOf(threemfModel(object(1, threemfCorner()), item(2)))),
            "'part': places the object 2 of '3D/3dmodel.model', which there is not; export it "
            "again");
  EXPECT_THAT(refusal(threemfOf(threemfModel(object(1, "") + object(1, ""), item(1)))),
              HasSubstr("has a second object with the id 1"));
  EXPECT_THAT(refusal(oneObject(threemfCorner() + threemfCorner())),
              HasSubstr("has an object with two meshes"));
}

TEST(Threemf, RefusesNumbersThatAreNone) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string mesh = threemfCorner();
    mesh.replace(mesh.find(from), from.size(), to);
    return refusal(oneObject(mesh));
  };
  EXPECT_THAT(with("x=\"1\"", "x=\"nan\""),
              HasSubstr("'part': its file '3D/3dmodel.model', line 2: vertex 1 is not finite (nan "
                        "0 0); export it again"));
  EXPECT_THAT(with("x=\"1\"", "x=\"1e999\""), HasSubstr("vertex 1 is not finite (inf 0 0)"));
  EXPECT_THAT(with("x=\"1\"", "x=\"1 2\""), HasSubstr("vertex: its x '1 2' is not a number"));
  EXPECT_THAT(with("x=\"1\"", ""), HasSubstr("vertex: its x '' is not a number"));
  EXPECT_THAT(with("v3=\"1\"", "v3=\"4\""),
              HasSubstr("triangle 0 has corner 4, but there are 4 vertices, counted from 0"));
  EXPECT_THAT(with("v3=\"1\"", "v3=\"-1\""),
              HasSubstr("triangle: its v3 '-1' is not a whole number from 0 to 2147483647"));
}

TEST(Threemf, RefusesTransformsThatAreNone) {
  const auto with = [](const std::string& transform) {
    return refusal(threemfOf(
        threemfModel(object(1, threemfCorner()), item(1, "transform=\"" + transform + "\""))));
  };
  EXPECT_THAT(with("1 0 0"), HasSubstr("the transform '1 0 0' is not 12 finite numbers"));
  EXPECT_THAT(with("1 0 0 0 1 0 0 0 1 0 0 inf"), HasSubstr("is not 12 finite numbers"));
  EXPECT_THAT(with("1 0 0 0 1 0 0 0 1 0 0 0 0"), HasSubstr("has more than 12 numbers"));
  EXPECT_THAT(with("1 0 0 0 1 0 0 0 0 0 0 0"), HasSubstr("flattens the object"));
  EXPECT_THAT(with("1e300 0 0 0 1e300 0 0 0 1e300 1e308 1e308 1e308"), "read");
  EXPECT_THAT(
      refusal(threemfOf(threemfModel(
          object(1, threemfCorner()) +
              object(2, components(component(1, "transform=\"1e200 0 0 0 1 0 0 0 1 0 0 0\""))),
          item(2, "transform=\"1e200 0 0 0 1 0 0 0 1 0 0 0\"")))),
      HasSubstr("the object 1 is placed where coordinates are not finite"));
}

TEST(Threemf, RefusesDocumentTypesAndBrokenXml) {
  const std::string model = threemfModel(object(1, threemfCorner()), item(1));
  std::string entities = model;
  entities.insert(entities.find("<model"), "<!DOCTYPE model [<!ENTITY a \"b\">]>");
  EXPECT_THAT(refusal(threemfOf(entities)),
              HasSubstr("line 2: has a document type (<!DOCTYPE), which is not read"));
  EXPECT_THAT(refusal(threemfOf(model.substr(0, model.size() - 10))),
              HasSubstr("ends before its last element: it is cut off"));
  EXPECT_THAT(refusal(threemfOf("<a/>")),
              HasSubstr("begins with 'a', not with the model of a 3MF file"));
  EXPECT_THAT(refusal(threemfOf("no XML")), HasSubstr("is not well-formed XML; export it again"));
  EXPECT_THAT(refusal(threemfOf("<a><b></a></b>")), testing::Not("read"));
  EXPECT_THAT(refusal(threemfOf("<?xml version=\"1.0\" encoding=\"KOI8-R\"?><a/>")),
              HasSubstr("is in an encoding that is not read; use UTF-8"));
  EXPECT_THAT(refusal(threemfOf("%3McF\1\2\3")),
              HasSubstr("its file '3D/3dmodel.model' is encrypted (secure content)"));
}

TEST(Threemf, LimitsWhatXmlMakesTheParserKeep) {
  const std::string model = threemfModel(object(1, threemfCorner()), item(1));
  const auto with = [&](const std::string& more) {
    std::string changed = model;
    changed.insert(changed.find("<resources>"), more);
    return refusal(threemfOf(changed));
  };
  std::string deep;
  for (int i = 0; i < 64; ++i) deep += "<a>";
  EXPECT_THAT(with(deep), HasSubstr("nests more than 64 elements"));
  EXPECT_THAT(with("<a b=\"" + std::string(400'000, 'x') + "\"/>"),
              HasSubstr("has a tag of more than 256 KiB"));
  EXPECT_THAT(with("<a xmlns:b=\"" + std::string(257, 'x') + "\"/>"),
              HasSubstr("names a namespace with more than 256 bytes"));
  std::string names;
  for (int i = 0; i < 600'000; ++i) names += "<a b" + std::to_string(i) + "=\"\"/>";
  EXPECT_THAT(with(names), HasSubstr("has too many different names of elements and attributes"));
  std::string objects;
  for (int i = 2; i < 262'147; ++i) objects += "<object id=\"" + std::to_string(i) + "\"/>";
  EXPECT_THAT(refusal(threemfOf(threemfModel(objects, ""))),
              HasSubstr("has more than 262144 objects; split it"));
}

TEST(Threemf, RefusesBombs) {
  const std::string model = threemfModel(object(1, threemfCorner()), item(1));
  EXPECT_THAT(refusal(threemfOf(model + std::string(20 << 20, ' '))),
              HasSubstr("its member '3D/3dmodel.model' inflates more than 200 to 1"));
  std::mt19937 random(7);
  std::string mixed;
  for (int i = 0; i < (80 << 20) / 256; ++i)
    mixed += std::to_string(random() % 1000) + std::string(253, ' ');
  EXPECT_THAT(refusal(threemfOf(model + mixed)), HasSubstr("'part': its models inflate more than "
                                                           "64 to 1"));
}

TEST(Threemf, RefusesArchivesThatAreNone) {
  EXPECT_EQ(refusal(zipOf({{"part.stl", "solid"}})),
            "'part': a zip archive without a 3MF model; name the mesh that it holds, unpacked");
  EXPECT_EQ(refusal("PK\x03\x04 and no more"), "'part' is not a readable zip archive");
  EXPECT_EQ(refusal("some text", "a.3mf"),
            "'a.3mf': no zip archive, as a 3MF file is; export it "
            "again");
  const std::string whole = oneObject(threemfCorner());
  EXPECT_EQ(refusal(whole.substr(0, whole.size() / 2)), "'part' is not a readable zip archive");
  EXPECT_THAT(refusal(zipOf({{"3D/a\nb", ""}})),
              HasSubstr("its member '3D/a\\nb' has no proper name: it contains the unprintable"));
}

TEST(Threemf, TheModelIsFoundWithoutRelationshipsAndInAnyCase) {
  const std::string model = threemfModel(object(1, threemfCorner()), item(1));
  EXPECT_EQ(refusal(zipOf({{"3d/3DModel.model", model}})), "read");
  EXPECT_THAT(
      refusal(zipOf({{"_rels/.rels",
                      "<Relationships><Relationship Target=\"a.model\" Type=\"http://schemas."
                      "microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>"},
                     {"3D/3dmodel.model", model}})),
      HasSubstr("names the model 'a.model', but holds no such file"));
}

TEST(Threemf, ChecksTheChecksum) {
  std::string bytes = oneObject(threemfCorner());
  // The checksum of the last member, in the directory and in front of it.
  const std::size_t directory = bytes.rfind("PK\x01\x02");
  const std::size_t local = bytes.rfind("PK\x03\x04");
  bytes[directory + 16] ^= 1;
  bytes[local + 14] ^= 1;
  EXPECT_EQ(refusal(bytes), "'part': its file '3D/3dmodel.model' is damaged");
}

TEST(Threemf, ASpoiltFileIsReadOrRefused) {
  const std::string bytes = oneObject(threemfCorner());
  expectEveryPrefixIsReadOrRefused(bytes, false);
  expectSpoiltBytesAreReadOrRefused(bytes);
}

TEST(Threemf, IsReadAndNotWritten) {
  const MeshFormat* format = meshFormatNamedBy("part.3MF");
  ASSERT_NE(format, nullptr);
  EXPECT_EQ(format->write, nullptr);
  EXPECT_THAT(meshFormatNames(), HasSubstr("3MF"));
  EXPECT_THAT(meshEndings(), testing::Not(HasSubstr(".3mf")));
}

}  // namespace
}  // namespace vdbdither::test
