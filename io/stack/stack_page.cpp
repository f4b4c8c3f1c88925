#include "io/stack/stack_page.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include <nlohmann/json.hpp>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "io/file/staged_output.h"
#include "io/file/text_bytes.h"
#include "io/stack/viewer_page.h"
#include "vdbdither/engine/json_text.h"
#include "vdbdither/engine/option_values.h"
#include "vdbdither/engine/version.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

using nlohmann::ordered_json;

constexpr std::size_t group_slices = 16;
constexpr std::size_t most_materials = 255;

std::uint64_t base64Size(std::uint64_t bytes) { return (bytes + 2) / 3 * 4; }

void appendBase64(std::string& out, std::span<const std::uint8_t> bytes) {
  static constexpr std::string_view digits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) three = three << 8 | (k < count ? bytes[i + k] : 0);
    for (std::size_t k = 0; k < 4; ++k)
      out += k <= count ? digits[three >> (18 - 6 * k) & 63] : '=';
  }
}

/// An element that the browser does not read; the script finds it by its id.
void appendData(std::string& out, const std::string& id, std::span<const std::uint8_t> bytes) {
  out += "<script type=\"text/plain\" id=\"" + id + "\">";
  appendBase64(out, bytes);
  out += "</script>\n";
}

/// The same image seen from above with x to the right and y upwards, for the voxels of `frame`, and
/// with `meaning` of its values.
SpanImage framed(const SpanImage& image, const SliceLayout& layout, const openvdb::CoordBBox& frame,
                 std::span<const std::uint32_t> meaning) {
  SpansBuilder result(static_cast<std::uint32_t>(frame.dim().x()));
  const std::int64_t width = frame.dim().x();
  for (int y = frame.max().y(); y >= frame.min().y(); --y) {
    result.pixel(0, 0);
    if (y >= layout.box.min().y() && y <= layout.box.max().y()) {
      const auto row = image.row(
          layout.padding + (layout.flip_y ? y - layout.box.min().y() : layout.box.max().y() - y));
      const std::int64_t shift =
          std::int64_t{layout.box.min().x()} - frame.min().x() - layout.padding;
      std::int64_t end = 0;
      for (std::size_t i = 0; i < row.size(); ++i) {
        const std::size_t at = layout.flip_x ? row.size() - 1 - i : i;
        const std::int64_t left = at == 0 ? 0 : row[at - 1].end;
        const std::int64_t right = row[at].end;
        const std::int64_t begin = (layout.flip_x ? image.width - right : left) + shift;
        end = (layout.flip_x ? image.width - left : right) + shift;
        if (end <= 0 || begin >= width) continue;
        result.pixel(static_cast<std::uint32_t>(std::max<std::int64_t>(begin, 0)),
                     meaning[row[at].value]);
      }
      if (end > 0 && end < width) result.pixel(static_cast<std::uint32_t>(end), 0);
    }
    result.endRow();
  }
  return result.finish();
}

std::vector<const SpanImage*> pointersTo(std::span<const SpanImage> images) {
  std::vector<const SpanImage*> pointers;
  for (const SpanImage& image : images) pointers.push_back(&image);
  return pointers;
}

openvdb::CoordBBox frameOf(const PageStack& shown, const std::optional<PageStack>& other) {
  openvdb::CoordBBox frame = shown.manifest.lattice.box;
  if (other) frame.expand(other->manifest.lattice.box);
  return frame;
}

std::array<std::uint32_t, 3> sizeOf(const openvdb::CoordBBox& frame, ZRange layers) {
  return {static_cast<std::uint32_t>(frame.dim().x()), static_cast<std::uint32_t>(frame.dim().y()),
          static_cast<std::uint32_t>(layers.size())};
}

void countVoxels(const SpanImage& image, std::vector<std::uint64_t>& voxels) {
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t begin = 0;
    for (const Span& span : image.row(y)) {
      if (span.value) voxels[span.value - 1] += span.end - begin;
      begin = span.end;
    }
  }
}

std::vector<std::array<std::uint8_t, 4>> coloursOf(const MaterialTable& materials) {
  std::vector<std::array<std::uint8_t, 4>> colours;
  for (const Material& material : materials) colours.push_back(material.rgba);
  return colours;
}

}  // namespace

PageStack pageStack(const std::filesystem::path& path, const Manifest& manifest) {
  std::filesystem::path name = path.has_filename() ? path : path.parent_path();
  if (name.filename() == manifest_name && name.has_parent_path()) name = name.parent_path();
  return {namesArchive(name) ? name.stem().string() : name.filename().string(), manifest};
}

void StackPage::check(const std::filesystem::path& target, bool overwrite) {
  if (!equalsIgnoringCase(target.extension().string(), ".html"))
    throw UsageError("'" + target.string() + "' must end in .html");
  StagedOutput::check(target, StagedOutput::Kind::file, overwrite);
}

StackPage::StackPage(ZRange layers, PageStack shown, std::optional<PageStack> other,
                     std::uint64_t most_bytes)
    : layers_(layers),
      most_bytes_(most_bytes),
      frame_(frameOf(shown, other)),
      volume_(sizeOf(frame_, layers), shown.manifest.lattice.pitch_mm,
              coloursOf(shown.manifest.materials)),
      next_(layers.begin) {
  if (other && (other->manifest.lattice.pitch_mm != shown.manifest.lattice.pitch_mm ||
                other->manifest.lattice.origin_mm != shown.manifest.lattice.origin_mm)) {
    throw DataError("'" + other->name + "' has another pitch or origin than '" + shown.name +
                    "'; make both stacks for one printer");
  }
  stacks_.push_back(std::move(shown));
  if (other) stacks_.push_back(std::move(*other));
  for (const PageStack& stack : stacks_) addMaterials(stack.manifest.materials);
  voxels_.assign(stacks_.size(), std::vector<std::uint64_t>(materials_.size(), 0));
}

/// Materials of the same name are one; so are the only ones of stacks that have just one each.
void StackPage::addMaterials(const MaterialTable& materials) {
  std::vector<std::uint32_t> meaning{0};
  const bool only = materials.size() == 1 && materials_.size() == 1;
  const MaterialTable known = materials_;
  for (const Material& material : materials) {
    std::size_t i = 0;
    if (const Material* same = materialCalled(material.name, known)) {
      i = static_cast<std::size_t>(same - known.data());
    } else if (!only) {
      i = materials_.size();
      materials_.push_back(material);
    }
    meaning.push_back(static_cast<std::uint32_t>(i + 1));
  }
  if (materials_.size() > most_materials) {
    throw DataError("a page has room for " + std::to_string(most_materials) +
                    " materials, and there are " + std::to_string(materials_.size()));
  }
  meaning_.push_back(std::move(meaning));
}

void StackPage::add(int z, std::vector<SpanImage> images) {
  const auto keep = [&](Slices slices) {
    if ((next_ - layers_.begin) % stride_ == 0) pending_.push_back(std::move(slices));
    ++next_;
  };
  while (next_ < z) keep(Slices(stacks_.size(), blankSlice({frame_, 0, false, false})));
  Slices slices(stacks_.size());
  tbb::parallel_for(std::size_t{0}, stacks_.size(), [&](std::size_t i) {
    slices[i] = framed(images[i], stacks_[i].manifest.layout, frame_, meaning_[i]);
    countVoxels(slices[i], voxels_[i]);
  });
  volume_.add(static_cast<std::uint32_t>(z - layers_.begin), slices[0]);
  keep(std::move(slices));
  if (pending_.size() >= group_slices * tbb::this_task_arena::max_concurrency()) packPending(false);
}

StackPage::Groups StackPage::packed(std::span<const Slices> all) const {
  Groups groups;
  std::vector<const SpanImage*> base;
  for (std::size_t stack = 0; stack < stacks_.size(); ++stack) {
    std::vector<const SpanImage*> images;
    for (const Slices& slices : all) images.push_back(&slices[stack]);
    groups.push_back(packSlices(images, values(), base));
    if (stack == 0) base = std::move(images);
  }
  return groups;
}

std::vector<StackPage::Slices> StackPage::unpacked(const Groups& groups) const {
  std::vector<Slices> result(groups[0].slices);
  std::vector<SpanImage> first;
  for (const SliceGroup& group : groups) {
    std::vector<SpanImage> images =
        unpackSlices(group, static_cast<std::uint32_t>(frame_.dim().x()),
                     static_cast<std::uint32_t>(frame_.dim().y()), values(), pointersTo(first));
    for (std::size_t i = 0; i < images.size(); ++i) result[i].push_back(images[i]);
    first = std::move(images);
  }
  return result;
}

void StackPage::append(Groups groups) {
  for (const SliceGroup& group : groups) bytes_ += base64Size(group.bytes.size());
  groups_.push_back(std::move(groups));
}

// Groups are appended one after the other, so that the number of threads does not decide which of
// them is too much.
void StackPage::packPending(bool last) {
  while (pending_.size() >= group_slices || (last && !pending_.empty())) {
    const std::size_t ready = (pending_.size() + (last ? group_slices - 1 : 0)) / group_slices;
    std::vector<Groups> made(std::min<std::size_t>(ready, tbb::this_task_arena::max_concurrency()));
    const std::span<const Slices> pending(pending_);
    tbb::parallel_for(std::size_t{0}, made.size(), [&](std::size_t i) {
      const std::size_t begin = i * group_slices;
      made[i] = packed(pending.subspan(begin, std::min(group_slices, pending.size() - begin)));
    });
    for (Groups& groups : made) {
      pending_.erase(pending_.begin(), pending_.begin() + groups[0].slices);
      append(std::move(groups));
      if (bytes_ > most_bytes_ && (groups_.size() > 1 || groups_[0][0].slices > 1)) {
        thinOut();
        break;
      }
    }
  }
}

/// Leaves out every second one of the slices that came.
void StackPage::thinOut() {
  const std::vector<Groups> all = std::exchange(groups_, {});
  std::vector<Slices> rest;
  for (std::size_t i = all.back()[0].slices % 2; i < pending_.size(); i += 2)
    rest.push_back(std::move(pending_[i]));
  stride_ *= 2;
  bytes_ = 0;
  const auto together = static_cast<std::size_t>(2 * tbb::this_task_arena::max_concurrency());
  for (std::size_t begin = 0; begin < all.size(); begin += together) {
    const std::size_t end = std::min(begin + together, all.size());
    std::vector<Groups> made((end - begin + 1) / 2);
    tbb::parallel_for(std::size_t{0}, made.size(), [&](std::size_t i) {
      std::vector<Slices> kept;
      for (std::size_t k = begin + 2 * i; k < std::min(begin + 2 * i + 2, end); ++k) {
        std::vector<Slices> slices = unpacked(all[k]);
        for (std::size_t j = 0; j < slices.size(); j += 2) kept.push_back(std::move(slices[j]));
      }
      if (kept.size() == group_slices) {
        made[i] = packed(kept);
      } else {  // the last ones
        rest.insert(rest.begin(), std::make_move_iterator(kept.begin()),
                    std::make_move_iterator(kept.end()));
      }
    });
    for (Groups& groups : made)
      if (!groups.empty()) append(std::move(groups));
  }
  pending_ = std::move(rest);
}

std::string StackPage::warning() const {
  if (stride_ == 1) return "";
  return "the page shows one slice of " + std::to_string(stride_) +
         ": with all of them it would take more than " +
         shortestText(static_cast<double>(most_bytes_) / 1e6) + " MB";
}

std::string StackPage::description() const {
  const Manifest& manifest = stacks_[0].manifest;
  const openvdb::Vec3d& pitch = manifest.lattice.pitch_mm;
  const openvdb::Vec3d& origin = manifest.lattice.origin_mm;
  ordered_json json;
  json["creator"] = std::string("vdbdither ") + version;
  json["stacks"] = ordered_json::array();
  for (std::size_t i = 0; i < stacks_.size(); ++i) {
    const PageStack& stack = stacks_[i];
    json["stacks"].push_back({{"name", stack.name},
                              {"grid", stack.manifest.grid},
                              {"voxels", voxels_[i]},
                              {"history", stack.manifest.history}});
  }
  const ordered_json printer = parsedJson(manifest.printer);
  json["printer"] = printer.is_object() ? printer : ordered_json();
  json["materials"] = ordered_json::array();
  for (const Material& material : materials_)
    json["materials"].push_back({{"name", material.name}, {"rgba", material.rgba}});
  json["pitch_mm"] = {pitch[0], pitch[1], pitch[2]};
  json["origin_mm"] = {origin[0], origin[1], origin[2]};
  json["size"] = sizeOf(frame_, layers_);
  json["first"] = {frame_.min().x(), frame_.min().y(), layers_.begin};
  json["stride"] = stride_;
  json["warning"] = warning();
  json["groups"] = ordered_json::array();
  for (const Groups& groups : groups_) {
    ordered_json entry = ordered_json::array({groups[0].slices});
    for (const SliceGroup& group : groups)
      entry.push_back({group.left, group.top, group.width, group.height});
    json["groups"].push_back(std::move(entry));
  }
  json["volume"] = {
      {"cell_mm", volume_.cellMm()}, {"cells", volume_.cells()}, {"blocks", volume_.blocks()}};
  std::string text;
  // Nothing in the text may end the element that holds it.
  for (const char c : jsonText(json)) text += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return text;
}

void StackPage::finish(const std::filesystem::path& target) {
  packPending(true);
  const std::size_t mark = viewer_page.find(data_mark);
  std::string page(viewer_page.substr(0, mark));
  page.reserve(page.size() + bytes_ + (std::size_t{4} << 20));
  for (std::size_t i = 0; i < groups_.size(); ++i) {
    for (std::size_t stack = 0; stack < stacks_.size(); ++stack) {
      appendData(page, "group-" + std::to_string(stack) + "-" + std::to_string(i),
                 groups_[i][stack].bytes);
    }
  }
  const std::vector<std::uint8_t> volume = volume_.finish();
  const std::array<std::span<const std::uint8_t>, 1> pieces{volume};
  appendData(page, "volume", deflated(pieces));
  page += "<script type=\"application/json\" id=\"stack\">" + description() + "</script>\n";
  page += viewer_page.substr(mark + data_mark.size());
  output_.emplace(target, StagedOutput::Kind::file);
  writeFile(output_->path(), textBytes(page), target);
  output_->complete();
}

}  // namespace vdbdither
