#pragma once

#include <glm/glm.hpp>

#include <cstdint>

namespace insitu {

/// A counter-based stream of uniform numbers in [0, 1): a function of (seed, pixel, sample) and
/// how many were drawn, never of a thread's luck, so that any thread count gives the same bytes.
///
/// Source: PCG-RXS-M-XS 64 output permutation over a 64-bit counter [ONeill14], seeded by
/// splitmix64 mixing [Steele14].
class RandomStream {
public:
    RandomStream(std::uint64_t seed, std::uint64_t pixel, std::uint64_t sample)
        : state_(mix(mix(mix(seed) ^ pixel) ^ (sample * 0x9E3779B97F4A7C15ull)))
    {
    }

    [[nodiscard]] float uniform() { return static_cast<float>(next() >> 40) * 0x1p-24f; }
    [[nodiscard]] double uniformDouble() { return static_cast<double>(next() >> 11) * 0x1p-53; }
    [[nodiscard]] glm::vec2 uniform2()
    {
        const float a = uniform();
        return {a, uniform()};
    }
    /// Uniform integer in [0, n), n > 0.
    [[nodiscard]] std::uint32_t below(std::uint32_t n)
    {
        return static_cast<std::uint32_t>(((next() >> 32) * n) >> 32);
    }
    /// Standard normal deviate (Box–Muller, one of the pair).
    [[nodiscard]] double normal();

private:
    [[nodiscard]] static std::uint64_t mix(std::uint64_t x)
    {
        x += 0x9E3779B97F4A7C15ull;
        x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
        x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
        return x ^ (x >> 31);
    }
    [[nodiscard]] std::uint64_t next()
    {
        state_ = state_ * 6364136223846793005ull + 1442695040888963407ull;
        const std::uint64_t word =
            ((state_ >> ((state_ >> 59) + 5)) ^ state_) * 12605985483714917081ull;
        return (word >> 43) ^ word;
    }

    std::uint64_t state_;
};

}  // namespace insitu
