#include "reconstruct/scene_pose.h"

#include "core/check.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace insitu {

namespace {

using std::numbers::pi;

ChainNumber operator+(const ChainNumber& a, const ChainNumber& b)
{
    return {a.value + b.value, a.gradient + b.gradient};
}
ChainNumber operator-(const ChainNumber& a, const ChainNumber& b)
{
    return {a.value - b.value, a.gradient - b.gradient};
}
ChainNumber operator*(const ChainNumber& a, const ChainNumber& b)
{
    return {a.value * b.value, b.value * a.gradient + a.value * b.gradient};
}
ChainNumber operator*(double factor, const ChainNumber& a)
{
    return {factor * a.value, factor * a.gradient};
}
ChainNumber operator+(const ChainNumber& a, double b)
{
    return {a.value + b, a.gradient};
}
ChainNumber sine(const ChainNumber& a)
{
    return {std::sin(a.value), std::cos(a.value) * a.gradient};
}
ChainNumber cosine(const ChainNumber& a)
{
    return {std::cos(a.value), -std::sin(a.value) * a.gradient};
}

/// Azimuth of a local axis (x or z): R_y(azimuth) turns x into it.
double axisAzimuth(int axis)
{
    return axis == 0 ? 0.0 : -pi / 2;
}

AxisPlane planeOf(const ScenePrimitive& primitive, std::size_t face)
{
    const auto plane = axisPlane(primitive.shape, face);
    INSITU_CHECK(plane.has_value(), "{}: face {} is oblique", primitive.name, face);
    return *plane;
}

/// Own axis = this sign times the target's axis.
int axisSign(const SceneContact& contact, const AxisPlane& own, const AxisPlane& target)
{
    return (contact.flush ? 1 : -1) * own.sign * target.sign;
}

}  // namespace

/// What a contact makes of the turn: own turn = target's turn + this.
double contactTurn(const SceneContact& contact, const AxisPlane& own, const AxisPlane& target)
{
    return axisAzimuth(target.axis) - axisAzimuth(own.axis) +
           (axisSign(contact, own, target) < 0 ? pi : 0.0);
}

SceneLayout::SceneLayout(const SceneGraph& graph) : graph_(graph)
{
    std::vector<ScenePose> poses(graph.primitives.size());
    std::vector<double> start;
    for (std::size_t i = 0; i < graph.primitives.size(); ++i) {
        const ScenePrimitive& primitive = graph.primitives[i];
        Plan plan;
        plan.first = unknowns_.size();
        for (std::size_t p = 0; p < primitive.parameters.size(); ++p) {
            const SceneNumber& number = primitive.parameters[p];
            const PrimitiveParameter& kind = primitive.shape.parameters[p];
            plan.parameter_unknown.push_back(number.fixed
                                                 ? kNone
                                                 : addUnknown({i,
                                                               primitive.name + "." + kind.name,
                                                               p,
                                                               kind.minimum,
                                                               kind.maximum,
                                                               number.value,
                                                               number.sigma},
                                                              plan));
        }
        if (primitive.height == SceneHeight::OnFace) {
            plan.frame = primitive.support;
            plan.support = planeOf(graph.primitives[primitive.support], primitive.support_face);
        }
        planTurn(i, plan);
        if (primitive.height == SceneHeight::Free)
            plan.height_unknown = addUnknown(
                {i, primitive.name + ".height", {}, -1e6, 1e6, primitive.position_m.y, {}}, plan);
        planPlace(i, plan);
        linkChain(plan, i);
        plans_.push_back(std::move(plan));
        placeStart(i, start, poses);
    }
}

/// Starts that are counted from an ancestor, now that it is known where that stands.
void SceneLayout::placeStart(std::size_t index,
                             std::vector<double>& start,
                             std::vector<ScenePose>& poses)
{
    const ScenePrimitive& primitive = graph_.primitives[index];
    Plan& plan = plans_[index];
    start.resize(unknowns_.size(), 0.0);
    for (std::size_t u = plan.first; u < unknowns_.size(); ++u)
        start[u] = unknowns_[u].start;
    if (plan.turn_unknown != kNone && plan.frame != kNone)
        start[plan.turn_unknown] -= poses[plan.frame].turn.value;
    evaluateOne(index, start, poses);
    const auto& at = poses[index].position;
    const glm::dvec3 off = primitive.position_m - glm::dvec3(at[0].value, at[1].value, at[2].value);
    const bool on_contact = plan.contact[0].has_value() || plan.contact[1].has_value();
    const double turn = on_contact            ? poses[index].turn.value
                        : plan.frame != kNone ? poses[plan.frame].turn.value
                                              : 0.0;
    const glm::dvec3 in_axes = rotatedY(off, -turn);
    for (std::size_t k = 0; k < 2; ++k) {
        if (plan.contact[k]) continue;
        const double value = k == 0 ? in_axes.x : in_axes.z;
        if (plan.place_unknown[k] == kNone)
            plan.place[k] = value;
        else
            start[plan.place_unknown[k]] = value;
    }
    evaluateOne(index, start, poses);
    for (std::size_t u = plan.first; u < unknowns_.size(); ++u)
        unknowns_[u].start = start[u];
}

std::size_t SceneLayout::addUnknown(SceneUnknown unknown, Plan& plan)
{
    unknowns_.push_back(std::move(unknown));
    ++plan.count;
    return unknowns_.size() - 1;
}

void SceneLayout::planTurn(std::size_t index, Plan& plan)
{
    const ScenePrimitive& primitive = graph_.primitives[index];
    for (const SceneContact& contact : primitive.contacts) {
        const Touch touch{contact,
                          planeOf(primitive, contact.face),
                          planeOf(graph_.primitives[contact.target], contact.target_face)};
        plan.contact[touch.own.axis == 0 ? 0 : 1] = touch;
        if (plan.turn_from != kNone) continue;
        plan.turn_from = contact.target;
        plan.turn_offset = contactTurn(contact, touch.own, touch.target);
    }
    if (primitive.aligned) {
        plan.turn_from = primitive.aligned->target;
        plan.turn_offset = primitive.aligned->turn_rad;
    } else if (plan.turn_from != kNone) {
        return;
    } else if (primitive.rotation_fixed) {
        plan.turn_offset = primitive.rotation_y_rad;
    } else {
        plan.turn_from = plan.frame;
        plan.turn_unknown = addUnknown(
            {index, primitive.name + ".rotation_y", {}, -1e6, 1e6, primitive.rotation_y_rad, {}},
            plan);
    }
}

void SceneLayout::planPlace(std::size_t index, Plan& plan)
{
    const ScenePrimitive& primitive = graph_.primitives[index];
    static constexpr const char* kNames[] = {".position_x", ".position_z"};
    for (std::size_t k = 0; k < 2; ++k)
        if (!plan.contact[k] && !primitive.position_fixed)
            plan.place_unknown[k] =
                addUnknown({index, primitive.name + kNames[k], {}, -1e6, 1e6, 0.0, {}}, plan);
}

void SceneLayout::linkChain(Plan& plan, std::size_t index)
{
    const ScenePrimitive& primitive = graph_.primitives[index];
    std::vector<std::size_t> all{index};
    const auto include = [&](std::size_t target) {
        INSITU_CHECK(target < index, "{} refers to one after it", primitive.name);
        all.insert(all.end(), plans_[target].ancestry.begin(), plans_[target].ancestry.end());
    };
    if (primitive.height == SceneHeight::OnFace) include(primitive.support);
    for (const SceneContact& contact : primitive.contacts)
        include(contact.target);
    if (primitive.aligned) include(primitive.aligned->target);
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    plan.ancestry = all;
    for (const std::size_t member : all) {
        const Plan& other = member == index ? plan : plans_[member];
        for (std::size_t u = 0; u < other.count; ++u)
            plan.chain.push_back(other.first + u);
    }
    INSITU_CHECK(plan.chain.size() <= kMaxChain, "{} unknowns in a chain", plan.chain.size());
}

ChainNumber SceneLayout::own(const Plan& plan,
                             std::size_t unknown,
                             double value,
                             std::span<const double> state) const
{
    ChainNumber number{value, ChainGradient::Zero(static_cast<Eigen::Index>(plan.chain.size()))};
    if (unknown == kNone) return number;
    number.value = state[unknown];
    // A primitive's own unknowns are the last of its chain.
    const std::size_t column = plan.chain.size() - plan.count + (unknown - plan.first);
    number.gradient[static_cast<Eigen::Index>(column)] = 1.0;
    return number;
}

ChainNumber SceneLayout::lifted(const ChainNumber& number, std::size_t from, const Plan& to) const
{
    ChainNumber result{number.value,
                       ChainGradient::Zero(static_cast<Eigen::Index>(to.chain.size()))};
    const std::vector<std::size_t>& chain = plans_[from].chain;
    std::size_t at = 0;
    for (std::size_t i = 0; i < chain.size(); ++i) {
        while (to.chain[at] != chain[i])
            ++at;
        result.gradient[static_cast<Eigen::Index>(at)] =
            number.gradient[static_cast<Eigen::Index>(i)];
    }
    return result;
}

double SceneLayout::parameterValue(std::size_t primitive,
                                   std::size_t parameter,
                                   std::span<const double> state) const
{
    const std::size_t unknown = plans_[primitive].parameter_unknown[parameter];
    return unknown == kNone ? graph_.primitives[primitive].parameters[parameter].value
                            : state[unknown];
}

/// Offset of a face's plane along its local axis, with derivatives in the chain of `in`.
ChainNumber SceneLayout::planeOffset(const AxisPlane& plane,
                                     std::size_t primitive,
                                     const Plan& in,
                                     std::span<const double> state) const
{
    ChainNumber sum{plane.offset.constant,
                    ChainGradient::Zero(static_cast<Eigen::Index>(in.chain.size()))};
    for (std::size_t p = 0; p < plane.offset.coefficients.size(); ++p) {
        const double factor = plane.offset.coefficients[p];
        if (factor == 0.0) continue;
        sum.value += factor * parameterValue(primitive, p, state);
        const std::size_t unknown = plans_[primitive].parameter_unknown[p];
        if (unknown == kNone) continue;
        const auto at = std::lower_bound(in.chain.begin(), in.chain.end(), unknown);
        sum.gradient[at - in.chain.begin()] += factor;
    }
    return sum;
}

void SceneLayout::evaluateOne(std::size_t index,
                              std::span<const double> state,
                              std::vector<ScenePose>& poses) const
{
    const ScenePrimitive& primitive = graph_.primitives[index];
    const Plan& plan = plans_[index];
    ScenePose& pose = poses[index];
    pose.parameters.resize(primitive.parameters.size());
    for (std::size_t p = 0; p < pose.parameters.size(); ++p)
        pose.parameters[p] = parameterValue(index, p, state);

    pose.turn = own(plan, plan.turn_unknown, 0.0, state) + plan.turn_offset;
    if (plan.turn_from != kNone)
        pose.turn = pose.turn + lifted(poses[plan.turn_from].turn, plan.turn_from, plan);

    pose.position[1] = own(plan, plan.height_unknown, primitive.position_m.y, state);
    if (primitive.height == SceneHeight::OnFace)
        pose.position[1] = lifted(poses[primitive.support].position[1], primitive.support, plan) +
                           planeOffset(plan.support, primitive.support, plan, state) +
                           primitive.support_gap_m;

    std::array<ChainNumber, 2> along;
    for (std::size_t k = 0; k < 2; ++k)
        along[k] = own(plan, plan.place_unknown[k], plan.place[k], state);
    const bool on_contact = plan.contact[0].has_value() || plan.contact[1].has_value();
    if (!on_contact && plan.frame == kNone) {
        pose.position[0] = along[0];
        pose.position[2] = along[1];
        return;
    }
    // Axes (x, z) that the place is counted along, from the origin of a reference.
    const std::size_t reference =
        on_contact ? (plan.contact[0] ? plan.contact[0] : plan.contact[1])->contact.target
                   : plan.frame;
    const ChainNumber turn =
        on_contact ? pose.turn : lifted(poses[reference].turn, reference, plan);
    const ChainNumber c = cosine(turn);
    const ChainNumber s = sine(turn);
    const std::array<std::array<ChainNumber, 2>, 2> axes = {{{c, -1.0 * s}, {s, c}}};
    for (std::size_t k = 0; k < 2; ++k) {
        const std::optional<Touch>& touch = plan.contact[k];
        const std::size_t from = touch ? touch->contact.target : reference;
        along[k] = along[k] + axes[k][0] * lifted(poses[from].position[0], from, plan) +
                   axes[k][1] * lifted(poses[from].position[2], from, plan);
        if (!touch) continue;
        const double sign = axisSign(touch->contact, touch->own, touch->target);
        along[k] = along[k] + sign * planeOffset(touch->target, from, plan, state) -
                   planeOffset(touch->own, index, plan, state) +
                   touch->contact.gap_m * touch->target.sign * sign;
    }
    pose.position[0] = axes[0][0] * along[0] + axes[1][0] * along[1];
    pose.position[2] = axes[0][1] * along[0] + axes[1][1] * along[1];
}

void SceneLayout::evaluate(std::span<const double> state, std::vector<ScenePose>& poses) const
{
    poses.resize(plans_.size());
    for (std::size_t i = 0; i < plans_.size(); ++i)
        evaluateOne(i, state, poses);
}

ChainPoint SceneLayout::vertex(const std::vector<ScenePose>& poses, SceneVertex which) const
{
    const ScenePose& pose = poses[which.primitive];
    const Plan& plan = plans_[which.primitive];
    const PrimitiveShape& shape = graph_.primitives[which.primitive].shape;
    const glm::dvec3 local = shape.vertex(which.vertex, pose.parameters);
    const double c = std::cos(pose.turn.value);
    const double s = std::sin(pose.turn.value);
    ChainPoint point;
    point.value =
        glm::dvec3(c * local.x + s * local.z, local.y, -s * local.x + c * local.z) +
        glm::dvec3(pose.position[0].value, pose.position[1].value, pose.position[2].value);
    point.jacobian.resize(3, static_cast<Eigen::Index>(plan.chain.size()));
    point.jacobian.row(0) =
        (pose.position[0].gradient + (-s * local.x + c * local.z) * pose.turn.gradient).transpose();
    point.jacobian.row(1) = pose.position[1].gradient.transpose();
    point.jacobian.row(2) =
        (pose.position[2].gradient + (-c * local.x - s * local.z) * pose.turn.gradient).transpose();
    for (std::size_t p = 0; p < plan.parameter_unknown.size(); ++p) {
        const std::size_t unknown = plan.parameter_unknown[p];
        if (unknown == kNone) continue;
        const auto& v = shape.vertices[which.vertex];
        const glm::dvec3 d(v[0].coefficients[p], v[1].coefficients[p], v[2].coefficients[p]);
        const Eigen::Index column =
            static_cast<Eigen::Index>(plan.chain.size() - plan.count + (unknown - plan.first));
        point.jacobian(0, column) += c * d.x + s * d.z;
        point.jacobian(1, column) += d.y;
        point.jacobian(2, column) += -s * d.x + c * d.z;
    }
    return point;
}

}  // namespace insitu
