#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/job/job.h"

namespace vdbdither {

/// The files that run a job, by name, besides `job.json`; all run `vdbdither piece . N` for each
/// piece and `vdbdither merge .`, from the job's folder:
///
/// * `jobs.txt`: one piece a line, for GNU parallel, xargs, OpenCue and other lists of commands
/// * `job.sbatch`: a script that submits itself to Slurm, as an array with the merge behind it
/// * `job.openjd.json`: a template of Open Job Description, `jobtemplate-2023-09`
std::vector<std::pair<std::string, std::string>> jobScripts(const Job& job);

}  // namespace vdbdither
