#include "io/job/open_job.h"

#include <system_error>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace fs = std::filesystem;

OpenJob::OpenJob(const std::string& folder)
    : folder_(fs::absolute(folder).lexically_normal()), job_(readJob(folder)) {
  identity_ = identityOf(job_);
  std::error_code error;
  const fs::path start = folder_ / job_.folder;
  fs::current_path(start, error);
  if (error) {
    throw DataError("cannot go to '" + start.string() +
                    "', where the files of the job are: " + error.message());
  }
}

std::vector<Step> OpenJob::steps(const std::vector<std::string>& options) const {
  std::vector<Step> steps = parseChain(job_.chain);
  std::vector<std::string>& first = steps.front().arguments;
  first.insert(first.begin(), options.begin(), options.end());
  return steps;
}

void OpenJob::checkLattice(const JobPlan& plan) const {
  const Lattice& lattice = plan.lattice();
  if (lattice.box == job_.lattice.box && lattice.pitch_mm == job_.lattice.pitch_mm &&
      lattice.origin_mm == job_.lattice.origin_mm)
    return;
  throw DataError(
      "the chain makes another lattice here than when the job was planned; plan it "
      "again");
}

}  // namespace vdbdither
