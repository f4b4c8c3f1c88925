#include "ops/kernels/measure/span_difference.h"

#include <algorithm>

namespace vdbdither {

void SpanDifference::add(int z, const SpanImage& image, const SpanImage& expected) {
  DifferingLayer layer{z, 0, {}};
  for (std::uint32_t y = 0; y < image.height; ++y) {
    const std::span<const Span> is = image.row(y);
    const std::span<const Span> should = expected.row(y);
    std::uint32_t begin = 0;
    for (std::size_t i = 0, j = 0; i < is.size() && j < should.size();) {
      const std::uint32_t end = std::min(is[i].end, should[j].end);
      if (is[i].value != should[j].value) {
        if (layer.pixels == 0) layer.first = {begin, y};
        layer.pixels += end - begin;
        tallies_[is[i].value].extra += end - begin;
        tallies_[should[j].value].missing += end - begin;
      }
      begin = end;
      if (is[i].end == end) ++i;
      if (should[j].end == end) ++j;
    }
  }
  if (layer.pixels == 0) return;
  pixels_ += layer.pixels;
  ++layers_;
  if (first_.size() < listed) first_.push_back(layer);
}

void SpanDifference::add(const SpanDifference& above) {
  pixels_ += above.pixels_;
  layers_ += above.layers_;
  for (const auto& [value, tally] : above.tallies_) {
    tallies_[value].missing += tally.missing;
    tallies_[value].extra += tally.extra;
  }
  for (const DifferingLayer& layer : above.first_) {
    if (first_.size() < listed) first_.push_back(layer);
  }
}

}  // namespace vdbdither
