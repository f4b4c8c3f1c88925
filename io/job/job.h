#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/file/file_digest.h"
#include "vdbdither/model/lattice.h"

namespace vdbdither {

/// The file of a job's folder that describes the job.
inline constexpr const char* job_name = "job.json";
/// The folder of the pieces in a job's folder.
inline constexpr const char* pieces_name = "pieces";

/// A file that the chain of a job reads, as it was when the job was planned.
struct JobInput {
  std::string file;      ///< as the chain names it, or below the data folders of the program
  bool is_data = false;  ///< whether it is one of the program's own, such as a printer's profile
  FileDigest digest;
};

/// One of the runs that make a job together.
struct JobPiece {
  ZRange layers;                  ///< counted from the bottom of the job, as --layers does
  std::optional<double> seconds;  ///< about; nothing if unknown
  double memory_bytes = 0;        ///< about, at most
  double disk_bytes = 0;          ///< of its outputs, about; 0 if unknown
};

/// A chain cut into pieces, which runs on any number of machines make and one run joins.
struct Job {
  std::string version;             ///< of the program that planned it
  std::string folder;              ///< where the chain's names begin, from the job's folder
  std::vector<std::string> chain;  ///< its words
  Lattice lattice;                 ///< of the last stage
  int slab_layers = 0;
  int threads = 1;                   ///< of each run
  std::vector<std::string> outputs;  ///< as the chain names them
  std::vector<JobInput> inputs;
  std::vector<JobPiece> pieces;  ///< by number, from 0, in rising layers
};

/// The most time and memory that any piece takes. The time is unknown if that of some piece is.
JobPiece largestPiece(const Job& job);

/// The text of `job.json`.
std::string textOf(const Job& job);

/// Reads that text back. Throws DataError where it is malformed, or was planned by another version
/// of the program.
/// @param shown  what messages call it: its name in quotes
Job jobOf(std::string_view text, const std::string& shown);

/// Reads the job that a folder holds. Throws DataError as `jobOf` does, and where there is none.
Job readJob(const std::filesystem::path& folder);

/// A digest of what the bytes of a piece follow from, besides its layers: version, chain, lattice
/// and inputs. Hexadecimal.
std::string identityOf(const Job& job);

/// The folder of a piece in the folder of its job: `pieces/0017`.
std::filesystem::path pieceFolder(const std::filesystem::path& job_folder, std::size_t number);

/// The files that the program has read so far, with their digests; neither those of `outputs` nor
/// masks that are kept for the next run. Throws DataError.
std::vector<JobInput> inputsRead(const std::vector<std::string>& outputs);

/// Throws DataError unless each input is the file it was.
void checkInputs(const Job& job);

/// Throws DataError if the program has read a file that the job does not list as an input, for
/// example a file that did not exist when the job was planned.
void checkReads(const Job& job);

}  // namespace vdbdither
