#include "calib/views_bundle.h"

#include "calib/views_costs.h"

#include <Eigen/Dense>
#include <ceres/ceres.h>
#include <ceres/rotation.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>

namespace insitu::bundle {

namespace {

/// A height or length that is given as exact is read from a tape to this, metres.
constexpr double kTapeSigma = 0.002;

/// The problem with the memory that its blocks stand in.
class Bundle {
public:
    Bundle(const RoomViews& room, double sigma_px, const State& start)
        : room_(room), sigma_px_(sigma_px), start_(start)
    {
        // Blocks must not move: all room for them first.
        points_.reserve(room.points.size() + 1 + extraPoints());
        for (const glm::dvec3 p : start.points_m)
            points_.push_back({p.x, p.y, p.z});
        addCameras();
        addPoints();
        addLengths();
    }

    std::optional<Solved> run()
    {
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::DENSE_QR;
        options.logging_type = ceres::SILENT;
        options.max_num_iterations = 200;
        options.function_tolerance = 1e-15;
        options.gradient_tolerance = 1e-13;
        options.parameter_tolerance = 1e-13;
        options.num_threads = 1;
        ceres::Solver::Summary summary;
        ceres::Solve(options, &problem_, &summary);
        if (!summary.IsSolutionUsable() || !std::isfinite(summary.final_cost)) return std::nullopt;
        Solved solved;
        solved.chi_squared = 2.0 * summary.final_cost;
        solved.freedom = static_cast<double>(summary.num_residuals_reduced) -
                         static_cast<double>(summary.num_effective_parameters_reduced);
        if (!fill(solved)) return std::nullopt;
        findWorst(solved);
        return solved;
    }

private:
    struct Named {
        ceres::ResidualBlockId block;
        std::string name;
    };

    std::size_t extraPoints() const
    {
        std::size_t count = 0;
        for (const RoomView& view : room_.views)
            count += 2 * view.lines.lengths.size();
        return count;
    }

    glm::dvec2 centred(std::size_t view, glm::dvec2 pixel) const
    {
        return start_.cameras[view].straightened(pixel) - start_.cameras[view].principal_px;
    }

    double* focalOf(std::size_t view) { return &focals_[group_of_[view]]; }

    void add(ceres::CostFunction* cost, const std::vector<double*>& blocks, std::string name)
    {
        named_.push_back({problem_.AddResidualBlock(cost, nullptr, blocks), std::move(name)});
    }

    /// One focal length for all views by one body; its start is their mean.
    void groupViews()
    {
        std::map<std::string, std::size_t> groups;
        for (std::size_t v = 0; v < room_.views.size(); ++v) {
            const std::string& body = room_.views[v].camera;
            const std::string key = body.empty() ? fmt::format("\n{}", v) : body;
            group_of_.push_back(groups.emplace(key, groups.size()).first->second);
        }
        focals_.assign(groups.size(), 0.0);
        std::vector<double> counts(groups.size(), 0.0);
        for (std::size_t v = 0; v < room_.views.size(); ++v) {
            focals_[group_of_[v]] += std::log(start_.cameras[v].focal_px.x);
            counts[group_of_[v]] += 1.0;
        }
        for (std::size_t g = 0; g < focals_.size(); ++g)
            focals_[g] /= counts[g];
    }

    void addCameras()
    {
        groupViews();
        poses_.resize(room_.views.size());
        std::vector<bool> has_prior(focals_.size(), false);
        for (std::size_t v = 0; v < room_.views.size(); ++v) {
            const RoomView& view = room_.views[v];
            const Camera& camera = start_.cameras[v];
            frames_.push_back(cameraFromWorld(camera));
            const glm::dvec3 p = camera.position_m;
            poses_[v] = {0.0, 0.0, 0.0, p.x, p.y, p.z};
            for (std::size_t i = 0; i < view.lines.segments.size(); ++i)
                addSegment(v, i);
            if (view.lines.camera_height_m)
                add(new ceres::AutoDiffCostFunction<HeightCost, 1, kPoseSize>(
                        new HeightCost{*view.lines.camera_height_m,
                                       std::max(kTapeSigma, view.lines.camera_height_sigma_m)}),
                    {poses_[v].data()},
                    view.name + " camera_height_m");
            // The pictures of one body tell one focal length in EXIF, once.
            if (view.exif && !has_prior[group_of_[v]]) {
                has_prior[group_of_[v]] = true;
                add(new ceres::AutoDiffCostFunction<FocalCost, 1, 1>(new FocalCost{*view.exif}),
                    {focalOf(v)},
                    view.name + " EXIF");
            }
        }
    }

    /// Axis of the world that a segment's own axis is: views may be turned by quarters.
    int worldAxis(std::size_t v, RoomAxis axis) const
    {
        if (axis == RoomAxis::Y) return 1;
        const bool exchanged = start_.quarters[v] % 2 == 1;
        return (axis == RoomAxis::X) != exchanged ? 0 : 2;
    }

    void addSegment(std::size_t v, std::size_t index)
    {
        const LineSegment& segment = room_.views[v].lines.segments[index];
        const glm::dvec2 from = centred(v, segment.from_px);
        const glm::dvec2 to = centred(v, segment.to_px);
        add(new ceres::AutoDiffCostFunction<SegmentCost, 1, kPoseSize, 1>(
                new SegmentCost{frames_[v],
                                worldAxis(v, segment.axis),
                                0.5 * (from + to),
                                0.5 * (to - from),
                                sigma_px_}),
            {poses_[v].data(), focalOf(v)},
            fmt::format("{} segments[{}]", room_.views[v].name, index));
    }

    void addSeen(std::size_t v, glm::dvec2 pixel, double* point, double above, std::string name)
    {
        add(new ceres::AutoDiffCostFunction<PointCost, 2, kPoseSize, 1, 3>(
                new PointCost{frames_[v], centred(v, pixel), sigma_px_, above}),
            {poses_[v].data(), focalOf(v), point},
            std::move(name));
    }

    void keepOnFloor(double* point)
    {
        point[1] = 0.0;
        problem_.SetManifold(point, new ceres::SubsetManifold(3, {1}));
    }

    void addPoints()
    {
        for (std::size_t i = 0; i < room_.points.size(); ++i) {
            double* point = points_[i].data();
            for (const auto& [v, pixel] : room_.points[i].seen_px)
                addSeen(v,
                        pixel,
                        point,
                        0.0,
                        fmt::format("{} point \"{}\"", room_.views[v].name, room_.points[i].name));
            if (room_.points[i].on_floor && problem_.HasParameterBlock(point)) keepOnFloor(point);
        }
        // The world's origin: the first view's, and it does not move.
        points_.push_back({0.0, 0.0, 0.0});
        double* origin = points_.back().data();
        addSeen(0, room_.views[0].lines.origin_px, origin, 0.0, room_.views[0].name + " origin_px");
        problem_.SetParameterBlockConstant(origin);
    }

    /// A view's own known lengths: their ends are floor points that only it sees.
    void addLengths()
    {
        for (const SharedLength& length : room_.lengths)
            add(new ceres::AutoDiffCostFunction<LengthCost, 1, 3, 3>(
                    new LengthCost{length.metres, length.sigma_m}),
                {points_[length.from].data(), points_[length.to].data()},
                "lengths");
        for (std::size_t v = 0; v < room_.views.size(); ++v)
            for (const KnownLength& length : room_.views[v].lines.lengths)
                addOwnLength(v, length);
    }

    double* floorPoint(std::size_t v, glm::dvec2 pixel)
    {
        const Camera& camera = start_.cameras[v];
        const glm::dvec3 ray = camera.rayDirection(pixel);
        const double down = std::min(ray.y, -1e-3);
        const glm::dvec3 p = camera.position_m - ray * (camera.position_m.y / down);
        points_.push_back({p.x, 0.0, p.z});
        return points_.back().data();
    }

    void addOwnLength(std::size_t v, const KnownLength& length)
    {
        const std::string name = room_.views[v].name + " scale.lengths";
        double* from = floorPoint(v, length.from_px);
        addSeen(v, length.from_px, from, 0.0, name);
        keepOnFloor(from);
        if (length.on == KnownLength::On::Vertical) {
            addSeen(v, length.to_px, from, length.metres, name);
            return;
        }
        double* to = floorPoint(v, length.to_px);
        addSeen(v, length.to_px, to, 0.0, name);
        keepOnFloor(to);
        add(new ceres::AutoDiffCostFunction<LengthCost, 1, 3, 3>(
                new LengthCost{length.metres, kTapeSigma}),
            {from, to},
            name);
    }

    bool fill(Solved& solved)
    {
        ceres::Covariance::Options options;
        options.algorithm_type = ceres::DENSE_SVD;
        options.num_threads = 1;
        ceres::Covariance covariance(options);
        std::vector<const double*> blocks;
        for (auto& pose : poses_)
            blocks.push_back(pose.data());
        for (double& focal : focals_)
            blocks.push_back(&focal);
        if (!covariance.Compute(blocks, &problem_)) return false;
        for (std::size_t v = 0; v < poses_.size(); ++v) {
            CameraEstimate estimate;
            estimate.camera = cameraOf(v);
            double pose_covariance[kPoseSize * kPoseSize];
            double focal_covariance = 0.0;
            if (!covariance.GetCovarianceBlock(
                    poses_[v].data(), poses_[v].data(), pose_covariance) ||
                !covariance.GetCovarianceBlock(focalOf(v), focalOf(v), &focal_covariance))
                return false;
            double turn = 0.0;
            for (int k = 0; k < 3; ++k) {
                turn += pose_covariance[k * kPoseSize + k];
                estimate.position_sigma_m[k] =
                    std::sqrt(pose_covariance[(k + 3) * kPoseSize + k + 3]);
            }
            estimate.rotation_sigma_rad = std::sqrt(turn);
            estimate.focal_sigma_px = estimate.camera.focal_px.x * std::sqrt(focal_covariance);
            if (!std::isfinite(estimate.focal_sigma_px + turn)) return false;
            solved.cameras.push_back(estimate);
        }
        for (std::size_t i = 0; i < room_.points.size(); ++i)
            solved.points_m.emplace_back(points_[i][0], points_[i][1], points_[i][2]);
        return true;
    }

    Camera cameraOf(std::size_t v)
    {
        Camera camera = start_.cameras[v];
        camera.focal_px = glm::dvec2(std::exp(*focalOf(v)));
        double m[9];
        ceres::AngleAxisToRotationMatrix(poses_[v].data(), m);  // column-major, as GLM
        const glm::dmat3 turn(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8]);
        const glm::dmat3 world_from_camera = glm::transpose(turn * frames_[v]);
        camera.right = world_from_camera[0];
        camera.up = -world_from_camera[1];
        camera.forward = world_from_camera[2];
        camera.position_m = {poses_[v][3], poses_[v][4], poses_[v][5]};
        return camera;
    }

    void findWorst(Solved& solved)
    {
        for (const Named& named : named_) {
            double cost = 0.0;
            problem_.EvaluateResidualBlock(named.block, false, &cost, nullptr, nullptr);
            const double sigmas = std::sqrt(2.0 * cost);
            if (sigmas <= solved.worst_sigmas) continue;
            solved.worst_sigmas = sigmas;
            solved.worst = named.name;
        }
    }

    const RoomViews& room_;
    double sigma_px_;
    const State& start_;
    std::vector<std::array<double, kPoseSize>> poses_;
    std::vector<glm::dmat3> frames_;
    std::vector<double> focals_;  ///< ln f, one a camera body
    std::vector<std::size_t> group_of_;
    std::vector<std::array<double, 3>> points_;
    std::vector<Named> named_;
    ceres::Problem problem_;
};

}  // namespace

std::optional<Solved> solve(const RoomViews& room, double sigma_px, const State& start)
{
    return Bundle(room, sigma_px, start).run();
}

}  // namespace insitu::bundle
