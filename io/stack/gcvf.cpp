// GCVF, the archive that GrabCAD Print takes for voxel printing on PolyJet printers. Undocumented
// by Stratasys; after public writers of it and the sample that they quote.

#include <bit>
#include <charconv>
#include <cmath>
#include <map>
#include <span>
#include <sstream>
#include <utility>

#include "io/file/little_endian.h"
#include "io/file/xml_reader.h"
#include "io/image/png_decoder.h"
#include "io/image/png_spans.h"
#include "io/stack/container.h"
#include "io/stack/slice_format.h"
#include "io/stack/xml_text.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/printable.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

constexpr const char* configuration_name = "ConfigFile.xml";
constexpr const char* bounds_name = "MeshBbx.ktn";
constexpr const char* mesh_name = "Mesh.stl";
constexpr double inch_mm = 25.4;
constexpr int most_dpi = 65535;
constexpr double nanometre_mm = 1e-6;
const SliceNames gcvf_names{"layer_", 1, 0};

/// The dots per inch that are nearest to a pitch: printers state these, and pitches in mm are
/// rounded.
int dpiOf(double pitch_mm) { return static_cast<int>(std::lround(inch_mm / pitch_mm)); }

std::string channels(const std::array<std::uint8_t, 4>& colour) {
  std::string text;
  for (const std::uint8_t channel : colour)
    text += (text.empty() ? "" : " ") + std::to_string(channel);
  return text;
}

void putFloat(std::vector<std::uint8_t>& bytes, double value) {
  putLittleEndian(bytes, std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
}

/// A binary STL of the box of all slices: x to the right, y from the top row down, mm.
std::vector<std::uint8_t> boxMesh(const openvdb::Vec3d& size_mm) {
  std::vector<std::uint8_t> bytes(80, ' ');
  constexpr int triangles = 12;
  putLittleEndian(bytes, triangles, 4);
  const auto corner = [&](int bits) {
    putFloat(bytes, (bits & 1) != 0 ? size_mm.x() : 0);
    putFloat(bytes, (bits & 2) != 0 ? 0 : -size_mm.y());
    putFloat(bytes, (bits & 4) != 0 ? size_mm.z() : 0);
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int along = 1 << (axis + 1) % 3;
    const int across = 1 << (axis + 2) % 3;
    for (const int side : {0, 1 << axis}) {
      // Anticlockwise from outside.
      const int first = side == 0 ? across : along;
      const int second = side == 0 ? along : across;
      for (const bool is_lower : {true, false}) {
        for (int i = 0; i < 3; ++i) putFloat(bytes, i != axis ? 0 : side == 0 ? -1 : 1);
        corner(side);
        corner(side | (is_lower ? first : along | across));
        corner(side | (is_lower ? along | across : second));
        putLittleEndian(bytes, 0, 2);
      }
    }
  }
  return bytes;
}

class GcvfSlices : public SliceEncoder {
 public:
  void plan(const Manifest& stack, const Grids& grids) override {
    SliceEncoder::plan(stack, grids);
    checkPitch("gcvf", stack, printerOf(stack));
  }

  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    const std::vector<std::uint32_t> colours = palette();
    return {{layer.name + ".png", "",
             encodePng(layer.image, {PngPixels::rgba8, colours, pitchMm().x(), pitchMm().y()})}};
  }

  void finish(const Manifest& stack, const SpanImage& /*preview*/,
              StackOutput& output) const override {
    writeText(output, configuration_name, configuration(stack));
    const openvdb::Vec3d size(stack.layout.width(), stack.layout.height(), stack.layers.size());
    std::vector<std::uint8_t> bounds;
    for (const openvdb::Vec3d& corner : {openvdb::Vec3d(0), size}) {
      for (int axis = 0; axis < 3; ++axis) putFloat(bounds, corner[axis]);
    }
    output.write(bounds_name, bounds);
    output.write(mesh_name, boxMesh(size * pitchMm()));
  }

 private:
  [[nodiscard]] std::string configuration(const Manifest& stack) const {
    constexpr int most_colours = 6;
    const PrinterProfile printer = printerOf(stack);
    std::ostringstream xml;
    xml << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<GCVF>\n  <Version>2</Version>\n"
        << "  <Resolution>\n    <XDpi>" << dpiOf(pitchMm().x()) << "</XDpi>\n    <YDpi>"
        << dpiOf(pitchMm().y()) << "</YDpi>\n    <SliceThicknessNanoMeter>"
        << std::lround(pitchMm().z() / nanometre_mm)
        << "</SliceThicknessNanoMeter>\n  </Resolution>\n"
        << "  <SliceDimensions>\n    <SliceWidth>" << stack.layout.width()
        << "</SliceWidth>\n    <SliceHeight>" << stack.layout.height()
        << "</SliceHeight>\n  </SliceDimensions>\n"
        << "  <SliceRange>\n    <StartIndex>" << gcvf_names.first
        << "</StartIndex>\n    <NumberOfSlices>" << stack.layers.size()
        << "</NumberOfSlices>\n  </SliceRange>\n  <BitDepth>4</BitDepth>\n  <MaxNumberOfColors>"
        << (printer.maximum_colours > 0 ? printer.maximum_colours : most_colours)
        << "</MaxNumberOfColors>\n  <DataSemantics>Materials</DataSemantics>\n"
        << "  <CreationMode>MODEL_ONLY</CreationMode>\n  <ImageFilePrefix>" << gcvf_names.prefix
        << "</ImageFilePrefix>\n  <MaterialList>\n    <BackGroundMaterialRGBA>"
        << channels(stack.background) << "</BackGroundMaterialRGBA>\n";
    for (std::size_t i = 0; i < stack.materials.size(); ++i) {
      const Material& material = stack.materials[i];
      xml << "    <Material>\n      <Name>" << xmlText(resinOf(material, printer))
          << "</Name>\n      <RGBA>" << channels(material.rgba) << "</RGBA>\n      <VoxelCount>"
          << stack.voxels[i] << "</VoxelCount>\n    </Material>\n";
    }
    xml << "  </MaterialList>\n</GCVF>\n";
    return xml.str();
  }
};

/// Gathers the texts of the elements that say what the slices are.
class ConfigurationReader final : public XmlReader {
 public:
  explicit ConfigurationReader(const StackInput& files)
      : XmlReader(shownIn(files)), shown_(shownIn(files)) {
    read(files.read(configuration_name, most_configuration_bytes));
    finish();
  }

  static std::string shownIn(const StackInput& files) {
    return "'" + files.shown(configuration_name) + "'";
  }

  [[nodiscard]] ContainerContents contents() const {
    ContainerContents contents;
    contents.pitch_mm = {inch_mm / number("XDpi", 1, most_dpi),
                         inch_mm / number("YDpi", 1, most_dpi),
                         number("SliceThicknessNanoMeter", 1, 1e9) * nanometre_mm};
    constexpr double most = 1 << 24;
    contents.width = std::lround(number("SliceWidth", 1, most));
    contents.height = std::lround(number("SliceHeight", 1, most));
    contents.layers = std::lround(number("NumberOfSlices", 1, most));
    const int first = static_cast<int>(number("StartIndex", 0, most));
    contents.file_name = [first, prefix = text("ImageFilePrefix")](int layer, std::size_t) {
      return prefix + std::to_string(first + layer) + ".png";
    };
    contents.background = colour(text("BackGroundMaterialRGBA"));
    for (const MaterialTexts& material : materials_)
      contents.materials.push_back({material.name, colour(material.rgba)});
    return contents;
  }

  /// Tells what contradicts the slices.
  void check(std::span<const std::uint64_t> voxels, const std::string& file,
             Findings& findings) const {
    const auto most = texts_.find("MaxNumberOfColors");
    if (most != texts_.end() && wholeOf(most->second) < materials_.size()) {
      findings.error("too-many-colours",
                     "it lists " + std::to_string(materials_.size()) +
                         " materials, and MaxNumberOfColors is " + most->second +
                         "; make the stack of fewer",
                     file);
    }
    for (std::size_t i = 0; i < materials_.size(); ++i) {
      const MaterialTexts& material = materials_[i];
      if (material.voxels.empty() || wholeOf(material.voxels) == voxels[i]) continue;
      findings.error("voxel-count",
                     "its VoxelCount of '" + material.name + "' is " + material.voxels +
                         ", and the slices have " + std::to_string(voxels[i]) +
                         "; make the stack again",
                     file);
    }
  }

 private:
  struct MaterialTexts {
    std::string name, rgba, voxels;
  };

  /// The greatest number for what is none.
  static std::uint64_t wholeOf(const std::string& text) {
    std::uint64_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() ? number : ~std::uint64_t{0};
  }

  void begin(const XmlElement& element) override {
    text_.clear();
    if (element.name() == "Material") {
      constexpr std::size_t most = 255;
      if (materials_.size() == most) refuse("names more than 255 materials");
      materials_.emplace_back();
      in_material_ = true;
    }
    open_.emplace_back(element.name());
  }
  void text(std::string_view piece) override {
    constexpr std::size_t longest = 1 << 12;
    if (text_.size() + piece.size() > longest) refuse("has a text of more than 4096 bytes");
    text_ += piece;
  }
  void end() override {
    const std::string name = std::move(open_.back());
    open_.pop_back();
    const std::string value(trimmed(text_));
    text_.clear();
    if (name == "Material") {
      in_material_ = false;
    } else if (in_material_) {
      if (name == "Name") materials_.back().name = value;
      if (name == "RGBA") materials_.back().rgba = value;
      if (name == "VoxelCount") materials_.back().voxels = value;
    } else if (!value.empty()) {
      texts_.try_emplace(name, value);
    }
  }

  [[nodiscard]] std::string text(const std::string& name) const {
    const auto found = texts_.find(name);
    if (found == texts_.end()) throw DataError(shown_ + " has no " + name);
    return found->second;
  }
  [[nodiscard]] double number(const std::string& name, double least, double most) const {
    const std::string value = text(name);
    std::istringstream stream(value);
    double number = 0;
    if (!(stream >> number) || !stream.eof() || !(number >= least && number <= most)) {
      throw DataError(shown_ + ": " + name + " must be a number from " + shortestText(least) +
                      " to " + shortestText(most) + ", not '" + printable(value) + "'");
    }
    return number;
  }
  [[nodiscard]] std::array<std::uint8_t, 4> colour(const std::string& text) const {
    std::istringstream stream(text);
    std::array<std::uint8_t, 4> colour{};
    for (std::uint8_t& channel : colour) {
      int value = -1;
      if (!(stream >> value) || value < 0 || value > 255) {
        throw DataError(shown_ + ": a colour must be four whole numbers from 0 to 255, not '" +
                        printable(text) + "'");
      }
      channel = static_cast<std::uint8_t>(value);
    }
    return colour;
  }

  std::string shown_;
  std::vector<std::string> open_;
  std::string text_;
  bool in_material_ = false;
  std::map<std::string, std::string> texts_;
  std::vector<MaterialTexts> materials_;
};

std::optional<DescribedStack> describeGcvf(const StackInput& files) {
  if (!files.contains(configuration_name)) return std::nullopt;
  ContainerContents contents = ConfigurationReader(files).contents();
  contents.format = "gcvf";
  contents.configuration = configuration_name;
  contents.shown = ConfigurationReader::shownIn(files);
  return describedBy(contents, files);
}

double floatAt(std::span<const std::uint8_t> bytes, std::size_t at) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(littleEndian(bytes.subspan(at), 4)));
}

/// Returns a file that every GCVF has, or tells that it is missing.
std::vector<std::uint8_t> companion(const StackInput& files, const char* name, Findings& findings) {
  if (files.contains(name)) return files.read(name, most_configuration_bytes);
  findings.error("missing-file", "the file is missing; make the stack again", files.shown(name));
  return {};
}

/// The corners of a binary STL, or an empty box.
openvdb::BBoxd boundsOf(std::span<const std::uint8_t> stl) {
  constexpr std::size_t header = 84;
  constexpr std::size_t triangle = 50;
  openvdb::BBoxd bounds;
  for (std::size_t at = header; at + triangle <= stl.size(); at += triangle) {
    for (std::size_t corner = 1; corner <= 3; ++corner) {
      openvdb::Vec3d point;
      for (std::size_t axis = 0; axis < 3; ++axis)
        point[static_cast<int>(axis)] = floatAt(stl, at + 12 * corner + 4 * axis);
      bounds.expand(point);
    }
  }
  return bounds;
}

void checkGcvf(const StackInput& files, const DescribedStack& stack,
               std::span<const std::uint64_t> voxels, Findings& findings) {
  ConfigurationReader(files).check(voxels, files.shown(configuration_name), findings);
  const SliceLayout& layout = stack.manifest.layout;
  const openvdb::Vec3d size(layout.width(), layout.height(), stack.manifest.layers.size());
  const auto bounds = companion(files, bounds_name, findings);
  std::vector<std::uint8_t> expected;
  for (const openvdb::Vec3d& corner : {openvdb::Vec3d(0), size}) {
    for (int axis = 0; axis < 3; ++axis) putFloat(expected, corner[axis]);
  }
  if (!bounds.empty() && bounds != expected) {
    findings.error("mesh-bounds",
                   "the box is not that of the slices, 0 0 0 to " + shortestText(size.x()) + " " +
                       shortestText(size.y()) + " " + shortestText(size.z()) +
                       " voxels; make the stack again",
                   files.shown(bounds_name));
  }
  const auto mesh = companion(files, mesh_name, findings);
  if (mesh.empty()) return;
  const openvdb::Vec3d size_mm = size * stack.manifest.lattice.pitch_mm;
  const openvdb::BBoxd box = boundsOf(mesh);
  const openvdb::Vec3d least(0, -size_mm.y(), 0);
  const openvdb::Vec3d most(size_mm.x(), 0, size_mm.z());
  for (int axis = 0; axis < 3; ++axis) {
    // Half a voxel, and what single precision leaves of long ones.
    const double tolerance_mm =
        0.5 * stack.manifest.lattice.pitch_mm[axis] + 1e-6 * std::abs(size_mm[axis]);
    if (std::abs(box.min()[axis] - least[axis]) <= tolerance_mm &&
        std::abs(box.max()[axis] - most[axis]) <= tolerance_mm)
      continue;
    findings.error("mesh-bounds",
                   std::string("along ") + "xyz"[axis] + " the mesh does not go from " +
                       shortestText(std::round(least[axis] * 1e3) / 1e3) + " to " +
                       shortestText(std::round(most[axis] * 1e3) / 1e3) +
                       " mm as the slices do; make the stack again",
                   files.shown(mesh_name));
  }
}

}  // namespace

extern const SliceFormat gcvf;
const SliceFormat gcvf{.name = "gcvf",
                       .summary = "Archive for GrabCAD Print: slices as png, and their materials",
                       .ending = ".png",
                       .pixel = SlicePixel::colour,
                       .encoder = makeSliceEncoder<GcvfSlices>,
                       .decode = decodePng,
                       .decodes_colours = true,
                       .bytes_per_leaf = 125,
                       .container_ending = ".gcvf",
                       .describe = describeGcvf,
                       .check = checkGcvf,
                       .names = &gcvf_names};

}  // namespace vdbdither
