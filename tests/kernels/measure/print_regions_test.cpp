#include "ops/kernels/measure/print_regions.h"

#include <array>
#include <map>
#include <random>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/span_images.h"

namespace vdbdither {

void PrintTo(const Region& region, std::ostream* out) {
  *out << region.voxels << " voxels from layer " << region.layer << ", row " << region.row
       << ", column " << region.column;
}

namespace {

using testing::ElementsAre;
using testing::IsEmpty;

/// Rows of a layer, printed where not '.', from the lowest layer on.
using Drawing = std::vector<std::vector<std::string>>;

PrintFindings findingsOf(const Drawing& drawing, std::size_t together = 3) {
  std::vector<SpanImage> images;
  images.reserve(drawing.size());
  for (const auto& rows : drawing) {
    images.push_back(test::spanImage(
        static_cast<int>(rows[0].size()), static_cast<int>(rows.size()), [&](int x, int y) {
          const char c = rows[static_cast<std::size_t>(y)][static_cast<std::size_t>(x)];
          return static_cast<std::uint32_t>(c == '.' ? 0 : c - '0');
        }));
  }
  PrintRegions regions;
  for (std::size_t begin = 0; begin < images.size(); begin += together) {
    std::vector<PrintRegions::Layer> layers;
    for (std::size_t i = begin; i < std::min(begin + together, images.size()); ++i)
      layers.push_back({static_cast<int>(i), images[i]});
    regions.add(layers);
  }
  return regions.finish();
}

TEST(PrintRegions, AnIslandHasNothingBelow) {
  const PrintFindings found =
      findingsOf({{"11...", "11..."}, {"11.12", "11..."}, {"1..1.", "....."}});
  EXPECT_THAT(found.islands.largest, ElementsAre(Region{2, 1, 3, 0}));
  EXPECT_EQ(found.islands.count, 1U);
  EXPECT_EQ(found.specks.count, 0U);
}

TEST(PrintRegions, CornersNeitherConnectNorSupport) {
  EXPECT_EQ(findingsOf({{"1..", "..."}, {"1..", ".11"}}).islands.count, 1U);
  EXPECT_EQ(findingsOf({{"1..", "..."}, {"...", ".11"}}).islands.count, 1U);
}

TEST(PrintRegions, TheLowestPrintedLayerHasNoIslands) {
  EXPECT_EQ(findingsOf({{"....", "...."}, {"11.1", "...1"}}).islands.count, 0U);
}

TEST(PrintRegions, ASpeckTouchesNothing) {
  const PrintFindings found = findingsOf({{"1...."}, {"1.1.."}, {"1...1"}, {"1...1"}});
  EXPECT_THAT(found.specks.largest, ElementsAre(Region{1, 1, 2, 0}));
  EXPECT_THAT(found.islands.largest, ElementsAre(Region{1, 2, 4, 0})) << "it goes on above";
}

TEST(PrintRegions, EmptyLayersAreToldAmidThePart) {
  const PrintFindings found =
      findingsOf({{".."}, {"1."}, {".."}, {".."}, {"11"}, {".."}, {"11"}, {".."}}, 2);
  EXPECT_THAT(found.empty_layers, ElementsAre(ZRange{2, 4}, ZRange{5, 6}));
  EXPECT_EQ(found.islands.count, 2U);
}

const std::vector<std::string> full{"11111", "11111", "11111"};
const std::vector<std::string> ring{"11111", "1...1", "11111"};
const std::vector<std::string> gap{"11111", "1....", "11111"};

TEST(PrintRegions, ACavityDoesNotReachTheOutside) {
  const PrintFindings found = findingsOf({full, ring, ring, full});
  EXPECT_THAT(found.cavities.largest, ElementsAre(Region{6, 1, 1, 1}));
  EXPECT_EQ(found.cups.count, 0U);
  EXPECT_EQ(findingsOf({full, ring, gap, full}).cavities.count, 0U);
}

TEST(PrintRegions, ACupOpensAfterItWasClosed) {
  EXPECT_THAT(findingsOf({full, ring, gap, full}).cups.largest, ElementsAre(Region{3, 1, 1, 1}));
  EXPECT_THAT(findingsOf({full, ring, ring}).cups.largest, ElementsAre(Region{6, 1, 1, 1}));
  EXPECT_EQ(findingsOf({full, gap, ring, full}).cups.count, 0U) << "it was open from the start";
}

TEST(PrintRegions, ThePlateClosesACup) {
  const PrintFindings found = findingsOf({ring, ring, full});
  EXPECT_THAT(found.cups.largest, ElementsAre(Region{6, 0, 1, 1}));
  EXPECT_EQ(found.cavities.count, 0U) << "it opens when the part leaves the plate";
  EXPECT_EQ(findingsOf({{".....", ".....", "....."}, ring, ring}).cups.count, 1U);
}

TEST(PrintRegions, TwoCupsThatJoinAreOne) {
  const std::vector<std::string> two{"11111", "1.1.1", "11111"};
  EXPECT_THAT(findingsOf({full, two, ring, ring}).cups.largest, ElementsAre(Region{8, 1, 1, 1}));
}

TEST(PrintRegions, OfNothingThereIsNothing) {
  EXPECT_EQ(PrintRegions().finish().islands.count, 0U);
  EXPECT_THAT(findingsOf({{"..."}, {"..."}}).empty_layers, IsEmpty());
}

TEST(PrintRegions, TheLargestAreListed) {
  PrintFindings found;
  for (std::uint32_t i = 0; i < 100; ++i) found.islands.add({1 + i % 50, 7, i, 0});
  EXPECT_EQ(found.islands.count, 100U);
  ASSERT_EQ(found.islands.largest.size(), Regions::listed);
  EXPECT_EQ(found.islands.largest[0], (Region{50, 7, 49, 0}));
  EXPECT_EQ(found.islands.largest[1], (Region{50, 7, 99, 0}));
}

/// The same by filling a dense array.
class Reference {
 public:
  explicit Reference(const Drawing& drawing) : drawing_(drawing) {}

  struct Counts {
    std::multimap<int, std::uint64_t> islands, specks, cavities, cups;  ///< voxels by lowest layer
  };

  Counts counts() {
    Counts counts;
    int lowest = 0;
    while (lowest < depth() && isBlank(lowest)) ++lowest;
    for (int z = lowest; z < depth(); ++z) findIslands(z, lowest, counts);
    findCavities(counts);
    for (int z = lowest; z < depth(); ++z) findCups(lowest, z, counts);
    return counts;
  }

 private:
  [[nodiscard]] int width() const { return static_cast<int>(drawing_[0][0].size()); }
  [[nodiscard]] int height() const { return static_cast<int>(drawing_[0].size()); }
  [[nodiscard]] int depth() const { return static_cast<int>(drawing_.size()); }
  [[nodiscard]] bool inside(int x, int y, int z) const {
    return x >= 0 && y >= 0 && z >= 0 && x < width() && y < height() && z < depth();
  }
  [[nodiscard]] bool printed(int x, int y, int z) const {
    return inside(x, y, z) && drawing_[z][y][x] != '.';
  }
  [[nodiscard]] bool isBlank(int z) const {
    for (const std::string& row : drawing_[z]) {
      if (row.find_first_not_of('.') != std::string::npos) return false;
    }
    return true;
  }

  struct Filled {
    std::vector<std::array<int, 3>> voxels;
    bool leaves = false;  ///< whether it goes beyond the edges of slices
    int lowest = 1 << 20, highest = -1;
  };

  /// What is connected to a voxel in the layers [bottom, top].
  Filled fill(int x, int y, int z, int bottom, int top, std::set<std::array<int, 3>>& seen) const {
    const bool kind = printed(x, y, z);
    Filled filled;
    filled.voxels = {{x, y, z}};
    seen.insert({x, y, z});
    for (std::size_t i = 0; i < filled.voxels.size(); ++i) {
      const auto at = filled.voxels[i];
      filled.lowest = std::min(filled.lowest, at[2]);
      filled.highest = std::max(filled.highest, at[2]);
      for (int axis = 0; axis < 3; ++axis) {
        for (const int step : {-1, 1}) {
          auto to = at;
          to[axis] += step;
          if (to[2] < bottom || to[2] > top) continue;
          if (!inside(to[0], to[1], to[2])) {
            filled.leaves = true;
          } else if (printed(to[0], to[1], to[2]) == kind && seen.insert(to).second) {
            filled.voxels.push_back(to);
          }
        }
      }
    }
    return filled;
  }

  void findIslands(int z, int lowest, Counts& counts) const {
    std::set<std::array<int, 3>> seen;
    for (int y = 0; y < height(); ++y) {
      for (int x = 0; x < width(); ++x) {
        if (!printed(x, y, z) || seen.contains({x, y, z})) continue;
        const Filled filled = fill(x, y, z, z, z, seen);
        bool held = false;
        for (const auto& at : filled.voxels) held = held || printed(at[0], at[1], z - 1);
        if (held) continue;
        if (filled.voxels.size() == 1 && !printed(x, y, z + 1)) {
          counts.specks.emplace(z, 1);
        } else if (z > lowest) {
          counts.islands.emplace(z, filled.voxels.size());
        }
      }
    }
  }

  void findCavities(Counts& counts) const {
    std::set<std::array<int, 3>> seen;
    for (int z = 0; z < depth(); ++z) {
      for (int y = 0; y < height(); ++y) {
        for (int x = 0; x < width(); ++x) {
          if (printed(x, y, z) || seen.contains({x, y, z})) continue;
          const Filled filled = fill(x, y, z, 0, depth() - 1, seen);
          if (!filled.leaves && filled.lowest > 0 && filled.highest < depth() - 1)
            counts.cavities.emplace(filled.lowest, filled.voxels.size());
        }
      }
    }
  }

  /// Cups that are closed up to layer `top` and no longer: what is there with one layer more is
  /// open, does not go on though the plate closes it, or there is no more layer.
  void findCups(int lowest, int top, Counts& counts) const {
    std::set<std::array<int, 3>> seen;
    for (int z = lowest; z <= top; ++z) {
      for (int y = 0; y < height(); ++y) {
        for (int x = 0; x < width(); ++x) {
          if (printed(x, y, z) || seen.contains({x, y, z})) continue;
          const Filled filled = fill(x, y, z, lowest, top, seen);
          if (filled.leaves || filled.highest < top) continue;
          std::set<std::array<int, 3>> none;
          const Filled more = fill(x, y, z, lowest, top + 1, none);
          const bool goes_on = more.highest > top;
          if (top + 1 == depth() || (goes_on && more.leaves) ||
              (!goes_on && filled.lowest == lowest))
            counts.cups.emplace(filled.lowest, filled.voxels.size());
        }
      }
    }
  }

  const Drawing& drawing_;
};

std::multimap<int, std::uint64_t> byLayer(const Regions& regions) {
  std::multimap<int, std::uint64_t> result;
  for (const Region& region : regions.largest) result.emplace(region.layer, region.voxels);
  return result;
}

/// As many of the reference as are listed, the largest first.
std::multimap<int, std::uint64_t> largestOf(const std::multimap<int, std::uint64_t>& all) {
  Regions regions;
  // By place, a region of the reference is known by its layer alone.
  std::uint32_t column = 0;
  for (const auto& [layer, voxels] : all) regions.add({voxels, layer, column++, 0});
  return byLayer(regions);
}

std::uint64_t voxelsOf(const std::multimap<int, std::uint64_t>& all) {
  std::uint64_t sum = 0;
  for (const auto& [layer, voxels] : all) sum += voxels;
  return sum;
}

TEST(PrintRegions, FindsWhatAFloodFillFinds) {
  std::mt19937 random(5);
  std::array<std::uint64_t, 4> told{};
  for (int run = 0; run < 200; ++run) {
    const int width = 1 + static_cast<int>(random() % 12);
    const int height = 1 + static_cast<int>(random() % 9);
    const double share = std::array{0.15, 0.4, 0.65, 0.8, 0.93}[run % 5];
    Drawing drawing(1 + random() % 8);
    for (auto& layer : drawing) {
      layer.assign(static_cast<std::size_t>(height),
                   std::string(static_cast<std::size_t>(width), '.'));
      for (std::string& row : layer) {
        for (char& voxel : row) {
          if (random() < share * 4294967296.0) voxel = random() % 2 ? '1' : '2';
        }
      }
    }
    const Reference::Counts expected = Reference(drawing).counts();
    const PrintFindings found = findingsOf(drawing, 1 + random() % 5);
    int kind = 0;
    for (const auto& [regions, reference] :
         {std::pair(&found.islands, &expected.islands), std::pair(&found.specks, &expected.specks),
          std::pair(&found.cavities, &expected.cavities), std::pair(&found.cups, &expected.cups)}) {
      SCOPED_TRACE("run " + std::to_string(run) + ", kind " + std::to_string(kind));
      EXPECT_EQ(regions->count, reference->size());
      EXPECT_EQ(regions->voxels, voxelsOf(*reference));
      EXPECT_EQ(byLayer(*regions), largestOf(*reference));
      told[kind++] += regions->count;
    }
  }
  for (const std::uint64_t count : told) EXPECT_GT(count, 50U) << "each kind is there";
}

}  // namespace
}  // namespace vdbdither
