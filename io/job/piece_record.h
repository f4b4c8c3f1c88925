#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// What a folder of files is a piece of.
struct PieceOf {
  std::string job;  ///< see identityOf
  ZRange layers;    ///< counted from the bottom of the job

  friend bool operator==(const PieceOf&, const PieceOf&) = default;
};

/// Writes `piece.json` into the folder of a piece that is otherwise complete: what it is, and the
/// size and digest of every file. Throws DataError.
void writePieceRecord(const std::filesystem::path& folder, const PieceOf& piece);

/// Returns why `folder` does not hold `piece`, whole and unchanged, in words that go on from its
/// name; nothing if it does. Reads every file, on all threads.
std::optional<std::string> pieceProblem(const std::filesystem::path& folder, const PieceOf& piece);

}  // namespace vdbdither
