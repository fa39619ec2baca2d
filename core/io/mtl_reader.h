#pragma once

#include "core/mesh.h"

#include <filesystem>
#include <map>
#include <string>

namespace insitu {

/// One `newmtl` of an MTL library, with its texture names still unresolved.
struct MtlMaterial {
    Material material;
    std::string diffuse_map;  ///< map_Kd; empty = none
    bool clamp = false;       ///< -clamp on
    std::string ignored;      ///< other maps and options that were there, comma-separated
};

/// Reads an MTL library into metallic-roughness materials. The rules, chosen so that a file means
/// here what Blender's importer makes of it [BlenderObj]:
///
///   Kd      base colour, linear (Blender writes and reads it unencoded); with map_Kd the texture
///           (sRGB) stands in its place
///   Ks      specular = min(mean(Ks) / 0.5, 1): mean(Ks) is Blender's "Specular", whose 0.5 is
///           F0 = 0.04. None, or illum 0 or 1: no highlight, specular 0
///   Ns      roughness = 1 - sqrt(min(Ns, 1000) / 1000)
///   d, Tr   alpha = d = 1 - Tr; below 1 it is cut out at alpha_cutoff 0.5
///   Ke      emissive
///   Pr, Pm  roughness and metallic of the PBR extension take precedence over Ns
///
/// All OBJ materials are double-sided, since the format cannot say. Other maps and statements are
/// not used. InputError names file, line and cause.
[[nodiscard]] std::map<std::string, MtlMaterial> readMtl(const std::filesystem::path& path);

}  // namespace insitu
