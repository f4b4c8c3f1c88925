#include "io/stack/stack_page.h"

#include <array>
#include <map>
#include <string>
#include <zlib.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <tbb/task_arena.h>

#include "tests/support/png_reader.h"
#include "tests/support/scratch_folder.h"
#include "tests/support/span_images.h"
#include "vdbdither/model/errors.h"

namespace vdbdither {
namespace {

using nlohmann::ordered_json;
using openvdb::Coord;
using openvdb::CoordBBox;
using test::spanImage;
using testing::HasSubstr;
using testing::Not;
using Bytes = std::vector<std::uint8_t>;
using Pixels = std::vector<std::uint8_t>;  ///< of a slice, row by row

Bytes decodedBase64(const std::string& text) {
  Bytes bytes;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    if (c == '=') break;
    const int digit = c >= 'a'   ? c - 'a' + 26
                      : c >= 'A' ? c - 'A'
                      : c >= '0' ? c - '0' + 52
                      : c == '+' ? 62
                                 : 63;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (count -= 8)));
  }
  return bytes;
}

Bytes inflatedBytes(const Bytes& bytes) {
  Bytes out(std::size_t{16} << 20);
  z_stream stream{};
  inflateInit2(&stream, -15);
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

/// A page as its reader takes it apart: pixel by pixel, as docs/viewer.md describes the format.
class Page {
 public:
  explicit Page(const std::filesystem::path& path) {
    const Bytes bytes = test::fileBytes(path);
    text_.assign(bytes.begin(), bytes.end());
    json_ = ordered_json::parse(element("stack"));
  }

  [[nodiscard]] const ordered_json& json() const { return json_; }
  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] std::string element(const std::string& id) const {
    const std::size_t begin = text_.find('>', text_.find(" id=\"" + id + "\"")) + 1;
    return text_.substr(begin, text_.find("</script", begin) - begin);
  }
  [[nodiscard]] Bytes bytes(const std::string& id) const {
    return inflatedBytes(decodedBase64(element(id)));
  }

  /// The slices of one of the stacks.
  [[nodiscard]] std::vector<Pixels> slices(std::size_t stack = 0) const {
    std::vector<Pixels> all;
    for (std::size_t group = 0; group < json_["groups"].size(); ++group) {
      const std::vector<Pixels> base = stack ? slicesOf(0, group, {}) : std::vector<Pixels>();
      for (Pixels& slice : slicesOf(stack, group, base)) all.push_back(std::move(slice));
    }
    return all;
  }

 private:
  struct Box {
    int left, top, width, height;
    [[nodiscard]] bool contains(int x, int y) const {
      return x >= left && y >= top && x < left + width && y < top + height;
    }
  };

  [[nodiscard]] std::vector<Pixels> slicesOf(std::size_t stack, std::size_t index,
                                             const std::vector<Pixels>& base) const {
    const ordered_json& entry = json_["groups"][index];
    const int width = json_["size"][0];
    const int height = json_["size"][1];
    const Box box{entry[stack + 1][0], entry[stack + 1][1], entry[stack + 1][2],
                  entry[stack + 1][3]};
    std::vector<Pixels> slices(entry[0], Pixels(static_cast<std::size_t>(width) * height));
    if (box.width == 0) return slices;
    const Bytes data = bytes("group-" + std::to_string(stack) + "-" + std::to_string(index));
    std::array<Bytes, 5> streams;
    std::size_t at = 1044;
    for (std::size_t i = 0; i < 5; ++i) {
      const std::size_t size =
          data[1024 + 4 * i] | data[1025 + 4 * i] << 8 | data[1026 + 4 * i] << 16;
      streams[i].assign(data.begin() + static_cast<std::ptrdiff_t>(at),
                        data.begin() + static_cast<std::ptrdiff_t>(at + size));
      at += size;
    }
    EXPECT_EQ(at, data.size());
    // All misses of the first three classes, as places in the sequence of the pixels of the class.
    std::array<std::map<std::uint64_t, bool>, 3> misses;
    for (std::size_t i = 0; i < 3; ++i) {
      std::uint64_t place = 0;
      for (std::size_t k = 0; k < streams[i].size(); ++place) {
        std::uint64_t gap = 0;
        for (int shift = 0;; shift += 7) {
          gap |= std::uint64_t{streams[i][k] & 127U} << shift;
          if (streams[i][k++] < 128) break;
        }
        misses[i][place += gap] = true;
      }
    }
    std::array<std::uint64_t, 4> seen{};
    std::size_t next_value = 0;
    const Pixels nothing(static_cast<std::size_t>(width) * height);
    for (std::size_t z = 0; z < slices.size(); ++z) {
      const Pixels& under = !base.empty() ? base[z] : z ? slices[z - 1] : nothing;
      const auto pixel = [&](const Pixels& from, int x, int y) {
        return box.contains(x, y) ? from[static_cast<std::size_t>(y) * width + x] : 0;
      };
      for (int y = box.top; y < box.top + box.height; ++y) {
        for (int x = box.left; x < box.left + box.width; ++x) {
          const auto here = [&](int dx, int dy) { return pixel(slices[z], x + dx, y + dy); };
          const auto below = [&](int dx, int dy) { return pixel(under, x + dx, y + dy); };
          const int b = below(0, 0);
          const std::array<int, 9> around{here(-1, 0),  here(0, -1),  below(1, 0),
                                          below(0, 1),  here(1, -1),  here(-1, -1),
                                          below(-1, 0), below(0, -1), here(-2, 0)};
          std::size_t context = b ? 512 : 0;
          for (std::size_t i = 0; i < around.size(); ++i)
            context |= static_cast<std::size_t>(around[i] != b) << i;
          const int rule = data[context];
          int value = std::array{b, around[0], around[1], around[2]}[rule & 3];
          const int group = rule >> 2;
          bool miss = false;
          if (group > 0) {
            const std::uint64_t place = seen[group - 1]++;
            miss = group < 4 ? misses[group - 1].contains(place)
                             : (streams[3][place / 8] >> place % 8 & 1) != 0;
          }
          if (miss) {
            const int other = json_["materials"].size() > 1 ? streams[4].at(next_value++) : 0;
            value = other < value ? other : other + 1;
          }
          slices[z][static_cast<std::size_t>(y) * width + x] = static_cast<std::uint8_t>(value);
        }
      }
    }
    EXPECT_EQ(next_value, streams[4].size());
    return slices;
  }

  std::string text_;
  ordered_json json_;
};

Pixels pixelsOf(const SpanImage& image) {
  Pixels pixels;
  for (std::uint32_t y = 0; y < image.height; ++y) {
    for (const Span& span : image.row(y))
      pixels.resize(std::size_t{y} * image.width + span.end, static_cast<std::uint8_t>(span.value));
  }
  return pixels;
}

constexpr int columns = 45;
constexpr int rows = 30;

class StackPages : public testing::Test {
 protected:
  static Manifest manifest(int layers, int materials) {
    Manifest stack;
    stack.lattice = {{0.1, 0.2, 0.05},
                     {0, 0, 0},
                     CoordBBox(Coord(-3, 5, -2), Coord(columns - 4, rows + 4, layers - 3))};
    stack.layout = {stack.lattice.box, 0, false, false};
    for (int i = 1; i <= materials; ++i)
      stack.materials.push_back(
          {"m" + std::to_string(i), {static_cast<std::uint8_t>(i), 0, 0, 255}});
    return stack;
  }
  /// A cone with a grainy rim, of `materials` in stripes.
  static SpanImage slice(int z, int materials, std::uint32_t seed = 0) {
    const SpanImage disc =
        test::ditheredDisc(columns, rows, 6, static_cast<std::uint32_t>(z) + seed);
    const Pixels pixels = pixelsOf(disc);
    return spanImage(columns, rows, [&](int x, int y) {
      return pixels[static_cast<std::size_t>(y) * columns + x] *
             static_cast<std::uint32_t>(1 + (x + z) / 3 % materials);
    });
  }

  Page write(int layers, int materials, std::uint64_t most_bytes = StackPage::default_most_bytes) {
    StackPage page({-2, layers - 2}, {"part", manifest(layers, materials)}, {}, most_bytes);
    for (int z = 0; z < layers; ++z) page.add(z - 2, {slice(z, materials)});
    page.finish(scratch_ / "out.html");
    page.commit();
    warning_ = page.warning();
    return Page(scratch_ / "out.html");
  }

  test::ScratchFolder scratch_;
  std::string warning_;
};

TEST_F(StackPages, HoldEveryVoxel) {
  for (const int materials : {1, 5}) {
    const Page page = write(37, materials);
    const std::vector<Pixels> slices = page.slices();
    ASSERT_EQ(slices.size(), 37);
    std::vector<std::uint64_t> voxels(static_cast<std::size_t>(materials));
    for (int z = 0; z < 37; ++z) {
      const Pixels pixels = pixelsOf(slice(z, materials));
      EXPECT_EQ(slices[z], pixels) << z << " of " << materials;
      for (const std::uint8_t value : pixels)
        if (value) ++voxels[value - 1];
    }
    EXPECT_EQ(page.json()["stacks"][0]["voxels"].get<std::vector<std::uint64_t>>(), voxels);
    EXPECT_EQ(page.json()["stride"], 1);
    EXPECT_EQ(page.json()["first"], ordered_json({-3, 5, -2}));
    EXPECT_EQ(warning_, "");
  }
}

TEST_F(StackPages, HoldEmptySlicesAndSuchThatDidNotCome) {
  StackPage page({0, 40}, {"part", manifest(40, 1)});
  page.add(20, {slice(20, 1)});
  page.finish(scratch_ / "out.html");
  page.commit();
  const std::vector<Pixels> slices = Page(scratch_ / "out.html").slices();
  ASSERT_EQ(slices.size(), 21);
  for (int z = 0; z < 20; ++z) EXPECT_EQ(slices[z], Pixels(columns * rows)) << z;
  EXPECT_EQ(slices[20], pixelsOf(slice(20, 1)));
}

TEST_F(StackPages, ThatWouldBeTooLargeShowFewerSlicesAndSaySo) {
  const Page whole = write(100, 5);
  const Page page = write(100, 5, 5'000);
  const int stride = page.json()["stride"];
  ASSERT_GE(stride, 4);
  EXPECT_EQ(warning_, "the page shows one slice of " + std::to_string(stride) +
                          ": with all of them it would take more than 0.005 MB");
  EXPECT_EQ(page.json()["warning"], warning_);
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < page.json()["groups"].size(); ++i)
    bytes += page.element("group-0-" + std::to_string(i)).size();
  EXPECT_LE(bytes, 5'000);
  const std::vector<Pixels> slices = page.slices();
  ASSERT_EQ(slices.size(), (100 + stride - 1) / stride);
  for (std::size_t i = 0; i < slices.size(); ++i)
    EXPECT_EQ(slices[i], pixelsOf(slice(static_cast<int>(i) * stride, 5))) << i;
  EXPECT_EQ(page.json()["stacks"], whole.json()["stacks"]);
  EXPECT_EQ(page.element("volume"), whole.element("volume"));
}

TEST_F(StackPages, AreTheSameOnAnyNumberOfThreads) {
  std::map<int, std::string> texts;
  for (const int threads : {1, 2}) {
    tbb::task_arena arena(threads);
    arena.execute([&] { texts[threads] = write(100, 3, 6'000).text(); });
    EXPECT_GT(Page(scratch_ / "out.html").json()["stride"], 1);
    EXPECT_EQ(texts[threads], texts[1]) << threads;
  }
}

TEST_F(StackPages, ShowSlicesFromAboveWhateverTheirLayout) {
  Manifest stack = manifest(1, 1);
  stack.layout.padding = 2;
  stack.layout.flip_x = true;
  stack.layout.flip_y = true;
  const Pixels pixels = pixelsOf(slice(0, 1));
  const SpanImage turned = spanImage(columns + 4, rows + 4, [&](int x, int y) -> std::uint32_t {
    const int column = columns + 1 - x;
    const int row = rows + 1 - y;
    const bool inside = column >= 0 && row >= 0 && column < columns && row < rows;
    return inside ? pixels[static_cast<std::size_t>(row) * columns + column] : 0;
  });
  StackPage page({0, 1}, {"part", stack});
  page.add(0, {turned});
  page.finish(scratch_ / "out.html");
  page.commit();
  EXPECT_EQ(Page(scratch_ / "out.html").slices()[0], pixels);
}

TEST_F(StackPages, HoldAnotherStackInOneFrame) {
  Manifest other = manifest(20, 2);
  other.lattice.box = CoordBBox(Coord(-5, 5, -2), Coord(columns - 6, rows + 4, 17));
  other.layout.box = other.lattice.box;
  other.materials[0].name = "M2";
  other.materials[1].name = "other";
  StackPage page({-2, 18}, {"part", manifest(20, 3)}, PageStack{"second", other});
  for (int z = 0; z < 20; ++z) page.add(z - 2, {slice(z, 3), slice(z, 2, 99)});
  page.finish(scratch_ / "out.html");
  page.commit();
  const Page read(scratch_ / "out.html");
  EXPECT_EQ(read.json()["size"], ordered_json({columns + 2, rows, 20}));
  EXPECT_EQ(read.json()["materials"].size(), 4);
  EXPECT_EQ(read.json()["materials"][3]["name"], "other");
  const std::vector<Pixels> first = read.slices(0);
  const std::vector<Pixels> second = read.slices(1);
  for (int z = 0; z < 20; ++z) {
    const Pixels a = pixelsOf(slice(z, 3));
    const Pixels b = pixelsOf(slice(z, 2, 99));
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns + 2; ++x) {
        const std::size_t at = static_cast<std::size_t>(y) * (columns + 2) + x;
        const std::size_t row = static_cast<std::size_t>(y) * columns;
        EXPECT_EQ(first[z][at], x < 2 ? 0 : a[row + x - 2]);
        const int value = x < columns ? b[row + x] : 0;
        EXPECT_EQ(second[z][at], value == 0 ? 0 : value * 2);
      }
    }
  }
}

TEST_F(StackPages, NamesOfFilesEndNoElement) {
  Manifest stack = manifest(1, 1);
  const std::string hostile = "</script><script>alert(1)</script><!--\"'&\x1b[31m\xff";
  stack.materials[0].name = hostile;
  stack.history = {hostile};
  stack.grid = hostile;
  stack.printer = ordered_json{{"title", "</script><b>"}, {"name", "\"<!--"}}.dump();
  StackPage page({0, 1}, {hostile, stack});
  page.add(0, {slice(0, 1)});
  page.finish(scratch_ / "out.html");
  page.commit();
  const Page read(scratch_ / "out.html");
  EXPECT_THAT(read.text(), Not(HasSubstr("alert(1)</")));
  EXPECT_THAT(read.text(), Not(HasSubstr("\x1b")));
  EXPECT_THAT(read.element("stack"), Not(HasSubstr("<")));
  const std::string shown = "</script><script>alert(1)</script><!--\"'&\x1b[31m\\xff";
  EXPECT_EQ(read.json()["materials"][0]["name"], shown);
  EXPECT_FALSE(read.json().contains("history"));
  EXPECT_EQ(read.json()["stacks"][0]["history"][0], shown);
  EXPECT_EQ(read.json()["stacks"][0]["name"], shown);
  EXPECT_EQ(read.json()["printer"]["title"], "</script><b>");
}

TEST_F(StackPages, TellTheSharesOfCubesAndTheirMaterials) {
  Manifest stack = manifest(8, 2);
  stack.materials[0].rgba = {200, 0, 0, 255};
  stack.materials[1].rgba = {0, 100, 0, 255};
  StackPage page({0, 8}, {"part", stack});
  // Cubes of 0.2 mm: two columns, one row, four layers.
  for (int z = 0; z < 8; ++z) {
    page.add(z, {spanImage(columns, rows, [&](int x, int y) -> std::uint32_t {
               return y == 3 && x < 4 ? (x == 1 ? 2 : x == 3 && z == 0 ? 2 : x == 3 ? 0 : 1) : 0;
             })});
  }
  page.finish(scratch_ / "out.html");
  page.commit();
  const Page read(scratch_ / "out.html");
  EXPECT_EQ(read.json()["volume"]["cell_mm"], 0.2);
  EXPECT_EQ(read.json()["volume"]["cells"], ordered_json({23, 30, 2}));
  EXPECT_EQ(read.json()["volume"]["blocks"], ordered_json({12, 15, 1}));
  const Bytes volume = read.bytes("volume");
  const std::size_t count = 23 * 30 * 2;
  ASSERT_EQ(volume.size(), 2 * count + 3 * 12 * 15);
  const auto at = [&](int x, int y, int z) {
    return volume[(static_cast<std::size_t>(z) * 30 + y) * 23 + x];
  };
  EXPECT_EQ(at(0, 3, 0), 255);
  EXPECT_EQ(at(1, 3, 0), 17 * 9);  // 5 of 8 voxels
  EXPECT_EQ(at(1, 3, 1), 17 * 8);  // 4 of 8 voxels
  EXPECT_EQ(at(0, 2, 0), 0);
  EXPECT_EQ(volume[count + 3 * 23 + 1], 1);
  // 16 voxels of the first material and 9 of the second; steps of 4.
  EXPECT_EQ(volume[2 * count + 12 * 3], 160);
  EXPECT_EQ(volume[2 * count + 12 * 3 + 1], 60);
  EXPECT_EQ(volume[2 * count + 12 * 3 + 2], 4);
  EXPECT_EQ(volume[2 * count + 2], 0);
}

template <class Work>
std::string refusalOf(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(StackPages, RefuseStacksOfAnotherPitchAndTooManyMaterials) {
  Manifest other = manifest(1, 1);
  other.lattice.pitch_mm[0] = 0.11;
  EXPECT_EQ(refusalOf([&] {
              StackPage({0, 1}, {"a", manifest(1, 1)}, PageStack{"b", other});
            }),
            "'b' has another pitch or origin than 'a'; make both stacks for one printer");
  EXPECT_EQ(refusalOf([&] {
              StackPage({0, 1}, {"a", manifest(1, 256)});
            }),
            "a page has room for 255 materials, and there are 256");
  EXPECT_EQ(refusalOf([&] { StackPage({0, 1}, {"a", manifest(1, 255)}); }), "");
}

TEST_F(StackPages, RefuseNamesThatAreNoPages) {
  EXPECT_EQ(refusalOf([] { StackPage::check("out.htm", false); }), "'out.htm' must end in .html");
  const std::string there = scratch_.write("out.html", "").string();
  EXPECT_THAT(refusalOf([&] { StackPage::check(there, false); }), HasSubstr("exists"));
  EXPECT_EQ(refusalOf([&] { StackPage::check(there, true); }), "");
}

TEST(StackNames, AreThoseOfFoldersAndArchives) {
  for (const auto* path : {"a/out", "a/out/", "a/out.zip", "a/out/manifest.json"})
    EXPECT_EQ(pageStack(path, {}).name, "out") << path;
}

}  // namespace
}  // namespace vdbdither
