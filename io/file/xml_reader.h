#pragma once

#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

struct XML_ParserStruct;

namespace vdbdither {

/// An element of an XML document where it begins.
class XmlElement {
 public:
  /// @param name        as expat gives it: the namespace, a blank and the name
  /// @param attributes  names and values in turn, up to a null pointer
  XmlElement(std::string_view name, const char* const* attributes);

  [[nodiscard]] std::string_view space() const { return space_; }  ///< URI of its namespace
  [[nodiscard]] std::string_view name() const { return name_; }
  /// @param name  of an attribute without a namespace, or with one: "http://… path"
  [[nodiscard]] std::optional<std::string_view> attribute(std::string_view name) const;

 private:
  std::string_view space_;
  std::string_view name_;
  const char* const* attributes_;
};

/// Reads an XML document piece by piece, in memory that does not grow with it. Document types are
/// refused, and with them entities of the document's own. Every refusal is a DataError of one line
/// that names the document and the line.
class XmlReader {
 public:
  /// @param shown  what messages call the document
  explicit XmlReader(std::string shown);
  XmlReader(const XmlReader&) = delete;
  XmlReader& operator=(const XmlReader&) = delete;
  virtual ~XmlReader();

  /// Reads the next bytes of the document.
  void read(std::span<const std::uint8_t> bytes);
  /// Checks that the document is complete.
  void finish();

 protected:
  /// An element begins. Its strings live as long as the call.
  virtual void begin(const XmlElement& element) = 0;
  /// The innermost element ends.
  virtual void end() = 0;
  /// A piece of text within the innermost element; one text may come in several.
  virtual void text(std::string_view /*piece*/) {}
  /// The next element declares a prefix of a namespace.
  virtual void declare(std::string_view /*prefix*/, std::string_view /*space*/) {}

  [[noreturn]] void refuse(const std::string& why) const;

 private:
  struct Callbacks;

  void parse(std::span<const std::uint8_t> bytes, bool is_last);

  std::string shown_;
  std::unique_ptr<XML_ParserStruct, void (*)(XML_ParserStruct*)> parser_;
  std::uint64_t bytes_ = 0;
  int depth_ = 0;
  std::exception_ptr thrown_;  ///< by a callback: no exception may pass through the parser
};

}  // namespace vdbdither
