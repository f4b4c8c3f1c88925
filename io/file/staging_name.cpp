#include "io/file/staging_name.h"

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <span>
#include <unistd.h>

#include "io/file/digest.h"

namespace vdbdither {

namespace fs = std::filesystem;

namespace {

std::string digestText(const std::string& text, std::size_t digits) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(text.data());
  return sha256Of({bytes, text.size()}).substr(0, digits);
}

/// Tells apart machines and containers that share a folder: a process number means something in
/// one of them only.
const std::string& machine() {
  static const std::string name = [] {
    std::array<char, 256> host{};
    ::gethostname(host.data(), host.size() - 1);
    std::error_code none;
    const fs::path processes = fs::read_symlink("/proc/self/ns/pid", none);
    return digestText(host.data() + processes.string(), 8);
  }();
  return name;
}

/// The beginning that the target gives. Long names are cut within no character of UTF-8.
std::string prefixOf(const fs::path& target) {
  constexpr std::size_t long_name = 64;
  constexpr std::size_t kept = 40;
  std::string name = target.filename().string();
  if (name.size() > long_name) {
    std::size_t end = kept;
    while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xc0) == 0x80) --end;
    name = name.substr(0, end) + "~" + digestText(name, 16);
  }
  return "." + name + ".partial-";
}

bool hasEnded(pid_t process) { return ::kill(process, 0) != 0 && errno == ESRCH; }

}  // namespace

fs::path stagingPath(const fs::path& target) {
  return target.parent_path() / (prefixOf(target) + machine() + "-" + std::to_string(::getpid()));
}

std::optional<StagingName> parseStagingName(const fs::path& target, const std::string& name) {
  const std::string prefix = prefixOf(target);
  const std::size_t dash = prefix.size() + machine().size();
  if (!name.starts_with(prefix) || name.size() <= dash || name[dash] != '-') return std::nullopt;
  pid_t process = 0;
  const auto [end, error] =
      std::from_chars(name.data() + dash + 1, name.data() + name.size(), process);
  if (error != std::errc() || process <= 0) return std::nullopt;
  const std::string_view rest(end, static_cast<std::size_t>(name.data() + name.size() - end));
  if (!rest.empty() && rest.front() != '.' && rest.front() != '-') return std::nullopt;
  const bool here = name.compare(prefix.size(), machine().size(), machine()) == 0;
  return StagingName{here && (process == ::getpid() || hasEnded(process)), rest == put_aside};
}

}  // namespace vdbdither
