#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <iterator>
#include <malloc.h>
#include <new>

#include <nlohmann/json.hpp>

#include "io/file/staged_output.h"
#include "io/file/standard_streams.h"
#include "io/vdb/vdb.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/manual.h"
#include "vdbdither/engine/named_file.h"
#include "vdbdither/engine/pipeline.h"
#include "vdbdither/engine/registry.h"
#include "vdbdither/engine/tool_run.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/unexpected.h"
#include "vdbdither/program/console.h"
#include "vdbdither/program/ending.h"
#include "vdbdither/program/threads.h"

namespace vdbdither {
namespace {

using Clock = std::chrono::steady_clock;

/// The text of `help` for a verb, or for all.
std::string helpOn(const std::string& verb) {
  if (verb == "all") return listing();
  if (const ToolInfo* tool = findTool(verb)) return helpText(pageOf(*tool));
  return helpText(pageOf(findOperator(verb)));
}

/// Refuses a word that is not an operator but resembles the name of a tool.
void refuseNearTool(const std::string& word) {
  std::vector<std::string> names;
  for (const OperatorInfo* info : registeredOperators()) names.emplace_back(info->name);
  for (const ToolInfo* info : registeredTools()) {
    if (!info->hidden) names.emplace_back(info->name);
  }
  const std::string near = nearestWord(word, names);
  if (word != near && findTool(near))
    throw UsageError("no operator or tool '" + word + "'; did you mean '" + near + "'?");
}

/// The words of the chain: the arguments themselves, or the line after `run`. If the program was
/// called through a link named like an operator, that operator comes first.
std::vector<std::string> chainWords(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  const std::string called = std::filesystem::path(argv[0]).filename();
  for (const OperatorInfo* info : registeredOperators()) {
    if (called == info->name) words.insert(words.begin(), called);
  }
  if (!words.empty() && words.front() == "run") {
    if (words.size() != 2) throw UsageError("run: takes one argument, the chain in quotes");
    std::vector<std::string> chain = splitWords(words[1]);
    if (chain.empty()) throw UsageError("run: the chain is empty");
    return chain;
  }
  return words;
}

std::string reportJson(const JobReport& report, double seconds) {
  nlohmann::ordered_json json;
  json["version"] = version;
  json["seconds"] = seconds;
  if (report.expected_seconds) json["expected_seconds"] = *report.expected_seconds;
  json["layers"] = report.layers;
  json["box_voxels"] = report.box_voxels;
  json["peak_memory_bytes"] = peakMemoryBytes();
  json["stages"] = nlohmann::ordered_json::array();
  for (const StageReport& stage : report.stages) {
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
  return jsonText(json) + "\n";
}

void printStages(const JobReport& report, double seconds) {
  for (const StageReport& stage : report.stages) {
    std::fprintf(stderr, "%-16s %8.2f s  %12.0f voxels  %8s out  %8s peak", stage.name.c_str(),
                 stage.seconds, stage.active_voxels, bytesText(stage.bytes).c_str(),
                 bytesText(stage.peak_memory_bytes).c_str());
    for (const auto& [name, value] : stage.counts) {
      std::fprintf(stderr, "  %s %s", printable(name).c_str(), shortestText(value).c_str());
    }
    std::fputc('\n', stderr);
  }
  std::fprintf(stderr, "%-16s %8.2f s  %8.0f Mvoxel/s of the box\n", "all", seconds,
               report.box_voxels / seconds / 1e6);
}

/// Runs `job`, a Pipeline or a ToolRun, by `function` and reports what it did.
template <typename Job, typename Function>
void runReported(Job& job, Console& console, Clock::time_point start, const Function& function) {
  function();
  console.end();
  const RunOptions& options = job.options();
  const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
  if (options.verbose) printStages(job.report(), seconds);
  if (options.json) console.print(reportJson(job.report(), seconds));
}

void runTool(ToolRun&& tool) {
  watchForInterrupts();
  if (tool.options().no_flush) StagedOutput::leaveFlushOut();
  const GrantedThreads threads;
  const Clock::time_point start = Clock::now();
  Console console(tool.options().progress, tool.report().stages.front().name);
  console.begin(tool.options().quiet || tool.options().verbose, 0, 0);
  runReported(tool, console, start, [&] { tool.run(console); });
}

void runChain(const std::vector<Step>& steps) {
  Pipeline pipeline(steps);
  const RunOptions& options = pipeline.options();
  if (const OperatorInfo* info = pipeline.helpWanted())
    return printData(helpText(pageOf(*info)).c_str());
  watchForInterrupts();
  if (options.no_flush) StagedOutput::leaveFlushOut();
  const GrantedThreads threads;
  const Clock::time_point start = Clock::now();
  Console console(options.progress, steps.front().verb);
  console.begin(options.quiet, 0, 0);
  if (options.explain) StagedOutput::acceptExisting();
  const JobPlan& plan = pipeline.plan(console);
  if (options.explain) {
    printData((options.json ? toJson(plan) : toText(plan)).c_str());
    return pipeline.readInputsToEnd();
  }
  console.keepStandardOutputFree(plan.writesToStandardOutput());
  console.begin(options.quiet || options.verbose, plan.boxVoxels(), plan.seconds.value_or(0));
  runReported(pipeline, console, start, [&] { pipeline.run(); });
}

void runProgram(int argc, char** argv) {
  const std::vector<std::string> words = chainWords(argc, argv);
  if (words.empty()) return printData(overview().c_str());
  if (std::find(words.begin(), words.end(), "--version") != words.end())
    return printData((std::string("vdbdither ") + version + "\n").c_str());
  if (words.front() == "--help" || words.front() == "-h" || words.front() == "help") {
    return printData(words.size() > 1 ? helpOn(words[1]).c_str() : overview().c_str());
  }
  if (const ToolInfo* tool = findTool(words.front())) {
    const std::vector<std::string> arguments(words.begin() + 1, words.end());
    if (asksForHelp(arguments)) return printData(helpText(pageOf(*tool)).c_str());
    return runTool({*tool, arguments});
  }
  refuseNearTool(words.front());
  const std::vector<Step> steps = parseChain(words);
  const OperatorInfo& info = findOperator(steps.front().verb);
  if (steps.size() == 1 && worksOnFile(info, steps.front().arguments))
    return runTool({info, steps.front().arguments});
  runChain(steps);
}

/// Runs the program. An error after a signal is a consequence of it, such as a call that came back
/// early.
void runStoppable(int argc, char** argv) {
  try {
    runProgram(argc, argv);
  } catch (...) {
    throwIfInterrupted();
    throw;
  }
}

/// Whether a message begins with the verb that it is about.
bool namesItsVerb(const std::string& message) {
  const std::string first = message.substr(0, message.find(": "));
  const auto operators = registeredOperators();
  return findTool(first) || first == "run" ||
         std::any_of(operators.begin(), operators.end(),
                     [&](const OperatorInfo* info) { return first == info->name; });
}

/// Whether the arguments ask for progress in the words of Open Job Description. A run may fail
/// before its options are parsed.
bool tellsOpenJobDescription(int argc, char** argv) {
  const std::vector<std::string> words(argv + 1, argv + argc);
  const auto option = std::find(words.begin(), words.end(), "--progress");
  return std::find(words.begin(), words.end(), "--progress=openjd") != words.end() ||
         (option != words.end() && std::next(option) != words.end() &&
          *std::next(option) == "openjd");
}

int guardedMain(int argc, char** argv) {
  const auto tell = [&](const std::string& message) {
    if (tellsOpenJobDescription(argc, argv)) Console::tellFailure(message);
  };
  const auto fail = [&](const std::string& message, int code) {
    tell(message);
    claimEnding(code);
    std::fprintf(stderr, "vdbdither%s %s\n", namesItsVerb(message) ? "" : ":",
                 printable(message).c_str());
    return code;
  };
  // The next slab needs what one slab frees: returning it to the system in between takes a tenth of
  // the time. Blocks of 128 KiB and more would be returned one by one.
  mallopt(M_TRIM_THRESHOLD, 256 << 20);
  mallopt(M_MMAP_THRESHOLD, 32 << 20);
  try {
    openStandardDescriptors();
    setStandardOutputAside();
    // Libraries write warnings there, in their own words.
    std::cerr.rdbuf(nullptr);
    noteInterrupts();
    initializeVdb();
    runStoppable(argc, argv);
    claimEnding(0);
    return 0;
  } catch (const Interrupted& error) {
    tell(error.what());
    claimEnding(128 + error.signal());
    printLastLine(error.what());
    return 128 + error.signal();
  } catch (const UsageError& error) {
    return fail(error.what(), 2);
  } catch (const std::bad_alloc&) {
    return fail("out of memory; try a smaller --slab or fewer --layers", 1);
  } catch (const Error& error) {
    return fail(error.what(), 1);
  } catch (const std::exception& error) {
    return fail(unexpectedText(error), 1);
  }
}

}  // namespace
}  // namespace vdbdither

int main(int argc, char** argv) { return vdbdither::guardedMain(argc, argv); }
