#include "capture/bracket.h"

#include "core/check.h"
#include "core/io/image_io.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace insitu {

namespace {

/// Exposures closer than this are the same: EXIF times are rounded to about three digits.
constexpr double kSameExposureRatio = 1.01;

Exposure overridden(Exposure exif, const Exposure& given)
{
    if (given.seconds) exif.seconds = given.seconds;
    if (given.f_number) exif.f_number = given.f_number;
    if (given.iso) exif.iso = given.iso;
    return exif;
}

double requireExposure(const Exposure& exposure, const std::string& name)
{
    const std::optional<double> relative = exposure.relative();
    if (!relative)
        throw InputError(name,
                         "no exposure time in EXIF; give --exposures 1/60,... or add "
                         "exposure_seconds to the project file");
    if (!std::isfinite(*relative) || !(*relative > 0.0))
        throw InputError(name, fmt::format("exposure {} is not a positive number", *relative));
    return *relative;
}

void checkFrame(const BracketFrame& frame, const BracketFrame& first)
{
    if (frame.image.codes.empty()) throw InputError(frame.name, "the image is empty");
    if (!frame.image.codes.sameSize(first.image.codes))
        throw InputError(frame.name,
                         fmt::format("{}x{} pixels, but {} has {}x{}: the exposures of a bracket "
                                     "must have the same size (not cropped by hand)",
                                     frame.image.codes.width(),
                                     frame.image.codes.height(),
                                     first.name,
                                     first.image.codes.width(),
                                     first.image.codes.height()));
    INSITU_CHECK(frame.excluded.empty() || frame.excluded.sameSize(frame.image.codes),
                 "{}: mask of {}x{}",
                 frame.name,
                 frame.excluded.width(),
                 frame.excluded.height());
}

void checkMetadata(const std::vector<Exposure>& exposures,
                   const std::vector<std::string>& cameras,
                   Findings& findings)
{
    const auto with_f = std::ranges::count_if(exposures, [](auto& e) { return !!e.f_number; });
    const auto with_iso = std::ranges::count_if(exposures, [](auto& e) { return !!e.iso; });
    const auto all = static_cast<std::ptrdiff_t>(exposures.size());
    if ((with_f != 0 && with_f != all) || (with_iso != 0 && with_iso != all))
        findings.push_back({Severity::Warning,
                            "bracket-partial-exposure",
                            "f-number or ISO is known for some exposures of the bracket only; the "
                            "others count as N = 1 and ISO 100, which is hardly right: give them"});
    if (std::ranges::any_of(cameras, [&](auto& camera) { return camera != cameras.front(); }))
        findings.push_back({Severity::Warning,
                            "bracket-mixed-cameras",
                            "the exposures of the bracket name different cameras in EXIF"});
}

}  // namespace

Bracket makeBracket(std::vector<BracketFrame> frames, PhotoMetadata metadata)
{
    if (frames.empty()) throw InputError("bracket", "no image given");
    for (const BracketFrame& frame : frames) {
        checkFrame(frame, frames.front());
        if (!std::isfinite(frame.relative_exposure) || !(frame.relative_exposure > 0.0))
            throw InputError(frame.name, "the exposure is not a positive number");
    }
    Bracket bracket;
    bracket.frames = std::move(frames);
    bracket.metadata = std::move(metadata);
    std::ranges::stable_sort(bracket.frames, [](const BracketFrame& a, const BracketFrame& b) {
        return a.relative_exposure > b.relative_exposure;
    });

    bool different = false;
    for (std::size_t i = 1; i < bracket.frames.size(); ++i) {
        const BracketFrame& longer = bracket.frames[i - 1];
        const BracketFrame& shorter = bracket.frames[i];
        if (longer.relative_exposure > kSameExposureRatio * shorter.relative_exposure)
            different = true;
        else
            bracket.findings.push_back(
                {Severity::Info,
                 "bracket-duplicate-exposure",
                 fmt::format("{} and {} have the same exposure; they are averaged",
                             longer.name,
                             shorter.name)});
    }
    if (!different)
        bracket.findings.push_back(
            {Severity::Warning,
             "bracket-single-exposure",
             fmt::format("{}: only one exposure: neither the camera's response nor clipped lights "
                         "can be measured; take at least three, 2 EV apart",
                         bracket.frames.front().name)});
    return bracket;
}

Bracket readBracket(const std::vector<std::filesystem::path>& files,
                    const std::vector<Exposure>& overrides)
{
    INSITU_CHECK(overrides.empty() || overrides.size() == files.size(),
                 "{} exposures for {} files",
                 overrides.size(),
                 files.size());
    std::vector<BracketFrame> frames;
    std::vector<Exposure> exposures;
    std::vector<std::string> cameras;
    PhotoMetadata first;
    Findings told;
    for (std::size_t i = 0; i < files.size(); ++i) {
        Photo photo = readPhoto(files[i]);
        // One picture of a camera speaks for all of them.
        if (told.empty()) told = photoFindings(photo.metadata, files[i].filename().string());
        const Exposure exposure = overrides.empty()
                                      ? photo.metadata.exposure
                                      : overridden(photo.metadata.exposure, overrides[i]);
        BracketFrame frame;
        frame.name = files[i].filename().string();
        frame.relative_exposure = requireExposure(exposure, files[i].string());
        frame.image = std::move(photo.image);
        frames.push_back(std::move(frame));
        exposures.push_back(exposure);
        cameras.push_back(photo.metadata.make + " " + photo.metadata.model);
        if (i == 0) first = std::move(photo.metadata);
    }
    Bracket bracket = makeBracket(std::move(frames), std::move(first));
    checkMetadata(exposures, cameras, bracket.findings);
    append(bracket.findings, std::move(told));
    return bracket;
}

}  // namespace insitu
