#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstdlib>

namespace vdbdither {

/// The bit of a voxel among the 27 of a neighbourhood; each coordinate is −1, 0 or 1.
constexpr unsigned neighbourBit(int x, int y, int z) {
  return static_cast<unsigned>(9 * (x + 1) + 3 * (y + 1) + z + 1);
}

namespace simple_point_tables {

/// By the bit of a voxel of the neighbourhood: those that touch it, by faces, edges and corners or
/// by faces alone. The middle is left out.
struct Touching {
  std::array<std::uint32_t, 27> by_corners{};
  std::array<std::uint32_t, 27> by_faces{};
  std::uint32_t faces = 0;  ///< the six neighbours by faces of the middle
  std::uint32_t edges = 0;  ///< these and the twelve by edges
};

constexpr Touching touchingVoxels() {
  Touching made;
  const auto size = [](int n) { return n < 0 ? -n : n; };
  for (int a = 0; a < 27; ++a) {
    const std::array<int, 3> at{a / 9 - 1, a / 3 % 3 - 1, a % 3 - 1};
    const int from_middle = size(at[0]) + size(at[1]) + size(at[2]);
    if (from_middle == 1) made.faces |= 1U << a;
    if (from_middle == 1 || from_middle == 2) made.edges |= 1U << a;
    for (int b = 0; b < 27; ++b) {
      const int x = size(b / 9 - 1 - at[0]);
      const int y = size(b / 3 % 3 - 1 - at[1]);
      const int z = size(b % 3 - 1 - at[2]);
      if (a == b || b == 13 || x > 1 || y > 1 || z > 1) continue;
      made.by_corners[static_cast<std::size_t>(a)] |= 1U << b;
      if (x + y + z == 1) made.by_faces[static_cast<std::size_t>(a)] |= 1U << b;
    }
  }
  return made;
}

inline constexpr Touching touching = touchingVoxels();

/// Returns the voxels of `among` that are connected to those of `seed`.
constexpr std::uint32_t connected(std::uint32_t seed, std::uint32_t among,
                                  const std::array<std::uint32_t, 27>& adjacent) {
  std::uint32_t reached = seed;
  for (std::uint32_t added = seed; added != 0;) {
    std::uint32_t next = 0;
    for (; added != 0; added &= added - 1)
      next |= adjacent[static_cast<std::size_t>(std::countr_zero(added))];
    added = next & among & ~reached;
    reached |= added;
  }
  return reached;
}

}  // namespace simple_point_tables

/// Whether a voxel can change its side without changing the topology: what touches (by faces, edges
/// or corners) inside the part, and what touches by faces outside of it, stays in as many pieces,
/// with as many tunnels. `inside` holds a bit for each voxel around it that is inside; that of the
/// middle does not count.
constexpr bool isSimplePoint(std::uint32_t inside) {
  using simple_point_tables::connected;
  using simple_point_tables::touching;
  constexpr std::uint32_t all = ((1U << 27) - 1) & ~(1U << 13);
  inside &= all;
  if (inside == 0) return false;
  const std::uint32_t lowest = inside & (~inside + 1);
  if (connected(lowest, inside, touching.by_corners) != inside) return false;
  const std::uint32_t outside = all & ~inside & touching.edges;
  const std::uint32_t next = outside & touching.faces;
  if (next == 0) return false;
  const std::uint32_t reached = connected(next & (~next + 1), outside, touching.by_faces);
  return (next & ~reached) == 0;
}

}  // namespace vdbdither
