#pragma once

#include <glm/glm.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace tinygltf {
class Model;
}

namespace insitu {

/// Reads accessors of a parsed glTF with every bound checked: buffer view, offset, stride, count,
/// sparse substitution (glTF 2.0, section 3.6.2). All throw InputError naming `path` and the
/// accessor when it does not exist, has another type, or reaches outside its buffer.

/// Number of elements, checked against kMaxModelElements; nothing is read.
[[nodiscard]] std::size_t accessorCount(const tinygltf::Model& gltf,
                                        int accessor,
                                        const std::string& path);
/// VEC3 of float.
[[nodiscard]] std::vector<glm::vec3> readVec3Accessor(const tinygltf::Model& gltf,
                                                      int accessor,
                                                      const std::string& path);
/// VEC2 of float, or of unsigned bytes or shorts, which are normalised to [0, 1].
[[nodiscard]] std::vector<glm::vec2> readTexcoordAccessor(const tinygltf::Model& gltf,
                                                          int accessor,
                                                          const std::string& path);
/// SCALAR of unsigned byte, short or int.
[[nodiscard]] std::vector<std::uint32_t> readIndexAccessor(const tinygltf::Model& gltf,
                                                           int accessor,
                                                           const std::string& path);

}  // namespace insitu
