#include "lighting/staged_objects.h"

#include "core/parallel.h"
#include "reconstruct/ray_scene.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/lighting/light_samples.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <cstring>

namespace insitu {
namespace {

class Stage : public testing::Test {
protected:
    static constexpr int kFace = 16;
    TriangleMesh chair_ = shapes::chair();
    TriangleMesh table_ = shapes::table();
    VisibilityAtlas chair_atlas_ = buildVisibilityAtlas(chair_, {kFace, 64, 2}, silent);
    VisibilityAtlas table_atlas_ = buildVisibilityAtlas(table_, {kFace, 64, 2}, silent);
    CellLight light_ = splitLight(skyWithWindow(), glm::dmat3(1.0), {kFace});
    std::vector<glm::dvec3> floor_;
    const glm::vec3 up_{0, 1, 0};

    Stage()
    {
        for (int i = 0; i < 1600; ++i)
            floor_.emplace_back(-2.0 + 0.1 * (i % 40), -1e-4, -2.0 + 0.1 * (i / 40));
    }
    [[nodiscard]] ObjectStage stage(const std::vector<StagedObject>& objects) const
    {
        return {objects, light_, {kFace}, {128, 2}, silent};
    }
    [[nodiscard]] std::vector<Rgb> hiddenOnFloor(const ObjectStage& objects) const
    {
        std::vector<Rgb> hidden(floor_.size());
        objects.hiddenIrradiance(floor_, up_, hidden);
        return hidden;
    }
    /// By rays along the light's own directions.
    [[nodiscard]] std::vector<Rgb> byRays(const std::vector<StagedObject>& objects) const
    {
        std::vector<TriangleMesh> meshes;
        std::vector<const TriangleMesh*> pointers;
        for (const StagedObject& object : objects)
            meshes.push_back(placed(*object.mesh, object.placement));
        for (const TriangleMesh& mesh : meshes)
            pointers.push_back(&mesh);
        const RayScene rays(pointers);
        std::vector<Rgb> hidden(floor_.size(), Rgb(0.0f));
        const auto add = [&](const IrradianceVector& light, glm::dvec3 d) {
            const Rgb irradiance = glm::max(light.along(up_), Rgb(0.0f));
            if (irradiance == Rgb(0.0f)) return;
            for (std::size_t i = 0; i < floor_.size(); ++i)
                if (rays.occluded(floor_[i], d)) hidden[i] += irradiance;
        };
        for (std::size_t k = 0; k < light_.along.size(); ++k) {
            add(light_.along[k], DirectionCells{kFace}.direction(k));
            add(light_.against[k], -DirectionCells{kFace}.direction(k));
        }
        for (std::size_t k = 0; k < light_.fine.size(); ++k)
            add(light_.fine[k], light_.fine_directions[k]);
        return hidden;
    }
};

/// Root mean square difference over the largest truth.
double relativeError(const std::vector<Rgb>& truth, const std::vector<Rgb>& found)
{
    double square = 0.0;
    double most = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        square += (truth[i].g - found[i].g) * (truth[i].g - found[i].g);
        most = std::max<double>(most, truth[i].g);
    }
    return std::sqrt(square / static_cast<double>(truth.size())) / most;
}

TEST_F(Stage, OneObjectThatStandsStraightIsAsByItself)
{
    const ObjectStage one = stage({{&table_, &table_atlas_, {}}});
    const ObjectLight alone = lightObject(table_, table_atlas_, light_, {128, 2}, silent);
    std::vector<glm::vec3> local;
    for (const glm::dvec3& x : floor_)
        local.push_back(alone.local().localFrom(x));
    std::vector<Rgb> hidden(local.size());
    hiddenIrradiance(alone, local, up_, hidden);
    EXPECT_LT(relativeError(hidden, hiddenOnFloor(one)), 1e-4);
    EXPECT_EQ(one.light().along.size(), light_.along.size());
}

TEST_F(Stage, SeveralTurnedObjectsEqualRays)
{
    const std::vector<StagedObject> objects = {
        {&table_, &table_atlas_, {.rotation_y_rad = 0.5, .position_m = {0.1, 0, 0.2}}},
        {&chair_, &chair_atlas_, {.rotation_y_rad = -2.1, .position_m = {0.1, 0, 0.3}}},
        {&chair_, &chair_atlas_, {.scale = 1.2, .position_m = {-0.3, 0, -0.3}}}};
    const std::vector<Rgb> truth = byRays(objects);
    const std::vector<Rgb> found = hiddenOnFloor(stage(objects));
    // Directions of the cells are up to 3 degrees off in turned objects; a window of 40 of them.
    const double error = relativeError(truth, found);
    EXPECT_LT(error, 0.025);

    // Adding up what each hides counts overlaps twice: far worse.
    std::vector<Rgb> sum(floor_.size(), Rgb(0.0f));
    for (const StagedObject& object : objects) {
        const std::vector<Rgb> one = hiddenOnFloor(stage({object}));
        for (std::size_t i = 0; i < sum.size(); ++i)
            sum[i] += one[i];
    }
    EXPECT_GT(relativeError(truth, sum), 3.0 * error);
}

TEST_F(Stage, TwoInTheSamePlaceHideAsOne)
{
    const StagedObject table{&table_, &table_atlas_, {.rotation_y_rad = 0.3}};
    const std::vector<Rgb> one = hiddenOnFloor(stage({table}));
    const std::vector<Rgb> two = hiddenOnFloor(stage({table, table}));
    // Parts of a texel count as independent: edges are a little darker, nothing else.
    EXPECT_LT(relativeError(one, two), 0.02);
    for (std::size_t i = 0; i < one.size(); ++i)
        EXPECT_GE(two[i].g, one[i].g - 1e-4f);
}

TEST_F(Stage, VectorsAndNormalsAreTheWorlds)
{
    const ObjectStage turned =
        stage({{&chair_, &chair_atlas_, {.rotation_y_rad = 1.0, .position_m = {0.2, 0, 0}}}});
    std::vector<IrradianceVector> vectors(floor_.size());
    turned.hiddenVectors(floor_, vectors);
    const std::vector<Rgb> common = hiddenOnFloor(turned);
    std::vector<Rgb> own(floor_.size());
    turned.hiddenIrradiance(floor_, std::vector<glm::vec3>(floor_.size(), up_), own);
    for (std::size_t i = 0; i < floor_.size(); ++i) {
        EXPECT_EQ(own[i], common[i]);
        // The chair stands above the floor: no light below the horizon is hidden.
        EXPECT_NEAR(vectors[i].along(up_).g, common[i].g, 0.02f);
    }
}

TEST_F(Stage, FarFromTheOriginAndForAnyThreadCountTheSame)
{
    const glm::dvec3 away(4096.0, 0.0, -8192.0);
    const StagedObject here{&chair_, &chair_atlas_, {.rotation_y_rad = 0.4}};
    StagedObject there = here;
    there.placement.position_m = away;
    const std::vector<Rgb> near = hiddenOnFloor(stage({here}));
    for (glm::dvec3& x : floor_)
        x += away;
    EXPECT_LT(relativeError(near, hiddenOnFloor(stage({there}))), 1e-5);
    const std::vector<Rgb> many = hiddenOnFloor(stage({there}));
    setThreadCount(1);
    const std::vector<Rgb> one = hiddenOnFloor(stage({there}));
    setThreadCount(0);
    EXPECT_EQ(std::memcmp(one.data(), many.data(), one.size() * sizeof(one[0])), 0);
}

TEST_F(Stage, RefusesNothingAndBadOptions)
{
    EXPECT_THROW((void)stage({}), LogicError);
    const std::vector<StagedObject> objects = {{&chair_, &chair_atlas_, {}}};
    EXPECT_THROW((void)ObjectStage(objects, light_, {8}, {}, silent), LogicError);
    EXPECT_THAT(inputErrorOf([&] {
                    (void)ObjectStage(objects, light_, {kFace}, {1, 1}, silent);
                }),
                testing::HasSubstr("resolution is 1"));
}

}  // namespace
}  // namespace insitu
