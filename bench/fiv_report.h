#pragma once

#include "core/io/file.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace insitu::report {

/// Wall and processor time since construction; the latter is of all threads and hardly changes on a
/// busy machine.
class Stopwatch {
public:
    struct Seconds {
        double wall = 0.0, processor = 0.0;
    };
    [[nodiscard]] Seconds passed() const
    {
        return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(),
                processorSeconds() - processor_};
    }

private:
    [[nodiscard]] static double processorSeconds()
    {
        rusage usage{};
        getrusage(RUSAGE_SELF, &usage);
        const auto seconds = [](const timeval& t) {
            return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
        };
        return seconds(usage.ru_utime) + seconds(usage.ru_stime);
    }
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
    double processor_ = processorSeconds();
};

/// Fastest of some runs.
template <class Body>
Stopwatch::Seconds fastest(int runs, const Body& body)
{
    Stopwatch::Seconds best{1e30, 1e30};
    for (int i = 0; i < runs; ++i) {
        const Stopwatch watch;
        body();
        const auto passed = watch.passed();
        best = {std::min(best.wall, passed.wall), std::min(best.processor, passed.processor)};
    }
    return best;
}

/// One line of the table: a technique on a configuration.
struct Row {
    std::string configuration, technique;
    double precompute_s = 0.0;  ///< processor time before a frame can be shaded
    double shade_s = 0.0;       ///< processor time of all places
    double memory_mb = 0.0;
    double nrmse = 0.0;  ///< against brute force; < 0: not an error measurement
    std::string asked;
};

class Table {
public:
    void add(const Row& row)
    {
        rows_.push_back(row);
        fmt::print("{:<34} {:<36} {:>9.3f} {:>9.4f} {:>8.2f} {:>9} {}\n",
                   row.configuration,
                   row.technique,
                   row.precompute_s,
                   row.shade_s,
                   row.memory_mb,
                   row.nrmse < 0.0 ? "-" : fmt::format("{:.5f}", row.nrmse),
                   row.asked);
        std::fflush(stdout);
    }
    static void printHead()
    {
        fmt::print("{:<34} {:<36} {:>9} {:>9} {:>8} {:>9} {}\n",
                   "configuration",
                   "technique",
                   "before, s",
                   "shade, s",
                   "MB",
                   "NRMSE",
                   "asked (thesis)");
    }
    /// fiv.csv, and fiv.svg: processor time against error, one colour a technique.
    void write(const std::filesystem::path& folder) const;

private:
    std::vector<Row> rows_;
};

inline void Table::write(const std::filesystem::path& folder) const
{
    std::filesystem::create_directories(folder);
    std::string csv = "configuration,technique,precompute_s,shade_s,memory_mb,nrmse,asked\n";
    for (const Row& r : rows_)
        csv += fmt::format("\"{}\",\"{}\",{:.6f},{:.6f},{:.3f},{},\"{}\"\n",
                           r.configuration,
                           r.technique,
                           r.precompute_s,
                           r.shade_s,
                           r.memory_mb,
                           r.nrmse < 0.0 ? "" : fmt::format("{:.6f}", r.nrmse),
                           r.asked);
    writeTextFile(folder / "fiv.csv", csv);

    std::vector<std::string> techniques;
    for (const Row& r : rows_)
        if (r.nrmse > 0.0 && std::ranges::find(techniques, r.technique) == techniques.end())
            techniques.push_back(r.technique);
    const auto color = [&](std::size_t i) {
        return fmt::format("hsl({},70%,42%)",
                           360 * i / std::max<std::size_t>(techniques.size(), 1));
    };
    // Decades: 1 ms to 1000 s across, 1e-4 to 1 down.
    const auto x = [](double s) { return 70.0 + 110.0 * (std::log10(std::max(s, 1e-3)) + 3.0); };
    const auto y = [](double e) { return 20.0 - 120.0 * std::log10(std::clamp(e, 1e-4, 1.0)); };
    std::string svg =
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1100\" height=\"560\" "
        "font-family=\"sans-serif\" font-size=\"11\"><rect width=\"1100\" "
        "height=\"560\" fill=\"white\"/>\n";
    for (int d = -3; d <= 3; ++d)
        svg += fmt::format(
            "<path d=\"M{0} 20V500\" stroke=\"#ddd\"/><text x=\"{0}\" y=\"516\" "
            "text-anchor=\"middle\">1e{1} s</text>\n",
            x(std::pow(10.0, d)),
            d);
    for (int d = -4; d <= 0; ++d)
        svg += fmt::format(
            "<path d=\"M70 {0}H730\" stroke=\"#ddd\"/><text x=\"64\" y=\"{0}\" "
            "text-anchor=\"end\">1e{1}</text>\n",
            y(std::pow(10.0, d)),
            d);
    svg +=
        "<text x=\"400\" y=\"540\" text-anchor=\"middle\">processor time before and for all "
        "places</text><text x=\"16\" y=\"260\" transform=\"rotate(-90 16 260)\" "
        "text-anchor=\"middle\">NRMSE against brute force</text>\n";
    for (const Row& r : rows_) {
        if (!(r.nrmse > 0.0)) continue;
        const auto i = static_cast<std::size_t>(std::ranges::find(techniques, r.technique) -
                                                techniques.begin());
        svg += fmt::format(
            "<g><title>{3}: {4}</title><circle cx=\"{0:.1f}\" cy=\"{1:.1f}\" r=\"5\" "
            "fill=\"{2}\"/></g>\n",
            x(r.precompute_s + r.shade_s),
            y(r.nrmse),
            color(i),
            r.configuration,
            r.technique);
    }
    for (std::size_t i = 0; i < techniques.size(); ++i)
        svg += fmt::format(
            "<circle cx=\"760\" cy=\"{0}\" r=\"5\" fill=\"{1}\"/><text x=\"772\" "
            "y=\"{2}\">{3}</text>\n",
            30 + 20 * i,
            color(i),
            34 + 20 * i,
            techniques[i]);
    writeTextFile(folder / "fiv.svg", svg + "</svg>\n");
}

}  // namespace insitu::report
