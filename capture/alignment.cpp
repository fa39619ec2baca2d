#include "capture/alignment.h"

#include "capture/matched_pyramid.h"
#include "capture/pair_alignment.h"
#include "core/check.h"
#include "core/parallel.h"

#include <Eigen/LU>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace insitu {

namespace {

/// A shift within this many standard deviations of none is none.
constexpr double kSignificance = 2.0;

/// A frame's place relative to the reference, as far as it is known.
struct Place {
    bool known = false;
    Eigen::Matrix3d frame_from_reference = Eigen::Matrix3d::Identity();
    double variance = 0.0;  ///< of the worst corner, pixels squared
    std::string reason;     ///< why it is not known
};

/// Frames in the order in which they are laid down, each beside one that is nearer to the
/// reference in exposure.
std::vector<int> orderFrom(int reference, int count)
{
    std::vector<int> order;
    for (int k = reference - 1; k >= 0; --k)
        order.push_back(k);
    for (int k = reference + 1; k < count; ++k)
        order.push_back(k);
    return order;
}

int towards(int reference, int frame)
{
    return frame < reference ? frame + 1 : frame - 1;
}

/// Every frame relative to its neighbour on the reference's side; where that fails, to the one
/// beyond it.
std::vector<Place> locateFrames(const Bracket& bracket,
                                int reference,
                                const AlignmentOptions& options)
{
    const auto count = static_cast<int>(bracket.frames.size());
    const auto frame = [&](int k) -> const BracketFrame& {
        return bracket.frames[static_cast<std::size_t>(k)];
    };
    const std::vector<int> order = orderFrom(reference, count);
    std::vector<detail::PairFit> links(order.size());
    parallelFor(0, static_cast<std::int64_t>(order.size()), [&](std::int64_t i) {
        const int k = order[static_cast<std::size_t>(i)];
        links[static_cast<std::size_t>(i)] =
            detail::alignPair(frame(towards(reference, k)), frame(k), options);
    });

    std::vector<Place> places(static_cast<std::size_t>(count));
    places[static_cast<std::size_t>(reference)].known = true;
    for (std::size_t i = 0; i < order.size(); ++i) {
        const int k = order[i];
        Place& place = places[static_cast<std::size_t>(k)];
        place.reason = links[i].reason;
        for (int anchor = towards(reference, k);; anchor = towards(reference, anchor)) {
            const Place& known = places[static_cast<std::size_t>(anchor)];
            if (known.known) {
                const detail::PairFit fit =
                    anchor == towards(reference, k)
                        ? links[i]
                        : detail::alignPair(frame(anchor), frame(k), options);
                if (fit.found) {
                    place.known = true;
                    place.frame_from_reference = fit.b_from_a * known.frame_from_reference;
                    place.frame_from_reference /= place.frame_from_reference(2, 2);
                    place.variance = known.variance + fit.sigma_px * fit.sigma_px;
                    break;
                }
            }
            if (anchor == reference) break;
        }
    }
    return places;
}

void reportFailures(const Bracket& bracket,
                    const std::vector<Place>& places,
                    bool moved,
                    Alignment& alignment)
{
    for (std::size_t k = 0; k < places.size(); ++k) {
        if (places[k].known) continue;
        alignment.findings.push_back(
            {moved ? Severity::Warning : Severity::Info,
             "bracket-alignment-failed",
             fmt::format(
                 "{}: how it lies relative to the other exposures cannot be told ({}); it "
                 "is used as it is{}",
                 bracket.frames[k].name,
                 places[k].reason,
                 moved ? ", though the others moved: leave it out if it shows double edges" : "")});
    }
}

void reportShifts(const Bracket& bracket, bool moved, Alignment& alignment)
{
    std::string shifts;
    for (std::size_t k = 0; k < bracket.frames.size(); ++k) {
        if (static_cast<int>(k) == alignment.reference) continue;
        shifts += fmt::format("{}{} {:.2f}",
                              shifts.empty() ? "" : ", ",
                              bracket.frames[k].name,
                              alignment.shift_px[k]);
    }
    const std::string& reference =
        bracket.frames[static_cast<std::size_t>(alignment.reference)].name;
    if (moved)
        alignment.findings.push_back(
            {Severity::Info,
             "bracket-aligned",
             fmt::format("the camera moved between the exposures; laid onto {}, pixels moved: {}",
                         reference,
                         shifts)});
    else
        alignment.findings.push_back(
            {Severity::Info,
             "bracket-static",
             fmt::format(
                 "the exposures lie on each other; pixels apart from {}: {}", reference, shifts)});
}

}  // namespace

Findings AlignmentOptions::validate() const
{
    Findings findings;
    if (!(max_shift_fraction > 0.0 && max_shift_fraction <= 0.5))
        findings.push_back({Severity::Error,
                            "alignment-options",
                            fmt::format("max_shift_fraction is {}, must be above 0 and at most 0.5",
                                        max_shift_fraction)});
    if (!(min_shift_px >= 0.0 && std::isfinite(min_shift_px)))
        findings.push_back(
            {Severity::Error,
             "alignment-options",
             fmt::format("min_shift_px is {}, must be a number of at least 0", min_shift_px)});
    return findings;
}

bool Alignment::isIdentity() const
{
    return std::ranges::all_of(frame_from_reference,
                               [](const glm::dmat3& m) { return m == glm::dmat3(1.0); });
}

Alignment alignBracket(const Bracket& bracket, const AlignmentOptions& options)
{
    requireValid(options.validate(), "alignment options");
    INSITU_CHECK(!bracket.frames.empty(), "empty bracket");
    const std::size_t count = bracket.frames.size();
    if (options.reference &&
        (*options.reference < 0 || static_cast<std::size_t>(*options.reference) >= count))
        throw InputError("alignment options",
                         fmt::format("there is no exposure {} to align to, the bracket has {}",
                                     *options.reference,
                                     count));

    Alignment alignment;
    alignment.reference = options.reference.value_or(detail::bestExposedFrame(bracket));
    alignment.frame_from_reference.assign(count, glm::dmat3(1.0));
    alignment.shift_px.assign(count, 0.0);
    alignment.sigma_px.assign(count, 0.0);
    if (count == 1) return alignment;

    const std::vector<Place> places = locateFrames(bracket, alignment.reference, options);
    const int width = bracket.frames.front().image.codes.width();
    const int height = bracket.frames.front().image.codes.height();
    bool moved = false;
    for (std::size_t k = 0; k < count; ++k) {
        if (!places[k].known) continue;
        alignment.shift_px[k] = detail::cornerShift(places[k].frame_from_reference, width, height);
        alignment.sigma_px[k] = std::sqrt(places[k].variance);
        if (alignment.shift_px[k] <
            std::max(options.min_shift_px, kSignificance * alignment.sigma_px[k]))
            continue;
        alignment.frame_from_reference[k] = detail::toGlm(places[k].frame_from_reference);
        moved = moved || static_cast<int>(k) != alignment.reference;
    }
    if (std::ranges::count_if(places, &Place::known) < 2) {
        alignment.findings.push_back(
            {Severity::Warning,
             "bracket-not-alignable",
             fmt::format("no exposure shows enough in common with {} ({}): whether the camera "
                         "moved cannot be told, and they are used as they are",
                         bracket.frames[static_cast<std::size_t>(alignment.reference)].name,
                         places[alignment.reference == 0 ? 1 : 0].reason)});
        return alignment;
    }
    reportShifts(bracket, moved, alignment);
    reportFailures(bracket, places, moved, alignment);
    return alignment;
}

}  // namespace insitu
