#include "io/job/job.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <nlohmann/json.hpp>

#include "io/file/data_files.h"
#include "io/file/digest.h"
#include "io/file/files_read.h"
#include "io/file/text_bytes.h"
#include "io/file/whole_file.h"
#include "io/vdb/mask_cache.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr int number_digits = 4;
constexpr int farthest = 1 << 29;

template <class Triple>
ordered_json jsonOf(const Triple& triple) {
  return ordered_json::array({triple[0], triple[1], triple[2]});
}

ordered_json jsonOf(const Lattice& lattice) {
  return {{"pitch_mm", jsonOf(lattice.pitch_mm)},
          {"origin_mm", jsonOf(lattice.origin_mm)},
          {"min", jsonOf(lattice.box.min())},
          {"max", jsonOf(lattice.box.max())}};
}

ordered_json jsonOf(const std::vector<JobInput>& inputs) {
  ordered_json json = ordered_json::array();
  for (const JobInput& input : inputs) {
    json.push_back({{input.is_data ? "data" : "file", input.file},
                    {"bytes", input.digest.bytes},
                    {"sha256", input.digest.sha256}});
  }
  return json;
}

/// Reads the members of a job.
class JobParser {
 public:
  JobParser(std::string_view text, std::string shown)
      : shown_(std::move(shown)), json_(parsedJson(text)) {
    if (json_.is_discarded()) refuse(jsonProblem(text));
    if (!json_.is_object()) refuse("it is not a JSON object");
  }

  [[nodiscard]] Job job() const {
    Job job;
    job.version = text(json_, "version");
    if (job.version != version) {
      throw DataError(shown_ + " was planned by vdbdither " + printable(job.version) +
                      ", and this is " + version +
                      "; pieces of one job need one version, so plan it again");
    }
    job.folder = text(json_, "folder");
    for (const ordered_json& word : list(json_, "chain")) job.chain.push_back(textOf(word));
    const ordered_json& lattice = member(json_, "lattice");
    for (int axis = 0; axis < 3; ++axis) {
      job.lattice.pitch_mm[axis] = triple(lattice, "pitch_mm", axis);
      job.lattice.origin_mm[axis] = triple(lattice, "origin_mm", axis);
      job.lattice.box.min()[axis] = static_cast<int>(triple(lattice, "min", axis));
      job.lattice.box.max()[axis] = static_cast<int>(triple(lattice, "max", axis));
    }
    job.slab_layers = integer(json_, "slab_layers", 1);
    job.threads = integer(json_, "threads", 1);
    for (const ordered_json& output : list(json_, "outputs")) job.outputs.push_back(textOf(output));
    for (const ordered_json& entry : list(json_, "inputs")) {
      const bool is_data = entry.is_object() && entry.contains("data");
      job.inputs.push_back(
          {text(entry, is_data ? "data" : "file"),
           is_data,
           {static_cast<std::uint64_t>(number(entry, "bytes")), text(entry, "sha256")}});
    }
    int next = 0;
    for (const ordered_json& entry : list(json_, "pieces")) {
      const ordered_json& layers = list(entry, "layers");
      JobPiece piece;
      if (layers.size() != 2) refuse("'layers' must be two whole numbers");
      piece.layers = {integerOf(layers[0], "layers", 0), integerOf(layers[1], "layers", 1)};
      if (piece.layers.begin != next || piece.layers.empty())
        refuse("the layers of its pieces do not follow each other");
      next = piece.layers.end;
      if (!member(entry, "seconds").is_null()) piece.seconds = number(entry, "seconds");
      piece.memory_bytes = number(entry, "memory_bytes");
      piece.disk_bytes = number(entry, "disk_bytes");
      job.pieces.push_back(piece);
    }
    if (next != job.lattice.layers().size()) refuse("its pieces are not all layers of the lattice");
    return job;
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw DataError(shown_ + " is not a job of plan: " + why + "; plan it again");
  }

  [[nodiscard]] const ordered_json& member(const ordered_json& json, const char* key) const {
    const auto found = json.is_object() ? json.find(key) : json.end();
    if (!json.is_object() || found == json.end()) refuse("'" + std::string(key) + "' is missing");
    return *found;
  }
  [[nodiscard]] std::string textOf(const ordered_json& json) const {
    if (!json.is_string()) refuse("a text is missing");
    return json.get<std::string>();
  }
  [[nodiscard]] std::string text(const ordered_json& json, const char* key) const {
    return textOf(member(json, key));
  }
  [[nodiscard]] const ordered_json& list(const ordered_json& json, const char* key) const {
    const ordered_json& value = member(json, key);
    if (!value.is_array()) refuse("'" + std::string(key) + "' is not a list");
    return value;
  }
  [[nodiscard]] int integerOf(const ordered_json& json, const char* key, int least) const {
    if (!json.is_number_integer() || json.get<double>() < least || json.get<double>() > farthest)
      refuse("'" + std::string(key) + "' must be a whole number from " + std::to_string(least));
    return json.get<int>();
  }
  [[nodiscard]] int integer(const ordered_json& json, const char* key, int least) const {
    return integerOf(member(json, key), key, least);
  }
  [[nodiscard]] double number(const ordered_json& json, const char* key) const {
    const ordered_json& value = member(json, key);
    constexpr double most = 1e18;
    if (!value.is_number() || !(value.get<double>() >= 0 && value.get<double>() <= most))
      refuse("'" + std::string(key) + "' must be a number from 0");
    return value.get<double>();
  }
  [[nodiscard]] double triple(const ordered_json& json, const char* key, int axis) const {
    const ordered_json& values = list(json, key);
    const auto index = static_cast<std::size_t>(axis);
    if (values.size() != 3 || !values[index].is_number() ||
        !(std::abs(values[index].get<double>()) <= farthest))
      refuse("'" + std::string(key) + "' must be three numbers");
    return values[index].get<double>();
  }

  std::string shown_;
  ordered_json json_;
};

/// The path of `file` below `folder`, or nothing if it lies elsewhere.
std::optional<fs::path> below(const fs::path& folder, const fs::path& file) {
  const fs::path path = fs::absolute(file).lexically_normal().lexically_relative(
      fs::absolute(folder).lexically_normal());
  if (path.empty() || *path.begin() == ".." || path == ".") return std::nullopt;
  return path;
}

std::optional<fs::path> belowData(const fs::path& file) {
  for (const fs::path& folder : dataFolders()) {
    auto path = below(folder, file);
    if (path && findDataFile(path->string())) return path;
  }
  return std::nullopt;
}

/// Without its digest.
JobInput inputNamed(const fs::path& file) {
  const std::optional<fs::path> data = belowData(file);
  const std::optional<fs::path> here = below(fs::current_path(), file);
  return {(data ? *data : here ? *here : file).string(), data.has_value(), {}};
}

// Behind links.
fs::path placeOf(const fs::path& path) { return fs::weakly_canonical(fs::absolute(path)); }

bool isAtOrBelow(const fs::path& place, const fs::path& file) {
  return place == file || below(place, file).has_value();
}

/// What was read, without masks that are kept for the next run.
std::vector<fs::path> inputFilesRead() {
  std::vector<fs::path> files = filesRead();
  if (const std::optional<fs::path> cache = maskCacheFolder()) {
    const fs::path masks = placeOf(*cache);
    std::erase_if(files, [&](const fs::path& file) { return isAtOrBelow(masks, placeOf(file)); });
  }
  return files;
}

}  // namespace

JobPiece largestPiece(const Job& job) {
  JobPiece largest;
  largest.seconds = 0;
  for (const JobPiece& piece : job.pieces) {
    largest.memory_bytes = std::max(largest.memory_bytes, piece.memory_bytes);
    if (largest.seconds && piece.seconds) {
      largest.seconds = std::max(*largest.seconds, *piece.seconds);
    } else {
      largest.seconds.reset();
    }
  }
  return largest;
}

std::string textOf(const Job& job) {
  ordered_json json;
  json["version"] = job.version;
  json["folder"] = job.folder;
  json["chain"] = job.chain;
  json["lattice"] = jsonOf(job.lattice);
  json["slab_layers"] = job.slab_layers;
  json["threads"] = job.threads;
  json["outputs"] = job.outputs;
  json["inputs"] = jsonOf(job.inputs);
  json["pieces"] = ordered_json::array();
  for (std::size_t number = 0; number < job.pieces.size(); ++number) {
    const JobPiece& piece = job.pieces[number];
    json["pieces"].push_back(
        {{"number", number},
         {"layers", {piece.layers.begin, piece.layers.end}},
         {"seconds", piece.seconds ? ordered_json(*piece.seconds) : ordered_json()},
         {"memory_bytes", piece.memory_bytes},
         {"disk_bytes", piece.disk_bytes}});
  }
  return jsonText(json, 1) + "\n";
}

Job jobOf(std::string_view text, const std::string& shown) { return JobParser(text, shown).job(); }

Job readJob(const fs::path& folder) {
  std::error_code none;
  if (!fs::exists(folder / job_name, none)) {
    throw DataError("'" + folder.string() + "' holds no " + job_name +
                    ", so it is not a job made by plan");
  }
  const ReadsUnnoted of_job;
  constexpr std::uint64_t most_bytes = std::uint64_t{64} << 20;
  const std::string shown = "'" + (folder / job_name).string() + "'";
  const std::vector<std::uint8_t> bytes = readWholeFile(folder / job_name, shown, most_bytes);
  return jobOf({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, shown);
}

std::string identityOf(const Job& job) {
  const ordered_json json{{"version", job.version},
                          {"chain", job.chain},
                          {"lattice", jsonOf(job.lattice)},
                          {"inputs", jsonOf(job.inputs)}};
  const std::string text = jsonText(json);
  return sha256Of(textBytes(text));
}

fs::path pieceFolder(const fs::path& job_folder, std::size_t number) {
  return job_folder / pieces_name / zeroPadded(static_cast<int>(number), number_digits);
}

std::vector<JobInput> inputsRead(const std::vector<std::string>& outputs) {
  std::vector<fs::path> output_places;
  std::transform(outputs.begin(), outputs.end(), std::back_inserter(output_places), placeOf);
  std::vector<JobInput> inputs;
  for (const fs::path& file : inputFilesRead()) {
    const fs::path place = placeOf(file);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
      if (!isAtOrBelow(output_places[i], place)) continue;
      throw UsageError("the chain reads '" + file.string() + "' and writes '" + outputs[i] +
                       "', so that pieces would read what the merge has written; give the output "
                       "another name");
    }
    JobInput& input = inputs.emplace_back(inputNamed(file));
    input.digest = digestOfFile(file);
  }
  return inputs;
}

void checkReads(const Job& job) {
  for (const fs::path& file : inputFilesRead()) {
    const JobInput read = inputNamed(file);
    const bool is_known =
        std::any_of(job.inputs.begin(), job.inputs.end(), [&](const JobInput& input) {
          return input.file == read.file && input.is_data == read.is_data;
        });
    if (!is_known)
      throw DataError("'" + read.file +
                      "' was not read when the job was planned; take it away, or plan the job "
                      "again");
  }
}

void checkInputs(const Job& job) {
  for (const JobInput& input : job.inputs) {
    const std::optional<fs::path> file =
        input.is_data ? findDataFile(input.file) : std::optional<fs::path>(input.file);
    if (!file) {
      throw DataError("the data file '" + input.file +
                      "' of the job is not installed here; install the same version everywhere");
    }
    std::error_code none;
    if (!fs::exists(*file, none)) {
      throw DataError("there is no '" + fs::absolute(*file).lexically_normal().string() +
                      "', which the job reads; a job that is moved takes its inputs along, at the "
                      "same places beside it");
    }
    if (digestOfFile(*file) != input.digest) {
      throw DataError("'" + file->string() +
                      "' is not the file that the job was planned with; put that one back, or plan "
                      "the job again");
    }
  }
}

}  // namespace vdbdither
