#include "io/job/piece_record.h"

#include <map>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>
#include <tbb/parallel_for.h>

#include "io/file/file_digest.h"
#include "io/file/file_name.h"
#include "io/file/files_read.h"
#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "io/file/whole_file.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/interrupt.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr const char* record_name = "piece.json";

using FileDigests = std::map<std::string, FileDigest>;

/// The names of the files below `folder`, besides the record.
FileDigests filesBelow(const fs::path& folder) {
  FileDigests files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (!entry.is_directory() && name != record_name) files[name] = {};
  }
  return files;
}

void digestAll(const fs::path& folder, FileDigests& files) {
  std::vector<FileDigests::value_type*> all;
  for (auto& file : files) all.push_back(&file);
  tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) {
    throwIfInterrupted();
    all[i]->second = digestOfFile(folder / all[i]->first);
  });
}

struct Record {
  PieceOf piece;
  FileDigests files;
};

/// The record of a folder, or nothing if it is not one.
/// \param problem  takes why it is not JSON
std::optional<Record> readRecord(const fs::path& folder, std::string& problem) {
  constexpr std::uint64_t most_bytes = std::uint64_t{256} << 20;
  const fs::path path = folder / record_name;
  const ReadsUnnoted of_piece;
  const std::vector<std::uint8_t> bytes =
      readWholeFile(path, "'" + path.string() + "'", most_bytes);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const ordered_json json = parsedJson(text);
  if (json.is_discarded()) problem = jsonProblem(text);
  try {
    Record record{{json.at("job").get<std::string>(),
                   {json.at("layers").at(0).get<int>(), json.at("layers").at(1).get<int>()}},
                  {}};
    for (const ordered_json& file : json.at("files")) {
      record.files[file.at("file").get<std::string>()] = {file.at("bytes").get<std::uint64_t>(),
                                                          file.at("sha256").get<std::string>()};
    }
    return record;
  } catch (const ordered_json::exception&) {
    return std::nullopt;
  }
}

/// Whether file servers and desktops leave files of this name in any folder.
bool isOfFileBrowser(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.starts_with('.') || name == "Thumbs.db" || name == "desktop.ini";
}

}  // namespace

void writePieceRecord(const fs::path& folder, const PieceOf& piece) {
  FileDigests files = filesBelow(folder);
  digestAll(folder, files);
  ordered_json json{{"job", piece.job}, {"layers", {piece.layers.begin, piece.layers.end}}};
  json["files"] = ordered_json::array();
  for (const auto& [name, digest] : files)
    json["files"].push_back({{"file", name}, {"bytes", digest.bytes}, {"sha256", digest.sha256}});
  const std::string text = jsonText(json, 1) + "\n";
  writeFile(folder / record_name, textBytes(text), folder / record_name);
}

std::optional<std::string> pieceProblem(const fs::path& folder, const PieceOf& piece) {
  std::error_code none;
  if (!fs::is_directory(folder, none)) return "is missing";
  if (!fs::is_regular_file(folder / record_name, none))
    return "holds no " + std::string(record_name);
  std::string problem;
  const std::optional<Record> record = readRecord(folder, problem);
  if (!record) {
    return "has a " + std::string(record_name) + " that says nothing" +
           (problem.empty() ? "" : " (" + problem + ")");
  }
  if (record->piece != piece) return "was made for another plan of the job";
  FileDigests files = filesBelow(folder);
  for (const auto& [name, digest] : record->files) {
    if (!files.contains(name)) return "lacks its file '" + printable(name) + "'";
  }
  std::erase_if(files, [&](const auto& file) {
    return !record->files.contains(file.first) && isOfFileBrowser(file.first);
  });
  for (const auto& [name, digest] : files) {
    if (!record->files.contains(name)) return "holds a foreign file '" + printable(name) + "'";
  }
  digestAll(folder, files);
  for (const auto& [name, digest] : files) {
    if (digest != record->files.at(name))
      return "has another '" + printable(name) + "' than it had";
  }
  return std::nullopt;
}

}  // namespace vdbdither
