#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace vdbdither {

/// SHA-256 of bytes as they come (FIPS 180-4, by OpenSSL).
class Digest {
 public:
  using Value = std::array<std::uint8_t, 32>;

  Digest();
  ~Digest();
  Digest(Digest&&) noexcept;
  Digest& operator=(Digest&&) noexcept;

  void update(const void* data, std::size_t size);
  /// The digest of everything so far; further updates start anew.
  Value finish();

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

/// Lower-case hexadecimal.
std::string hexText(const Digest::Value& value);

/// The digest of `bytes` as that text.
std::string sha256Of(std::span<const std::uint8_t> bytes);

}  // namespace vdbdither
