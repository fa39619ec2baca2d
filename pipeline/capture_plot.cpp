#include "core/io/file.h"
#include "pipeline/capture_report.h"
#include "pipeline/capture_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace insitu {

namespace {

constexpr std::array<const char*, 3> kChannelColors = {"#c22", "#292", "#22c"};
/// Colours of frames, from the longest to the shortest, over and over.
constexpr std::array<const char*, 8> kFrameColors = {
    "#1b4f8f", "#2a9d8f", "#6a994e", "#bc6c25", "#9b2226", "#7b2cbf", "#555", "#0096c7"};
constexpr double kPanelWidth = 400.0;
constexpr double kPanelHeight = 240.0;
constexpr double kMargin = 60.0;
constexpr double kRowHeight = 20.0;

std::string escaped(const std::string& text)
{
    std::string result;
    for (const char c : text) {
        if (c == '&')
            result += "&amp;";
        else if (c == '<')
            result += "&lt;";
        else
            result += c;
    }
    return result;
}

/// One diagram: a frame on the page and what its axes span.
class Panel {
public:
    Panel(int column, int row, glm::dvec2 low, glm::dvec2 high)
        : corner_(kMargin + column * (kPanelWidth + kMargin),
                  kMargin + row * (kPanelHeight + 1.4 * kMargin)),
          low_(low),
          high_(high)
    {
    }

    [[nodiscard]] glm::dvec2 place(double x, double y) const
    {
        const glm::dvec2 share = glm::clamp(
            (glm::dvec2(x, y) - low_) / (high_ - low_), glm::dvec2(-0.02), glm::dvec2(1.02));
        return corner_ + glm::dvec2(share.x * kPanelWidth, (1.0 - share.y) * kPanelHeight);
    }

    void title(std::string& svg, const std::string& text, const std::string& x_axis) const
    {
        svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n",
                           corner_.x,
                           corner_.y - 10,
                           text);
        svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\" text-anchor=\"end\">{}</text>\n",
                           corner_.x + kPanelWidth,
                           corner_.y + kPanelHeight + 34,
                           x_axis);
    }

    void verticalAt(std::string& svg, double x, const std::string& label) const
    {
        line(svg, place(x, low_.y), place(x, high_.y));
        const glm::dvec2 foot = place(x, low_.y);
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n",
                           foot.x,
                           foot.y + 16,
                           label);
    }
    void horizontalAt(std::string& svg, double y, const std::string& label) const
    {
        line(svg, place(low_.x, y), place(high_.x, y));
        const glm::dvec2 left = place(low_.x, y);
        svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n",
                           left.x - 6,
                           left.y + 4,
                           label);
    }

    void curve(std::string& svg, const std::vector<glm::dvec2>& points, const char* color) const
    {
        if (points.empty()) return;
        std::string path;
        for (const glm::dvec2 point : points) {
            const glm::dvec2 at = place(point.x, point.y);
            path += fmt::format("{}{:.1f} {:.1f} ", path.empty() ? "M" : "L", at.x, at.y);
        }
        svg += fmt::format(
            "<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.5\"/>\n", path, color);
    }

    void bar(std::string& svg, glm::dvec2 from, glm::dvec2 to, const char* color) const
    {
        const glm::dvec2 a = place(from.x, from.y);
        const glm::dvec2 b = place(to.x, to.y);
        svg += fmt::format(
            "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n",
            std::min(a.x, b.x),
            std::min(a.y, b.y),
            std::abs(a.x - b.x),
            std::abs(a.y - b.y),
            color);
    }

private:
    static void line(std::string& svg, glm::dvec2 a, glm::dvec2 b)
    {
        svg += fmt::format(
            "<path d=\"M{:.1f} {:.1f} L{:.1f} {:.1f}\" stroke=\"#ddd\"/>\n", a.x, a.y, b.x, b.y);
    }

    glm::dvec2 corner_;
    glm::dvec2 low_;
    glm::dvec2 high_;
};

const char* frameColor(std::size_t frame)
{
    return kFrameColors[frame % kFrameColors.size()];
}

void drawResponse(std::string& svg, const ResponseCurve& response)
{
    constexpr double kLowestStop = -10.0;
    constexpr double kHighestStop = 4.0;
    const Panel panel(0, 0, {kLowestStop, 0.0}, {kHighestStop, 255.0});
    panel.title(svg,
                fmt::format("Response: code of each channel ({})", escaped(response.source)),
                "exposure, stops from code 128");
    for (double stop = kLowestStop; stop <= kHighestStop; stop += 2.0)
        panel.verticalAt(svg, stop, fmt::format("{:.0f}", stop));
    for (int code = 0; code <= 255; code += 51)
        panel.horizontalAt(svg, code, fmt::format("{}", code));
    for (std::size_t c = 0; c < 3; ++c) {
        const auto& table = response.exposure[c];
        std::vector<glm::dvec2> points;
        for (std::size_t code = 0; code < table.size(); ++code) {
            const double stops = std::log2(std::max(table[code], 1e-30) / table[128]);
            if (stops >= kLowestStop && stops <= kHighestStop)
                points.emplace_back(stops, static_cast<double>(code));
        }
        panel.curve(svg, points, kChannelColors[c]);
    }
}

void drawRadianceAxis(std::string& svg, const Panel& panel, double low, double high)
{
    const double step = std::max(2.0, std::ceil((high - low) / 8.0));
    for (double stop = std::ceil(low); stop <= high; stop += step)
        panel.verticalAt(svg, stop, fmt::format("{:.0f}", stop));
}

void drawWeights(std::string& svg, const CapturedRadiance& captured)
{
    constexpr int kGreen = 1;
    const WeightCurve curve = mergeWeights(captured, kGreen);
    if (curve.radiance.empty()) return;
    const double low = std::log2(curve.radiance.front());
    const double high = std::log2(curve.radiance.back());
    const Panel panel(1, 0, {low, 0.0}, {high, 1.0});
    panel.title(svg, "Weight of each exposure (green channel)", "log2 of the radiance");
    drawRadianceAxis(svg, panel, low, high);
    for (int i = 0; i <= 4; ++i)
        panel.horizontalAt(svg, 0.25 * i, fmt::format("{} %", 25 * i));
    for (std::size_t k = 0; k < curve.weight.size(); ++k) {
        std::vector<glm::dvec2> points;
        for (std::size_t i = 0; i < curve.radiance.size(); ++i)
            points.emplace_back(std::log2(curve.radiance[i]), curve.weight[k][i]);
        panel.curve(svg, points, frameColor(k));
    }
}

void drawDeviations(std::string& svg, const CapturedRadiance& captured)
{
    const std::vector<DeviationStep> steps = mergedDeviations(captured.merged);
    if (steps.empty()) return;
    const double low = std::log2(steps.front().radiance) - 0.5;
    const double high = std::log2(steps.back().radiance) + 0.5;
    // Decades from 0.01 % to 100 %.
    const Panel panel(0, 1, {low, -4.0}, {high, 0.0});
    panel.title(
        svg, "Standard deviation of merged pixels: median, 10 % and 90 %", "log2 of the luminance");
    drawRadianceAxis(svg, panel, low, high);
    for (int decade = -4; decade <= 0; ++decade)
        panel.horizontalAt(svg, decade, fmt::format("{:g} %", 100.0 * std::pow(10.0, decade)));
    const auto draw = [&](double DeviationStep::*member, const char* color) {
        std::vector<glm::dvec2> points;
        for (const DeviationStep& step : steps)
            points.emplace_back(std::log2(step.radiance), std::log10(step.*member + 1e-12));
        panel.curve(svg, points, color);
    };
    draw(&DeviationStep::low, "#aaa");
    draw(&DeviationStep::high, "#aaa");
    draw(&DeviationStep::median, "#222");
}

void drawClipping(std::string& svg, const CapturedRadiance& captured)
{
    const auto count = static_cast<double>(captured.frames.size());
    const Panel panel(1, 1, {0.0, 0.0}, {count, 1.0});
    panel.title(svg,
                fmt::format("Clipped (red) and black (grey) pixels; clipped in all: {:.2f} %",
                            100.0 * captured.merged.clipped_fraction),
                "exposure, longest first");
    for (int i = 0; i <= 4; ++i)
        panel.horizontalAt(svg, 0.25 * i, fmt::format("{} %", 25 * i));
    for (std::size_t k = 0; k < captured.frames.size(); ++k) {
        const auto at = static_cast<double>(k);
        const CapturedFrame& frame = captured.frames[k];
        panel.bar(svg, {at + 0.1, 0.0}, {at + 0.5, frame.clipped_fraction}, "#c33");
        panel.bar(svg, {at + 0.5, 0.0}, {at + 0.9, frame.black_fraction}, "#888");
        panel.bar(svg, {at + 0.1, -0.02}, {at + 0.9, -0.005}, frameColor(k));
    }
}

void drawTable(std::string& svg, const CapturedRadiance& captured, double top)
{
    constexpr std::array<double, 7> kColumns = {60, 300, 400, 500, 600, 700, 800};
    const auto row = [&](std::size_t line, const std::array<std::string, 7>& cells, bool bold) {
        for (std::size_t i = 0; i < cells.size(); ++i)
            svg += fmt::format("<text x=\"{:.0f}\" y=\"{:.0f}\"{}>{}</text>\n",
                               kColumns[i],
                               top + kRowHeight * static_cast<double>(line),
                               bold ? " font-weight=\"bold\"" : "",
                               escaped(cells[i]));
    };
    row(0, {"exposure", "given", "measured", "used", "used / given", "clipped", "black"}, true);
    for (std::size_t k = 0; k < captured.frames.size(); ++k) {
        const CapturedFrame& frame = captured.frames[k];
        const double change = std::log2(frame.used_exposure / frame.nominal_exposure);
        const double y = top + kRowHeight * static_cast<double>(k + 1);
        svg += fmt::format("<rect x=\"42\" y=\"{:.0f}\" width=\"10\" height=\"10\" fill=\"{}\"/>\n",
                           y - 10,
                           frameColor(k));
        row(k + 1,
            {frame.name,
             fmt::format("{:.4g}", frame.nominal_exposure),
             frame.measured_exposure ? fmt::format("{:.4g}", *frame.measured_exposure) : "-",
             fmt::format("{:.4g}", frame.used_exposure),
             fmt::format("{:+.3f} EV", change),
             fmt::format("{:.2f} %", 100.0 * frame.clipped_fraction),
             fmt::format("{:.2f} %", 100.0 * frame.black_fraction)},
            false);
    }
}

}  // namespace

void writeCapturePlot(const std::filesystem::path& path, const CapturedRadiance& captured)
{
    const double width = 2.0 * kPanelWidth + 2.7 * kMargin;
    const double table_top = kMargin + 2.0 * (kPanelHeight + 1.4 * kMargin);
    const double height =
        table_top + kRowHeight * (static_cast<double>(captured.frames.size()) + 1.5);
    std::string svg = fmt::format(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "font-family=\"sans-serif\" font-size=\"12\">\n"
        "<rect width=\"{0:.0f}\" height=\"{1:.0f}\" fill=\"white\"/>\n",
        width,
        height);
    drawResponse(svg, captured.response);
    drawWeights(svg, captured);
    drawDeviations(svg, captured);
    drawClipping(svg, captured);
    drawTable(svg, captured, table_top);
    writeTextFile(path, svg + "</svg>\n");
}

}  // namespace insitu
