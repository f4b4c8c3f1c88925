#include "io/stack/stack_preview.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include <tbb/parallel_for.h>

#include "io/file/little_endian.h"
#include "io/image/png_spans.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {

namespace {

constexpr int largest_width = 1200;
constexpr int largest_height = 1000;
constexpr int margin = 20;
constexpr int fineness = 2;  ///< rays per pixel along each side
constexpr std::array<float, 3> background = {112, 120, 132};

int pixels(double length_mm, double pixel_mm) {
  return std::max(1, static_cast<int>(std::lround(length_mm / pixel_mm)));
}

}  // namespace

StackPreview::StackPreview(const openvdb::Vec3d& pitch_mm, std::uint32_t width,
                           std::uint32_t height, ZRange layers, std::vector<std::uint32_t> palette)
    : pitch_mm_(pitch_mm),
      width_(width),
      height_(height),
      layers_(layers),
      palette_(std::move(palette)) {
  const double width_mm = width * pitch_mm.x();
  const double front_mm = layers.size() * pitch_mm.z();
  const double slice_mm = height * pitch_mm.y();
  // As large as the picture allows, but a voxel need not be more than eight pixels.
  pixel_mm_ = std::max({2 * width_mm / (largest_width - 3 * margin - 2),
                        std::max(front_mm, slice_mm) / (largest_height - 2 * margin - 1),
                        std::max({pitch_mm.x(), pitch_mm.y(), pitch_mm.z()}) / 8});
  columns_ = pixels(width_mm, pixel_mm_);
  front_rows_ = pixels(front_mm, pixel_mm_);
  slice_rows_ = pixels(slice_mm, pixel_mm_);
  const int rays = columns_ * fineness;
  hits_.assign(static_cast<std::size_t>(rays) * front_rows_ * fineness, Hit{0, 0});
  next_ray_.resize(rays + 1);
  first_ray_.resize(width + 1);
  int ray = 0;
  for (std::uint32_t x = 0; x <= width; ++x) {
    while (ray < rays && (ray + 0.5) / rays * width < x) ++ray;
    first_ray_[x] = ray;
  }
}

void StackPreview::add(int z, SpanImage&& slice, std::uint64_t filled) {
  if (filled == 0) return;
  const int rows = front_rows_ * fineness;
  const int rays = columns_ * fineness;
  const double rows_per_layer = static_cast<double>(rows) / layers_.size();
  const int from = static_cast<int>(std::ceil((z - layers_.begin) * rows_per_layer - 0.5));
  const int to = static_cast<int>(std::ceil((z + 1 - layers_.begin) * rows_per_layer - 0.5));
  for (int row = std::max(0, from); row < std::min(rows, to); ++row) {
    Hit* hits = hits_.data() + static_cast<std::size_t>(rows - 1 - row) * rays;
    if (row == std::max(0, from)) {
      look(slice, hits);
    } else {
      std::copy_n(hits + rays, rays, hits);
    }
  }
  if (filled > fullest_count_) {
    fullest_count_ = filled;
    fullest_ = std::move(slice);
  }
}

std::vector<std::uint8_t> StackPreview::part() const {
  const std::size_t rays = static_cast<std::size_t>(columns_) * fineness;
  std::vector<std::uint8_t> bytes;
  std::vector<std::size_t> rows;
  for (std::size_t row = 0; row < hits_.size() / rays; ++row) {
    const Hit* hits = hits_.data() + row * rays;
    if (std::any_of(hits, hits + rays, [](const Hit& hit) { return hit.value != 0; }))
      rows.push_back(row);
  }
  putLittleEndian(bytes, rows.size(), 4);
  for (const std::size_t row : rows) {
    putLittleEndian(bytes, row, 4);
    for (std::size_t ray = row * rays; ray < (row + 1) * rays; ++ray) {
      putLittleEndian(bytes, std::bit_cast<std::uint32_t>(hits_[ray].depth_mm), 4);
      putLittleEndian(bytes, hits_[ray].value, 4);
    }
  }
  putLittleEndian(bytes, fullest_count_, 8);
  if (fullest_count_ == 0) return bytes;
  for (std::uint32_t y = 0; y < fullest_.height; ++y) {
    putLittleEndian(bytes, fullest_.row(y).size(), 4);
    for (const Span& span : fullest_.row(y)) {
      putLittleEndian(bytes, span.end, 4);
      putLittleEndian(bytes, span.value, 4);
    }
  }
  return bytes;
}

void StackPreview::addPart(std::span<const std::uint8_t> bytes) {
  LittleEndianReader reader(bytes);
  const auto number = [&](int size) { return reader.take(size); };
  const auto refuse = [] { throw DataError("is not of a piece of this stack"); };
  const auto value = [&] {
    const auto index = static_cast<std::uint32_t>(number(4));
    if (index >= palette_.size()) refuse();
    return index;
  };
  const std::size_t rays = static_cast<std::size_t>(columns_) * fineness;
  for (std::uint64_t rows = number(4); rows > 0; --rows) {
    const std::uint64_t row = number(4);
    if (row >= hits_.size() / rays) refuse();
    for (std::size_t ray = row * rays; ray < (row + 1) * rays; ++ray) {
      hits_[ray].depth_mm = std::bit_cast<float>(static_cast<std::uint32_t>(number(4)));
      hits_[ray].value = value();
    }
  }
  const std::uint64_t count = number(8);
  if (count > 0) {
    SpanImage slice{width_, height_, {0}, {}};
    for (std::uint32_t y = 0; y < height_; ++y) {
      std::uint32_t begin = 0;
      for (std::uint64_t spans = number(4); spans > 0; --spans) {
        const auto end = static_cast<std::uint32_t>(number(4));
        if (end <= begin || end > width_) refuse();
        slice.spans.push_back({begin = end, value()});
      }
      if (begin != width_) refuse();
      slice.row_begin.push_back(slice.spans.size());
    }
    if (count > fullest_count_) {
      fullest_count_ = count;
      fullest_ = std::move(slice);
    }
  }
  if (!reader.rest().empty()) refuse();
}

void StackPreview::look(const SpanImage& slice, Hit* hits) {
  std::iota(next_ray_.begin(), next_ray_.end(), 0U);
  const auto next_ray = [&](std::uint32_t ray) {
    while (next_ray_[ray] != ray) ray = next_ray_[ray] = next_ray_[next_ray_[ray]];
    return ray;
  };
  for (std::uint32_t y = slice.height; y-- > 0;) {
    std::uint32_t begin = 0;
    for (const Span& span : slice.row(y)) {
      if (span.value) {
        const std::uint32_t end = first_ray_[span.end];
        for (std::uint32_t ray = next_ray(first_ray_[begin]); ray < end; ray = next_ray(ray)) {
          hits[ray] = {static_cast<float>((slice.height - 1 - y) * pitch_mm_.y()), span.value};
          next_ray_[ray] = ray + 1;
        }
      }
      begin = span.end;
    }
  }
}

/// What a pixel of the front view shows.
struct StackPreview::Surface {
  float depth_mm = 0;
  float cover = 0;
  Pixel colour{0, 0, 0};
};

double StackPreview::stepMm() const {
  return std::max({pitch_mm_.x(), pitch_mm_.y(), pitch_mm_.z(), pixel_mm_});
}

std::vector<StackPreview::Surface> StackPreview::surfaces() const {
  const int rays = columns_ * fineness;
  const double step_mm = stepMm();
  std::vector<Surface> surface(static_cast<std::size_t>(columns_) * front_rows_);
  for (int row = 0; row < front_rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      Surface& pixel = surface[static_cast<std::size_t>(row) * columns_ + column];
      std::array<Hit, std::size_t{fineness} * fineness> hits;
      float nearest_mm = std::numeric_limits<float>::infinity();
      for (int i = 0; i < fineness * fineness; ++i) {
        const int ray = column * fineness + i % fineness;
        hits[i] = hits_[static_cast<std::size_t>(row * fineness + i / fineness) * rays + ray];
        if (hits[i].value) nearest_mm = std::min(nearest_mm, hits[i].depth_mm);
      }
      // At an outline the rays of a pixel meet surfaces far apart; the nearest gives the slope.
      float near_rays = 0;
      for (const Hit& hit : hits) {
        if (!hit.value) continue;
        const std::uint32_t colour = palette_[hit.value];
        pixel.colour.red += static_cast<float>(colour & 255);
        pixel.colour.green += static_cast<float>(colour >> 8 & 255);
        pixel.colour.blue += static_cast<float>(colour >> 16 & 255);
        pixel.cover += 1;
        if (hit.depth_mm > nearest_mm + 2 * step_mm) continue;
        pixel.depth_mm += hit.depth_mm;
        near_rays += 1;
      }
      if (pixel.cover > 0) {
        pixel.depth_mm /= near_rays;
        for (float* channel : {&pixel.colour.red, &pixel.colour.green, &pixel.colour.blue}) {
          *channel /= pixel.cover;
        }
      }
      pixel.cover /= fineness * fineness;
    }
  }
  return surface;
}

std::vector<StackPreview::Pixel> StackPreview::front() const {
  const std::vector<Surface> surface = surfaces();
  std::vector<Pixel> result(surface.size());
  tbb::parallel_for(0, front_rows_, [&](int row) {
    for (int column = 0; column < columns_; ++column) {
      result[static_cast<std::size_t>(row) * columns_ + column] = shaded(surface, row, column);
    }
  });
  return result;
}

StackPreview::Pixel StackPreview::shaded(const std::vector<Surface>& surface, int row,
                                         int column) const {
  const Surface& here = surface[static_cast<std::size_t>(row) * columns_ + column];
  if (here.cover <= 0) return {background[0], background[1], background[2]};
  // The surface is a staircase of voxels: its slope is that of a plane fitted to the pixels around
  // that belong to it.
  const double step_mm = stepMm();
  const int radius = std::clamp(static_cast<int>(std::ceil(2 * step_mm / pixel_mm_)), 2, 8);
  double n = 0, x = 0, z = 0, d = 0, xx = 0, xz = 0, zz = 0, xd = 0, zd = 0;
  for (int v = std::max(-radius, -row); v <= std::min(radius, front_rows_ - 1 - row); ++v) {
    for (int u = std::max(-radius, -column); u <= std::min(radius, columns_ - 1 - column); ++u) {
      const Surface& near = surface[static_cast<std::size_t>(row + v) * columns_ + column + u];
      const double depth = near.depth_mm - here.depth_mm;
      const double distance = std::sqrt(u * u + v * v);
      if (near.cover <= 0 || distance > radius ||
          std::abs(depth) > 4 * pixel_mm_ * distance + 2 * step_mm)
        continue;
      const double weight = near.cover * (radius + 1 - distance);
      n += weight, x += weight * u, z -= weight * v, d += weight * depth;
      xx += weight * u * u, xz -= weight * u * v, zz += weight * v * v;
      xd += weight * u * depth, zd -= weight * v * depth;
    }
  }
  xx -= x * x / n, xz -= x * z / n, zz -= z * z / n, xd -= x * d / n, zd -= z * d / n;
  const double determinant = xx * zz - xz * xz;
  double slope_x = 0;
  double slope_z = 0;
  if (determinant > 1e-6 * n * n) {
    slope_x = (xd * zz - zd * xz) / determinant / pixel_mm_;
    slope_z = (zd * xx - xd * xz) / determinant / pixel_mm_;
  }
  // Outward normal (slope_x, -1, slope_z); a key light from the upper left in front, a fill
  // from the right.
  const double length = std::sqrt(slope_x * slope_x + 1 + slope_z * slope_z);
  const double key = std::max(0.0, (-0.5 * slope_x + 0.62 + 0.605 * slope_z) / length);
  const double fill = std::max(0.0, (0.8 * slope_x + 0.6) / length);
  const auto light = static_cast<float>(std::min(1.0, 0.14 + 0.8 * key + 0.14 * fill));
  const auto blend = [&](float colour, float behind) {
    return behind + here.cover * ((8 + colour * 0.97F) * light - behind);
  };
  return {blend(here.colour.red, background[0]), blend(here.colour.green, background[1]),
          blend(here.colour.blue, background[2])};
}

std::vector<StackPreview::Pixel> StackPreview::slice() const {
  std::vector<Pixel> result(static_cast<std::size_t>(columns_) * slice_rows_, Pixel{0, 0, 0});
  std::vector<Pixel> line(columns_);
  // Every pixel is the mean of what it covers: `spread` gives each pixel between two positions its
  // share.
  const auto spread = [](double begin, double end, int count, const auto& give) {
    for (int i = static_cast<int>(begin); i < count && i < end; ++i) {
      give(i, static_cast<float>(std::min(end, i + 1.0) - std::max<double>(begin, i)));
    }
  };
  const double columns_per_voxel = static_cast<double>(columns_) / width_;
  const double rows_per_voxel = static_cast<double>(slice_rows_) / height_;
  for (std::uint32_t y = 0; y < height_; ++y) {
    std::fill(line.begin(), line.end(), Pixel{0, 0, 0});
    std::uint32_t begin = 0;
    const std::array<Span, 1> blank = {Span{width_, 0}};
    for (const Span& span :
         fullest_.spans.empty() ? std::span<const Span>(blank) : fullest_.row(y)) {
      const std::uint32_t colour = palette_[span.value];
      const Pixel pixel = span.value ? Pixel{static_cast<float>(colour & 255),
                                             static_cast<float>(colour >> 8 & 255),
                                             static_cast<float>(colour >> 16 & 255)}
                                     : Pixel{background[0], background[1], background[2]};
      spread(begin * columns_per_voxel, span.end * columns_per_voxel, columns_,
             [&](int column, float share) {
               line[column].red += share * pixel.red;
               line[column].green += share * pixel.green;
               line[column].blue += share * pixel.blue;
             });
      begin = span.end;
    }
    spread(y * rows_per_voxel, (y + 1) * rows_per_voxel, slice_rows_, [&](int row, float share) {
      Pixel* to = result.data() + static_cast<std::size_t>(row) * columns_;
      for (int column = 0; column < columns_; ++column) {
        to[column].red += share * line[column].red;
        to[column].green += share * line[column].green;
        to[column].blue += share * line[column].blue;
      }
    });
  }
  return result;
}

SpanImage StackPreview::picture() const {
  const std::array<std::pair<std::vector<Pixel>, int>, 2> panels = {
      std::pair{front(), front_rows_}, std::pair{slice(), slice_rows_}};
  SpanImage image;
  image.width = static_cast<std::uint32_t>(2 * columns_ + 3 * margin);
  image.height = static_cast<std::uint32_t>(std::max(front_rows_, slice_rows_) + 2 * margin);
  image.row_begin.push_back(0);
  const auto byte = [](float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F)));
  };
  for (std::uint32_t y = 0; y < image.height; ++y) {
    std::uint32_t x = 0;
    const auto put = [&](const Pixel& pixel) {
      image.spans.push_back({++x, rgba(byte(pixel.red), byte(pixel.green), byte(pixel.blue))});
    };
    const Pixel behind{background[0], background[1], background[2]};
    const auto put_margin = [&] {
      for (int i = 0; i < margin; ++i) put(behind);
    };
    put_margin();
    for (const auto& [panel, rows] : panels) {
      // Both stand on the bottom margin.
      const int row = static_cast<int>(y) - (static_cast<int>(image.height) - margin - rows);
      for (int column = 0; column < columns_; ++column) {
        put(row < 0 || row >= rows ? behind
                                   : panel[static_cast<std::size_t>(row) * columns_ + column]);
      }
      put_margin();
    }
    image.row_begin.push_back(image.spans.size());
  }
  return image;
}

}  // namespace vdbdither
