#include "io/mesh/threemf_volumes.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/parsed_meshes.h"
#include "tests/support/threemf_files.h"

namespace vdbdither::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A project of PrusaSlicer: an object of two corners of a cube, of which the second is a volume of
/// the type.
std::string prusaProject(const std::string& metadata) {
  std::string mesh = threemfCorner();
  const std::string end = "</triangles></mesh>";
  EXPECT_THAT(mesh, HasSubstr(end));
  mesh.replace(
      mesh.find(end), end.size(),
      "<triangle v1=\"0\" v2=\"1\" v3=\"2\"/><triangle v1=\" 0 \" v2=\"3\" v3=\"1\"/>" + end);
  return threemfOf(threemfModel("<object id=\"1\">" + mesh + "</object>", "<item objectid=\"1\"/>"),
                   {{"Metadata/Slic3r_PE_model.config",
                     "<config><object id=\"1\" instances_count=\"1\">"
                     "<metadata type=\"object\" key=\"name\" value=\"part\"/>"
                     "<volume firstid=\"0\" lastid=\"3\">"
                     "<metadata type=\"volume\" key=\"volume_type\" value=\"ModelPart\"/></volume>"
                     "<volume firstid=\"4\" lastid=\"5\">"
                     "<metadata type=\"volume\" key=\"name\" value=\"second\"/>" +
                         metadata + "</volume></object></config>"}});
}

std::string volumeType(const std::string& type) {
  return "<metadata type=\"volume\" key=\"volume_type\" value=\"" + type + "\"/>";
}

/// A project of Bambu Studio: an object of two components, of which the second is a part of the
/// subtype.
std::string bambuProject(const std::string& subtype) {
  return threemfOf(
      threemfModel("<object id=\"1\">" + threemfCorner() + "</object><object id=\"2\">" +
                       threemfCorner() +
                       "</object><object id=\"3\"><components><component objectid=\"1\"/>"
                       "<component objectid=\"2\"/></components></object>",
                   "<item objectid=\"3\"/>"),
      {{"Metadata/model_settings.config",
        "<config><object id=\"3\"><metadata key=\"name\" value=\"part\"/>"
        "<part id=\"1\" subtype=\"normal_part\"><metadata key=\"name\" value=\"first\"/></part>"
        "<part id=\"2\" subtype=\"" +
            subtype + "\"><metadata key=\"name\" value=\"second\"/></part></object></config>"}});
}

TEST(ThreemfVolumes, LeavesOutVolumesThatSlicersDoNotPrint) {
  const std::string warning =
      "'part': leaves out 1 volume that is not printed: modifiers, support blockers and enforcers "
      "of the slicer's project";
  for (const std::string& bytes :
       {prusaProject(volumeType("ParameterModifier")), prusaProject(volumeType("SupportBlocker")),
        prusaProject(volumeType("SupportEnforcer")),
        prusaProject("<metadata type=\"volume\" key=\"modifier\" value=\"1\"/>"),
        bambuProject("modifier_part"), bambuProject("support_blocker"),
        bambuProject("support_enforcer")}) {
    Warnings warnings;
    EXPECT_EQ(parse(bytes, &warnings).triangles.size(), 4U);
    EXPECT_THAT(warnings, ElementsAre(warning));
  }
  EXPECT_EQ(parseQuietly(prusaProject(volumeType("ModelPart"))).triangles.size(), 6U);
  EXPECT_EQ(parseQuietly(bambuProject("normal_part")).triangles.size(), 8U);
}

TEST(ThreemfVolumes, RefusesVolumesThatAreCutOutOfThePart) {
  const std::string message =
      "'part': has a negative volume, 'second', which is to be cut out of the part; do that in the "
      "slicer (a Boolean of meshes), or export the part as STL";
  EXPECT_EQ(refusal(prusaProject(volumeType("NegativeVolume"))), message);
  EXPECT_EQ(refusal(bambuProject("negative_part")), message);
}

}  // namespace
}  // namespace vdbdither::test
