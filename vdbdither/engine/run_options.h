#pragma once

#include <string>

#include "vdbdither/engine/options.h"

namespace vdbdither {

/// The options that every operator takes. They concern the run as a whole, wherever in a chain they
/// stand.
struct RunOptions {
  std::string input;   ///< .vdb for a chain that begins without a source; empty: standard input
  std::string output;  ///< .vdb for a chain that ends without a sink; empty: standard output
  bool overwrite = false;
  int threads = 0;            ///< 0: all
  std::string slab = "auto";  ///< or all, or a multiple of 8
  std::string memory = "auto";
  std::string layers;  ///< A:B, counted from the bottom of the job; empty: all
  bool stream = false;
  bool explain = false;
  bool json = false;
  bool quiet = false;
  bool verbose = false;
  bool help = false;
  bool version = false;

  void declare(Options& options);
};

/// A size such as 512MiB, 4GiB, 2e9 (bytes). Throws UsageError.
double parseBytes(const std::string& text);

/// 1.5 GiB, 12 MiB, 640 B.
std::string bytesText(double bytes);

/// `0.4 s`, `12 s`, `3 min`, `2.5 h`: two digits, for estimates.
std::string durationText(double seconds);

}  // namespace vdbdither
