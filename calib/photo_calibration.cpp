#include "calib/photo_calibration.h"

#include "calib/exif_focal.h"
#include "calib/exif_gravity.h"

namespace insitu {

CalibrationOptions withExif(CalibrationOptions options, const Photo& photo)
{
    if (!options.exif_focal_px)
        if (const auto exif = focalFromExif(
                photo.metadata, photo.image.codes.width(), photo.image.codes.height())) {
            options.exif_focal_px = exif->focal_px;
            options.exif_focal_sigma = exif->sigma;
        }
    if (options.use_exif_gravity && !options.exif_gravity)
        options.exif_gravity = gravityFromExif(photo.metadata);
    return options;
}

CameraEstimate calibratePhoto(const LineSet& lines,
                              const Photo& photo,
                              const CalibrationOptions& options,
                              const std::string& source)
{
    checkLinesMatchPhoto(lines, photo.image.codes.width(), photo.image.codes.height(), source);
    return calibrateCamera(lines, withExif(options, photo), source);
}

}  // namespace insitu
