#include "io/stack/stack_writer.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include "io/file/digest.h"
#include "io/image/png_spans.h"
#include "vdbdither/model/errors.h"
#include "vdbdither/model/words.h"

namespace vdbdither {

namespace {

std::vector<std::uint32_t> displayColours(const MaterialTable& materials) {
  std::vector<std::uint32_t> colours{0};
  for (const Material& material : materials) colours.push_back(rgba(material.rgba));
  return colours;
}

}  // namespace

/// A layer on its way through the threads.
struct StackWriter::Layer {
  int z = 0;
  SpanImage image;
  std::vector<SliceFile> files;
  std::vector<std::string> sha256;    ///< of each of the files
  std::vector<std::uint64_t> voxels;  ///< of each material
  /// Of a layer of a piece, in place of an image: the files that it has already, by their paths.
  std::vector<std::filesystem::path> made = {};
};

StackWriter::StackWriter(const std::filesystem::path& target, Manifest stack, SliceNames names,
                         const SliceEncoder& encoder, BlankLayers blank, StackPart part)
    : stack_(std::move(stack)),
      names_(std::move(names)),
      encoder_(encoder),
      blank_(blank),
      part_(part),
      lowest_(stack_.lattice.layers().begin),
      output_(target),
      preview_(stack_.lattice.pitch_mm, stack_.layout.width(), stack_.layout.height(),
               stack_.lattice.layers(), displayColours(stack_.materials)) {
  stack_.voxels.assign(stack_.materials.size(), 0);
  if (encoder.keepsBlank() || part == StackPart::piece) blank_.keep = true;
}

void StackWriter::expect(ZRange layers) {
  if (known_.empty()) known_ = {layers.begin, layers.begin};
  if (layers.begin != known_.end) {
    throw DataError("layers " + std::to_string(known_.end) + " to " +
                    std::to_string(layers.begin - 1) + " are missing");
  }
  known_.end = layers.end;
}

void StackWriter::keep(Layer&& layer, std::vector<Layer>& ready) {
  if (stack_.layers.empty() && ready.empty() && beginsAtBottom()) {
    stack_.cropped_below = std::exchange(waiting_, 0);
    lowest_ = layer.z;
  }
  release(layer.z, ready);
  ready.push_back(std::move(layer));
}

void StackWriter::add(ZRange layers, std::vector<SpanImage> images, const Grids& grids) {
  expect(layers);
  std::vector<Layer> ready;
  for (int z = layers.begin; z < layers.end; ++z) {
    SpanImage& image = images[static_cast<std::size_t>(z - layers.begin)];
    if (!blank_.keep && isBlank(image)) {
      ++waiting_;
    } else {
      keep({z, std::move(image), {}, {}, {}}, ready);
    }
  }
  encodeAll(std::move(ready), grids);
}

void StackWriter::takePiece(const std::filesystem::path& folder) {
  const StackInput files(folder);
  const Manifest made = readManifest(files, EditedStack::refused, {});
  constexpr auto unlimited = std::numeric_limits<std::uint64_t>::max();
  const std::string shown = "'" + files.shown(stack_piece_name) + "'";
  const std::vector<std::uint8_t> bytes = files.read(stack_piece_name, unlimited);
  std::vector<Layer> ready;
  try {
    const StackPiece piece = stackPieceOf(bytes);
    if (piece.layers != made.layers || piece.materials != stack_.materials.size() ||
        made.format != stack_.format || made.layout.width() != stack_.layout.width() ||
        made.layout.height() != stack_.layout.height())
      throw DataError("is not of a piece of this stack");
    expect(piece.layers);
    auto slice = made.slices.begin();
    for (int z = piece.layers.begin; z < piece.layers.end; ++z) {
      const auto voxels = piece.voxelsOf(z);
      Layer layer{z, {}, {}, {}, {voxels.begin(), voxels.end()}};
      for (; slice != made.slices.end() && slice->layer == z; ++slice) {
        layer.files.push_back({slice->file, slice->material, {}});
        layer.sha256.push_back(slice->sha256);
        layer.made.push_back(folder / slice->file);
      }
      if (layer.made.empty()) throw DataError("tells of a layer that has no slice");
      const bool is_blank =
          std::all_of(voxels.begin(), voxels.end(), [](auto count) { return count == 0; });
      if (!blank_.keep && is_blank) {
        ++waiting_;
      } else {
        keep(std::move(layer), ready);
      }
    }
    preview_.addPart(piece.preview);
  } catch (const DataError& error) {
    throw DataError(shown + " " + error.what() + "; make the piece again");
  }
  encodeAll(std::move(ready), {});
}

void StackWriter::release(int end, std::vector<Layer>& layers) {
  for (int z = end - std::exchange(waiting_, 0); z < end; ++z)
    layers.push_back({z, blankSlice(stack_.layout), {}, {}, {}});
}

// The layers are kept here, for TBB forgets what is on its way when one of the steps fails.
void StackWriter::encodeAll(std::vector<Layer> all, const Grids& grids) {
  std::size_t next = 0;
  const auto take = [&](tbb::flow_control& control) -> Layer* {
    if (next < all.size()) return &all[next++];
    control.stop();
    return nullptr;
  };
  const auto encode_one = [&](Layer* layer) {
    encode(*layer, grids);
    return layer;
  };
  const auto store_one = [&](Layer* layer) {
    store(*layer);
    *layer = {};
  };
  tbb::parallel_pipeline(
      std::size_t{2} * tbb::this_task_arena::max_concurrency(),
      tbb::make_filter<void, Layer*>(tbb::filter_mode::serial_in_order, take) &
          tbb::make_filter<Layer*, Layer*>(tbb::filter_mode::parallel, encode_one) &
          tbb::make_filter<Layer*, void>(tbb::filter_mode::serial_in_order, store_one));
}

const Manifest& StackWriter::finish() {
  if (!stack_.layers.empty() && known_.end == stack_.lattice.layers().end) {
    const int needed = std::clamp(blank_.minimum_layers - stack_.layers.size(), 0, waiting_);
    stack_.cropped_above = waiting_ - needed;
    waiting_ = needed;
    std::vector<Layer> blank;
    release(known_.end - stack_.cropped_above, blank);
    encodeAll(std::move(blank), {});
  } else {
    std::vector<Layer> blank;
    release(known_.end, blank);
    encodeAll(std::move(blank), {});
  }
  if (part_ == StackPart::piece) {
    finishPiece();
  } else {
    encoder_.finish(stack_, preview_.picture(), output_);
  }
  output_.complete();
  return stack_;
}

/// A piece is described by a manifest, whatever the format.
void StackWriter::finishPiece() {
  encoder_.SliceEncoder::finish(stack_, preview_.picture(), output_);
  piece_.layers = stack_.layers;
  piece_.materials = stack_.materials.size();
  piece_.preview = preview_.part();
  output_.write(stack_piece_name, bytesOf(piece_));
}

std::string StackWriter::nameOf(int z, int lowest) const {
  return names_.prefix + zeroPadded(names_.first + z - lowest, names_.digits);
}

void StackWriter::encode(Layer& layer, const Grids& grids) const {
  const std::string name = nameOf(layer.z, lowest_);
  if (!layer.made.empty()) {
    // A piece counts its slices from the bottom of the lattice.
    const std::string before = nameOf(layer.z, stack_.lattice.layers().begin);
    for (SliceFile& file : layer.files)
      file.name.replace(file.name.rfind('/') + 1, before.size(), name);
    return;
  }
  layer.voxels = countedVoxels(layer);
  layer.files = encoder_.encode({layer.z, name, layer.image, grids});
  for (const SliceFile& file : layer.files) layer.sha256.push_back(sha256Of(file.bytes));
}

std::vector<std::uint64_t> StackWriter::countedVoxels(const Layer& layer) const {
  std::vector<std::uint64_t> voxels(stack_.materials.size(), 0);
  for (std::uint32_t y = 0; y < layer.image.height; ++y) {
    std::uint32_t begin = 0;
    for (const Span& span : layer.image.row(y)) {
      if (span.value > voxels.size()) {
        throw DataError("layer " + std::to_string(layer.z) + " holds material " +
                        std::to_string(static_cast<std::int32_t>(span.value)) +
                        ", but the table of materials ends at " + std::to_string(voxels.size()));
      }
      if (span.value > 0) voxels[span.value - 1] += span.end - begin;
      begin = span.end;
    }
  }
  return voxels;
}

void StackWriter::store(Layer& layer) {
  if (stack_.layers.empty()) stack_.layers = {layer.z, layer.z};
  ++stack_.layers.end;
  for (std::size_t i = 0; i < layer.files.size(); ++i) {
    const SliceFile& file = layer.files[i];
    if (layer.made.empty()) {
      output_.write(file.name, file.bytes);
    } else {
      output_.copy(file.name, layer.made[i]);
    }
    stack_.slices.push_back({layer.z, file.name, layer.sha256[i], file.material});
  }
  for (std::size_t i = 0; i < layer.voxels.size(); ++i) stack_.voxels[i] += layer.voxels[i];
  if (part_ == StackPart::piece)
    piece_.voxels.insert(piece_.voxels.end(), layer.voxels.begin(), layer.voxels.end());
  if (!layer.made.empty()) return;
  preview_.add(layer.z, std::move(layer.image),
               std::accumulate(layer.voxels.begin(), layer.voxels.end(), std::uint64_t{0}));
}

}  // namespace vdbdither
