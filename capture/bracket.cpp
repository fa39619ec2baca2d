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

/// The frame's picture in the middle of a larger one, its border repeated and excluded.
void putIntoMiddle(BracketFrame& frame, int width, int height)
{
    const Image<glm::u16vec3> cut = std::move(frame.image.codes);
    const int left = (width - cut.width()) / 2;
    const int top = (height - cut.height()) / 2;
    frame.image.codes = Image<glm::u16vec3>(width, height);
    frame.excluded = Image<std::uint8_t>(width, height);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const int from_x = std::clamp(x - left, 0, cut.width() - 1);
            const int from_y = std::clamp(y - top, 0, cut.height() - 1);
            frame.image.codes(x, y) = cut(from_x, from_y);
            frame.excluded(x, y) = from_x + left == x && from_y + top == y ? 0 : 1;
        }
    }
}

/// Gives hand-cut pictures one size. False when they had it.
bool makeEqualSized(std::vector<BracketFrame>& frames)
{
    constexpr double kLeastShare = 0.75;  // of the largest: less is hardly the same thing
    int width = 0;
    int height = 0;
    for (const BracketFrame& frame : frames) {
        width = std::max(width, frame.image.codes.width());
        height = std::max(height, frame.image.codes.height());
    }
    bool changed = false;
    for (BracketFrame& frame : frames) {
        const Image<glm::u16vec3>& codes = frame.image.codes;
        if (codes.empty() || (codes.width() == width && codes.height() == height)) continue;
        if (codes.width() < kLeastShare * width || codes.height() < kLeastShare * height)
            throw InputError(frame.name,
                             fmt::format("{}x{} pixels, others up to {}x{}: too different to be "
                                         "cut-outs of the same thing; cut all about equally large",
                                         codes.width(),
                                         codes.height(),
                                         width,
                                         height));
        putIntoMiddle(frame, width, height);
        changed = true;
    }
    return changed;
}

/// The same picture twice under one exposure counts once: its noise is no second measurement.
void leaveOutRepeated(Bracket& bracket)
{
    std::vector<BracketFrame> kept;
    for (BracketFrame& frame : bracket.frames) {
        const auto original = std::ranges::find_if(kept, [&](const BracketFrame& other) {
            return other.relative_exposure == frame.relative_exposure &&
                   other.image.max_code == frame.image.max_code &&
                   other.image.codes == frame.image.codes;
        });
        if (original == kept.end()) {
            kept.push_back(std::move(frame));
            continue;
        }
        bracket.findings.push_back(
            {Severity::Warning,
             "bracket-repeated-picture",
             fmt::format(
                 "{} is the same picture as {}; it is left out", frame.name, original->name)});
    }
    bracket.frames = std::move(kept);
}

/// What a file of the bracket says beside its pixels.
struct FrameFacts {
    std::filesystem::path file;
    double relative_exposure = 0.0;
    PhotoMetadata metadata;
};

/// White balance is part of a RAW file's matrix and may differ; nothing else may.
void checkColors(const FrameFacts& facts, const FrameFacts& first)
{
    const ColorProfile& color = facts.metadata.color;
    const ColorProfile& expected = first.metadata.color;
    const std::string other = first.file.filename().string();
    if (color.transfer_is_response != expected.transfer_is_response)
        throw InputError(facts.file.string(),
                         fmt::format("{} RAW, unlike {}: give a bracket of RAW files or one of "
                                     "pictures, not both",
                                     color.transfer_is_response ? "is" : "is not",
                                     other));
    if (!color.transfer_is_response && !sameColors(color, expected))
        throw InputError(facts.file.string(),
                         fmt::format("has the colour profile '{}', {} has '{}': export all "
                                     "exposures with the same",
                                     color.name,
                                     other,
                                     expected.name));
}

void checkMetadata(const std::vector<FrameFacts>& facts, Findings& findings)
{
    const auto all = static_cast<std::ptrdiff_t>(facts.size());
    const auto with_f = std::ranges::count_if(
        facts, [](const FrameFacts& f) { return !!f.metadata.exposure.f_number; });
    const auto with_iso =
        std::ranges::count_if(facts, [](const FrameFacts& f) { return !!f.metadata.exposure.iso; });
    if ((with_f != 0 && with_f != all) || (with_iso != 0 && with_iso != all))
        findings.push_back({Severity::Warning,
                            "bracket-partial-exposure",
                            "f-number or ISO is known for some exposures of the bracket only; the "
                            "others count as N = 1 and ISO 100, which is hardly right: give them"});
    const PhotoMetadata& first = facts.front().metadata;
    if (std::ranges::any_of(facts, [&](const FrameFacts& f) {
            return f.metadata.make != first.make || f.metadata.model != first.model;
        }))
        findings.push_back({Severity::Warning,
                            "bracket-mixed-cameras",
                            "the exposures of the bracket name different cameras in EXIF"});
    constexpr double kSameBalance = 0.01;
    if (std::ranges::any_of(facts, [&](const FrameFacts& f) {
            return !sameColors(f.metadata.color, first.color, kSameBalance);
        }))
        findings.push_back({Severity::Info,
                            "bracket-white-balance",
                            "the RAW files were taken with different white balances (automatic?); "
                            "that of the longest exposure is used for all"});
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

    leaveOutRepeated(bracket);

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
                    const std::vector<Exposure>& overrides,
                    FrameSizes sizes)
{
    INSITU_CHECK(overrides.empty() || overrides.size() == files.size(),
                 "{} exposures for {} files",
                 overrides.size(),
                 files.size());
    std::vector<BracketFrame> frames;
    std::vector<FrameFacts> facts;
    for (std::size_t i = 0; i < files.size(); ++i) {
        Photo photo = readPhoto(files[i]);
        if (!overrides.empty())
            photo.metadata.exposure = overridden(photo.metadata.exposure, overrides[i]);
        BracketFrame frame;
        frame.name = files[i].filename().string();
        frame.relative_exposure = requireExposure(photo.metadata.exposure, files[i].string());
        frame.image = std::move(photo.image);
        facts.push_back({files[i], frame.relative_exposure, std::move(photo.metadata)});
        checkColors(facts.back(), facts.front());
        frames.push_back(std::move(frame));
    }
    const bool hand_cut = sizes == FrameSizes::HandCut && makeEqualSized(frames);
    Bracket bracket = makeBracket(std::move(frames));
    bracket.hand_cut = hand_cut;
    if (hand_cut)
        bracket.findings.push_back(
            {Severity::Info,
             "bracket-hand-cut",
             "the exposures differ in size: they are taken to be cut out of larger pictures and "
             "are laid onto each other by what they show"});
    checkMetadata(facts, bracket.findings);
    // The longest speaks for all, in whatever order they were given.
    const auto longest = std::ranges::max_element(facts, {}, &FrameFacts::relative_exposure);
    append(bracket.findings, photoFindings(longest->metadata, longest->file.filename().string()));
    bracket.metadata = std::move(longest->metadata);
    return bracket;
}

}  // namespace insitu
