// glTF 2.0: ISO/IEC 12113:2022, section 3.7.3.

#include "io/mesh/gltf_skin.h"

#include <numeric>
#include <string>

namespace vdbdither {

using openvdb::Mat4d;

GltfSkin::GltfSkin(const GltfValue& json, const std::map<std::uint64_t, Mat4d>& to_world,
                   GltfAccessors& accessors)
    : json_(json) {
  const GltfValue joints = json["joints"];
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const auto found = to_world.find(joints.at(i).count());
    if (found == to_world.end()) joints.at(i).refuse("is a joint that no scene holds");
    joints_.push_back(found->second);
  }
  const GltfValue place = json["inverseBindMatrices"];
  if (!place.exists()) return;
  const GltfAccessor& accessor = accessors.at(place.count());
  if (accessor.components != 16 || accessor.type != GltfAccessor::Type::float32 ||
      accessor.count < joints_.size())
    place.refuse("leads to an accessor that is none of a matrix for each joint");
  std::vector<std::uint32_t> all(joints_.size());
  std::iota(all.begin(), all.end(), 0U);
  const std::vector<double> values = elementsOf(accessor, all);
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    Mat4d from_bind;
    for (int row = 0; row < 4; ++row) {
      for (int column = 0; column < 4; ++column)
        from_bind(row, column) = values[16 * i + static_cast<std::size_t>(4 * column + row)];
    }
    joints_[i] = joints_[i] * from_bind;
  }
}

Mat4d GltfSkin::mapOf(const std::array<GltfBone, 4>& bones) const {
  Mat4d sum = Mat4d::zero();
  double weights = 0;
  for (const GltfBone& bone : bones) {
    if (bone.weight == 0) continue;
    if (bone.joint >= joints_.size())
      json_.refuse("has no joint " + std::to_string(bone.joint) + ", which a vertex names");
    sum += joints_[bone.joint] * static_cast<double>(bone.weight);
    weights += static_cast<double>(bone.weight);
  }
  if (!(weights > 0)) json_.refuse("moves a vertex by joints without weight");
  return sum * (1 / weights);
}

}  // namespace vdbdither
