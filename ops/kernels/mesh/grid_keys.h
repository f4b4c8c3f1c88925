#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include <openvdb/math/Coord.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

namespace vdbdither {

/// A place on a grid, ordered by z, y, x. Five more bits fit on its right.
using Key = std::uint64_t;

constexpr int key_bits = 19;
constexpr int key_offset = 1 << (key_bits - 1);

/// Packs indices from −2^18 to 2^18 − 1.
inline Key keyOf(const openvdb::Coord& ijk) {
  const auto part = [](int index) { return static_cast<Key>(index + key_offset); };
  return part(ijk.z()) << 2 * key_bits | part(ijk.y()) << key_bits | part(ijk.x());
}
inline openvdb::Coord coordOf(Key key) {
  const auto part = [](Key bits) {
    return static_cast<int>(bits & ((1U << key_bits) - 1)) - key_offset;
  };
  return {part(key), part(key >> key_bits), part(key >> 2 * key_bits)};
}

/// A hash map from keys to millions of values, by open addressing; it cannot be iterated.
template <class T>
class KeyMap {
 public:
  [[nodiscard]] const T* find(Key key) const {
    if (slots_.empty()) return nullptr;
    const Slot& slot = slots_[placeOf(key)];
    return slot.key == key ? &slot.value : nullptr;
  }
  [[nodiscard]] bool contains(Key key) const { return find(key) != nullptr; }
  [[nodiscard]] const T& at(Key key) const { return *find(key); }
  /// Adds `value` if the key is new. Returns the value of the key, and whether it was added.
  std::pair<T&, bool> add(Key key, const T& value) {
    if (2 * count_ >= slots_.size()) grow();
    Slot& slot = slots_[placeOf(key)];
    const bool is_new = slot.key != key;
    if (is_new) {
      slot = {key, value};
      ++count_;
    }
    return {slot.value, is_new};
  }

 private:
  static constexpr Key empty = ~Key{0};
  struct Slot {
    Key key = empty;
    T value{};
  };

  /// Returns the slot of the key, or the one to put it into.
  [[nodiscard]] std::size_t placeOf(Key key) const {
    Key scattered = key * 0x9e3779b97f4a7c15ULL;
    scattered ^= scattered >> 32;
    std::size_t place = scattered & (slots_.size() - 1);
    while (slots_[place].key != key && slots_[place].key != empty)
      place = (place + 1) & (slots_.size() - 1);
    return place;
  }
  void grow() {
    std::vector<Slot> old(std::max<std::size_t>(1024, 2 * slots_.size()));
    old.swap(slots_);
    for (const Slot& slot : old)
      if (slot.key != empty) slots_[placeOf(slot.key)] = slot;
  }

  std::vector<Slot> slots_;
  std::size_t count_ = 0;
};

/// Erases the values for which `is_done` is true; it is called on all threads.
template <class T, class IsDone>
void eraseAll(std::vector<T>& values, const IsDone& is_done) {
  std::vector<char> done(values.size());
  tbb::parallel_for(std::size_t{0}, values.size(),
                    [&](std::size_t i) { done[i] = is_done(values[i]) ? 1 : 0; });
  std::size_t kept = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (done[i] == 0) values[kept++] = values[i];
  values.resize(kept);
}

template <class T>
void sortUnique(std::vector<T>& values) {
  tbb::parallel_sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

/// Sorts, and keeps the first of each key.
template <class T>
void sortUniqueKeys(std::vector<std::pair<Key, T>>& values) {
  tbb::parallel_sort(values.begin(), values.end());
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  values.erase(std::unique(values.begin(), values.end(), same), values.end());
}

}  // namespace vdbdither
