// The files of projects as PrusaSlicer 2 (src/libslic3r/Format/3mf.cpp) and Bambu Studio
// (src/libslic3r/Format/bbs_3mf.cpp) write them.

#include "io/mesh/threemf_volumes.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <string_view>

#include "io/file/xml_reader.h"
#include "vdbdither/model/printable.h"

namespace vdbdither {

namespace {

using Kind = ThreemfVolume::Kind;

constexpr std::array files_of_projects{"Metadata/Slic3r_PE_model.config",
                                       "Metadata/model_settings.config"};
constexpr std::uint64_t most_bytes = std::uint64_t{64} << 20;
constexpr std::size_t most_volumes = std::size_t{1} << 18;

Kind kindOf(std::string_view word) {
  constexpr std::array<std::string_view, 2> negatives{"NegativeVolume", "negative_part"};
  constexpr std::array<std::string_view, 6> helpers{"ParameterModifier", "SupportBlocker",
                                                    "SupportEnforcer",   "modifier_part",
                                                    "support_blocker",   "support_enforcer"};
  if (std::find(negatives.begin(), negatives.end(), word) != negatives.end()) return Kind::negative;
  return std::find(helpers.begin(), helpers.end(), word) != helpers.end() ? Kind::helper
                                                                          : Kind::part;
}

std::optional<std::uint32_t> numberIn(const XmlElement& element, std::string_view name) {
  const std::string_view text = element.attribute(name).value_or("");
  std::uint32_t value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || stop != text.data() + text.size()) return {};
  return value;
}

class VolumesReader : public XmlReader {
 public:
  using XmlReader::XmlReader;

  std::vector<ThreemfVolume> take() { return std::move(volumes_); }

 protected:
  void begin(const XmlElement& element) override {
    elements_.emplace_back(element.name());
    if (element.name() == "object") object_ = numberIn(element, "id");
    if (element.name() == "volume" || element.name() == "part") add(element);
    if (element.name() == "metadata" && isInVolume()) readMetadata(element);
  }
  void end() override { elements_.pop_back(); }

 private:
  void add(const XmlElement& element) {
    if (volumes_.size() >= most_volumes) refuse("describes too many volumes");
    ThreemfVolume& volume = volumes_.emplace_back();
    volume.object = object_.value_or(0);
    volume.kind = kindOf(element.attribute("subtype").value_or(""));
    if (element.name() == "part") {
      volume.component = numberIn(element, "id");
    } else {
      volume.first_triangle = numberIn(element, "firstid").value_or(0);
      volume.last_triangle = numberIn(element, "lastid");
    }
  }

  [[nodiscard]] bool isInVolume() const {
    if (elements_.size() < 2) return false;
    const std::string& parent = elements_[elements_.size() - 2];
    return parent == "volume" || parent == "part";
  }

  void readMetadata(const XmlElement& element) {
    const std::string_view key = element.attribute("key").value_or("");
    const std::string_view value = element.attribute("value").value_or("");
    ThreemfVolume& volume = volumes_.back();
    if (key == "name") volume.name = printable(value);
    if (key == "volume_type") volume.kind = kindOf(value);
    // Before volumes had types.
    if (key == "modifier" && value == "1" && volume.kind == Kind::part) volume.kind = Kind::helper;
  }

  std::vector<std::string> elements_;
  std::optional<std::uint32_t> object_;
  std::vector<ThreemfVolume> volumes_;
};

/// Takes the triangles of the volume out of the object.
void eraseTriangles(ThreemfObject& object, const std::vector<bool>& drop) {
  std::size_t kept = 0;
  const std::size_t with_properties = object.properties.size();
  std::size_t kept_properties = 0;
  for (std::size_t t = 0; t < object.triangles.size(); ++t) {
    if (drop[t]) continue;
    object.triangles[kept++] = object.triangles[t];
    if (t < with_properties) object.properties[kept_properties++] = object.properties[t];
  }
  object.triangles.resize(kept);
  object.properties.resize(kept_properties);
}

}  // namespace

std::vector<ThreemfVolume> readThreemfVolumes(ThreemfPackage& package) {
  std::vector<ThreemfVolume> all;
  for (const char* path : files_of_projects) {
    if (!package.contains(path)) continue;
    const std::string member = package.find("settings", path);
    VolumesReader reader(package.shown(member));
    reader.read(package.read(member, most_bytes));
    reader.finish();
    const std::vector<ThreemfVolume> volumes = reader.take();
    all.insert(all.end(), volumes.begin(), volumes.end());
  }
  return all;
}

void leaveOutHelpers(const std::vector<ThreemfVolume>& volumes, ThreemfPart& root,
                     const MeshFile& file) {
  std::size_t left_out = 0;
  std::map<std::size_t, std::vector<bool>> drop;  // of the triangles of an object
  for (const ThreemfVolume& volume : volumes) {
    const auto found = root.object_of_id.find(volume.object);
    if (volume.kind == Kind::part || found == root.object_of_id.end()) continue;
    if (volume.kind == Kind::negative) {
      file.refuse("has a negative volume" +
                  (volume.name.empty() ? std::string() : ", " + inQuotes(volume.name)) +
                  ", which is to be cut out of the part; do that in the slicer (a Boolean of "
                  "meshes), or export the part as STL");
    }
    ThreemfObject& object = root.objects[found->second];
    ++left_out;
    if (volume.component) {
      std::erase_if(object.components,
                    [&](const ThreemfUse& use) { return use.object == *volume.component; });
    } else if (volume.last_triangle) {
      std::vector<bool>& dropped = drop[found->second];
      dropped.resize(object.triangles.size());
      for (std::size_t t = volume.first_triangle;
           t < dropped.size() && t <= std::size_t{*volume.last_triangle}; ++t)
        dropped[t] = true;
    }
  }
  for (const auto& [object, dropped] : drop) eraseTriangles(root.objects[object], dropped);
  if (left_out > 0) {
    file.warn("leaves out " + std::to_string(left_out) +
              (left_out == 1 ? " volume that is" : " volumes that are") +
              " not printed: modifiers, support blockers and enforcers of the slicer's project");
  }
}

}  // namespace vdbdither
