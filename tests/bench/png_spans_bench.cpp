// Slices of 2857 x 1416 pixels as RGBA PNG: from spans, and by the general encoders from a buffer
// of pixels. items_per_second are pixels, that is voxels of the bounding box; `bytes` is the size
// of the file.

#include <functional>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>
#include <png.h>
#include <spng.h>

#include "io/image/png_spans.h"
#include "tests/support/span_images.h"

namespace vdbdither {
namespace {

constexpr int width = 2857;
constexpr int height = 1416;
const std::vector<std::uint32_t> palette = {rgba(0, 0, 0),     rgba(240, 240, 240),
                                            rgba(26, 26, 29),  rgba(0, 90, 158),
                                            rgba(166, 33, 98), rgba(200, 189, 3)};

SpanImage noise(std::uint32_t colours) {
  std::mt19937 random(1);
  return test::spanImage(width, height, [&](int, int) { return random() % colours; });
}

const SpanImage& slice(int kind) {
  static const std::vector<SpanImage> slices = {
      test::spanImage(width, height, [](int, int) { return 0U; }),
      test::ditheredDisc(width, height, 1e-9, 1),
      test::ditheredDisc(width, height, 6, 1),
      test::ditheredDisc(width, height, 100, 1),
      noise(2),
      noise(6)};
  return slices[kind];
}

const char* const names[] = {"blank",      "disc",      "disc, rim of 6", "disc, rim of 100",
                             "noise of 2", "noise of 6"};

std::vector<std::uint32_t> pixelsOf(const SpanImage& image) {
  std::vector<std::uint32_t> pixels;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (const Span& span : image.row(y))
      pixels.resize(std::size_t{y} * width + span.end, palette[span.value]);
  }
  return pixels;
}

void report(benchmark::State& state, std::size_t bytes) {
  state.SetLabel(names[state.range(0)]);
  state.SetItemsProcessed(state.iterations() * width * height);
  state.counters["bytes"] = static_cast<double>(bytes);
}

void fromSpans(benchmark::State& state) {
  const SpanImage& image = slice(static_cast<int>(state.range(0)));
  std::size_t bytes = 0;
  for (auto _ : state) bytes = encodePng(image, {PngPixels::rgba8, palette, 0.042, 0.084}).size();
  state.counters["spans"] = static_cast<double>(image.spans.size());
  report(state, bytes);
}

void byLibpng(benchmark::State& state) {
  const std::vector<std::uint32_t> pixels = pixelsOf(slice(static_cast<int>(state.range(0))));
  std::size_t bytes = 0;
  for (auto _ : state) {
    bytes = 0;
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(
        png, &bytes,
        [](png_structp writer, png_bytep, std::size_t size) {
          *static_cast<std::size_t*>(png_get_io_ptr(writer)) += size;
        },
        nullptr);
    png_set_compression_level(png, static_cast<int>(state.range(1)));
    png_set_IHDR(png, info, width, height, 8, PNG_COLOR_TYPE_RGBA, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    for (int y = 0; y < height; ++y) {
      png_write_row(png,
                    reinterpret_cast<png_const_bytep>(pixels.data() + std::size_t{1} * y * width));
    }
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
  }
  report(state, bytes);
}

void bySpng(benchmark::State& state) {
  const std::vector<std::uint32_t> pixels = pixelsOf(slice(static_cast<int>(state.range(0))));
  std::size_t bytes = 0;
  for (auto _ : state) {
    spng_ctx* context = spng_ctx_new(SPNG_CTX_ENCODER);
    spng_set_option(context, SPNG_ENCODE_TO_BUFFER, 1);
    spng_set_option(context, SPNG_IMG_COMPRESSION_LEVEL, static_cast<int>(state.range(1)));
    spng_ihdr header{width, height, 8, SPNG_COLOR_TYPE_TRUECOLOR_ALPHA, 0, 0, 0};
    spng_set_ihdr(context, &header);
    spng_encode_image(context, pixels.data(), pixels.size() * 4, SPNG_FMT_PNG,
                      SPNG_ENCODE_FINALIZE);
    int failed = 0;
    free(spng_get_png_buffer(context, &bytes, &failed));
    spng_ctx_free(context);
  }
  report(state, bytes);
}

BENCHMARK(fromSpans)->DenseRange(0, 5)->Unit(benchmark::kMicrosecond);
BENCHMARK(byLibpng)
    ->ArgsProduct({{0, 1, 2, 3, 4, 5}, {1, 6}})
    ->Unit(benchmark::kMicrosecond)
    ->Iterations(1);
BENCHMARK(bySpng)
    ->ArgsProduct({{0, 1, 2, 3, 4, 5}, {1}})
    ->Unit(benchmark::kMicrosecond)
    ->Iterations(1);

}  // namespace
}  // namespace vdbdither

BENCHMARK_MAIN();
