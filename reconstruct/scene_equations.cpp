#include "reconstruct/scene_equations.h"

#include "core/check.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

/// Nearer than this a vertex counts as behind the camera.
constexpr double kNear_m = 1e-3;

/// A point in the camera's frame (x right, y down, z forward) with derivatives.
struct CameraPoint {
    Eigen::Vector3d value;
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxChain> jacobian;
};

CameraPoint inCamera(const Camera& camera, const ChainPoint& point)
{
    Eigen::Matrix3d rotation;
    rotation << camera.right.x, camera.right.y, camera.right.z, -camera.up.x, -camera.up.y,
        -camera.up.z, camera.forward.x, camera.forward.y, camera.forward.z;
    const glm::dvec3 d = point.value - camera.position_m;
    CameraPoint result;
    result.value = rotation * Eigen::Vector3d(d.x, d.y, d.z);
    result.jacobian = rotation * point.jacobian;
    return result;
}

/// Unknowns and primitives that the chains of all given primitives hold.
void linkUnknowns(const SceneLayout& layout, std::vector<std::size_t> of, SceneEquation& equation)
{
    for (const std::size_t primitive : of) {
        const auto chain = layout.chain(primitive);
        equation.unknowns.insert(equation.unknowns.end(), chain.begin(), chain.end());
        for (const std::size_t member : layout.ancestry(primitive))
            if (layout.unknownCount(member) > 0) equation.primitives.push_back(member);
    }
    const auto sortUnique = [](std::vector<std::size_t>& list) {
        std::sort(list.begin(), list.end());
        list.erase(std::unique(list.begin(), list.end()), list.end());
    };
    sortUnique(equation.unknowns);
    sortUnique(equation.primitives);
}

bool evaluateVertex(const SceneEquation& equation,
                    const Camera& camera,
                    const ChainPoint& point,
                    double* residuals,
                    EquationJacobian* jacobian)
{
    const CameraPoint p = inCamera(camera, point);
    if (!(p.value.z() > kNear_m)) return false;
    for (int k = 0; k < 2; ++k) {
        const double ratio = p.value[k] / p.value.z();
        residuals[k] =
            (camera.focal_px[k] * ratio + camera.principal_px[k] - equation.at[k]) / equation.sigma;
        if (jacobian)
            jacobian->row(k) = camera.focal_px[k] / (p.value.z() * equation.sigma) *
                               (p.jacobian.row(k) - ratio * p.jacobian.row(2));
    }
    return true;
}

/// Distance of each mark to the edge's line: with n = A × B the normal of the plane of view and
/// l = K⁻ᵀ n the line in the picture, l·(u, v, 1) / √(l₁² + l₂²). Also right for ends behind the
/// camera.
bool evaluateEdge(const SceneEquation& equation,
                  const Camera& camera,
                  const ChainPoint& from,
                  const ChainPoint& to,
                  double* residuals,
                  EquationJacobian* jacobian)
{
    const CameraPoint a = inCamera(camera, from);
    const CameraPoint b = inCamera(camera, to);
    const Eigen::Vector3d n = a.value.cross(b.value);
    const double fx = camera.focal_px.x;
    const double fy = camera.focal_px.y;
    const Eigen::Vector2d line(n.x() / fx, n.y() / fy);
    const double length = line.norm();
    if (!(length > 1e-12 * n.norm() / std::max(fx, fy))) return false;
    // Derivative of the normal: dA × B + A × dB.
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxChain> dn;
    if (jacobian) {
        dn.resize(3, a.jacobian.cols());
        for (Eigen::Index c = 0; c < dn.cols(); ++c)
            dn.col(c) = Eigen::Vector3d(a.jacobian.col(c)).cross(b.value) +
                        a.value.cross(Eigen::Vector3d(b.jacobian.col(c)));
    }
    for (int k = 0; k < 2; ++k) {
        const glm::dvec2 mark = (k == 0 ? equation.at : equation.at_b) - camera.principal_px;
        const Eigen::Vector3d ray(mark.x / fx, mark.y / fy, 1.0);
        const double distance = n.dot(ray) / length;
        residuals[k] = distance / equation.sigma;
        if (!jacobian) continue;
        const Eigen::Vector3d by_normal =
            ray / length -
            distance / (length * length) * Eigen::Vector3d(line.x() / fx, line.y() / fy, 0.0);
        jacobian->row(k) = by_normal.transpose() * dn / equation.sigma;
    }
    return true;
}

void evaluateLength(const SceneEquation& equation,
                    const SceneLayout& layout,
                    const ChainPoint& a,
                    const ChainPoint& b,
                    double* residuals,
                    EquationJacobian* jacobian)
{
    const glm::dvec3 way = b.value - a.value;
    const double length = std::max(glm::length(way), 1e-12);
    residuals[0] = (length - equation.wanted) / equation.sigma;
    if (!jacobian) return;
    const Eigen::RowVector3d unit =
        Eigen::RowVector3d(way.x, way.y, way.z) / (length * equation.sigma);
    const auto scatter = [&](const ChainPoint& point, std::size_t primitive, double sign) {
        const auto chain = layout.chain(primitive);
        const Eigen::RowVectorXd row = sign * unit * point.jacobian;
        for (std::size_t i = 0; i < chain.size(); ++i) {
            const auto at =
                std::lower_bound(equation.unknowns.begin(), equation.unknowns.end(), chain[i]);
            (*jacobian)(0, at - equation.unknowns.begin()) += row[static_cast<Eigen::Index>(i)];
        }
    };
    scatter(a, equation.a.primitive, -1.0);
    scatter(b, equation.b.primitive, 1.0);
}

}  // namespace

glm::dvec2 idealPixel(const Camera& camera, glm::dvec2 pixel)
{
    const glm::dvec3 direction = camera.rayDirection(pixel);
    const double z = glm::dot(direction, camera.forward);
    INSITU_CHECK(z > 0.0, "pixel ({}, {}) looks sideways", pixel.x, pixel.y);
    return camera.principal_px + camera.focal_px * glm::dvec2(glm::dot(direction, camera.right) / z,
                                                              -glm::dot(direction, camera.up) / z);
}

SceneEquation vertexEquation(const VertexObservation& observation,
                             const Camera& camera,
                             const SceneLayout& layout)
{
    SceneEquation equation;
    equation.kind = SceneEquation::Kind::Vertex;
    equation.name = observation.name;
    equation.size = 2;
    equation.sigma = observation.sigma_px;
    equation.a = observation.vertex;
    equation.at = idealPixel(camera, observation.pixel);
    linkUnknowns(layout, {observation.vertex.primitive}, equation);
    return equation;
}

std::vector<SceneEquation> sceneEquations(const SceneGraph& graph,
                                          const Camera& camera,
                                          const SceneLayout& layout)
{
    std::vector<SceneEquation> equations;
    for (const VertexObservation& observation : graph.vertices)
        equations.push_back(vertexEquation(observation, camera, layout));
    for (const EdgeObservation& observation : graph.edges) {
        INSITU_CHECK(observation.from.primitive == observation.to.primitive,
                     "edge {} between two primitives",
                     observation.name);
        SceneEquation equation;
        equation.kind = SceneEquation::Kind::Edge;
        equation.name = observation.name;
        equation.size = 2;
        equation.sigma = observation.sigma_px;
        equation.a = observation.from;
        equation.b = observation.to;
        equation.at = idealPixel(camera, observation.from_px);
        equation.at_b = idealPixel(camera, observation.to_px);
        linkUnknowns(layout, {observation.from.primitive}, equation);
        equations.push_back(std::move(equation));
    }
    for (const LengthObservation& observation : graph.lengths) {
        SceneEquation equation;
        equation.kind = SceneEquation::Kind::Length;
        equation.name = observation.name;
        equation.sigma = observation.sigma_m;
        equation.a = observation.from;
        equation.b = observation.to;
        equation.wanted = observation.metres;
        linkUnknowns(layout, {observation.from.primitive, observation.to.primitive}, equation);
        equations.push_back(std::move(equation));
    }
    for (std::size_t u = 0; u < layout.unknowns().size(); ++u) {
        const SceneUnknown& unknown = layout.unknowns()[u];
        if (!unknown.prior_sigma) continue;
        SceneEquation equation;
        equation.kind = SceneEquation::Kind::Prior;
        equation.name = "the value given for " + unknown.label;
        equation.sigma = *unknown.prior_sigma;
        equation.wanted = unknown.start;
        equation.unknown = u;
        for (std::size_t i = 0; i < layout.unknownCount(unknown.primitive); ++i)
            equation.unknowns.push_back(layout.firstUnknown(unknown.primitive) + i);
        equation.primitives = {unknown.primitive};
        equations.push_back(std::move(equation));
    }
    return equations;
}

bool evaluateEquation(const SceneEquation& equation,
                      const Camera& camera,
                      const SceneLayout& layout,
                      std::span<const double> state,
                      const std::vector<ScenePose>& poses,
                      double* residuals,
                      EquationJacobian* jacobian)
{
    if (jacobian) jacobian->setZero(2, static_cast<Eigen::Index>(equation.unknowns.size()));
    switch (equation.kind) {
        case SceneEquation::Kind::Vertex:
            return evaluateVertex(
                equation, camera, layout.vertex(poses, equation.a), residuals, jacobian);
        case SceneEquation::Kind::Edge:
            return evaluateEdge(equation,
                                camera,
                                layout.vertex(poses, equation.a),
                                layout.vertex(poses, equation.b),
                                residuals,
                                jacobian);
        case SceneEquation::Kind::Length:
            evaluateLength(equation,
                           layout,
                           layout.vertex(poses, equation.a),
                           layout.vertex(poses, equation.b),
                           residuals,
                           jacobian);
            return true;
        case SceneEquation::Kind::Prior:
            residuals[0] = (state[equation.unknown] - equation.wanted) / equation.sigma;
            if (jacobian)
                (*jacobian)(
                    0, static_cast<Eigen::Index>(equation.unknown - equation.unknowns.front())) =
                    1.0 / equation.sigma;
            return true;
    }
    return false;
}

}  // namespace insitu
