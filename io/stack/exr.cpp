#include "io/image/exr.h"

#include <algorithm>
#include <array>
#include <utility>

#include "io/stack/slice_format.h"
#include "vdbdither/model/find_grid.h"
#include "vdbdither/model/openvdb.h"

namespace vdbdither {

namespace {

constexpr std::array<Choice<ExrPacking>, 5> packings{
    {{ExrPacking::none, "none", "Uncompressed"},
     {ExrPacking::rle, "rle", "Run lengths of each row"},
     {ExrPacking::zips, "zips", "Deflate of each row"},
     {ExrPacking::zip, "zip", "Deflate of 16 rows together"},
     {ExrPacking::piz, "piz", "Wavelets of 32 rows together"}}};

class ExrSlices : public SliceEncoder {
 public:
  void declare(Options& options) override {
    options.choice("exr-packing", packing_, packings, "Lossless compression of exr");
    options.integer("exr-tile", tile_, {0, 4096}, "Edge of the tiles of exr; 0 stores rows");
    options.flag("exr-half", half_, "Stores the distances of exr in 16 bits, not 32");
  }

  void plan(const Manifest& manifest, const Grids& grids) override {
    SliceEncoder::plan(manifest, grids);
    constexpr std::size_t most_in_half = 2048;
    channels_ = {{"material", manifest.materials.size() <= most_in_half}};
    if (grids.contains(surface_grid)) {
      findGrid<openvdb::FloatGrid>(grids, surface_grid);
      channels_.push_back({"distance", half_});
    }
    if (grids.contains(normal_grid)) {
      findGrid<openvdb::Vec3SGrid>(grids, normal_grid);
      for (const char* name : {"N.x", "N.y", "N.z"}) channels_.push_back({name, true});
    }
  }

  [[nodiscard]] std::vector<std::string> reads() const override {
    return {surface_grid, normal_grid};
  }

  [[nodiscard]] std::vector<SliceFile> encode(const SliceLayer& layer) const override {
    const auto fill = [&](std::uint32_t row, std::size_t channel, std::span<float> values) {
      const std::string& name = channels_[channel].name;
      if (name == "material") {
        fillFromSpans(layer.image.row(row), values);
      } else if (name == "distance") {
        fillFromGrid(*findGrid<openvdb::FloatGrid>(layer.grids, surface_grid), layer.z, row, values,
                     [](float value) { return value; });
      } else {
        const int axis = name.back() - 'x';
        fillFromGrid(*findGrid<openvdb::Vec3SGrid>(layer.grids, normal_grid), layer.z, row, values,
                     [axis](const openvdb::Vec3s& normal) { return normal[axis]; });
      }
    };
    const ExrFormat format{pitchMm().x() / pitchMm().y(), packing_, tile_};
    const SliceLayout& layout = stack().layout;
    return {{layer.name + ".exr", "",
             encodeExr(layout.width(), layout.height(), format, channels_, fill)}};
  }

 private:
  static void fillFromSpans(std::span<const Span> spans, std::span<float> values) {
    std::uint32_t begin = 0;
    for (const Span& span : spans) {
      std::fill(values.begin() + begin, values.begin() + span.end, static_cast<float>(span.value));
      begin = span.end;
    }
  }

  /// The values of `grid` along a row of the layer `z`, and its background in the padding.
  template <class Grid, class Convert>
  void fillFromGrid(const Grid& grid, int z, std::uint32_t row, std::span<float> values,
                    const Convert& convert) const {
    const SliceLayout& layout = stack().layout;
    const openvdb::CoordBBox& box = layout.box;
    std::fill(values.begin(), values.end(), convert(grid.background()));
    const int from_top = static_cast<int>(row) - layout.padding;
    if (from_top < 0 || from_top >= box.dim().y()) return;
    const auto accessor = grid.getConstAccessor();
    openvdb::Coord at(0, layout.flip_y ? box.min().y() + from_top : box.max().y() - from_top, z);
    for (int i = 0; i < box.dim().x(); ++i) {
      at.x() = layout.flip_x ? box.max().x() - i : box.min().x() + i;
      values[layout.padding + i] = convert(accessor.getValue(at));
    }
  }

  ExrPacking packing_ = ExrPacking::zips;
  int tile_ = 0;
  bool half_ = false;
  std::vector<ExrChannel> channels_;
};

SpanImage decodeMaterials(std::span<const std::uint8_t> bytes, const SizeCheck& check) {
  return decodeExr(bytes, "material", check);
}

}  // namespace

extern const SliceFormat exr;
const SliceFormat exr{.name = "exr",
                      .summary = "Material index, and distance and normal where there are any",
                      .ending = ".exr",
                      .pixel = SlicePixel::index,
                      .encoder = makeSliceEncoder<ExrSlices>,
                      .decode = decodeMaterials,
                      .bytes_per_leaf = 1300};

}  // namespace vdbdither
