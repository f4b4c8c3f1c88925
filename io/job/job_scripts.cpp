// After the manual of sbatch (Slurm 22.05) and "Open Job Description Specification", template
// schemas 2023-09, with RFC 0001 (task chunking).

#include "io/job/job_scripts.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include <nlohmann/json.hpp>

#include "vdbdither/engine/json_text.h"

namespace vdbdither {

using nlohmann::ordered_json;

namespace {

constexpr double mebibyte = 1 << 20;

/// What a machine must give each piece: the estimates of the largest, with room.
struct Needs {
  int cpus;
  int memory_mib;
  int minutes;  ///< 0: unknown
};

Needs needsOf(const Job& job) {
  constexpr double memory_room = 1.25;
  constexpr double memory_floor_mib = 256;
  constexpr double time_room = 4;  // machines differ
  constexpr int least_minutes = 10;
  const JobPiece largest = largestPiece(job);
  const int minutes = static_cast<int>(std::ceil(time_room * largest.seconds.value_or(0) / 60));
  return {
      job.threads,
      static_cast<int>(std::ceil(memory_floor_mib + memory_room * largest.memory_bytes / mebibyte)),
      largest.seconds ? std::max(least_minutes, minutes) : 0};
}

std::string lines(const Job& job) {
  std::string text;
  for (std::size_t number = 0; number < job.pieces.size(); ++number)
    text += "vdbdither piece . " + std::to_string(number) + "\n";
  return text;
}

std::string sbatch(const Job& job) {
  const Needs needs = needsOf(job);
  const std::size_t last = job.pieces.size() - 1;
  std::ostringstream text;
  text
      << "#!/bin/sh\n"
      << "# " << job.pieces.size()
      << " pieces as an array of Slurm, and the merge once all of them are there. In this folder:\n"
      << "#\n"
      << "#     sh job.sbatch\n"
      << "#\n"
      << "# Options of sbatch can follow, such as --partition=NAME.\n"
      << "#SBATCH --job-name=vdbdither\n"
      << "#SBATCH --nodes=1\n"
      << "#SBATCH --ntasks=1\n"
      << "#SBATCH --cpus-per-task=" << needs.cpus << "\n"
      << "#SBATCH --mem=" << needs.memory_mib << "M\n";
  if (needs.minutes > 0) text << "#SBATCH --time=" << needs.minutes << "\n";
  text << "#SBATCH --requeue\n"
       << "#SBATCH --open-mode=append\n"
       << "#SBATCH --output=job-%A-%a.log\n"
       << "set -eu\n"
       << "case \"${VDBDITHER_STEP:-submit}\" in\n"
       << "piece)\n"
       << "  exec vdbdither piece . \"$SLURM_ARRAY_TASK_ID\" --threads \"$SLURM_CPUS_PER_TASK\"\n"
       << "  ;;\n"
       << "merge)\n"
       << "  # A merge that is queued again may have published some of its outputs.\n"
       << "  exec vdbdither merge . ${SLURM_RESTART_COUNT:+--overwrite} --threads "
          "\"$SLURM_CPUS_PER_TASK\"\n"
       << "  ;;\n"
       << "submit)\n"
       << "  array=$(VDBDITHER_STEP=piece sbatch --parsable --array=0-" << last
       << " --export=ALL \"$@\" job.sbatch)\n"
       << "  VDBDITHER_STEP=merge sbatch --dependency=\"afterok:${array%%;*}\" "
          "--kill-on-invalid-dep=yes \\\n"
       << "    --output=job-%j-merge.log --export=ALL \"$@\" job.sbatch\n"
       << "  ;;\n"
       << "esac\n";
  return text.str();
}

std::string openJobDescription(const Job& job) {
  constexpr int chunk_seconds = 600;
  const Needs needs = needsOf(job);
  const std::size_t last = job.pieces.size() - 1;
  const auto step = [&](const char* name, ordered_json parameters, ordered_json words) {
    ordered_json json{{"name", name}};
    if (!parameters.is_null()) json["parameterSpace"] = std::move(parameters);
    json["hostRequirements"] = {{"amounts",
                                 {{{"name", "amount.worker.vcpu"}, {"min", needs.cpus}},
                                  {{"name", "amount.worker.memory"}, {"min", needs.memory_mib}}}}};
    json["script"] = {
        {"actions", {{"onRun", {{"command", "vdbdither"}, {"args", std::move(words)}}}}}};
    return json;
  };
  const ordered_json pieces{
      {"taskParameterDefinitions", ordered_json::array({{{"name", "Piece"},
                                                         {"type", "CHUNK[INT]"},
                                                         {"range", "0-" + std::to_string(last)},
                                                         {"chunks",
                                                          {{"defaultTaskCount", 1},
                                                           {"targetRuntimeSeconds", chunk_seconds},
                                                           {"rangeConstraint", "CONTIGUOUS"}}}}})}};
  ordered_json merge =
      step("Merge", nullptr,
           ordered_json::array({"merge", "{{Param.JobFolder}}", "--progress", "openjd"}));
  merge["dependencies"] = ordered_json::array({{{"dependsOn", "Pieces"}}});
  const ordered_json json{
      {"specificationVersion", "jobtemplate-2023-09"},
      {"extensions", {"TASK_CHUNKING"}},
      {"name", "vdbdither"},
      {"parameterDefinitions", ordered_json::array({{{"name", "JobFolder"},
                                                     {"type", "PATH"},
                                                     {"objectType", "DIRECTORY"},
                                                     {"dataFlow", "INOUT"},
                                                     {"default", "."}}})},
      {"steps",
       {step("Pieces", pieces,
             ordered_json::array(
                 {"piece", "{{Param.JobFolder}}", "{{Task.Param.Piece}}", "--progress", "openjd"})),
        merge}}};
  return jsonText(json, 1) + "\n";
}

}  // namespace

std::vector<std::pair<std::string, std::string>> jobScripts(const Job& job) {
  return {{"jobs.txt", lines(job)},
          {"job.sbatch", sbatch(job)},
          {"job.openjd.json", openJobDescription(job)}};
}

}  // namespace vdbdither
