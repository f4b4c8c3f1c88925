#include "io/mesh/unread_bytes.h"

#include <bit>
#include <cstdint>

#include "vdbdither/model/split_mix.h"

namespace vdbdither {

using openvdb::Vec3d;

namespace {

std::uint64_t hashOf(const Vec3d& position) {
  std::uint64_t hash = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double coordinate = position[axis] + 0.0;  // −0 becomes +0
    hash = splitMix(hash + std::bit_cast<std::uint64_t>(coordinate));
  }
  return hash;
}

/// The hash of a side, which that of the opposite side does not determine.
std::uint64_t hashOfSide(std::uint64_t from, std::uint64_t to) {
  return scattered(from + std::rotl(to, 23));
}

}  // namespace

bool isClosed(const Mesh& mesh) {
  std::uint64_t surplus = 0;
  for (const Mesh::Triangle& triangle : mesh.triangles) {
    const std::uint64_t a = hashOf(mesh.vertices[triangle[0]]);
    const std::uint64_t b = hashOf(mesh.vertices[triangle[1]]);
    const std::uint64_t c = hashOf(mesh.vertices[triangle[2]]);
    surplus += hashOfSide(a, b) - hashOfSide(b, a);
    surplus += hashOfSide(b, c) - hashOfSide(c, b);
    surplus += hashOfSide(c, a) - hashOfSide(a, c);
  }
  return surplus == 0;
}

bool isBlank(std::string_view bytes) {
  // Systems that knew no sizes of files ended a text with ^Z.
  constexpr std::string_view blanks(" \t\v\f\r\n\x1A\0", 8);
  return bytes.find_first_not_of(blanks) == std::string_view::npos;
}

void judgeUnread(const MeshFile& file, const Mesh& mesh, std::string_view rest,
                 const std::string& after) {
  if (rest.empty()) return;
  const std::string bytes = std::to_string(rest.size()) + " bytes";
  if (!isBlank(rest) && !isClosed(mesh)) {
    file.refuseAtByte(rest.data(), bytes + " follow " + after +
                                       " and the triangles before do not close: the file is not "
                                       "as its header says; export it again");
  }
  file.warn("ignored " + bytes + " after " + after);
}

}  // namespace vdbdither
