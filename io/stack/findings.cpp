#include "io/stack/findings.h"

#include <utility>

#include "vdbdither/model/printable.h"

namespace vdbdither {

void Findings::count(Finding::Severity severity, std::uint64_t number) {
  if (severity == Finding::Severity::error) errors_ += number;
  if (severity == Finding::Severity::warning) warnings_ += number;
}

void Findings::add(Finding finding) {
  count(finding.severity, 1);
  Kind& kind = kinds_[finding.id];
  if (kind.all++ == 0) order_.push_back(finding.id);
  if (kind.kept.size() < most_of_kind) kind.kept.push_back(std::move(finding));
}

void Findings::error(std::string_view id, std::string text, std::string file) {
  add({std::string(id), Finding::Severity::error, std::move(text), std::move(file)});
}

void Findings::warning(std::string_view id, std::string text, std::string file) {
  add({std::string(id), Finding::Severity::warning, std::move(text), std::move(file)});
}

void Findings::leaveOut(std::string_view id, Finding::Severity severity, std::uint64_t count) {
  if (count == 0) return;
  this->count(severity, count);
  const auto [kind, is_new] = kinds_.try_emplace(std::string(id));
  if (is_new) order_.emplace_back(id);
  kind->second.all += count;
}

std::vector<Finding> Findings::kept() const {
  std::vector<Finding> all;
  for (const std::string& id : order_) {
    const std::vector<Finding>& kept = kinds_.find(id)->second.kept;
    all.insert(all.end(), kept.begin(), kept.end());
  }
  return all;
}

std::uint64_t Findings::leftOut(std::string_view id) const {
  const auto kind = kinds_.find(id);
  return kind == kinds_.end() ? 0 : kind->second.all - kind->second.kept.size();
}

std::string grouped(std::uint64_t number) {
  std::string text = std::to_string(number);
  for (std::size_t at = text.size(); at > 3;) text.insert(at -= 3, ",");
  return text;
}

std::string counted(std::uint64_t number, const std::string& one, const std::string& several) {
  return grouped(number) + " " + (number == 1 ? one : several.empty() ? one + "s" : several);
}

std::string_view nameOf(Finding::Severity severity) {
  switch (severity) {
    case Finding::Severity::error:
      return "error";
    case Finding::Severity::warning:
      return "warning";
    case Finding::Severity::note:
      break;
  }
  return "note";
}

std::string textOf(const Finding& finding) {
  std::string place;
  const auto part = [&](const std::string& text) { place += (place.empty() ? "" : ", ") + text; };
  if (!finding.file.empty()) part("'" + finding.file + "'");
  if (finding.layer) part("layer " + std::to_string(*finding.layer));
  if (finding.pixel) {
    part("column " + std::to_string((*finding.pixel)[0]));
    part("row " + std::to_string((*finding.pixel)[1]));
  }
  return printable(std::string(nameOf(finding.severity)) + ": " +
                   (place.empty() ? "" : place + ": ") + finding.text) +
         " [" + finding.id + "]";
}

}  // namespace vdbdither
