// "Extensible Markup Language (XML) 1.0", fifth edition, and "Namespaces in XML 1.0", third
// edition, W3C, as expat parses them.

#include "io/file/xml_reader.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdlib>
#include <expat.h>
#include <new>
#include <utility>

#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr char between_space_and_name = ' ';
constexpr int deepest_element = 64;
/// Each element carries its namespace along.
constexpr std::size_t longest_space = 256;
/// A tag is kept whole until it ends.
constexpr std::uint64_t longest_tag = std::uint64_t{1} << 18;
/// The parser keeps each name of an element or attribute. Documents have a few dozen.
constexpr std::size_t most_parser_bytes = std::size_t{32} << 20;

std::string_view viewOf(const char* text) { return text == nullptr ? std::string_view() : text; }

/// What the parsers of this thread hold, in bytes.
std::size_t& parserBytes() {
  static thread_local std::size_t bytes = 0;
  return bytes;
}

/// In front of each block of a parser.
struct alignas(std::max_align_t) BlockSize {
  std::size_t bytes;
};

void* resizeBlock(void* block, std::size_t bytes) {
  BlockSize* old = block == nullptr ? nullptr : static_cast<BlockSize*>(block) - 1;
  const std::size_t old_bytes = old == nullptr ? 0 : old->bytes;
  if (bytes > most_parser_bytes || parserBytes() - old_bytes + bytes > most_parser_bytes)
    return nullptr;
  // NOLINTNEXTLINE(cppcoreguidelines-no-malloc): expat wants what realloc does
  auto* resized = static_cast<BlockSize*>(std::realloc(old, sizeof(BlockSize) + bytes));
  if (resized == nullptr) return nullptr;
  parserBytes() += bytes - old_bytes;
  resized->bytes = bytes;
  return resized + 1;
}

void freeBlock(void* block) {
  if (block == nullptr) return;
  BlockSize* old = static_cast<BlockSize*>(block) - 1;
  parserBytes() -= old->bytes;
  std::free(old);  // NOLINT(cppcoreguidelines-no-malloc)
}

XML_Parser createParser() {
  const XML_Memory_Handling_Suite memory{
      [](std::size_t bytes) { return resizeBlock(nullptr, bytes); }, resizeBlock, freeBlock};
  const std::array<char, 2> separator{between_space_and_name, '\0'};
  return XML_ParserCreate_MM(nullptr, &memory, separator.data());
}

}  // namespace

XmlElement::XmlElement(std::string_view name, const char* const* attributes)
    : attributes_(attributes) {
  const std::size_t blank = name.rfind(between_space_and_name);
  if (blank != std::string_view::npos) space_ = name.substr(0, blank);
  name_ = name.substr(blank == std::string_view::npos ? 0 : blank + 1);
}

std::optional<std::string_view> XmlElement::attribute(std::string_view name) const {
  for (const char* const* at = attributes_; *at != nullptr; at += 2) {
    if (name == *at) return at[1];
  }
  return std::nullopt;
}

struct XmlReader::Callbacks {
  template <class Work>
  static void guarded(void* data, const Work& work) {
    XmlReader& reader = *static_cast<XmlReader*>(data);
    if (reader.thrown_) return;
    try {
      work(reader);
    } catch (...) {
      reader.thrown_ = std::current_exception();
      XML_StopParser(reader.parser_.get(), XML_FALSE);
    }
  }

  static void XMLCALL begin(void* data, const char* name, const char** attributes) {
    guarded(data, [&](XmlReader& reader) {
      if (++reader.depth_ > deepest_element)
        reader.refuse("nests more than " + std::to_string(deepest_element) + " elements");
      reader.begin(XmlElement(name, attributes));
    });
  }

  static void XMLCALL end(void* data, const char* /*name*/) {
    guarded(data, [](XmlReader& reader) {
      --reader.depth_;
      reader.end();
    });
  }

  static void XMLCALL text(void* data, const char* piece, int size) {
    guarded(data, [&](XmlReader& reader) {
      reader.text(std::string_view(piece, static_cast<std::size_t>(size)));
    });
  }

  static void XMLCALL declare(void* data, const char* prefix, const char* space) {
    guarded(data, [&](XmlReader& reader) {
      if (viewOf(space).size() > longest_space) {
        reader.refuse("names a namespace with more than " + std::to_string(longest_space) +
                      " bytes");
      }
      reader.declare(viewOf(prefix), viewOf(space));
    });
  }

  static void XMLCALL documentType(void* data, const char* /*name*/, const char* /*system_id*/,
                                   const char* /*public_id*/, int /*has_subset*/) {
    guarded(data, [](XmlReader& reader) {
      reader.refuse("has a document type (<!DOCTYPE), which is not read; export it without");
    });
  }
};

XmlReader::XmlReader(std::string shown)
    : shown_(std::move(shown)), parser_(createParser(), XML_ParserFree) {
  XML_Parser parser = parser_.get();
  if (parser == nullptr) throw std::bad_alloc();
  XML_SetUserData(parser, this);
  XML_SetElementHandler(parser, Callbacks::begin, Callbacks::end);
  XML_SetCharacterDataHandler(parser, Callbacks::text);
  XML_SetStartNamespaceDeclHandler(parser, Callbacks::declare);
  XML_SetStartDoctypeDeclHandler(parser, Callbacks::documentType);
}

XmlReader::~XmlReader() = default;

void XmlReader::read(std::span<const std::uint8_t> bytes) {
  constexpr std::size_t step = std::size_t{1} << 16;
  for (; !bytes.empty(); bytes = bytes.subspan(std::min(step, bytes.size())))
    parse(bytes.first(std::min(step, bytes.size())), false);
}

void XmlReader::finish() { parse({}, true); }

void XmlReader::parse(std::span<const std::uint8_t> bytes, bool is_last) {
  XML_Parser parser = parser_.get();
  const XML_Status status = XML_Parse(parser, reinterpret_cast<const char*>(bytes.data()),
                                      static_cast<int>(bytes.size()), is_last ? 1 : 0);
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
  if (status == XML_STATUS_OK) {
    bytes_ += bytes.size();
    const auto understood = static_cast<std::uint64_t>(XML_GetCurrentByteIndex(parser));
    if (bytes_ > understood + longest_tag) refuse("has a tag of more than 256 KiB");
    return;
  }
  switch (XML_GetErrorCode(parser)) {
    case XML_ERROR_NO_MEMORY:
      refuse("has too many different names of elements and attributes; export it again");
    case XML_ERROR_UNKNOWN_ENCODING:
    case XML_ERROR_INCORRECT_ENCODING:
      refuse("is in an encoding that is not read; use UTF-8");
    case XML_ERROR_NO_ELEMENTS:
    case XML_ERROR_UNCLOSED_TOKEN:
      refuse("ends before its last element: it is cut off");
    case XML_ERROR_TAG_MISMATCH:
      refuse("ends an element that did not begin; export it again");
    default:
      refuse("is not well-formed XML; export it again");
  }
}

void XmlReader::refuse(const std::string& why) const {
  throw DataError(shown_ + ", line " + std::to_string(XML_GetCurrentLineNumber(parser_.get())) +
                  ": " + why);
}

}  // namespace vdbdither
