// 3MF with a volume: images of the materials, by the 3MF Core Specification 1.3 and the 3MF
// Volumetric & Implicit Extensions 1.0. Every material is an `image3d` of its own, whose values are
// the shares of a `composite`. The shape is a mesh of the user, which every consumer can print, or
// on request a `levelset` of the voxels, which few understand.

#include <cmath>
#include <sstream>

#include "io/file/file_name.h"
#include "io/file/xml_reader.h"
#include "io/image/png_decoder.h"
#include "io/image/png_spans.h"
#include "io/mesh/mesh_reader.h"
#include "io/stack/container.h"
#include "io/stack/xml_text.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

constexpr const char* model_name = "3D/3dmodel.model";
constexpr const char* core_space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
constexpr const char* volumetric_space = "http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01";
constexpr const char* image_folder = "3D/volumetric/";
constexpr const char* solid_image = "solid";
const SliceNames threemf_names{"sheet", 5, 0};

std::string imageOfMaterial(std::size_t index) { return "material" + std::to_string(index); }

/// The values of an image: an empty voxel has a trace of the first material, because nowhere in the
/// shape may the sum of all shares be zero.
constexpr std::uint32_t trace = 1;
constexpr std::uint32_t full = 255;

std::string hexColour(const std::array<std::uint8_t, 4>& colour) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string text = "#";
  for (const std::uint8_t channel : colour) {
    text += digits[channel >> 4];
    text += digits[channel & 15];
  }
  return text;
}

class VolumeEncoder : public SliceEncoder {
 public:
  void declare(Options& options) override {
    options.file(
        "3mf-mesh", mesh_, "MESH",
        "The surface of the part in 3mf, where mesh2sdf placed it: the mesh itself, or one "
        "of mesh-export");
    options.flag("3mf-level-set", is_level_set_,
                 "Takes the voxels as the shape in 3mf, in place of a mesh: a level set, which few "
                 "programs read");
  }

  void plan(const Manifest& stack, const Grids& grids) override {
    SliceEncoder::plan(stack, grids);
    if (mesh_.empty() != is_level_set_) {
      throw UsageError(
          "3mf: give either --3mf-mesh MESH, the surface of the part, or --3mf-level-set, which "
          "takes the voxels as the shape");
    }
    if (!is_level_set_) shape_ = readMesh(mesh_, {});
  }

  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    std::vector<SliceFile> files;
    const std::size_t count = stack().materials.size();
    std::vector<std::uint32_t> values(count + 1, 0);
    const auto add = [&](const std::string& image, const std::string& material) {
      files.push_back({image_folder + image + "/" + layer.name + ".png", material,
                       encodePng(layer.image, {PngPixels::grey8, values})});
    };
    for (std::size_t i = 1; i <= count; ++i) {
      values.assign(count + 1, 0);
      values[i] = full;
      if (i == 1) values[0] = trace;
      add(imageOfMaterial(i), stack().materials[i - 1].name);
    }
    if (count > 1) {
      values.assign(count + 1, full);
      values[0] = 0;
      add(solid_image, "");
    }
    return files;
  }

  void finish(const Manifest& stack, const SpanImage& preview, StackOutput& output) const override {
    writeText(output, model_name, model(stack));
    std::ostringstream relations;
    relations << xml_head << "<Relationships xmlns=\"" << relations_space << "\">\n";
    for (std::size_t i = 0; i < stack.slices.size(); ++i) {
      relations << " <Relationship Target=\"/" << stack.slices[i].file << "\" Id=\"image" << i
                << "\" Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dtexture\"/>\n";
    }
    relations << "</Relationships>\n";
    writeText(output, "3D/_rels/3dmodel.model.rels", relations.str());
    writeText(output, "_rels/.rels",
              std::string(xml_head) + "<Relationships xmlns=\"" + relations_space +
                  "\">\n <Relationship Target=\"/" + model_name +
                  "\" Id=\"model\" "
                  "Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/>\n"
                  " <Relationship Target=\"/Metadata/thumbnail.png\" Id=\"thumbnail\" "
                  "Type=\"http://schemas.openxmlformats.org/package/2006/relationships/metadata/"
                  "thumbnail\"/>\n</Relationships>\n");
    writeText(output, "[Content_Types].xml",
              std::string(xml_head) +
                  "<Types xmlns=\"http://schemas.openxmlformats.org/package/2006/content-types\">\n"
                  " <Default Extension=\"rels\" "
                  "ContentType=\"application/vnd.openxmlformats-package.relationships+xml\"/>\n"
                  " <Default Extension=\"model\" "
                  "ContentType=\"application/vnd.ms-package.3dmanufacturing-3dmodel+xml\"/>\n"
                  " <Default Extension=\"png\" ContentType=\"image/png\"/>\n</Types>\n");
    output.write("Metadata/thumbnail.png", encodePicture(thumbnailOf(preview, 400, 400)));
  }

 private:
  static constexpr const char* xml_head = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";
  static constexpr const char* relations_space =
      "http://schemas.openxmlformats.org/package/2006/relationships";

  [[nodiscard]] openvdb::Vec3d sizeMm(int layers) const {
    const SliceLayout& layout = stack().layout;
    return openvdb::Vec3d(layout.width(), layout.height(), layers) * pitchMm();
  }
  /// The corner of the slices with the least coordinates.
  [[nodiscard]] openvdb::Vec3d cornerMm(int first_layer) const {
    const SliceLayout& layout = stack().layout;
    openvdb::Coord voxel = layout.box.min();
    voxel.z() = first_layer;
    const openvdb::Vec3d padding(layout.padding, layout.padding, 0);
    return stack().lattice.position(voxel) - pitchMm() * (padding + openvdb::Vec3d(0.5));
  }

  /// The level set ends where its images end: beyond, their outermost voxels would go on.
  [[nodiscard]] Mesh boxOfSlices(ZRange layers) const {
    const openvdb::Vec3d corner = cornerMm(layers.begin);
    const openvdb::Vec3d size = sizeMm(layers.size());
    Mesh box;
    for (int bits = 0; bits < 8; ++bits) {
      box.vertices.push_back(corner +
                             size * openvdb::Vec3d(bits & 1, bits >> 1 & 1, bits >> 2 & 1));
    }
    box.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                     {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
    return box;
  }

  /// From mm to the coordinates of an image, 0 … 1, as the twelve numbers of a matrix: the first
  /// row of a sheet is at v = 1.
  [[nodiscard]] std::string transform(const Manifest& stack) const {
    const openvdb::Vec3d size = sizeMm(stack.layers.size());
    const openvdb::Vec3d corner = cornerMm(stack.layers.begin);
    const std::array<bool, 3> flips{stack.layout.flip_x, stack.layout.flip_y, false};
    std::string text;
    std::array<double, 12> matrix{};
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = (flips[axis] ? -1 : 1) / size[axis];
      matrix[4 * axis] = scale;
      matrix[9 + axis] = (flips[axis] ? 1 : 0) - corner[axis] * scale;
    }
    for (const double number : matrix) text += (text.empty() ? "" : " ") + shortestText(number);
    return text;
  }

  [[nodiscard]] std::string model(const Manifest& stack) const {
    const std::size_t count = stack.materials.size();
    const bool has_solid = count > 1;
    const std::size_t images = count + (has_solid ? 1 : 0);
    // Ids: 1 the materials, then an image and its function for each, then the rest.
    const auto imageId = [](std::size_t image) { return 2 + 2 * image; };
    const auto functionId = [](std::size_t image) { return 3 + 2 * image; };
    const std::size_t level_id = 2 + 2 * images;
    const std::size_t volume_id = level_id + 1;
    const std::size_t mesh_id = level_id + 2;
    const std::string to_image = transform(stack);
    std::ostringstream xml;
    xml << xml_head << "<model unit=\"millimeter\" xml:lang=\"en-US\" xmlns=\"" << core_space
        << "\" xmlns:v=\"" << volumetric_space << "\""
        << (is_level_set_ ? " requiredextensions=\"v\"" : "")
        << ">\n <metadata name=\"Application\">vdbdither " << version << "</metadata>\n"
        << " <resources>\n  <basematerials id=\"1\">\n";
    for (const Material& material : stack.materials) {
      xml << "   <base name=\"" << xmlText(material.name) << "\" displaycolor=\""
          << hexColour(material.rgba) << "\"/>\n";
    }
    xml << "  </basematerials>\n";
    for (std::size_t image = 0; image < images; ++image) {
      const std::string name = image < count ? imageOfMaterial(image + 1) : solid_image;
      xml << "  <v:image3d id=\"" << imageId(image) << "\" name=\"" << name
          << "\">\n   <v:imagestack rowcount=\"" << stack.layout.height() << "\" columncount=\""
          << stack.layout.width() << "\" sheetcount=\"" << stack.layers.size() << "\">\n";
      for (std::size_t i = image; i < stack.slices.size(); i += images)
        xml << "    <v:imagesheet path=\"/" << stack.slices[i].file << "\"/>\n";
      xml << "   </v:imagestack>\n  </v:image3d>\n  <v:functionfromimage3d id=\""
          << functionId(image) << "\" image3did=\"" << imageId(image)
          << "\" filter=\"nearest\" tilestyleu=\"clamp\" tilestylev=\"clamp\" "
             "tilestylew=\"clamp\"/>\n";
    }
    if (is_level_set_) {
      // Inside of the shape the value is negative.
      xml << "  <v:functionfromimage3d id=\"" << level_id << "\" image3did=\""
          << imageId(images - 1)
          << "\" valueoffset=\"0.5\" valuescale=\"-1\" filter=\"linear\" tilestyleu=\"clamp\" "
             "tilestylev=\"clamp\" tilestylew=\"clamp\"/>\n";
    }
    xml << "  <v:volumedata id=\"" << volume_id << "\">\n   <v:composite basematerialid=\"1\">\n";
    for (std::size_t image = 0; image < count; ++image) {
      xml << "    <v:materialmapping functionid=\"" << functionId(image) << "\" transform=\""
          << to_image << "\" channel=\"red\"/>\n";
    }
    xml << "   </v:composite>\n  </v:volumedata>\n  <object id=\"" << mesh_id
        << "\" type=\"model\">\n   <mesh"
        << (is_level_set_ ? "" : " v:volumeid=\"" + std::to_string(volume_id) + "\"") << ">\n";
    writeMesh(is_level_set_ ? boxOfSlices(stack.layers) : shape_, xml);
    xml << "   </mesh>\n  </object>\n";
    if (is_level_set_) {
      xml << "  <object id=\"" << mesh_id + 1 << "\" type=\"model\">\n   <v:levelset functionid=\""
          << level_id << "\" channel=\"red\" transform=\"" << to_image << "\" meshid=\"" << mesh_id
          << "\" meshbboxonly=\"true\" volumeid=\"" << volume_id << "\"/>\n  </object>\n";
    }
    xml << " </resources>\n <build>\n  <item objectid=\"" << mesh_id + (is_level_set_ ? 1 : 0)
        << "\"/>\n </build>\n</model>\n";
    return xml.str();
  }

  static void writeMesh(const Mesh& mesh, std::ostringstream& xml) {
    xml << "    <vertices>\n";
    for (const openvdb::Vec3d& vertex : mesh.vertices) {
      xml << "     <vertex x=\"" << shortestText(vertex.x()) << "\" y=\""
          << shortestText(vertex.y()) << "\" z=\"" << shortestText(vertex.z()) << "\"/>\n";
    }
    xml << "    </vertices>\n    <triangles>\n";
    for (const Mesh::Triangle& triangle : mesh.triangles) {
      xml << "     <triangle v1=\"" << triangle[0] << "\" v2=\"" << triangle[1] << "\" v3=\""
          << triangle[2] << "\"/>\n";
    }
    xml << "    </triangles>\n";
  }

  std::string mesh_;
  bool is_level_set_ = false;
  Mesh shape_;
};

/// Gathers what a model says of images and of the materials that they show.
class VolumeReader : public XmlReader {
 public:
  explicit VolumeReader(const std::string& shown) : XmlReader(shown), shown_(shown) {}

  [[nodiscard]] bool hasVolume() const { return !images_.empty(); }

  /// Returns the volume of the first composite.
  [[nodiscard]] ContainerContents contents() const {
    const auto refuse = [&](const std::string& what) -> void {
      throw DataError(shown_ + ": " + what +
                      "; slice-import reads volumes as slice-export writes "
                      "them, an image for each material");
    };
    if (mappings_.empty() || mappings_.size() != materials_.size())
      refuse("its composite does not map each material to a function");
    ContainerContents contents;
    contents.materials = materials_;
    std::vector<std::vector<std::string>> sheets;
    for (const Mapping& mapping : mappings_) {
      const auto function = functions_.find(mapping.function);
      const auto image =
          function == functions_.end() ? images_.end() : images_.find(function->second);
      if (image == images_.end()) refuse("a material is not mapped to an image");
      if (mapping.transform != mappings_.front().transform ||
          image->second.size != images_.begin()->second.size)
        refuse("the images of its materials are not alike");
      sheets.push_back(image->second.sheets);
      if (static_cast<std::int64_t>(sheets.back().size()) != image->second.size[2])
        refuse("an image has " + std::to_string(sheets.back().size()) + " sheets and not " +
               std::to_string(image->second.size[2]));
    }
    const std::array<std::int64_t, 3>& size = images_.begin()->second.size;
    contents.width = size[0];
    contents.height = size[1];
    contents.layers = size[2];
    place(mappings_.front().transform, contents);
    contents.file_name = [sheets](int layer, std::size_t material) {
      return sheets[material][static_cast<std::size_t>(layer)];
    };
    return contents;
  }

 private:
  struct Image {
    std::array<std::int64_t, 3> size{};
    std::vector<std::string> sheets;
  };
  struct Mapping {
    std::string function;
    std::string transform;
  };

  void begin(const XmlElement& element) override {
    if (element.space() == core_space && element.name() == "base") {
      constexpr std::size_t most = 255;
      if (materials_.size() == most) refuse("has more than 255 materials");
      materials_.push_back({textOf(element, "name"), colourOf(textOf(element, "displaycolor"))});
    }
    if (element.space() != volumetric_space) return;
    if (element.name() == "image3d") {
      image_ = &images_[textOf(element, "id")];
    } else if (element.name() == "imagestack" && image_ != nullptr) {
      image_->size = {countOf(element, "columncount"), countOf(element, "rowcount"),
                      countOf(element, "sheetcount")};
    } else if (element.name() == "imagesheet" && image_ != nullptr) {
      std::string path = textOf(element, "path");
      if (!path.starts_with('/')) refuse("names a sheet '" + path + "', which must begin with '/'");
      image_->sheets.push_back(path.substr(1));
    } else if (element.name() == "functionfromimage3d") {
      functions_[textOf(element, "id")] = textOf(element, "image3did");
    } else if (element.name() == "materialmapping") {
      mappings_.push_back({textOf(element, "functionid"), textOf(element, "transform")});
    }
  }
  void end() override {}

  [[nodiscard]] std::string textOf(const XmlElement& element, std::string_view name) const {
    const auto value = element.attribute(name);
    if (!value) refuse("has a " + std::string(element.name()) + " without " + std::string(name));
    return std::string(*value);
  }
  [[nodiscard]] std::int64_t countOf(const XmlElement& element, std::string_view name) const {
    const std::string text = textOf(element, name);
    constexpr std::size_t most_digits = 10;
    if (text.empty() || text.size() > most_digits ||
        text.find_first_not_of("0123456789") != std::string::npos)
      refuse("has a " + std::string(name) + " '" + text + "', which is no count");
    return std::stoll(text);
  }
  [[nodiscard]] std::array<std::uint8_t, 4> colourOf(const std::string& text) const {
    if ((text.size() != 7 && text.size() != 9) || text[0] != '#' ||
        text.find_first_not_of("0123456789abcdefABCDEF", 1) != std::string::npos)
      refuse("has the colour '" + text + "', which is not #RRGGBB or #RRGGBBAA");
    std::array<std::uint8_t, 4> colour{0, 0, 0, 255};
    for (std::size_t channel = 0; 2 * channel + 1 < text.size(); ++channel)
      colour[channel] =
          static_cast<std::uint8_t>(std::stoi(text.substr(2 * channel + 1, 2), nullptr, 16));
    return colour;
  }

  /// The pitch, the mirrors and the place of the lattice from the matrix of an image.
  void place(const std::string& transform, ContainerContents& contents) const {
    std::istringstream stream(transform);
    std::array<double, 12> matrix{};
    bool is_proper = true;
    for (std::size_t i = 0; i < matrix.size(); ++i) {
      is_proper = is_proper && static_cast<bool>(stream >> matrix[i]);
      const bool is_diagonal = i % 4 == 0 && i < 9;
      if (i < 9) is_proper = is_proper && (matrix[i] != 0) == is_diagonal;
    }
    if (!is_proper || matrix[8] < 0)
      refuse("has a transform '" + transform + "' that does more than scale and shift");
    const std::array<std::int64_t, 3> size{contents.width, contents.height, contents.layers};
    for (int axis = 0; axis < 3; ++axis) {
      const double scale = matrix[4 * axis];
      contents.pitch_mm[axis] = 1 / std::abs(scale) / static_cast<double>(size[axis]);
      const double corner_mm = ((scale < 0 ? 1 : 0) - matrix[9 + axis]) / scale;
      const double first = corner_mm / contents.pitch_mm[axis] + 0.5;
      constexpr double farthest = 1 << 28;
      if (!(std::abs(first) < farthest)) refuse("lies too far from the origin");
      contents.corner[axis] = static_cast<int>(std::lround(first));
      contents.origin_mm[axis] = (first - contents.corner[axis]) * contents.pitch_mm[axis];
      // What is left of rounding is none.
      constexpr double thousandth = 1e-3;
      if (std::abs(first - contents.corner[axis]) < thousandth) contents.origin_mm[axis] = 0;
    }
    contents.flip_x = matrix[0] < 0;
    contents.flip_y = matrix[4] < 0;
  }

  std::string shown_;
  MaterialTable materials_;
  std::map<std::string, Image> images_;
  std::map<std::string, std::string> functions_;  ///< the image of each
  std::vector<Mapping> mappings_;
  Image* image_ = nullptr;
};

std::optional<DescribedStack> describeVolume(const StackInput& files) {
  if (!files.contains(model_name)) return std::nullopt;
  constexpr std::uint64_t most_bytes = std::uint64_t{1} << 29;
  const std::string shown = "'" + files.shown(model_name) + "'";
  VolumeReader reader(shown);
  reader.read(files.read(model_name, most_bytes));
  reader.finish();
  if (!reader.hasVolume()) return std::nullopt;
  ContainerContents contents = reader.contents();
  contents.format = "3mf";
  contents.configuration = model_name;
  contents.shown = shown;
  return describedBy(contents, files);
}

/// More than half of a share is the material.
SpanImage decodeShares(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  SpanImage image = decodePng(bytes, check);
  for (Span& span : image.spans) span.value = (span.value & 255) > full / 2 ? 1 : 0;
  return image;
}

}  // namespace

extern const SliceFormat threemf_volume;
const SliceFormat threemf_volume{
    .name = "3mf",
    .summary = "3MF with a volume: an image stack for each material, in a mesh or a level set",
    .ending = ".png",
    .pixel = SlicePixel::one_material,
    .encoder = makeSliceEncoder<VolumeEncoder>,
    .decode = decodeShares,
    .bytes_per_leaf = 80,
    .container_ending = ".3mf",
    .describe = describeVolume,
    .names = &threemf_names};

}  // namespace vdbdither
