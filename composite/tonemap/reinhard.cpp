#include "composite/tonemap/reinhard.h"

#include "composite/tonemap/reinhard_adaptation.h"

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

class ReinhardCurve : public ToneCurve {
public:
    // Equation 2, then equation 4.
    ReinhardCurve(const ReinhardOptions& options, const SceneStatistics& statistics)
    {
        if (statistics.largest == 0.0) return;
        scale_ = options.key / statistics.log_average;
        const double white = options.white.value_or(scale_ * statistics.largest);
        inverse_white_squared_ = static_cast<float>(1.0 / (white * white));
    }

    [[nodiscard]] float scale() const override { return static_cast<float>(scale_); }

    void apply(const float* luminance,
               const float* adapted,
               float* display,
               std::ptrdiff_t count) const override
    {
        for (std::ptrdiff_t i = 0; i < count; ++i) {
            const float shown = luminance[i] * (1.0f + luminance[i] * inverse_white_squared_);
            display[i] = std::min(shown / (1.0f + adapted[i]), 1.0f);
        }
    }

private:
    double scale_ = 1.0;
    float inverse_white_squared_ = 0.0f;
};

class Reinhard : public SeparableOperator {
public:
    Reinhard(const ReinhardOptions& options, bool local) : options_(options), local_(local) {}

    [[nodiscard]] std::unique_ptr<ToneCurve> curve(const SceneStatistics& statistics) const override
    {
        return std::make_unique<ReinhardCurve>(options_, statistics);
    }
    [[nodiscard]] std::unique_ptr<LocalAdaptation> local() const override
    {
        if (!local_) return nullptr;
        return std::make_unique<tonemap::ReinhardAdaptation>(options_.key);
    }

private:
    ReinhardOptions options_;
    bool local_;
};

}  // namespace

Findings ReinhardOptions::validate() const
{
    Findings findings;
    const auto require = [&](bool good, const char* code, const std::string& message) {
        if (!good) findings.push_back({Severity::Error, code, message});
    };
    require(std::isfinite(key) && key > 0.0,
            "tonemap-key",
            fmt::format("the key is {}; give a number above 0, 0.18 for middle grey", key));
    require(!white || (std::isfinite(*white) && *white > 0.0),
            "tonemap-white",
            fmt::format("the white point is {}; give a number above 0", white.value_or(0.0)));
    return findings;
}

std::unique_ptr<SeparableOperator> makeReinhard(const ReinhardOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Reinhard>(options, false);
}

std::unique_ptr<SeparableOperator> makeReinhardLocal(const ReinhardOptions& options)
{
    requireValid(options.validate(), "tone mapping");
    return std::make_unique<Reinhard>(options, true);
}

}  // namespace insitu
