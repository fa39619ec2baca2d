#include "reconstruct/scene_graph.h"

#include "core/check.h"
#include "reconstruct/scene_pose.h"

#include <cmath>
#include <numbers>

namespace insitu {

namespace {

constexpr std::size_t kWorld = static_cast<std::size_t>(-1);
constexpr double kSameDirection = 1e-9;

/// A primitive's turn as that of another (or of the world) plus a constant.
struct TurnRoot {
    std::size_t root = kWorld;
    double offset = 0.0;

    [[nodiscard]] bool sameAs(const TurnRoot& other) const
    {
        const double apart = std::remainder(offset - other.offset, 2.0 * std::numbers::pi);
        return root == other.root && std::abs(apart) < kSameDirection;
    }
};

/// One contact: upright faces on both sides; along which local axis, which turn it demands.
std::optional<std::string> contactProblem(const SceneGraph& graph,
                                          const ScenePrimitive& primitive,
                                          const SceneContact& contact)
{
    const ScenePrimitive& target = graph.primitives[contact.target];
    const auto own = axisPlane(primitive.shape, contact.face);
    if (!own || own->axis == 1)
        return fmt::format("its face \"{}\" is not upright for all parameters",
                           primitive.shape.faces[contact.face].name);
    const auto other = axisPlane(target.shape, contact.target_face);
    if (!other || other->axis == 1)
        return fmt::format("the face \"{}\" of {} is not upright for all parameters",
                           target.shape.faces[contact.target_face].name,
                           target.name);
    return std::nullopt;
}

std::optional<std::string> supportProblem(const SceneGraph& graph, const ScenePrimitive& primitive)
{
    if (primitive.height != SceneHeight::OnFace) return std::nullopt;
    const ScenePrimitive& support = graph.primitives[primitive.support];
    const auto plane = axisPlane(support.shape, primitive.support_face);
    if (plane && plane->axis == 1 && (plane->sign > 0 || support.shape.two_sided))
        return std::nullopt;
    return fmt::format("it cannot stand on the face \"{}\" of {}, which does not look up",
                       support.shape.faces[primitive.support_face].name,
                       support.name);
}

/// The turn that all hierarchical constraints of a primitive demand, or what contradicts.
std::optional<std::string> findTurn(const SceneGraph& graph,
                                    std::size_t index,
                                    std::vector<TurnRoot>& turns)
{
    const ScenePrimitive& primitive = graph.primitives[index];
    struct Demand {
        TurnRoot turn;
        std::string by;
    };
    std::vector<Demand> demands;
    const auto demand = [&](std::size_t target, double offset, const std::string& by) {
        demands.push_back({{turns[target].root, turns[target].offset + offset}, by});
    };
    if (primitive.aligned)
        demand(primitive.aligned->target,
               primitive.aligned->turn_rad,
               "aligned with " + graph.primitives[primitive.aligned->target].name);
    std::array<bool, 2> taken{false, false};
    for (const SceneContact& contact : primitive.contacts) {
        if (auto problem = contactProblem(graph, primitive, contact)) return problem;
        const AxisPlane own = *axisPlane(primitive.shape, contact.face);
        const ScenePrimitive& target = graph.primitives[contact.target];
        bool& along = taken[own.axis == 0 ? 0 : 1];
        if (along)
            return fmt::format("two of its contacts are along its {} axis; one decides its place",
                               own.axis == 0 ? "x" : "z");
        along = true;
        demand(contact.target,
               contactTurn(contact, own, *axisPlane(target.shape, contact.target_face)),
               fmt::format("{} {}.{}",
                           contact.flush ? "flush with" : "against",
                           target.name,
                           target.shape.faces[contact.target_face].name));
    }
    if (primitive.rotation_fixed)
        demands.push_back({{kWorld, primitive.rotation_y_rad}, "its fixed rotation"});
    for (const Demand& other : demands)
        if (!other.turn.sameAs(demands[0].turn))
            return fmt::format(
                "its hierarchical constraints contradict each other: {} and {} ask for different "
                "directions",
                demands[0].by,
                other.by);
    turns[index] = demands.empty() ? TurnRoot{index, 0.0} : demands[0].turn;
    return std::nullopt;
}

/// Unknowns of a primitive by itself, at most.
std::size_t ownUnknowns(const ScenePrimitive& primitive)
{
    std::size_t count = 4 - std::min<std::size_t>(2, primitive.contacts.size());
    for (const SceneNumber& number : primitive.parameters)
        count += number.fixed ? 0 : 1;
    return count;
}

}  // namespace

std::optional<SceneProblem> sceneProblem(const SceneGraph& graph)
{
    std::vector<TurnRoot> turns(graph.primitives.size());
    std::vector<std::vector<bool>> ancestors(graph.primitives.size());
    for (std::size_t i = 0; i < graph.primitives.size(); ++i) {
        const ScenePrimitive& primitive = graph.primitives[i];
        std::vector<bool>& mine = ancestors[i];
        mine.resize(graph.primitives.size());
        mine[i] = true;
        const auto include = [&](std::size_t target) {
            INSITU_CHECK(target < i, "{} refers to one after it", primitive.name);
            for (std::size_t k = 0; k < target + 1; ++k)
                mine[k] = mine[k] || ancestors[target][k];
        };
        if (primitive.height == SceneHeight::OnFace) include(primitive.support);
        for (const SceneContact& contact : primitive.contacts)
            include(contact.target);
        if (primitive.aligned) include(primitive.aligned->target);

        if (auto problem = supportProblem(graph, primitive)) return SceneProblem{i, *problem};
        if (auto problem = findTurn(graph, i, turns)) return SceneProblem{i, *problem};
        std::size_t unknowns = 0;
        for (std::size_t k = 0; k <= i; ++k)
            if (mine[k]) unknowns += ownUnknowns(graph.primitives[k]);
        if (unknowns > kMaxChain)
            return SceneProblem{
                i,
                fmt::format("{} unknowns lie between it and its last ancestor; at most {} are "
                            "solved: fix some",
                            unknowns,
                            kMaxChain)};
    }
    return std::nullopt;
}

}  // namespace insitu
