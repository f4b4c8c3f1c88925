// glTF 2.0, as JSON and as GLB: ISO/IEC 12113:2022,
// https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/mesh/glb_encoder.h"
#include "io/mesh/gltf_buffers.h"
#include "io/mesh/gltf_json.h"
#include "io/mesh/gltf_materials.h"
#include "io/mesh/gltf_primitive.h"
#include "io/mesh/gltf_scene.h"
#include "io/mesh/gltf_skin.h"
#include "io/mesh/mesh_format.h"
#include "io/mesh/part_names.h"
#include "vdbdither/model/interrupt.h"

namespace vdbdither {

using openvdb::Mat4d;
using openvdb::Vec3d;

namespace {

constexpr std::string_view glb_magic = "glTF";

/// What is read, and what changes neither the shape nor the base colour.
constexpr std::array<std::string_view, 22> known_extensions{
    "KHR_draco_mesh_compression",
    "KHR_lights_punctual",
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_node_visibility",
    "KHR_texture_basisu",  // refused where an image needs it
    "KHR_texture_transform",
    "KHR_xmp_json_ld",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
};

struct Container {
  std::string_view json;
  std::optional<std::string_view> binary;
};

std::uint64_t numberAt(std::string_view bytes, std::uint64_t at) {
  std::uint64_t number = 0;
  for (std::uint64_t i = 4; i > 0; --i)
    number = number << 8 | static_cast<unsigned char>(bytes[at + i - 1]);
  return number;
}

/// Refuses what is cut off. Chunks of other types are passed over.
Container openGlb(const MeshFile& file) {
  constexpr std::uint64_t header_bytes = 12;
  constexpr std::uint64_t chunk_header_bytes = 8;
  constexpr std::uint64_t json_type = 0x4E4F534A;
  constexpr std::uint64_t binary_type = 0x004E4942;
  const std::string remedy = "; export or download it again";
  if (file.size() < header_bytes) file.refuse("the header is cut off" + remedy);
  const std::uint64_t version = numberAt(file.head(), 4);
  if (version != 2)
    file.refuse("a binary glTF of version " + std::to_string(version) + "; export glTF 2.0");
  const std::uint64_t length = numberAt(file.head(), 8);
  if (length > file.size())
    file.refuse("cut off: " + std::to_string(file.size()) + " of " + std::to_string(length) +
                " bytes" + remedy);
  if (length < file.size())
    file.warn("ignored " + std::to_string(file.size() - length) + " bytes after the end");
  const std::string_view bytes = file.bytes().substr(0, length);
  Container container;
  bool has_json = false;
  for (std::uint64_t at = header_bytes; at < length;) {
    if (length - at < chunk_header_bytes)
      file.refuseAtByte(bytes.data() + at, "a chunk is cut off" + remedy);
    const std::uint64_t size = numberAt(bytes, at);
    const std::uint64_t type = numberAt(bytes, at + 4);
    if (size > length - at - chunk_header_bytes)
      file.refuseAtByte(bytes.data() + at, "a chunk reaches beyond the end" + remedy);
    const std::string_view chunk = bytes.substr(at + chunk_header_bytes, size);
    if (!has_json && type != json_type)
      file.refuseAtByte(bytes.data() + at, "the first chunk must be JSON" + remedy);
    if (!has_json) container.json = chunk;
    has_json = true;
    if (type == binary_type && !container.binary) container.binary = chunk;
    at += chunk_header_bytes + size;
  }
  if (!has_json) file.refuse("the JSON is missing" + remedy);
  return container;
}

void checkVersion(const MeshFile& file, const GltfValue& root) {
  const GltfValue asset = root["asset"];
  if (!asset.exists())
    file.refuse("a JSON text without 'asset', which is not glTF; export " + meshFormatNames());
  for (const GltfValue& version : {asset["version"], asset["minVersion"]}) {
    if (version.exists() && !version.text().starts_with("2."))
      file.refuse("a glTF of version " + inQuotes(version.text()) + "; export glTF 2.0");
  }
}

void checkExtensions(const MeshFile& file, const GltfValue& root) {
  const GltfValue required = root["extensionsRequired"];
  for (std::size_t i = 0; i < required.size(); ++i) {
    const std::string_view name = required.at(i).text();
    if (std::find(known_extensions.begin(), known_extensions.end(), name) == known_extensions.end())
      file.refuse("needs the extension " + inQuotes(name) +
                  ", which is not read; export it without");
  }
}

class GltfReader {
 public:
  GltfReader(const MeshFile& file, const GltfValue& root,
             const std::optional<std::string_view>& binary)
      : file_(file),
        root_(root),
        buffers_(file, root, binary),
        materials_(file, root, buffers_),
        primitives_(file, root, buffers_, materials_) {}

  Mesh read() {
    const GltfScene scene = readGltfScene(root_);
    for (const GltfInstance& instance : scene.instances) load(instance.mesh);
    reserve(scene);
    loadSkins(scene);
    for (const GltfInstance& instance : scene.instances) add(instance);
    if (mesh_.parts.size() < 2) mesh_.parts.clear();
    if (file_.wantsColours() && !is_plain_) {
      appearance_->materials = materials_.takeMaterials();
      appearance_->textures = materials_.takeTextures();
      mesh_.appearance = std::move(appearance_);
    }
    warn(scene);
    return std::move(mesh_);
  }

 private:
  using Primitives = std::vector<GltfPrimitive>;

  void load(std::uint64_t mesh) {
    if (loaded_.count(mesh) != 0) return;
    const GltfValue primitives = root_["meshes"].at(mesh)["primitives"];
    Primitives& list = loaded_[mesh];
    for (std::size_t i = 0; i < primitives.size(); ++i) {
      GltfPrimitive primitive = primitives_.read(primitives.at(i));
      if (primitive.triangles.empty()) continue;
      is_plain_ = is_plain_ && primitive.is_plain;
      has_coordinates_ = has_coordinates_ || !primitive.coordinates.empty();
      has_colours_ = has_colours_ || !primitive.colours.empty();
      list.push_back(std::move(primitive));
    }
  }

  /// Refuses more than the size of the file justifies: a mesh may be used many times.
  void reserve(const GltfScene& scene) {
    std::uint64_t vertices = 0;
    std::uint64_t triangles = 0;
    std::uint64_t bytes_per_triangle = sizeof(Mesh::Triangle);
    if (file_.wantsColours() && !is_plain_) {
      bytes_per_triangle += sizeof(std::uint32_t) +
                            (has_coordinates_ ? sizeof(Appearance::Coordinates) : 0) +
                            (has_colours_ ? sizeof(Appearance::Colours) : 0);
    }
    for (const GltfInstance& instance : scene.instances) {
      for (const GltfPrimitive& primitive : loaded_[instance.mesh]) {
        vertices += primitive.positions.size();
        triangles += primitive.triangles.size();
        buffers_.takeMemory(primitive.positions.size() * sizeof(Vec3d) +
                            primitive.triangles.size() * bytes_per_triangle);
      }
    }
    if (std::max(vertices, triangles) > std::numeric_limits<std::uint32_t>::max())
      file_.refuse("more than 4294967295 vertices or triangles; split the scene");
    mesh_.vertices.reserve(vertices);
    mesh_.triangles.reserve(triangles);
    if (!file_.wantsColours() || is_plain_) return;
    appearance_->material.reserve(triangles);
    if (has_coordinates_) appearance_->coordinates.reserve(triangles);
    if (has_colours_) appearance_->colours.reserve(triangles);
  }

  void add(const GltfInstance& instance) {
    const Primitives& primitives = loaded_[instance.mesh];
    if (primitives.empty()) return;
    const auto begin = static_cast<std::uint32_t>(mesh_.triangles.size());
    const std::string name =
        instance.name.empty() ? "part " + std::to_string(mesh_.parts.size() + 1) : instance.name;
    mesh_.parts.push_back({names_.unique(name), begin});
    for (const GltfPrimitive& primitive : primitives) {
      throwIfInterrupted();
      const GltfSkin* skin =
          instance.skin && !primitive.bones.empty() ? &skins_.at(*instance.skin) : nullptr;
      // The node of a mesh with bones does not place it.
      const Mat4d to_world = skin != nullptr  ? skin->mapOf(primitive.bones.front())
                             : !instance.skin ? instance.to_world
                                              : Mat4d::identity();
      boneless_ += instance.skin && skin == nullptr ? 1 : 0;
      addVertices(primitive, to_world, skin);
      addTriangles(primitive, to_world);
    }
  }

  /// Reads the skins of the meshes that are placed.
  void loadSkins(const GltfScene& scene) {
    for (const GltfInstance& instance : scene.instances) {
      const Primitives& primitives = loaded_[instance.mesh];
      const bool has_bones =
          std::any_of(primitives.begin(), primitives.end(),
                      [](const GltfPrimitive& primitive) { return !primitive.bones.empty(); });
      if (!instance.skin || !has_bones || skins_.contains(*instance.skin)) continue;
      skins_.emplace(*instance.skin, GltfSkin(root_["skins"].at(*instance.skin), scene.to_world,
                                              primitives_.accessors()));
    }
  }

  void addVertices(const GltfPrimitive& primitive, const Mat4d& to_world, const GltfSkin* skin) {
    constexpr double mm_per_m = 1000;
    first_vertex_ = static_cast<std::uint32_t>(mesh_.vertices.size());
    Mat4d m = to_world * mm_per_m;
    for (std::size_t i = 0; i < primitive.positions.size(); ++i) {
      if (skin != nullptr) m = skin->mapOf(primitive.bones[i]) * mm_per_m;
      const Vec3d& from = primitive.positions[i];
      Vec3d position;
      for (int row = 0; row < 3; ++row) {
        position[row] =
            m(row, 0) * from.x() + m(row, 1) * from.y() + m(row, 2) * from.z() + m(row, 3);
      }
      if (!isFinite(position))
        file_.refuse("a node moves a vertex to where it is not finite (" + shown(position) +
                     "); export it again");
      mesh_.vertices.push_back(position);
    }
  }

  void addTriangles(const GltfPrimitive& primitive, const Mat4d& to_world) {
    // A reflection turns the triangles inside out.
    const bool is_mirrored = to_world.getMat3().det() < 0;
    const std::array<std::size_t, 3> order{0, is_mirrored ? 2U : 1U, is_mirrored ? 1U : 2U};
    for (const Mesh::Triangle& from : primitive.triangles) {
      const Mesh::Triangle local{from[order[0]], from[order[1]], from[order[2]]};
      mesh_.triangles.push_back(
          {first_vertex_ + local[0], first_vertex_ + local[1], first_vertex_ + local[2]});
      if (file_.wantsColours() && !is_plain_) addLook(primitive, local);
    }
  }

  void addLook(const GltfPrimitive& primitive, const Mesh::Triangle& local) {
    appearance_->material.push_back(primitive.material);
    if (has_coordinates_) {
      Appearance::Coordinates& corners = appearance_->coordinates.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        corners[i] =
            primitive.coordinates.empty() ? openvdb::Vec2f(0, 0) : primitive.coordinates[local[i]];
      }
    }
    if (!has_colours_) return;
    Appearance::Colours& corners = appearance_->colours.emplace_back();
    for (std::size_t i = 0; i < 3; ++i) {
      corners[i] =
          primitive.colours.empty() ? openvdb::Vec4f(1, 1, 1, 1) : primitive.colours[local[i]];
    }
  }

  void warn(const GltfScene& scene) const {
    const GltfOmissions& omissions = primitives_.omissions();
    const auto tell = [&](std::uint64_t count, const std::string& before,
                          const std::string& after) {
      if (count > 0) file_.warn(before + std::to_string(count) + after);
    };
    tell(omissions.points_and_lines, "ignored ", " primitives of points or lines");
    tell(omissions.morph_targets, "ignored the morph targets of ", " primitives");
    tell(boneless_, "ignored the bones of ", " primitives without weights for them");
    tell(scene.hidden, "left out ", " meshes that are hidden (KHR_node_visibility)");
    tell(omissions.missing_coordinates, "ignored the textures of ",
         " primitives without texture coordinates");
    tell(omissions.wild_coordinates, "took 0 for ",
         " texture coordinates and colours that are not finite");
  }

  const MeshFile& file_;
  GltfValue root_;
  GltfBuffers buffers_;
  GltfMaterials materials_;
  GltfPrimitives primitives_;
  std::map<std::uint64_t, Primitives> loaded_;
  bool is_plain_ = true;
  bool has_coordinates_ = false;
  bool has_colours_ = false;
  Mesh mesh_;
  std::shared_ptr<Appearance> appearance_ = std::make_shared<Appearance>();
  std::map<std::uint64_t, GltfSkin> skins_;
  PartNames names_;
  std::uint32_t first_vertex_ = 0;
  std::uint64_t boneless_ = 0;
};

Mesh readGltf(const MeshFile& file) {
  const bool is_glb = file.head().starts_with(glb_magic);
  const Container container = is_glb ? openGlb(file) : Container{file.text(), std::nullopt};
  const GltfJson json(file, container.json);
  const GltfValue root = json.root();
  checkVersion(file, root);
  checkExtensions(file, root);
  return GltfReader(file, root, container.binary).read();
}

MeshMatch matchGltf(const MeshFile& file) {
  if (file.head().starts_with(glb_magic)) return MeshMatch::signature;
  if (file.isText() && file.start().starts_with('{')) return MeshMatch::likely;
  return file.isText() && file.isNamed(".gltf") ? MeshMatch::name : MeshMatch::none;
}

std::unique_ptr<MeshEncoder> makeGlbEncoder(const std::filesystem::path& path,
                                            const MeshEncoding& how) {
  if (how.draco_mm) return std::make_unique<CompressedGlbEncoder>(path, how);
  return std::make_unique<GlbEncoder>(path, how.extras);
}

}  // namespace

extern const MeshFormat gltf;
const MeshFormat gltf{.name = "glTF",
                      .ending = ".glb",
                      .match = matchGltf,
                      .read = readGltf,
                      .write = makeGlbEncoder,
                      .states_unit = true,
                      .holds_extras = true,
                      .takes_draco = true,
                      .most = std::numeric_limits<std::uint32_t>::max() / sizeof(Mesh::Triangle),
                      .bytes_per_vertex = 36,
                      .us_per_vertex = 0.2};

}  // namespace vdbdither
