#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "vdbdither/model/span_image.h"

namespace vdbdither {

/// Keeps images in a file without a name until they are needed again: some two bytes for a span.
class SpanSpool {
 public:
  /// @param folder  on the disk to use
  /// Throws DataError.
  explicit SpanSpool(const std::filesystem::path& folder);

  /// Throws DataError where the disk is full.
  void add(const SpanImage& image);

  [[nodiscard]] std::size_t size() const { return starts_.size(); }

  /// Returns the image that was added as number `index`. Throws DataError.
  [[nodiscard]] SpanImage read(std::size_t index) const;

 private:
  struct Closer {
    void operator()(const int* descriptor) const;
  };

  std::filesystem::path folder_;
  std::unique_ptr<int, Closer> descriptor_;
  std::vector<std::uint64_t> starts_;
  std::uint64_t end_ = 0;
};

}  // namespace vdbdither
