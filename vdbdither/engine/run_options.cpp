#include "vdbdither/engine/run_options.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <utility>

#include "vdbdither/model/errors.h"

namespace vdbdither {

void RunOptions::declare(Options& options) {
  options.text("input", input, "FILE.vdb",
               "Read this file instead of standard input, where the chain has no source");
  options.letter('i');
  options.text("output", output, "FILE.vdb",
               "Write this file instead of standard output, where the chain has no sink");
  options.letter('o');
  options.flag("overwrite", overwrite, "Replace an output that is already there");
  options.integer("threads", threads, 0, 4096, "Threads to work with; 0 takes all");
  options.text("slab", slab, "N|auto|all", "Layers worked on at a time, a multiple of 8");
  options.text("memory", memory, "SIZE|auto",
               "What the run may use, such as 4GiB; auto is most of what is free");
  options.text("layers", layers, "A:B",
               "Only the layers A to B-1, counted from the bottom of the job");
  options.flag("stream", stream, "Refuse operators that need the whole volume at once");
  options.flag("explain", explain, "Say what would be done, and at what cost, and stop");
  options.flag("json", json, "Report time, voxels, bytes and peak memory of every stage as JSON");
  options.flag("quiet", quiet, "No words but warnings and errors");
  options.letter('q');
  options.flag("verbose", verbose, "One line for every stage");
  options.letter('v');
  options.flag("version", version, "Say which version this is");
  options.flag("help", help, "This text");
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
  if (error != std::errc() || factor == 0 || !(value > 0)) {
    throw UsageError("--memory: '" + text + "' is not a size such as 4GiB or 500MB");
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
