#include "calib/camera_solve.h"
#include "core/check.h"
#include "core/io/json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace insitu {

namespace {

constexpr const char* kAxisNames[] = {"x", "y", "z"};
/// Other programs write axes with few digits; what is further off is no rotation.
constexpr double kOrthonormal = 1e-3;
/// As for the lines (calib/line_segments.cpp).
constexpr double kMaxDivision = 0.5;

Severity severityFrom(const JsonNode& node)
{
    const std::string text = node.text();
    for (const Severity severity : {Severity::Info, Severity::Warning, Severity::Error})
        if (text == severityName(severity)) return severity;
    node.fail(fmt::format("\"{}\" is unknown; use \"info\", \"warning\" or \"error\"", text));
}

/// Makes the axes exactly orthonormal; complains when they are far from it.
void settleAxes(const JsonNode& root, Camera& camera)
{
    const glm::dmat3 axes(camera.right, camera.up, camera.forward);
    const glm::dmat3 products = glm::transpose(axes) * axes;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            if (std::abs(products[i][j] - (i == j ? 1.0 : 0.0)) > kOrthonormal)
                root.fail("right, up and forward are not unit vectors at right angles");
    if (glm::dot(glm::cross(camera.right, camera.up), camera.forward) > 0.0)
        root.fail("right × up must be −forward; these axes are left-handed");
    camera.forward = glm::normalize(camera.forward);
    camera.right = glm::normalize(glm::cross(camera.forward, camera.up));
    camera.up = glm::cross(camera.right, camera.forward);
}

/// {"division": λ}, or the empty list (zeros, null) of other programs for none.
double readDistortion(const JsonNode& root, double& sigma)
{
    const auto distortion = root.find("distortion");
    if (!distortion || distortion->value().is_null()) return 0.0;
    if (distortion->value().is_object()) {
        distortion->expectKeys({"division", "division_sigma"});
        if (const auto node = distortion->find("division_sigma")) sigma = node->number();
        const JsonNode node = distortion->at("division");
        const double division = node.number();
        if (std::abs(division) > kMaxDivision)
            node.fail(fmt::format("must lie within ±{}", kMaxDivision));
        return division;
    }
    for (std::size_t i = 0; i < distortion->size(); ++i)
        if (distortion->at(i).number() != 0.0)
            distortion->fail("coefficients of an unknown model; use {\"division\": λ}");
    return 0.0;
}

Json distortionJson(const CameraEstimate& estimate)
{
    const double division = estimate.camera.division;
    if (division == 0.0 && estimate.division_sigma == 0.0) return Json::array();
    return {{"division", division}, {"division_sigma", estimate.division_sigma}};
}

/// Nothing when something is open (infinite) or nothing is known.
std::optional<Json> covarianceJson(const CameraCovariance& covariance)
{
    Json rows = Json::array();
    bool known = false;
    for (const auto& row : covariance) {
        rows.push_back(row);
        for (const double value : row) {
            if (!std::isfinite(value)) return std::nullopt;
            known = known || value != 0.0;
        }
    }
    return known ? std::optional<Json>(rows) : std::nullopt;
}

void readCovariance(const JsonNode& node, CameraCovariance& covariance)
{
    if (node.size() != covariance.size()) node.fail("needs 10 rows of 10 numbers");
    for (std::size_t i = 0; i < covariance.size(); ++i) {
        const JsonNode row = node.at(i);
        if (row.size() != covariance.size()) row.fail("needs 10 numbers");
        for (std::size_t j = 0; j < covariance.size(); ++j)
            covariance[i][j] = row.at(j).number();
    }
}

void readDoubts(const JsonNode& root, CameraEstimate& estimate)
{
    if (const auto node = root.find("focal_px_sigma"))
        estimate.focal_sigma_px = node->value().is_array() ? node->vec2().x : node->number();
    if (const auto node = root.find("rotation_sigma_deg"))
        estimate.rotation_sigma_rad = glm::radians(node->number());
    if (const auto node = root.find("turn_sigma_deg"))
        estimate.turn_sigma_rad = glm::radians(node->vec3());
    if (const auto node = root.find("principal_point_px_sigma"))
        estimate.principal_sigma_px = node->vec2();
    if (const auto node = root.find("position_m_sigma")) estimate.position_sigma_m = node->vec3();
    if (const auto node = root.find("covariance")) readCovariance(*node, estimate.covariance);
    if (const auto node = root.find("outlier_segments"))
        for (std::size_t i = 0; i < node->size(); ++i)
            estimate.outlier_segments.push_back(
                static_cast<std::size_t>(std::max(0, node->at(i).integer())));
    if (const auto node = root.find("residual_rms_px")) estimate.residual_rms_px = node->number();
    if (const auto node = root.find("vanishing_points_px")) {
        node->expectKeys({"x", "y", "z"});
        for (std::size_t axis = 0; axis < 3; ++axis)
            if (const auto point = node->find(kAxisNames[axis]); point && !point->value().is_null())
                estimate.vanishing_points_px[axis] = point->vec2();
    }
    if (const auto node = root.find("findings"))
        for (std::size_t i = 0; i < node->size(); ++i) {
            const JsonNode item = node->at(i);
            item.expectKeys({"severity", "code", "message"});
            estimate.findings.push_back({severityFrom(item.at("severity")),
                                         item.at("code").text(),
                                         item.at("message").text()});
        }
}

}  // namespace

void writeCamera(const std::filesystem::path& path, const CameraEstimate& estimate)
{
    const Camera& camera = estimate.camera;
    Json json;
    json["image"] = {{"width", camera.width}, {"height", camera.height}};
    json["focal_px"] = toJson(camera.focal_px);
    json["focal_px_sigma"] = toJson(glm::dvec2(estimate.focal_sigma_px));
    json["principal_point_px"] = toJson(camera.principal_px);
    json["principal_point_px_sigma"] = toJson(estimate.principal_sigma_px);
    json["distortion"] = distortionJson(estimate);
    json["position_m"] = toJson(camera.position_m);
    json["position_m_sigma"] = toJson(estimate.position_sigma_m);
    json["right"] = toJson(camera.right);
    json["up"] = toJson(camera.up);
    json["forward"] = toJson(camera.forward);
    json["rotation_sigma_deg"] = glm::degrees(estimate.rotation_sigma_rad);
    json["turn_sigma_deg"] = toJson(glm::degrees(estimate.turn_sigma_rad));
    if (const auto covariance = covarianceJson(estimate.covariance))
        json["covariance"] = *covariance;
    json["residual_rms_px"] = estimate.residual_rms_px;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto& point = estimate.vanishing_points_px[axis];
        json["vanishing_points_px"][kAxisNames[axis]] = point ? toJson(*point) : Json();
    }
    json["outlier_segments"] = estimate.outlier_segments;
    json["findings"] = toJson(estimate.findings);
    writeJson(path, json);
}

CameraEstimate readCamera(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    root.expectKeys({"image",
                     "focal_px",
                     "focal_px_sigma",
                     "principal_point_px",
                     "principal_point_px_sigma",
                     "distortion",
                     "position_m",
                     "position_m_sigma",
                     "right",
                     "up",
                     "forward",
                     "rotation_sigma_deg",
                     "turn_sigma_deg",
                     "covariance",
                     "residual_rms_px",
                     "vanishing_points_px",
                     "outlier_segments",
                     "findings",
                     "note"});
    CameraEstimate estimate;
    Camera& camera = estimate.camera;
    const JsonNode image = root.at("image");
    image.expectKeys({"width", "height"});
    camera.width = image.at("width").integer();
    camera.height = image.at("height").integer();
    if (camera.width <= 0 || camera.height <= 0) image.fail("width and height must be positive");
    camera.focal_px = root.at("focal_px").vec2();
    if (!(camera.focal_px.x > 0.0) || !(camera.focal_px.y > 0.0))
        root.at("focal_px").fail("focal lengths must be positive");
    camera.principal_px = glm::dvec2(camera.width, camera.height) * 0.5;
    if (const auto principal = root.find("principal_point_px"))
        camera.principal_px = principal->vec2();
    camera.division = readDistortion(root, estimate.division_sigma);
    camera.position_m = root.at("position_m").vec3();
    camera.right = root.at("right").vec3();
    camera.up = root.at("up").vec3();
    camera.forward = root.at("forward").vec3();
    settleAxes(root, camera);
    readDoubts(root, estimate);
    return estimate;
}

}  // namespace insitu
