#pragma once

#include "reconstruct/scene_graph.h"

#include <Eigen/Core>

#include <array>
#include <span>
#include <string>
#include <vector>

namespace insitu {

/// Where the primitives of a scene graph stand, with derivatives. Private to this module.

/// Unknowns that a primitive may depend on: its own and its ancestors'.
inline constexpr int kMaxChain = 64;
using ChainGradient = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxChain, 1>;

/// A number and its derivatives with respect to a primitive's chain.
struct ChainNumber {
    double value = 0.0;
    ChainGradient gradient;
};

/// A number to be solved.
struct SceneUnknown {
    std::size_t primitive = 0;
    std::string label;  ///< "cupboard.width_m"
    std::optional<std::size_t> parameter;
    double minimum = -1e6;
    double maximum = 1e6;
    double start = 0.0;
    std::optional<double> prior_sigma;
};

/// Pose of a primitive at the present state: x_in_world = (x, y, z) + R_y(turn) x_in_primitive.
struct ScenePose {
    ChainNumber turn;
    std::array<ChainNumber, 3> position;
    std::vector<double> parameters;
};

/// A world point and its derivatives, a row for each coordinate, a column for each of the chain.
struct ChainPoint {
    glm::dvec3 value{0.0};
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxChain> jacobian;
};

/// The unknowns of a scene graph and how poses follow from them.
class SceneLayout {
public:
    /// The graph must be free of problems (sceneProblem) and outlive this.
    explicit SceneLayout(const SceneGraph& graph);

    [[nodiscard]] const std::vector<SceneUnknown>& unknowns() const { return unknowns_; }
    /// The primitives whose unknowns a primitive depends on, ascending; the last is itself.
    [[nodiscard]] std::span<const std::size_t> ancestry(std::size_t primitive) const
    {
        return plans_[primitive].ancestry;
    }
    /// A primitive's own unknowns are consecutive.
    [[nodiscard]] std::size_t firstUnknown(std::size_t primitive) const
    {
        return plans_[primitive].first;
    }
    [[nodiscard]] std::size_t unknownCount(std::size_t primitive) const
    {
        return plans_[primitive].count;
    }
    /// Indices of the unknowns that the columns of a primitive's gradients stand for.
    [[nodiscard]] std::span<const std::size_t> chain(std::size_t primitive) const
    {
        return plans_[primitive].chain;
    }

    /// One value an unknown → all poses.
    void evaluate(std::span<const double> state, std::vector<ScenePose>& poses) const;
    [[nodiscard]] ChainPoint vertex(const std::vector<ScenePose>& poses, SceneVertex which) const;

private:
    static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
    /// A contact with the planes of its two faces.
    struct Touch {
        SceneContact contact;
        AxisPlane own;
        AxisPlane target;
    };
    /// How a primitive's pose comes about.
    struct Plan {
        std::size_t first = 0;
        std::size_t count = 0;
        std::vector<std::size_t> ancestry;
        std::vector<std::size_t> chain;
        std::size_t frame = kNone;      ///< what turn and place are counted from
        std::size_t turn_from = kNone;  ///< the primitive whose turn is taken over
        double turn_offset = 0.0;       ///< added to it, or the turn itself
        std::size_t turn_unknown = kNone;
        std::size_t height_unknown = kNone;
        std::array<std::optional<Touch>, 2> contact;  ///< along local x, local z
        AxisPlane support;
        std::array<std::size_t, 2> place_unknown{kNone, kNone};
        std::array<double, 2> place{0.0, 0.0};  ///< where there is no unknown
        std::vector<std::size_t> parameter_unknown;
    };

    void planTurn(std::size_t primitive, Plan& plan);
    void planPlace(std::size_t primitive, Plan& plan);
    void placeStart(std::size_t primitive,
                    std::vector<double>& start,
                    std::vector<ScenePose>& poses);
    std::size_t addUnknown(SceneUnknown unknown, Plan& plan);
    void linkChain(Plan& plan, std::size_t primitive);
    [[nodiscard]] ChainNumber own(const Plan& plan,
                                  std::size_t unknown,
                                  double value,
                                  std::span<const double> state) const;
    [[nodiscard]] ChainNumber lifted(const ChainNumber& number,
                                     std::size_t from,
                                     const Plan& to) const;
    [[nodiscard]] ChainNumber planeOffset(const AxisPlane& plane,
                                          std::size_t primitive,
                                          const Plan& in,
                                          std::span<const double> state) const;
    void evaluateOne(std::size_t primitive,
                     std::span<const double> state,
                     std::vector<ScenePose>& poses) const;
    [[nodiscard]] double parameterValue(std::size_t primitive,
                                        std::size_t parameter,
                                        std::span<const double> state) const;

    const SceneGraph& graph_;
    std::vector<SceneUnknown> unknowns_;
    std::vector<Plan> plans_;
};

/// What a contact makes of the turn: own turn = target's turn + this.
[[nodiscard]] double contactTurn(const SceneContact& contact,
                                 const AxisPlane& own,
                                 const AxisPlane& target);

}  // namespace insitu
