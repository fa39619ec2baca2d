#include "pipeline/radiance_mesh_stage.h"

#include "core/io/image_io.h"
#include "pipeline/photo_light.h"
#include "pipeline/probe_location.h"

namespace insitu {

ProjectRadianceMesh projectRadianceMesh(const Project& given,
                                        const InsertOptions& options,
                                        const RadianceMeshOptions& mesh_options,
                                        Progress& progress)
{
    InsertResult result;
    Project project = given;
    result.photo = readPhotograph(project.photo.path);
    append(result.findings,
           photoFindings(result.photo.metadata, project.photo.path.filename().string()));
    result.camera = solveCamera(project, result.photo, options.use_exif_focal);
    append(result.findings, result.camera.findings);
    append(result.findings, placeProbeFromOutline(result.camera, project));
    const SceneProxy proxy(project.room);
    append(result.findings, proxy.findings());
    result.light = captureLight(project, proxy, result.camera.camera, options);
    append(result.findings, result.light.findings);
    choosePhotoResponse(project, proxy, result);
    const std::optional<PhotographedRadiance> photographed =
        photoLight(project, proxy, result.photo.metadata.color.rec709_from_linear, result)
            .in_probe_unit;
    RoomLightOptions light_options = options.light;
    light_options.reference_point_m = project.objects.front().position_m;
    light_options.references = allReferences(project, photographed, result);
    const RoomLight room(proxy,
                         result.light.environment,
                         result.light.center_m,
                         photographed,
                         light_options,
                         progress);
    append(result.findings, room.findings());
    return {makeRadianceMesh(
                room, result.light.environment, result.light.center_m, photographed, mesh_options),
            result.findings};
}

}  // namespace insitu
