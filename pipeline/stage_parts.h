#pragma once

#include "pipeline/insert.h"
#include "pipeline/value_archive.h"

// The parts of every value that a cached stage is made from or gives, each listed once: what is
// missing here is missed in keys and in what is read back. The sizes stand guard: who adds a member
// is led here.

namespace insitu {

/// What the stages room light and render give together.
struct RenderedStage {
    Findings light_findings;
    InsertionResult render;
};

void parts(auto& archive, PartsOf<Finding> auto& v)
{
    archive(v.severity, v.code, v.message);
}
void parts(auto& archive, PartsOf<Exposure> auto& v)
{
    archive(v.seconds, v.f_number, v.iso);
}
void parts(auto& archive, PartsOf<ResponseCurve> auto& v)
{
    archive(v.exposure, v.source);
}
void parts(auto& archive, PartsOf<ColorProfile> auto& v)
{
    archive(v.name, v.rec709_from_linear[0], v.rec709_from_linear[1], v.rec709_from_linear[2]);
    archive(v.transfer, v.transfer_is_response);
}
void parts(auto& archive, PartsOf<PhotoMetadata> auto& v)
{
    archive(v.exposure, v.focal_mm, v.focal_35mm, v.focal_px, v.make, v.model, v.orientation);
    archive(v.color, v.icc_problem, v.icc, v.exif);
}
void parts(auto& archive, PartsOf<EnvironmentMap> auto& v)
{
    archive(v.pixels, v.clipped);
}
void parts(auto& archive, PartsOf<LightReference> auto& v)
{
    archive(v.position_m, v.normal, v.irradiance, v.log_sigma);
}
void parts(auto& archive, PartsOf<ReferenceGroup> auto& v)
{
    archive(v.name, v.places, v.common_log_sigma, v.scale_free, v.luminance_only);
}
void parts(auto& archive, PartsOf<ProjectReference> auto& v)
{
    archive(v.kind, v.position_m, v.normal, v.sigma, v.irradiance, v.source, v.area_from_px);
    archive(v.area_size_px, v.center_px, v.radius_px, v.radius_m, v.reflectance_known);
    archive(v.reflectance, v.view_position_m, v.view_up);
    for (auto& image : v.images)
        archive(image.exposure);
}
void parts(auto& archive, PartsOf<CapturedLight> auto& v)
{
    archive(v.environment, v.center_m, v.response, v.response_known, v.radiance_unit_known);
    archive(v.metadata, v.references, v.findings);
}
void parts(auto& archive, PartsOf<RenderLayers> auto& v)
{
    archive(v.object, v.alpha, v.irradiance_without, v.irradiance_with, v.depth_m);
    archive(v.object_variance, v.ratio_variance, v.probe_radiance);
}
void parts(auto& archive, PartsOf<SampledError> auto& v)
{
    archive(v.pixels, v.rms, v.upper);
}
void parts(auto& archive, PartsOf<InsertionResult> auto& v)
{
    archive(v.fiv_error, v.no_interreflection_error);
    archive(v.layers, v.technique, v.mean_samples, v.stopped_by_time, v.ratio_error);
    archive(v.table_bytes, v.table_seconds, v.table_processor_seconds, v.findings);
}
void parts(auto& archive, PartsOf<RenderedStage> auto& v)
{
    archive(v.light_findings, v.render);
}

void parts(auto& archive, PartsOf<Camera> auto& v)
{
    archive(v.width, v.height, v.focal_px, v.principal_px, v.position_m, v.right, v.up, v.forward);
    archive(v.division);
}
void parts(auto& archive, PartsOf<ProxyFace> auto& v)
{
    archive(v.corner, v.edge_u, v.edge_v, v.normal, v.triangle, v.two_sided, v.solid, v.box);
    archive(v.name, v.openings);
}
void parts(auto& archive, PartsOf<RoomOpening> auto& v)
{
    archive(v.corners_m);
}
void parts(auto& archive, PartsOf<MirrorBall> auto& v)
{
    archive(v.center_px, v.radius_px, v.radius_m, v.reflectance, v.center_m);
}
void parts(auto& archive, PartsOf<TriangleMesh> auto& v)
{
    archive(v.positions, v.normals, v.texcoords, v.triangles, v.material_of);
}
void parts(auto& archive, PartsOf<Material> auto& v)
{
    archive(v.name, v.base_color, v.alpha, v.metallic, v.roughness, v.specular, v.emissive);
    archive(v.alpha_mask, v.alpha_cutoff, v.double_sided, v.base_color_texture);
    archive(v.metallic_roughness_texture, v.emissive_texture);
}
void parts(auto& archive, PartsOf<Texture> auto& v)
{
    archive(v.texels, v.srgb, v.clamp_s, v.clamp_t);
}
void parts(auto& archive, PartsOf<Model> auto& v)
{
    archive(v.mesh, v.materials, v.textures, v.findings);
}

void parts(auto& archive, PartsOf<Placement> auto& v)
{
    archive(v.pivot_in_model, v.scale, v.rotation_y_rad, v.position_m);
}

void parts(auto& archive, PartsOf<ResponseOptions> auto& v)
{
    archive(v.method, v.samples, v.smoothness, v.refine_exposures);
}
void parts(auto& archive, PartsOf<ChannelNoise> auto& v)
{
    archive(v.read_variance, v.gain, v.code_variance, v.neighbour_correlation);
}
void parts(auto& archive, PartsOf<NoiseModel> auto& v)
{
    archive(v.channels);
}
void parts(auto& archive, PartsOf<MergeOptions> auto& v)
{
    archive(v.clip_fraction, v.black_fraction, v.noise);
}
void parts(auto& archive, PartsOf<AlignmentOptions> auto& v)
{
    archive(v.model, v.max_shift_fraction, v.min_shift_px, v.reference);
}
void parts(auto& archive, PartsOf<DeghostOptions> auto& v)
{
    archive(v.sigmas, v.tolerance, v.min_region_px, v.grow_px);
}
void parts(auto& archive, PartsOf<CaptureOptions> auto& v)
{
    archive(v.align, v.deghost, v.alignment, v.ghosts, v.response, v.merge);
}
void parts(auto& archive, PartsOf<RoomLightOptions> auto& v)
{
    archive(v.texel_m, v.cell_m, v.rays_per_cell, v.fit_unmeasured, v.reference_point_m);
    archive(v.references, v.seed);
}
void parts(auto& archive, PartsOf<PathOptions> auto& v)
{
    archive(v.max_bounces, v.roulette_start);
}
void parts(auto& archive, PartsOf<InterreflectionOptions> auto& v)
{
    archive(v.enabled, v.rounds, v.samples_per_cell, v.seed, v.path);
}
void parts(auto& archive, PartsOf<IrradianceFilterOptions> auto& v)
{
    archive(v.levels, v.range_sigmas);
}
void parts(auto& archive, PartsOf<AtlasOptions> auto& v)
{
    archive(v.face_size, v.resolution, v.samples);
}
/// Where atlases are kept changes no picture.
void parts(auto& archive, PartsOf<FivOptions> auto& v)
{
    archive(v.atlas, v.object_face_size, v.receiver_node_spacing_m, v.object_node_spacing_m);
    archive(v.interpolation_tolerance, v.light, v.object_samples);
}
void parts(auto& archive, PartsOf<InsertionOptions> auto& v)
{
    archive(v.technique, v.max_samples, v.min_samples, v.target_error, v.max_seconds, v.seed);
    archive(v.path, v.interreflection, v.filter, v.fiv);
}
static_assert(sizeof(ResponseOptions) == 24 && sizeof(MergeOptions) == 120);
static_assert(sizeof(ChannelNoise) == 32 && sizeof(NoiseModel) == 96);
static_assert(sizeof(AlignmentOptions) == 32 && sizeof(DeghostOptions) == 24);
static_assert(sizeof(CaptureOptions) == 208);
static_assert(sizeof(RoomLightOptions) == 80 && sizeof(PathOptions) == 8);
static_assert(sizeof(InterreflectionOptions) == 32 && sizeof(IrradianceFilterOptions) == 16);
static_assert(sizeof(AtlasOptions) == 12 && sizeof(FivOptions) == 88);
static_assert(sizeof(InsertionOptions) == 184);

}  // namespace insitu
