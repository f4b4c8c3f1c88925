#include "io/file/digest.h"

#include <new>

#include <openssl/evp.h>

namespace vdbdither {

struct Digest::Context {
  EVP_MD_CTX* handle = EVP_MD_CTX_new();

  Context() {
    if (!handle) throw std::bad_alloc();
    EVP_DigestInit_ex(handle, EVP_sha256(), nullptr);
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context() { EVP_MD_CTX_free(handle); }
};

Digest::Digest() : context_(std::make_unique<Context>()) {}
Digest::~Digest() = default;
Digest::Digest(Digest&&) noexcept = default;
Digest& Digest::operator=(Digest&&) noexcept = default;

void Digest::update(const void* data, std::size_t size) {
  EVP_DigestUpdate(context_->handle, data, size);
}

Digest::Value Digest::finish() {
  Value value{};
  EVP_DigestFinal_ex(context_->handle, value.data(), nullptr);
  EVP_DigestInit_ex(context_->handle, EVP_sha256(), nullptr);
  return value;
}

std::string hexText(const Digest::Value& value) {
  static constexpr char digits[] = "0123456789abcdef";
  std::string text;
  for (const std::uint8_t byte : value) {
    text += digits[byte >> 4];
    text += digits[byte & 15];
  }
  return text;
}

std::string sha256Of(std::span<const std::uint8_t> bytes) {
  Digest digest;
  digest.update(bytes.data(), bytes.size());
  return hexText(digest.finish());
}

}  // namespace vdbdither
