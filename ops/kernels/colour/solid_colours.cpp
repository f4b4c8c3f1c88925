#include "ops/kernels/colour/solid_colours.h"

#include <algorithm>
#include <cstddef>
#include <unordered_map>
#include <utility>

#include "ops/kernels/colour/corner_weights.h"

namespace vdbdither {

using openvdb::Vec3d;
using openvdb::Vec4d;
using openvdb::Vec4f;

namespace {

/// The mean of colours that come one after the other.
struct MeanColour {
  Vec4d sum{0, 0, 0, 0};
  int count = 0;

  void add(const Vec4f& colour) {
    sum += Vec4d(colour);
    ++count;
  }
  [[nodiscard]] Vec4f value() const { return Vec4f(sum / std::max(count, 1)); }
};

/// The colours of the vertices of fillings, by vertex; those without a colour have count 0.
using VertexColours = std::unordered_map<std::uint32_t, MeanColour>;

/// Gives the vertices that no coloured triangle touches the mean of their neighbours, ring after
/// ring from the rim inwards.
void spreadInwards(const std::vector<Mesh::Triangle>& fillings, VertexColours& colours) {
  for (;;) {
    VertexColours found;
    for (const Mesh::Triangle& filling : fillings)
      for (std::size_t corner = 0; corner < 3; ++corner) {
        const std::uint32_t vertex = filling[corner];
        if (colours[vertex].count > 0) continue;
        for (const std::size_t other : {(corner + 1) % 3, (corner + 2) % 3})
          if (const MeanColour& near = colours[filling[other]]; near.count > 0)
            found[vertex].add(near.value());
      }
    if (found.empty()) return;
    for (const auto& [vertex, colour] : found) colours[vertex] = colour;
  }
}

}  // namespace

SolidColours::SolidColours(std::shared_ptr<const SurfaceColours> surface, const DerivedMesh& solid)
    : surface_(std::move(surface)), source_(solid.source) {
  colourFillings(solid);
}

void SolidColours::colourFillings(const DerivedMesh& solid) {
  const std::vector<Mesh::Triangle>& triangles = solid.mesh.triangles;
  std::vector<Mesh::Triangle> open;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    if (source_[t] != no_source) continue;
    open.push_back(triangles[t]);
    Filling& filling = fillings_.emplace_back();
    filling.triangle = t;
    for (std::size_t c = 0; c < 3; ++c)
      filling.corners_mm[c] = solid.mesh.vertices[triangles[t][c]];
  }
  if (fillings_.empty()) return;

  VertexColours colours;
  for (const Mesh::Triangle& filling : open)
    for (const std::uint32_t vertex : filling) colours[vertex];
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    if (source_[t] == no_source) continue;
    for (const std::uint32_t vertex : triangles[t])
      if (const auto rim = colours.find(vertex); rim != colours.end())
        rim->second.add(surface_->at(source_[t], solid.mesh.vertices[vertex]));
  }
  spreadInwards(open, colours);
  for (std::size_t f = 0; f < fillings_.size(); ++f)
    for (std::size_t c = 0; c < 3; ++c) {
      const MeanColour& colour = colours[open[f][c]];
      fillings_[f].colours[c] = colour.count > 0 ? colour.value() : Vec4f(1, 1, 1, 1);
    }
}

Vec4f SolidColours::at(std::uint32_t triangle, const Vec3d& p_mm) const {
  if (source_[triangle] != no_source) return surface_->at(source_[triangle], p_mm);
  const auto filling =
      std::lower_bound(fillings_.begin(), fillings_.end(), triangle,
                       [](const Filling& one, std::uint32_t t) { return one.triangle < t; });
  const auto& [a, b, c] = filling->corners_mm;
  return mixed(filling->colours, nearestPlace(a, b, c, p_mm).weights);
}

double SolidColours::memoryBytes() const {
  return static_cast<double>(source_.capacity() * sizeof(source_[0]) +
                             fillings_.capacity() * sizeof(Filling));
}

}  // namespace vdbdither
