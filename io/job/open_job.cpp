#include "io/job/open_job.h"

#include <algorithm>
#include <system_error>

#include "vdbdither/engine/operator.h"
#include "vdbdither/engine/registry.h"
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

std::vector<Step> OpenJob::stepsThatOverwrite() const {
  const std::string option = "--overwrite";
  std::vector<Step> steps = parseChain(job_.chain);
  const auto add = [&](Step& step) {
    std::vector<std::string>& arguments = step.arguments;
    if (std::find(arguments.begin(), arguments.end(), option) == arguments.end())
      arguments.push_back(option);
  };
  const auto isSink = [](const Step& step) {
    return dynamic_cast<const Sink*>(findOperator(step.verb).make().get()) != nullptr;
  };
  for (Step& step : steps) {
    if (isSink(step)) add(step);
  }
  // The run itself writes what the last operator makes.
  if (!isSink(steps.back())) add(steps.back());
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
