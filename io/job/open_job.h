#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/job/job.h"
#include "io/job/piece_record.h"
#include "vdbdither/engine/chain.h"
#include "vdbdither/engine/job_plan.h"

namespace vdbdither {

/// A job that this process works on.
class OpenJob {
 public:
  /// Reads the job that `folder` holds, and makes the folder where the names of its chain begin the
  /// current one. Throws DataError.
  explicit OpenJob(const std::string& folder);

  [[nodiscard]] const Job& job() const { return job_; }
  /// Absolute.
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  [[nodiscard]] PieceOf pieceOf(std::size_t number) const {
    return {identity_, job_.pieces[number].layers};
  }

  /// The chain, with `options` of a run before those that it gives itself.
  [[nodiscard]] std::vector<Step> steps(const std::vector<std::string>& options) const;

  /// The chain, with every output replaced if it is there.
  [[nodiscard]] std::vector<Step> stepsThatOverwrite() const;

  /// Throws DataError unless `plan`, of all layers or some, is of the lattice that the job was cut
  /// on.
  void checkLattice(const JobPlan& plan) const;

 private:
  std::filesystem::path folder_;
  Job job_;
  std::string identity_;
};

}  // namespace vdbdither
