#pragma once

#include <string_view>
#include <vector>

#include "vdbdither/engine/chain.h"

namespace vdbdither::test {

/// Operators for tests of the engine, found by `findNumbered` besides the registered ones. They
/// work on a grid `n` whose voxel (0, 0, z) tells something about layer z, and note their calls.
///
/// * `numbers --bottom A --top B`: a source; n is z + 100 in the layers A to B − 1.
/// * `sum --below A --above B`: a filter; n becomes its sum over A layers below to B above. With
///   `--fail-at Z` it fails on the slab of layer Z.
/// * `enlarge --by K`: a filter; adds K layers below and above the box, and a grid `seen`, a copy
///   of n.
/// * `join --bottom A --top B --pipe`: a filter; adds the n of an input of its own.
/// * `keep --file NAME`: a sink; notes the n of every layer. Costs 10 µs for each leaf and 1 s. It
///   fails with `--fail-to-finish` and `--fail-to-publish`.
const OperatorInfo& findNumbered(std::string_view name);

/// What the operators noted since the last `clearNotes`.
struct Notes {
  std::vector<std::string>
      calls;  ///< `sum 0:8`, `keep finish`, `publish NAME`, `input read 0:8`, …
  std::vector<std::pair<int, int>> kept;  ///< layer and n, as they came to `keep`
};
const Notes& notes();
void clearNotes();

/// A watcher that keeps warnings and drops the rest.
class QuietWatcher : public Watcher {
 public:
  void warn(const std::string& verb, const std::string& text) override {
    warnings.push_back(verb + ": " + text);
  }
  void progress(const std::string& verb, int done, int total, double) override {
    last_progress = verb + " " + std::to_string(done) + "/" + std::to_string(total);
  }
  void print(const std::string& text) override { printed += text; }

  std::vector<std::string> warnings;
  std::string last_progress;
  std::string printed;
};

}  // namespace vdbdither::test
