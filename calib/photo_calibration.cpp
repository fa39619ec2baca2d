#include "calib/photo_calibration.h"

#include "calib/exif_focal.h"

namespace insitu {

CameraEstimate calibratePhoto(const LineSet& lines,
                              const Photo& photo,
                              CalibrationOptions options,
                              const std::string& source)
{
    const int width = photo.image.codes.width();
    const int height = photo.image.codes.height();
    checkLinesMatchPhoto(lines, width, height, source);
    if (!options.exif_focal_px) {
        if (const auto exif = focalFromExif(photo.metadata, width, height)) {
            options.exif_focal_px = exif->focal_px;
            options.exif_focal_sigma = exif->sigma;
        }
    }
    return calibrateCamera(lines, options, source);
}

}  // namespace insitu
