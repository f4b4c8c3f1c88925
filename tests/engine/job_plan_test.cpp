#include "vdbdither/engine/job_plan.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using nlohmann::json;
using openvdb::Coord;
using testing::HasSubstr;
using Kind = StagePlan::Kind;

/// A source, a filter with an input, and a sink, over the layers -8 to 31, of which 0 to 15 are
/// wanted.
JobPlan example() {
  Schema schema;
  schema.lattice = {{0.042, 0.084, 0.022}, {0, 0, 0}, {Coord(0, 0, -8), Coord(99, 49, 31)}};
  schema.grids["surface"] = openvdb::FloatGrid::create();
  schema.footprint = {12, 60, 40};
  JobPlan plan;
  plan.layers = {0, 16};
  plan.slab_layers = 8;
  plan.threads = 2;
  plan.memory_bytes = 50 * 1048576.0;
  plan.memory_limit_bytes = 2 * 1073741824.0;
  plan.seconds = 3;
  plan.stages.resize(3);
  for (StagePlan& stage : plan.stages) {
    stage.schema = schema;
    stage.cores = {0, 16};
    stage.cpu_seconds = 1.5;
  }
  plan.stages[0].name = "mesh2sdf";
  plan.stages[0].kind = Kind::source;
  plan.stages[0].arguments = "part.stl";
  plan.stages[0].memory_bytes = 1048576;
  plan.stages[0].handed_on = {"surface"};
  plan.stages[1].name = "csg";
  plan.stages[1].reads = {{"surface", {2, 3}}};
  plan.stages[1].inputs = {{"second.vdb", false, {-8, 24}, 4096}};
  plan.stages[2].name = "write";
  plan.stages[2].kind = Kind::sink;
  plan.stages[2].is_barrier = true;
  plan.stages[2].output = {"out.vdb", 3 * 1048576.0};
  plan.stages[2].free_disk_bytes = 9 * 1073741824.0;
  return plan;
}

TEST(JobPlan, IsToldToPeopleLineByLine) {
  EXPECT_EQ(toText(example()),
            "lattice   0.042 x 0.084 x 0.022 mm, 100 x 50 x 40 voxels\n"
            "layers    16 of 40, in slabs of 8\n"
            "stage     mesh2sdf part.stl  -> surface, holds 1.0 MiB\n"
            "stage     csg  (reads 2 layers below, 3 above)  -> surface\n"
            "input     second.vdb for csg, a file of 32 layers\n"
            "stage     write  (barrier: holds the whole volume)  -> surface\n"
            "memory    about 50 MiB of 2.0 GiB\n"
            "time      about 3.0 s on 2 threads\n"
            "disk      about 3.0 MiB of 9.0 GiB for out.vdb\n");
}

TEST(JobPlan, SaysWhatIsUnknown) {
  JobPlan plan = example();
  plan.seconds.reset();
  plan.stages[1].cpu_seconds.reset();
  plan.stages[2].cpu_seconds.reset();
  plan.stages[2].output.bytes = 0;
  plan.stages[1].inputs[0] = {"-", true, {0, 8}, 0};
  EXPECT_THAT(toText(plan), HasSubstr("\ntime      unknown of csg, write\n"));
  EXPECT_THAT(toText(plan), HasSubstr("\ndisk      unknown of 9.0 GiB for out.vdb\n"));
  EXPECT_THAT(toText(plan), HasSubstr("\ninput     standard input for csg, a pipe of 8 layers\n"));
}

TEST(JobPlan, IsToldToProgramsAsOneLineOfJson) {
  const std::string text = toJson(example());
  EXPECT_EQ(text.find('\n'), text.size() - 1);
  const json plan = json::parse(text);
  EXPECT_EQ(plan["lattice"]["pitch_mm"], json({0.042, 0.084, 0.022}));
  EXPECT_EQ(plan["lattice"]["min"], json({0, 0, -8}));
  EXPECT_EQ(plan["layers"], json({{"begin", 8}, {"end", 24}})) << "counted as by --layers";
  EXPECT_EQ(plan["slab_layers"], 8);
  EXPECT_EQ(plan["threads"], 2);
  EXPECT_EQ(plan["seconds"], 3);
  EXPECT_EQ(plan["memory_bytes"], 50 * 1048576.0);
  EXPECT_EQ(plan["memory_limit_bytes"], 2 * 1073741824.0);
  ASSERT_EQ(plan["stages"].size(), 3U);
  const json& first = plan["stages"][0];
  EXPECT_EQ(first["name"], "mesh2sdf");
  EXPECT_EQ(first["kind"], "source");
  EXPECT_EQ(first["arguments"], "part.stl");
  EXPECT_EQ(first["grids"], json({"surface"}));
  EXPECT_EQ(first["handed_on"], json({"surface"}));
  EXPECT_EQ(first["leaves"], json({{"fullest_row", 12}, {"total", 60}, {"at_surface", 40}}));
  EXPECT_EQ(first["cpu_seconds"], 1.5);
  EXPECT_TRUE(first["output"].is_null());
  const json& second = plan["stages"][1];
  EXPECT_EQ(second["reads"],
            json({{{"grid", "surface"}, {"below", 2}, {"above", 3}, {"whole", false}}}));
  EXPECT_EQ(second["inputs"], json({{{"path", "second.vdb"},
                                     {"pipe", false},
                                     {"layers", {{"begin", 0}, {"end", 32}}},
                                     {"memory_bytes", 4096}}}));
  const json& third = plan["stages"][2];
  EXPECT_EQ(third["kind"], "sink");
  EXPECT_EQ(third["barrier"], true);
  EXPECT_EQ(third["output"], json({{"path", "out.vdb"},
                                   {"exists", false},
                                   {"bytes", 3 * 1048576.0},
                                   {"free_bytes", 9 * 1073741824.0}}));
}

TEST(JobPlan, TellsOfAnOutputThatExists) {
  JobPlan plan = example();
  plan.stages[2].output_exists = true;
  EXPECT_THAT(toText(plan), HasSubstr(" for out.vdb, which exists: --overwrite replaces it\n"));
  EXPECT_EQ(json::parse(toJson(plan))["stages"][2]["output"]["exists"], true);
}

TEST(JobPlan, UnknownFiguresAreNullInJson) {
  JobPlan plan = example();
  plan.seconds.reset();
  plan.memory_limit_bytes = std::numeric_limits<double>::infinity();
  plan.stages[0].schema.footprint = {};
  plan.stages[2].output.bytes = 0;
  const json told = json::parse(toJson(plan));
  EXPECT_TRUE(told["seconds"].is_null());
  EXPECT_TRUE(told["memory_limit_bytes"].is_null());
  EXPECT_TRUE(told["stages"][0]["leaves"].is_null());
  EXPECT_TRUE(told["stages"][2]["output"]["bytes"].is_null());
}

TEST(JobPlan, KnowsItsBoxAndWhetherVoxelsLeaveByStandardOutput) {
  JobPlan plan = example();
  EXPECT_EQ(plan.boxVoxels(), 100 * 50 * 16);
  EXPECT_FALSE(plan.writesToStandardOutput());
  plan.stages[2].output = {"-", 0};
  EXPECT_TRUE(plan.writesToStandardOutput());
  EXPECT_THAT(toText(plan), testing::Not(HasSubstr("disk")));
}

}  // namespace
}  // namespace vdbdither
