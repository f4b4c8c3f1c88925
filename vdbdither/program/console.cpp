#include "vdbdither/program/console.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <unistd.h>

#include "io/file/standard_streams.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

std::string clockText(double seconds) {
  const int whole = static_cast<int>(std::lround(seconds));
  std::array<char, 32> text{};
  if (whole < 3600) {
    std::snprintf(text.data(), text.size(), "%d:%02d", whole / 60, whole % 60);
  } else {
    std::snprintf(text.data(), text.size(), "%d:%02d:%02d", whole / 3600, whole / 60 % 60,
                  whole % 60);
  }
  return text.data();
}

}  // namespace

void Console::begin(bool quiet, double box_voxels, double expected_seconds) {
  terminal_ = !quiet && ::isatty(STDERR_FILENO);
  box_voxels_ = box_voxels;
  expected_seconds_ = expected_seconds;
  start_ = last_ = Clock::now();
  // The first progress of a stage may take a while to come.
  if (terminal_ && expected_seconds >= 1) {
    std::fprintf(stderr, "\r\033[K%-16s   0 %%  about %s left", "",
                 clockText(expected_seconds).c_str());
    std::fflush(stderr);
    shown_ = true;
  }
}

void Console::warn(const std::string& verb, const std::string& text) {
  clear();
  std::fprintf(stderr, "vdbdither %s: warning: %s\n", verb.c_str(), printable(text).c_str());
}

void Console::progress(const std::string& verb, int done, int total, double fraction) {
  const Clock::time_point now = Clock::now();
  if (!terminal_ || now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  const double share = done == 0 || total == 0 ? fraction : static_cast<double>(done) / total;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, "\r\033[K%-16s %3d %%", verb.c_str(), static_cast<int>(100 * share));
  if (done > 0 && share > 0) {
    std::fprintf(stderr, "  %.0f Mvoxel/s  %s left", share * box_voxels_ / seconds / 1e6,
                 clockText(seconds * (1 - share) / share).c_str());
  } else if (seconds < expected_seconds_) {
    std::fprintf(stderr, "  about %s left", clockText(expected_seconds_ - seconds).c_str());
  }
  std::fflush(stderr);
  shown_ = true;
}

void Console::print(const std::string& text) {
  clear();
  if (results_to_error_) {
    std::fputs(printableLines(text).c_str(), stderr);
  } else {
    printData(text.c_str());
  }
}

void Console::clear() {
  if (shown_) std::fputs("\r\033[K", stderr);
  shown_ = false;
}

}  // namespace vdbdither
