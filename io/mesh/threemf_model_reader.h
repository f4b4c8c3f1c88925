#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "io/file/xml_reader.h"
#include "io/mesh/mesh_file.h"
#include "io/mesh/threemf_model.h"

namespace vdbdither {

/// Reads a model part of a 3MF file.
class ThreemfModelReader : public XmlReader {
 public:
  /// @param shown   what messages call the part
  /// @param unread  gets the kinds of content that are passed over; must outlive the object
  ThreemfModelReader(std::string shown, MeshColours colours, std::set<std::string>& unread);

  /// Returns what was read.
  ThreemfPart take();

 protected:
  void begin(const XmlElement& element) override;
  void end() override;
  void declare(std::string_view prefix, std::string_view space) override;

 private:
  /// The elements that matter, and those in which nothing does.
  enum class Tag {
    document,
    model,
    resources,
    object,
    mesh,
    vertices,
    vertex,
    triangles,
    triangle,
    components,
    component,
    build,
    item,
    base_materials,
    base,
    colour_group,
    colour,
    texture,
    texture_group,
    coordinates,
    mixtures,
    skipped,
  };

  [[nodiscard]] Tag tagOf(const XmlElement& element);
  void noteUnread(const XmlElement& element);
  void open(Tag tag, const XmlElement& element);
  void readModel(const XmlElement& element);
  void refuseUnknownExtensions(std::string_view prefixes) const;
  void readObject(const XmlElement& element);
  void readComponent(const XmlElement& element);
  void readBaseMaterial(const XmlElement& element);
  void readVertex(const XmlElement& element);
  void readTriangle(const XmlElement& element);
  void readProperty(const XmlElement& element);
  void readItem(const XmlElement& element);
  void readTexture(const XmlElement& element);
  void readCoordinates(const XmlElement& element);

  /// Refuses to add one to `count` elements that are the maximum.
  void limit(std::size_t count, const std::string& what) const;
  [[nodiscard]] ThreemfUse useOf(const XmlElement& element) const;
  [[nodiscard]] ThreemfTransform transformOf(std::string_view text) const;
  ThreemfGroup& addGroup(const XmlElement& element);
  [[nodiscard]] ThreemfColour colourOf(const XmlElement& element, std::string_view name) const;
  [[nodiscard]] double number(const XmlElement& element, std::string_view name) const;
  [[nodiscard]] std::uint32_t index(const XmlElement& element, std::string_view name) const;
  [[nodiscard]] std::uint32_t indexOr(const XmlElement& element, std::string_view name,
                                      std::uint32_t otherwise) const;

  MeshColours colours_;
  std::set<std::string>& unread_;
  ThreemfPart part_;
  std::vector<Tag> open_{Tag::document};
  std::map<std::string, std::string, std::less<>> space_of_prefix_;
  ThreemfGroup* group_ = nullptr;  ///< whose elements are read
  double mm_per_unit_ = 1;
  std::size_t components_ = 0;
  std::uint64_t records_ = 0;
};

}  // namespace vdbdither
