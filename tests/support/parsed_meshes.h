#pragma once

#include <string>
#include <vector>

#include "vdbdither/model/mesh.h"

namespace vdbdither::test {

using Warnings = std::vector<std::string>;

/// Parses the content of a mesh file called `name`.
Mesh parse(const std::string& bytes, Warnings* warnings = nullptr,
           const std::string& name = "part");

/// Parses what must be fine: any warning fails the test.
Mesh parseQuietly(const std::string& bytes);

/// Parses the content of a mesh file called `name` with its colours, and expects a sound appearance
/// if there is any.
Mesh parseWithColours(const std::string& bytes, Warnings* warnings = nullptr,
                      const std::string& name = "part");

/// Returns the message of the refusal, or "read".
std::string refusal(const std::string& bytes, const std::string& name = "part");
std::string refusalWithColours(const std::string& bytes, const std::string& name = "part");

/// Expects that every index is in range and every number finite and, where it must be, 0 … 1.
void expectSoundAppearance(const Mesh& mesh);

void expectSame(const Mesh& mesh, const Mesh& expected);

/// A mesh whose coordinates are floats, its vertices in the order of their first use: so it
/// survives every format unchanged.
Mesh floatPart();

/// Expects that every prefix of `bytes` is read or refused in one line.
/// @param knows_its_end  whether what is read without a warning must then be the whole mesh
void expectEveryPrefixIsReadOrRefused(const std::string& bytes, bool knows_its_end);

/// Expects that `bytes` are read as a sound mesh or refused in one line whatever is changed in
/// them. Changes up to four bytes at a time, always the same ones.
void expectSpoiltBytesAreReadOrRefused(const std::string& bytes);

}  // namespace vdbdither::test
