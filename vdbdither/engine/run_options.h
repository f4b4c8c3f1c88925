#pragma once

#include <string>

#include "vdbdither/engine/options.h"

namespace vdbdither {

/// How a run shows how far it is.
enum class Progress {
  bar,     ///< a line that is overwritten, at a terminal only
  json,    ///< a line of JSON each second
  openjd,  ///< lines as Open Job Description reads them
};

/// The options that every operator takes. They apply to the whole job, whichever operator of a
/// chain they follow.
struct RunOptions {
  std::string input;   ///< .vdb for a chain that begins without a source; empty: standard input
  std::string output;  ///< .vdb for a chain that ends without a sink; empty: standard output
  bool overwrite = false;
  bool no_flush = false;
  int threads = 0;            ///< 0: all
  std::string slab = "auto";  ///< or all, or a multiple of 8
  std::string memory = "auto";
  std::string layers;  ///< A:B, counted from the bottom of the job; empty: all
  bool stream = false;
  bool explain = false;
  bool json = false;
  bool quiet = false;
  bool verbose = false;
  Progress progress = Progress::bar;
  bool help = false;
  bool version = false;

  void declare(Options& options);
  /// The ones of them that a tool takes which works for long.
  void declareForTool(Options& options);

 private:
  void declareWork(Options& options);
  void declareWords(Options& options);
};

/// Reads a size such as 512MiB, 4GiB, 2e9 (bytes). Throws UsageError.
double parseBytes(const std::string& text);

/// Returns `1.5 GiB`, `12 MiB`, `640 B`.
std::string bytesText(double bytes);

/// Returns `0.4 s`, `12 s`, `3 min`, `2.5 h`: two digits, for estimates.
std::string durationText(double seconds);

}  // namespace vdbdither
