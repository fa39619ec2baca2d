#pragma once

#include "composite/tonemap/ashikhmin.h"
#include "composite/tonemap/durand.h"
#include "composite/tonemap/histogram_adjustment.h"
#include "composite/tonemap/reinhard.h"
#include "composite/tonemap/selective.h"

#include <CLI/CLI.hpp>

#include <filesystem>
#include <memory>
#include <string>

namespace insitu::cli {

/// Flags that choose and tune a tone mapping operator, shared by the commands that map tones.
class TonemapOptions {
public:
    /// Adds the flags to a subcommand, as a group of its help; this object must outlive it.
    void addTo(CLI::App& command);
    /// The operator that the flags ask for. Reads maps. CLI::ValidationError for a flag that the
    /// operator does not have, InputError for bad values and files.
    /// `always`, when not empty, counts besides what the flags name (selective).
    [[nodiscard]] std::unique_ptr<ToneMapOperator> make(const CLI::App& command,
                                                        const Image<float>& always = {}) const;
    /// False when the operator makes its curve from the picture alone.
    [[nodiscard]] bool sharesCurves() const;
    [[nodiscard]] const std::string& name() const { return name_; }

private:
    [[nodiscard]] std::unique_ptr<SeparableOperator> makeSeparable(const std::string& name) const;

    std::string name_ = "reinhard";
    std::string selected_ = "ashikhmin";
    ReinhardOptions reinhard_;
    ViewingOptions viewing_;
    AshikhminOptions ashikhmin_;
    DurandOptions durand_;
    HistogramAdjustmentOptions histogram_;
    double importance_threshold_ = SelectiveOptions{}.importance_threshold;
    std::filesystem::path importance_;
    std::filesystem::path always_;
};

}  // namespace insitu::cli
