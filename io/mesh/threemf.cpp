// 3MF, the 3D Manufacturing Format: "Core Specification" 1.3.0, "Materials and Properties
// Extension" 1.2.1, "Production Extension" 1.1.2, 3MF Consortium. A zip archive of XML files and
// textures.

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "io/mesh/mesh_format.h"
#include "io/mesh/threemf_appearance.h"
#include "io/mesh/threemf_build.h"
#include "io/mesh/threemf_model.h"
#include "io/mesh/threemf_model_reader.h"
#include "io/mesh/threemf_package.h"
#include "io/mesh/threemf_volumes.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

constexpr std::string_view zip_magic = "PK\x03\x04";

MeshMatch matchThreemf(const MeshFile& file) {
  if (file.head().starts_with(zip_magic)) return MeshMatch::signature;
  return file.isNamed(".3mf") ? MeshMatch::name : MeshMatch::none;
}

/// The model parts of a file, read when something first leads to them.
class ThreemfReader {
 public:
  explicit ThreemfReader(const MeshFile& file) : file_(file), package_(file) {}

  Mesh read() {
    readPart(package_.root());
    // Objects of parts that are read lead to more parts.
    for (std::size_t part = 0; part < parts_.size(); ++part) readPartsOf(part);
    leaveOutHelpers(readThreemfVolumes(package_), parts_.front(), file_);
    ThreemfBuild build(file_, parts_, [&](std::size_t part, const std::string& path) {
      return path.empty() ? part : index_of_member_.at(package_.find("model", path));
    });
    ThreemfAppearance appearance(file_, package_, unread_);
    ThreemfBuild::Placed colour;
    if (file_.wantsColours()) {
      colour = [&](const ThreemfPart& part, const ThreemfObject& object, bool is_turned) {
        appearance.add(part, object, is_turned);
      };
    }
    Mesh mesh = build.make(colour);
    mesh.appearance = appearance.take();
    warnOfUnread();
    return mesh;
  }

 private:
  void readPart(const std::string& member) {
    if (!index_of_member_.try_emplace(member, parts_.size()).second) return;
    ThreemfModelReader reader(package_.shown(member),
                              file_.wantsColours() ? MeshColours::read : MeshColours::skip,
                              unread_);
    package_.readModel(member, [&](std::span<const std::uint8_t> piece) { reader.read(piece); });
    reader.finish();
    parts_.push_back(reader.take());
    parts_.back().name = member;
  }

  void readPartsOf(std::size_t part) {
    std::set<std::string> paths;
    for (const ThreemfUse& use : parts_[part].items) paths.insert(use.path);
    for (const ThreemfObject& object : parts_[part].objects) {
      for (const ThreemfUse& use : object.components) paths.insert(use.path);
    }
    for (const std::string& path : paths) {
      if (!path.empty()) readPart(package_.find("model", path));
    }
  }

  void warnOfUnread() const {
    std::string all;
    for (const std::string& kind : unread_) all += (all.empty() ? "" : ", ") + kind;
    if (!all.empty()) file_.warn("passes over " + all);
  }

  const MeshFile& file_;
  ThreemfPackage package_;
  std::vector<ThreemfPart> parts_;
  std::map<std::string, std::size_t> index_of_member_;
  std::set<std::string> unread_;
};

Mesh readThreemf(const MeshFile& file) {
  if (!file.head().starts_with(zip_magic))
    file.refuse("no zip archive, as a 3MF file is; export it again");
  try {
    return ThreemfReader(file).read();
  } catch (const DataError& error) {
    // Names of the archive can be anything.
    throw DataError(printable(error.what()));
  }
}

}  // namespace

extern const MeshFormat threemf;
const MeshFormat threemf{.name = "3MF",
                         .ending = ".3mf",
                         .match = matchThreemf,
                         .read = readThreemf,
                         .states_unit = true};

}  // namespace vdbdither
