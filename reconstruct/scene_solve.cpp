#include "reconstruct/scene_solve.h"

#include "core/check.h"
#include "reconstruct/scene_solve_state.h"

#include <ceres/ceres.h>

#include <algorithm>
#include <limits>

namespace insitu {

namespace {

constexpr int kMaxIterations = 200;
/// Relative change of cost and state at which a solution is there; a drag is followed by others.
constexpr double kTolerance = 1e-10;
constexpr double kDragTolerance = 1e-7;
constexpr double kUnbounded = std::numeric_limits<double>::max();

/// Brings the poses up to date once per evaluation, for all equations.
class PoseUpdate : public ceres::EvaluationCallback {
public:
    explicit PoseUpdate(SceneState& state) : state_(state) {}
    void PrepareForEvaluation(bool, bool new_point) override
    {
        if (new_point) state_.layout->evaluate(state_.values, state_.poses);
    }

private:
    SceneState& state_;
};

/// An equation for Ceres: one parameter block a primitive.
class EquationCost : public ceres::CostFunction {
public:
    EquationCost(const SceneEquation& equation, const SceneState& state)
        : equation_(equation), state_(state)
    {
        set_num_residuals(equation.size);
        for (const std::size_t primitive : equation.primitives)
            mutable_parameter_block_sizes()->push_back(
                static_cast<int>(state.layout->unknownCount(primitive)));
    }

    bool Evaluate(double const* const*, double* residuals, double** jacobians) const override
    {
        double values[2];
        EquationJacobian jacobian;
        if (!evaluateEquation(equation_,
                              state_.camera,
                              *state_.layout,
                              state_.values,
                              state_.poses,
                              values,
                              jacobians ? &jacobian : nullptr))
            return false;
        std::copy_n(values, equation_.size, residuals);
        if (!jacobians) return true;
        Eigen::Index column = 0;
        for (std::size_t block = 0; block < equation_.primitives.size(); ++block) {
            const int width = parameter_block_sizes()[block];
            if (jacobians[block])
                for (int row = 0; row < equation_.size; ++row)
                    for (int c = 0; c < width; ++c)
                        jacobians[block][row * width + c] = jacobian(row, column + c);
            column += width;
        }
        return true;
    }

private:
    const SceneEquation& equation_;
    const SceneState& state_;
};

ceres::Problem::Options problemOptions(PoseUpdate& update)
{
    ceres::Problem::Options options;
    options.evaluation_callback = &update;
    return options;
}

}  // namespace

struct SceneSolver::Impl {
    SceneState state;
    PoseUpdate update{state};
    std::unique_ptr<ceres::Problem> problem;

    void add(const SceneEquation& equation)
    {
        if (equation.primitives.empty()) return;
        std::vector<double*> blocks;
        for (const std::size_t primitive : equation.primitives)
            blocks.push_back(state.values.data() + state.layout->firstUnknown(primitive));
        problem->AddResidualBlock(new EquationCost(equation, state), nullptr, blocks);
    }

    /// Sets every size's bounds, or takes them away; true when one is broken.
    bool bound(bool on)
    {
        bool broken = false;
        for (std::size_t u = 0; u < state.values.size(); ++u) {
            const SceneUnknown& unknown = state.layout->unknowns()[u];
            if (!unknown.parameter) continue;
            double* block = state.values.data() + state.layout->firstUnknown(unknown.primitive);
            const int index = static_cast<int>(state.values.data() + u - block);
            if (!problem->HasParameterBlock(block)) continue;
            broken =
                broken || state.values[u] < unknown.minimum || state.values[u] > unknown.maximum;
            problem->SetParameterLowerBound(block, index, on ? unknown.minimum : -kUnbounded);
            problem->SetParameterUpperBound(block, index, on ? unknown.maximum : kUnbounded);
            if (on) state.values[u] = std::clamp(state.values[u], unknown.minimum, unknown.maximum);
        }
        return broken;
    }

    SceneSolution solve(double tolerance);

    SceneSolution run(double tolerance)
    {
        ceres::Solver::Options options;
        options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
        options.max_num_iterations = kMaxIterations;
        options.function_tolerance = tolerance;
        options.parameter_tolerance = tolerance;
        options.gradient_tolerance = 0.01 * tolerance;
        options.num_threads = 1;
        options.logging_type = ceres::SILENT;
        options.max_num_consecutive_invalid_steps = 20;
        ceres::Solver::Summary summary;
        ceres::Solve(options, problem.get(), &summary);
        SceneSolution solution;
        solution.converged = summary.termination_type == ceres::CONVERGENCE;
        solution.iterations = summary.num_successful_steps + summary.num_unsuccessful_steps;
        solution.cost = summary.final_cost;
        return solution;
    }
};

SceneSolver::SceneSolver(SceneGraph graph, const Camera& camera) : impl_(std::make_unique<Impl>())
{
    if (const auto problem = sceneProblem(graph))
        INSITU_CHECK(false, "{}: {}", graph.primitives[problem->primitive].name, problem->cause);
    SceneState& state = impl_->state;
    state.graph = std::move(graph);
    state.camera = camera;
    state.layout = std::make_unique<SceneLayout>(state.graph);
    for (const SceneUnknown& unknown : state.layout->unknowns())
        state.values.push_back(unknown.start);
    state.layout->evaluate(state.values, state.poses);
    impl_->problem = std::make_unique<ceres::Problem>(problemOptions(impl_->update));
    for (SceneEquation& equation : sceneEquations(state.graph, camera, *state.layout)) {
        state.equations.push_back(std::make_unique<SceneEquation>(std::move(equation)));
        impl_->add(*state.equations.back());
    }
}

SceneSolver::~SceneSolver() = default;
SceneSolver::SceneSolver(SceneSolver&&) noexcept = default;
SceneSolver& SceneSolver::operator=(SceneSolver&&) noexcept = default;

SceneSolution SceneSolver::solve()
{
    return impl_->solve(kTolerance);
}

SceneSolution SceneSolver::Impl::solve(double tolerance)
{
    state.layout->evaluate(state.values, state.poses);
    for (const auto& equation : state.equations) {
        double residuals[2];
        if (!evaluateEquation(*equation,
                              state.camera,
                              *state.layout,
                              state.values,
                              state.poses,
                              residuals,
                              nullptr))
            throw InputError(equation->name,
                             "lies behind the camera where the solution begins; give the "
                             "primitive a position_m and sizes nearer to the truth");
    }
    // Sizes are rarely at their bounds: these are set only when a free solution breaks one.
    state.solution = run(tolerance);
    if (bound(false)) {
        bound(true);
        state.solution = run(tolerance);
        bound(false);
    }
    state.layout->evaluate(state.values, state.poses);
    return state.solution;
}

SceneSolution SceneSolver::drag(SceneVertex vertex, glm::dvec2 pixel, double sigma_px)
{
    SceneState& state = impl_->state;
    auto& observations = state.graph.vertices;
    const auto known = std::find_if(observations.begin(),
                                    observations.end(),
                                    [&](const VertexObservation& o) { return o.vertex == vertex; });
    if (known != observations.end()) {
        known->pixel = pixel;
        known->sigma_px = sigma_px;
        // Vertex observations are the first equations, or were added by earlier drags.
        for (const auto& equation : state.equations)
            if (equation->kind == SceneEquation::Kind::Vertex && equation->a == vertex) {
                equation->at = idealPixel(state.camera, pixel);
                equation->sigma = sigma_px;
                return impl_->solve(kDragTolerance);
            }
    }
    const ScenePrimitive& primitive = state.graph.primitives[vertex.primitive];
    observations.push_back(
        {vertex,
         pixel,
         sigma_px,
         fmt::format("{}.{}", primitive.name, primitive.shape.vertex_names[vertex.vertex])});
    state.equations.push_back(std::make_unique<SceneEquation>(
        vertexEquation(observations.back(), state.camera, *state.layout)));
    impl_->add(*state.equations.back());
    return impl_->solve(kDragTolerance);
}

std::vector<SolvedPrimitive> SceneSolver::primitives() const
{
    std::vector<SolvedPrimitive> solved;
    for (const ScenePose& pose : impl_->state.poses) {
        SolvedPrimitive primitive;
        for (const double value : pose.parameters)
            primitive.parameters.push_back({value, {}});
        for (std::size_t axis = 0; axis < 3; ++axis)
            primitive.position_m[axis].value = pose.position[axis].value;
        primitive.rotation_y_rad.value = pose.turn.value;
        solved.push_back(std::move(primitive));
    }
    return solved;
}

SceneEstimate SceneSolver::estimate(std::span<const Camera> camera_errors) const
{
    return analyseScene(impl_->state, camera_errors);
}

const SceneGraph& SceneSolver::graph() const
{
    return impl_->state.graph;
}

std::vector<WorldFace> solvedFaces(const ScenePrimitive& primitive, const SolvedPrimitive& solved)
{
    std::vector<double> values;
    for (const SolvedNumber& number : solved.parameters)
        values.push_back(number.value);
    const glm::dvec3 position(
        solved.position_m[0].value, solved.position_m[1].value, solved.position_m[2].value);
    return placedFaces(primitive.shape, values, position, solved.rotation_y_rad.value);
}

}  // namespace insitu
