#include "vdbdither/engine/run_options.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

#include "vdbdither/model/errors.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

namespace {

/// `text` itself. Throws UsageError unless it is auto, all, or a multiple of the layers of a leaf.
std::string checkedSlab(const std::string& text) {
  if (text == "auto" || text == "all") return text;
  constexpr int most_layers = 1 << 20;
  const std::string wanted =
      "a multiple of 8 up to " + std::to_string(most_layers) + ", auto or all";
  const double layers = parseNumber(text, {leaf_layers, most_layers}, wanted);
  if (std::fmod(layers, leaf_layers) != 0)
    throw UsageError("'" + text + "' is not accepted; the value must be " + wanted);
  return std::to_string(static_cast<int>(layers));
}

constexpr std::array<Choice<Progress>, 3> progress_styles{
    {{Progress::bar, "bar", "A line that is overwritten, at a terminal only"},
     {Progress::json, "json", "A line of JSON each second"},
     {Progress::openjd, "openjd", "Lines that Open Job Description reads"}}};

}  // namespace

void RunOptions::declareWork(Options& options) {
  options.flag("no-flush", no_flush,
               "Does not wait until outputs are on the disk: faster, but a machine that stops may "
               "lose outputs of runs that have ended");
  options.integer("threads", threads, {0, 4096}, "Number of threads; 0 takes all");
}

void RunOptions::declareWords(Options& options) {
  options.choice("progress", progress, progress_styles, "How standard error shows the progress");
  options.flag("quiet", quiet, "Prints only warnings and errors");
  options.letter('q');
  options.flag("verbose", verbose, "Prints a line for each stage");
  options.letter('v');
}

void RunOptions::declareForTool(Options& options) {
  declareWork(options);
  declareWords(options);
}

void RunOptions::declare(Options& options) {
  options.file("input", input, "FILE.vdb",
               "Reads this file instead of standard input, where the chain has no source");
  options.letter('i');
  options.file("output", output, "FILE.vdb",
               "Writes this file instead of standard output, where the chain has no sink");
  options.letter('o');
  options.flag(
      "overwrite", overwrite,
      "Replaces each output that exists; behind an operator with an --overwrite of its own, "
      "the output of that operator only");
  declareWork(options);
  options.parsed(
      "slab", "N", [this](const std::string& text) { slab = checkedSlab(text); },
      [this] { return slab; }, "Number of layers worked on at a time, a multiple of 8");
  options.words({{"auto", "As many as the memory allows, up to 64, or 128 within 512MiB"},
                 {"all", "All layers at once"}});
  options.parsed(
      "memory", "SIZE",
      [this](const std::string& text) {
        if (text != "auto") parseBytes(text);
        memory = text;
      },
      [this] { return memory; }, "Memory that the run may use, such as 4GiB");
  options.words({{"auto", "Four fifths of the memory that is free"}});
  options.text("layers", layers, "A:B",
               "Makes the layers A to B-1 only, counted from the bottom of the job");
  options.flag("stream", stream, "Refuses operators that need the whole volume at once");
  options.flag("explain", explain, "Prints what the run would do and cost, and stops");
  options.flag("json", json, "Reports time, voxels, bytes and peak memory of each stage as JSON");
  declareWords(options);
  options.flag("version", version, "Prints the version of the program");
  options.flag("help", help, "Prints this text");
  options.letter('h');
}

namespace {

constexpr std::array<std::pair<const char*, double>, 8> byte_units{{{"KiB", 1024.0},
                                                                    {"MiB", 1048576.0},
                                                                    {"GiB", 1073741824.0},
                                                                    {"TiB", 1099511627776.0},
                                                                    {"kB", 1e3},
                                                                    {"MB", 1e6},
                                                                    {"GB", 1e9},
                                                                    {"B", 1.0}}};

}  // namespace

double parseBytes(const std::string& text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const std::string unit(end, text.data() + text.size());
  double factor = unit.empty() ? 1 : 0;
  for (const auto& [name, bytes] : byte_units) {
    if (unit == name) factor = bytes;
  }
  if (error != std::errc() || factor == 0 || !(value > 0) || !std::isfinite(value)) {
    throw UsageError("'" + text + "' is not accepted; give a size such as 4GiB or 500MB, or auto");
  }
  return value * factor;
}

std::string bytesText(double bytes) {
  const char* unit = "B";
  for (const char* larger : {"KiB", "MiB", "GiB", "TiB"}) {
    if (bytes < 1024) break;
    bytes /= 1024;
    unit = larger;
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), bytes < 10 && unit[0] != 'B' ? "%.1f %s" : "%.0f %s",
                bytes, unit);
  return text.data();
}

std::string durationText(double seconds) {
  double value = std::max(seconds, 0.1);
  const char* unit = "s";
  if (seconds >= 3600) {
    value = seconds / 3600;
    unit = "h";
  } else if (seconds >= 120) {
    value = seconds / 60;
    unit = "min";
  }
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), value < 9.95 ? "%.1f %s" : "%.0f %s", value, unit);
  return text.data();
}

}  // namespace vdbdither
