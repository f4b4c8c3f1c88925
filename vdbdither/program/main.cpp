#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <malloc.h>
#include <new>

#include <nlohmann/json.hpp>

#include "io/file/standard_streams.h"
#include "io/vdb/vdb.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/manual.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/program/console.h"

namespace vdbdither {
namespace {

/// What `help` says of a verb, or of all.
std::string helpOn(const std::string& verb) {
  if (verb == "all") return listing();
  if (const ToolInfo* tool = findTool(verb)) return helpText(pageOf(*tool));
  return helpText(pageOf(findOperator(verb)));
}

bool asksForHelp(const std::vector<std::string>& words) {
  return std::any_of(words.begin(), words.end(),
                     [](const std::string& word) { return word == "--help" || word == "-h"; });
}

void runTool(const ToolInfo& info, const std::vector<std::string>& arguments) {
  if (asksForHelp(arguments)) return printData(helpText(pageOf(info)).c_str());
  try {
    const std::unique_ptr<Tool> tool = info.make();
    Options options;
    tool->declare(options);
    options.parse(arguments);
    tool->run();
  } catch (const UsageError& error) {
    throw UsageError(std::string(info.name) + ": " + error.what());
  } catch (const DataError& error) {
    throw DataError(std::string(info.name) + ": " + error.what());
  }
}

/// Whether a word that is no operator was rather meant to be a command.
void refuseNearTool(const std::string& word) {
  std::vector<std::string> names;
  for (const OperatorInfo* info : registeredOperators()) names.emplace_back(info->name);
  for (const ToolInfo* info : registeredTools()) {
    if (!info->hidden) names.emplace_back(info->name);
  }
  const std::string near = nearestWord(word, names);
  if (word != near && findTool(near))
    throw UsageError("no operator or command '" + word + "'; did you mean '" + near + "'?");
}

/// The words of the chain: the arguments themselves, or the line after `run`; behind a link named
/// like an operator, that operator first.
std::vector<std::string> chainWords(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  const std::string called = std::filesystem::path(argv[0]).filename();
  for (const OperatorInfo* info : registeredOperators()) {
    if (called == info->name) words.insert(words.begin(), called);
  }
  if (!words.empty() && words.front() == "run") {
    if (words.size() != 2) throw UsageError("run: takes one argument, the chain in quotes");
    return splitWords(words[1]);
  }
  return words;
}

std::string reportJson(const Pipeline& pipeline, double seconds) {
  nlohmann::ordered_json json;
  json["version"] = version;
  json["seconds"] = seconds;
  if (const auto expected = pipeline.expectedSeconds()) json["expected_seconds"] = *expected;
  json["layers"] = pipeline.layers();
  json["box_voxels"] = pipeline.boxVoxels();
  json["peak_memory_bytes"] = peakMemoryBytes();
  json["stages"] = nlohmann::ordered_json::array();
  for (const StageReport& stage : pipeline.reports()) {
    nlohmann::ordered_json entry{{"name", stage.name},
                                 {"seconds", stage.seconds},
                                 {"cpu_seconds", stage.cpu_seconds},
                                 {"active_voxels", stage.active_voxels},
                                 {"bytes", stage.bytes},
                                 {"peak_memory_bytes", stage.peak_memory_bytes}};
    if (stage.expected_cpu_seconds) entry["expected_cpu_seconds"] = *stage.expected_cpu_seconds;
    for (const auto& [name, value] : stage.counts) entry["counts"][name] = value;
    json["stages"].push_back(entry);
  }
  return json.dump() + "\n";
}

void printStages(const Pipeline& pipeline, double seconds) {
  for (const StageReport& stage : pipeline.reports()) {
    std::fprintf(stderr, "%-16s %8.2f s  %12.0f voxels  %8s out  %8s peak", stage.name.c_str(),
                 stage.seconds, stage.active_voxels, bytesText(stage.bytes).c_str(),
                 bytesText(stage.peak_memory_bytes).c_str());
    for (const auto& [name, value] : stage.counts) {
      std::fprintf(stderr, "  %s %s", name.c_str(), shortestText(value).c_str());
    }
    std::fputc('\n', stderr);
  }
  std::fprintf(stderr, "%-16s %8.2f s  %8.0f Mvoxel/s of the box\n", "all", seconds,
               pipeline.boxVoxels() / seconds / 1e6);
}

/// The console of the program: what operators tell goes to standard output, or to standard error
/// where that carries voxels.
class ProgramConsole : public Console {
 public:
  explicit ProgramConsole(bool voxels_on_output) : voxels_on_output_(voxels_on_output) {}
  void print(const std::string& text) override {
    clear();
    if (voxels_on_output_) {
      std::fputs(text.c_str(), stderr);
    } else {
      printData(text.c_str());
    }
  }

 private:
  bool voxels_on_output_;
};

void runChain(const std::vector<std::string>& words) {
  Pipeline pipeline(parseChain(words));
  const RunOptions& options = pipeline.options();
  if (const OperatorInfo* info = pipeline.helpWanted())
    return printData(helpText(pageOf(*info)).c_str());
  ProgramConsole console(pipeline.writesToStandardOutput());
  console.begin(options.quiet, 0, 0);
  const auto start = std::chrono::steady_clock::now();
  pipeline.plan(console);
  if (options.explain) {
    printData(pipeline.explanation().c_str());
    return pipeline.drain();
  }
  console.begin(options.quiet || options.verbose, pipeline.boxVoxels(),
                pipeline.expectedSeconds().value_or(0));
  try {
    pipeline.run();
  } catch (...) {
    console.clear();
    throw;
  }
  console.clear();
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (options.verbose) printStages(pipeline, seconds);
  if (options.json) console.print(reportJson(pipeline, seconds));
}

void runProgram(int argc, char** argv) {
  const std::vector<std::string> words = chainWords(argc, argv);
  if (words.empty()) {
    std::fputs(overview().c_str(), stderr);
    throw UsageError("there is no operator");
  }
  if (std::find(words.begin(), words.end(), "--version") != words.end())
    return printData((std::string("vdbdither ") + version + "\n").c_str());
  if (words.front() == "--help" || words.front() == "-h" || words.front() == "help") {
    return printData(words.size() > 1 ? helpOn(words[1]).c_str() : overview().c_str());
  }
  if (const ToolInfo* tool = findTool(words.front()))
    return runTool(*tool, {words.begin() + 1, words.end()});
  refuseNearTool(words.front());
  runChain(words);
}

/// Whether a message begins with the stage that it is about.
bool namesItsStage(const std::string& message) {
  const std::string first = message.substr(0, message.find(": "));
  const auto operators = registeredOperators();
  return findTool(first) || first == "run" ||
         std::any_of(operators.begin(), operators.end(),
                     [&](const OperatorInfo* info) { return first == info->name; });
}

int guardedMain(int argc, char** argv) {
  const auto fail = [](const char* message, int code) {
    std::fprintf(stderr, "vdbdither%s %s\n", namesItsStage(message) ? "" : ":", message);
    return code;
  };
  // What one slab frees the next one wants again: giving it back to the system in between takes
  // twice the system time.
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  try {
    setStandardOutputAside();
    noteInterrupts();
    initializeVdb();
    runProgram(argc, argv);
    return 0;
  } catch (const Interrupted& error) {
    fail(error.what(), 0);
    return 128 + error.signal();
  } catch (const UsageError& error) {
    return fail(error.what(), 2);
  } catch (const std::bad_alloc&) {
    return fail("out of memory; try a smaller --slab or fewer --layers", 1);
  } catch (const std::exception& error) {
    return fail(error.what(), 1);
  }
}

}  // namespace
}  // namespace vdbdither

int main(int argc, char** argv) { return vdbdither::guardedMain(argc, argv); }
