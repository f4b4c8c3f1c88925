#include "tests/support/contract.h"

#include <array>
#include <cstdint>
#include <filesystem>
#include <sstream>
#include <vector>

#include <gtest/gtest.h>

#include "io/mesh/mesh_writer.h"
#include "io/vdb/vdb.h"
#include "tests/support/mesh_files.h"
#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/shapes.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {
namespace {

using test::firstBreach;
namespace fs = std::filesystem;

/// Keeps what operators are there to tell.
class Listener : public Watcher {
 public:
  void warn(const std::string&, const std::string&) override {}
  void progress(const std::string&, int, int, double) override {}
  void print(const std::string& text) override { printed += text; }

  std::string printed;
};

/// Returns what the chain told.
std::string runChain(std::vector<Step> steps, const std::vector<std::string>& more = {}) {
  for (const std::string& argument : more) steps.back().arguments.push_back(argument);
  Listener listener;
  Pipeline pipeline(steps);
  pipeline.plan(listener);
  pipeline.run();
  return listener.printed;
}

/// Writes the mesh as a PLY with a colour at every vertex.
void writeColouredPly(const Mesh& mesh, const fs::path& path) {
  std::vector<std::array<std::uint8_t, 3>> colours;
  for (std::size_t n = 0; n < mesh.vertices.size(); ++n)
    colours.push_back({static_cast<std::uint8_t>(n), static_cast<std::uint8_t>(3 * n),
                       static_cast<std::uint8_t>(5 * n)});
  MeshWriter writer(path, MeshEncoding{{true, false, ""}, {}});
  writer.add(mesh.vertices, mesh.triangles, 0, colours);
  writer.commit();
}

/// Every registered operator by its example, in a folder with a part.
class Contract : public testing::TestWithParam<const OperatorInfo*> {
 protected:
  void SetUp() override {
    initializeVdb();
    before_ = fs::current_path();
    enter("start");
  }
  void TearDown() override { fs::current_path(before_); }

  /// Goes to a new folder that holds nothing but a part.
  fs::path enter(const std::string& name) {
    const fs::path folder = scratch_.path() / name;
    fs::create_directories(folder);
    fs::current_path(folder);
    const Mesh part =
        test::transformed(test::torusMesh({0, 0, 0}, 0.7, 0.3, 40), {20, 35, 0}, {0.11, 0.2, 0.3});
    scratch_.write(name + "/part.stl", test::binaryStl(part));
    writeColouredPly(part, folder / "part.ply");
    return folder;
  }

  /// The chains of the example; the last one shows the operator.
  [[nodiscard]] static std::vector<std::vector<Step>> chains() {
    std::vector<std::vector<Step>> chains;
    std::istringstream text{std::string(GetParam()->example)};
    for (std::string line; std::getline(text, line);)
      chains.push_back(parseChain(splitWords(line)));
    return chains;
  }

  /// Returns what it told.
  static std::string runExample(const std::vector<std::string>& more = {}) {
    std::string printed;
    for (const std::vector<Step>& chain : chains()) printed += runChain(chain, more);
    return printed;
  }

  test::ScratchFolder scratch_;
  fs::path before_;
};

TEST_P(Contract, ItsExampleNamesItAndRuns) {
  const std::vector<Step> steps = chains().back();
  EXPECT_TRUE(GetParam()->transport ||
              std::any_of(steps.begin(), steps.end(),
                          [](const Step& step) { return step.verb == GetParam()->name; }));
  const fs::path folder = enter("example");
  runExample();
  EXPECT_GT(test::filesUnder(folder).size(), 2U);
}

TEST_P(Contract, ItsWordsAreOfOneStyle) {
  const auto expect_style = [](const std::string& sentence) {
    ASSERT_FALSE(sentence.empty());
    EXPECT_FALSE(std::islower(static_cast<unsigned char>(sentence.front())) &&
                 sentence.find(':') > 9)
        << sentence;
    EXPECT_NE(sentence.back(), '.') << sentence;
  };
  Options options;
  const std::unique_ptr<Operator> made = GetParam()->make();
  made->declare(options);
  expect_style(std::string(GetParam()->summary));
  for (const Option& option : options.all()) {
    expect_style(option.help);
    for (const Word& word : option.words) expect_style(word.meaning);
  }
}

TEST_P(Contract, OnAFileOfItsOwnItTakesTheSameOptions) {
  if (!GetParam()->on_file.make) GTEST_SKIP() << "works in chains only";
  Options options;
  Options of_tool;
  const std::unique_ptr<Operator> made = GetParam()->make();
  const std::unique_ptr<Tool> tool = GetParam()->on_file.make();
  made->declare(options);
  tool->declare(of_tool);
  ASSERT_EQ(of_tool.all().size(), options.all().size() + 1);
  EXPECT_EQ(of_tool.all().front().kind, Option::Kind::positional);
  for (const Option& option : options.all()) {
    const Option* same = of_tool.find(option.name);
    ASSERT_TRUE(same) << option.name;
    EXPECT_EQ(same->help, option.help);
  }
}

TEST_P(Contract, SlabHeightAndThreadsChangeNoByte) {
  const fs::path reference = enter("reference");
  const std::string printed = runExample();
  const auto expected = test::filesUnder(reference);
  for (const std::vector<std::string>& more :
       std::vector<std::vector<std::string>>{{"--slab", "8"},
                                             {"--slab", "24", "--threads", "2"},
                                             {"--slab", "all"},
                                             {"--threads", "1"}}) {
    const fs::path folder = enter(more[0] + more[1]);
    EXPECT_EQ(runExample(more), printed) << more[0] << " " << more[1];
    EXPECT_TRUE(test::filesUnder(folder) == expected) << more[0] << " " << more[1];
  }
}

TEST_P(Contract, ItKeepsWhatAFilterPromises) {
  std::vector<std::vector<Step>> before = chains();
  const std::vector<Step> steps = before.back();
  before.pop_back();
  const auto step = std::find_if(steps.begin(), steps.end(),
                                 [](const Step& s) { return s.verb == GetParam()->name; });
  const std::unique_ptr<Operator> made = GetParam()->make();
  auto* filter = dynamic_cast<Filter*>(made.get());
  if (!filter) GTEST_SKIP() << "no filter";
  for (const std::vector<Step>& chain : before) runChain(chain);
  std::vector<Step> upstream(steps.begin(), step);
  upstream.push_back({"write", {"upstream.vdb"}});
  runChain(upstream);
  const VdbContents contents = readVdb("upstream.vdb");
  const Schema schema = schemaOf(contents, "upstream.vdb");

  std::vector<std::string> arguments = step->arguments;
  if (const auto output = std::find(arguments.begin(), arguments.end(), "-o");
      output != arguments.end()) {
    arguments.erase(output, output + 2);
  }
  Options options;
  filter->declare(options);
  options.parse(arguments);
  filter->plan(schema);
  for (const int height : {8, 40})
    EXPECT_EQ(firstBreach(*filter, schema, contents.grids, height), "");
}

/// Without what consumes grids, and without the names of their files.
std::vector<Step> onlyMakers(const std::vector<Step>& steps) {
  std::vector<Step> makers;
  for (Step step : steps) {
    const auto output = std::find(step.arguments.begin(), step.arguments.end(), "-o");
    if (output != step.arguments.end()) step.arguments.erase(output, output + 2);
    if (!dynamic_cast<Sink*>(findOperator(step.verb).make().get())) makers.push_back(step);
  }
  return makers;
}

/// The chain that a history tells of: its last source and what follows.
std::vector<Step> stepsOf(const std::string& history) {
  std::vector<Step> steps;
  std::istringstream text(history);
  for (std::string line; std::getline(text, line);) {
    const std::vector<Step> step = parseChain(splitWords(line));
    EXPECT_EQ(step.size(), 1U) << line;
    if (dynamic_cast<Source*>(findOperator(step.front().verb).make().get())) steps.clear();
    steps.push_back(step.front());
  }
  return steps;
}

TEST_P(Contract, ItsHistoryRunsAgainToTheSameBytes) {
  std::vector<std::vector<Step>> before = chains();
  std::vector<Step> steps = onlyMakers(before.back());
  before.pop_back();
  if (steps.empty()) GTEST_SKIP() << "its example makes no grid";
  for (const std::vector<Step>& chain : before) runChain(chain);
  steps.push_back({"write", {"made.vdb"}});
  runChain(steps);
  std::vector<Step> again = stepsOf(readVdb("made.vdb").metadata.at("vdbdither:history"));
  EXPECT_EQ(again.size(), steps.size() - 1 - (steps.front().verb == "read" ? 1 : 0));
  again.push_back({"write", {"again.vdb"}});
  runChain(again);
  EXPECT_TRUE(test::fileBytes("made.vdb") == test::fileBytes("again.vdb"));
}

std::string nameOf(const testing::TestParamInfo<const OperatorInfo*>& info) {
  std::string name;
  bool capital = true;
  for (const char c : info.param->name) {
    if (c != '-') name += static_cast<char>(capital ? std::toupper(c) : c);
    capital = c == '-';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Operators, Contract,
                         testing::ValuesIn(registeredOperators().begin(),
                                           registeredOperators().end()),
                         nameOf);

/// Reads the layer above, and says or does not say so.
class LookAbove : public Filter {
 public:
  explicit LookAbove(bool honest) : honest_(honest) {}
  void declare(Options&) override {}
  Schema plan(const Schema& in) override { return in; }
  [[nodiscard]] std::vector<Read> reads() const override {
    return {{"solid", {0, honest_ ? 1 : 0}}};
  }
  [[nodiscard]] Grids run(const Slab& in) const override {
    const auto solid = openvdb::gridConstPtrCast<openvdb::BoolGrid>(in.grids.at("solid"));
    const auto result = openvdb::BoolGrid::create(false);
    for (int z = in.core.begin; z < in.core.end; ++z) {
      if (solid->tree().getValue({3, 3, z + 1})) result->tree().setValueOn({3, 3, z}, true);
    }
    return {{"solid", result}};
  }

 private:
  bool honest_;
};

TEST(ContractCheck, CatchesAReachThatLies) {
  initializeVdb();
  Schema schema;
  schema.lattice.box = openvdb::CoordBBox({0, 0, 0}, {7, 7, 39});
  const auto solid = openvdb::BoolGrid::create(false);
  for (int z = 0; z < 40; z += 8) solid->tree().setValueOn({3, 3, z + 3}, true);
  schema.grids["solid"] = solid->copyGridWithNewTree();
  const Grids whole{{"solid", solid}};
  LookAbove honest(true);
  EXPECT_EQ(firstBreach(honest, schema, whole, 8), "");
  LookAbove lying(false);
  EXPECT_EQ(
      firstBreach(lying, schema, whole, 8),
      "'solid' depends on the slab, or on what lies beyond the declared reach, in layers 0 to 7");
}

}  // namespace
}  // namespace vdbdither
