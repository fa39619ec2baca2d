#include "lighting/fiv_field.h"

#include "core/random.h"
#include "tests/lighting/furniture_shapes.h"
#include "tests/lighting/light_samples.h"
#include "tests/support/errors.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>

#include <numbers>

namespace insitu {
namespace {

using std::numbers::pi;
using testing::HasSubstr;

class Field : public testing::Test {
protected:
    TriangleMesh mesh_ = shapes::table();
    VisibilityAtlas atlas_ = buildVisibilityAtlas(mesh_, {12, 32, 2}, silent);
    ObjectLight object_ = lightObject(
        mesh_, atlas_, splitLight(skyWithWindow(), glm::dmat3(1.0), {12}), {64, 2}, silent);

    [[nodiscard]] IrradianceVector exact(glm::vec3 x) const
    {
        IrradianceVector hidden;
        hiddenVectors(object_, {&x, 1}, {&hidden, 1});
        return hidden;
    }
};

double vectorDistance(const IrradianceVector& a, const IrradianceVector& b)
{
    double most = 0.0;
    for (std::size_t c = 0; c < 3; ++c)
        most = std::max<double>(most, glm::length(a.channels[c] - b.channels[c]));
    return most;
}

glm::vec3 spherical(double azimuth, double polar, double radius)
{
    return glm::vec3(radius * std::sin(polar) * std::cos(azimuth),
                     radius * std::cos(polar),
                     radius * std::sin(polar) * std::sin(azimuth));
}

TEST_F(Field, ShellsHoldTheExactVectorsAtTheirNodes)
{
    const ShellFieldOptions size{16, 9, 5, 0.4, 6.4};
    const ShellField field(object_, size);
    // The first azimuth again at the end of each row, and a node that look-ups read beyond the
    // last.
    EXPECT_EQ(field.memoryBytes(), (17u * 9u * 5u + 1u) * 48u);
    for (int i = 0; i < 16; ++i)
        for (int j = 1; j < 8; ++j)
            for (int k = 0; k < 5; ++k) {
                // A factor 2 from shell to shell.
                const glm::vec3 x = spherical(pi * i / 8.0, pi * j / 8.0, 0.4 * (1 << k));
                const IrradianceVector truth = exact(x);
                // The azimuth's polynomial is off by 2e-7 turns.
                EXPECT_LT(vectorDistance(field.at(x), truth), 2e-4) << i << " " << j << " " << k;
            }
}

TEST_F(Field, ShellsAreTrilinearInBetween)
{
    const ShellField field(object_, {16, 9, 5, 0.4, 6.4});
    // Halfway along each axis, through the seam of azimuth as well.
    const auto at = [&](double i, double j, double k) {
        return field.at(spherical(pi * i / 8.0, pi * j / 8.0, 0.4 * std::exp2(k)));
    };
    const auto middle = [](IrradianceVector a, const IrradianceVector& b) {
        a += b;
        a *= 0.5f;
        return a;
    };
    EXPECT_LT(vectorDistance(at(15.5, 3, 2), middle(at(15, 3, 2), at(0, 3, 2))), 1e-4);
    EXPECT_LT(vectorDistance(at(4, 3.5, 2), middle(at(4, 3, 2), at(4, 4, 2))), 1e-4);
    EXPECT_LT(vectorDistance(at(4, 3, 2.5), middle(at(4, 3, 2), at(4, 3, 3))), 1e-4);
    // Inside the first shell its own value, beyond the last a quarter at twice the distance.
    EXPECT_LT(vectorDistance(at(4, 3, -1), at(4, 3, 0)), 1e-5);
    IrradianceVector quarter = at(4, 3, 4);
    quarter *= 0.25f;
    EXPECT_LT(vectorDistance(at(4, 3, 5), quarter), 1e-5);
}

TEST_F(Field, ShellsKnowTheThesisShadowCases)
{
    const ShellField field(object_, {16, 9, 5, 0.4, 6.4});
    const glm::vec3 x(2.0f, 0.0f, 0.0f);  // the object lies along -x
    const std::vector<glm::vec3> places(4, x);
    const glm::vec3 across = glm::normalize(glm::vec3(-0.1f, 1.0f, 0.0f));
    const glm::vec3 standing(0, 1, 0);
    const std::vector<glm::vec3> normals = {{-1, 0, 0}, across, standing, {1, 0, 0}};
    const glm::vec3 half = object_.local().half_extent;
    std::vector<glm::vec3> own = places;
    own[2].y = -half.y;  // the floor that it stands on
    std::vector<Rgb> hidden(4);
    field.hiddenIrradiance(own, normals, hidden);
    const IrradianceVector v = field.at(x);
    EXPECT_NEAR(hidden[0].g, v.along(normals[0]).g, 1e-5) << "A: wholly in front";
    const float reach = (0.1f * half.x + half.y) / std::sqrt(1.01f);
    const float share = 0.5f * (0.2f / std::sqrt(1.01f) / reach + 1.0f);
    EXPECT_NEAR(hidden[1].g, std::max(0.0f, share * v.along(across).g), 1e-5) << "B: cut";
    EXPECT_NEAR(hidden[2].g, field.at(own[2]).along(standing).g, 1e-5) << "A: on the floor";
    EXPECT_EQ(hidden[3], Rgb(0.0f)) << "C: behind";
}

TEST_F(Field, PlaneIsWithinItsErrorEverywhere)
{
    const ReceiverPlane floor{{-2.0, 0.0, -2.0}, {4.0, 0, 0}, {0, 0, 4.0}};
    EXPECT_EQ(floor.normal(), glm::dvec3(0, 1, 0));
    const PlaneField field(object_, floor, {16, 0.03, 7});
    std::vector<glm::vec3> places;
    std::vector<glm::dvec2> uv;
    for (std::uint64_t i = 0; i < 2000; ++i) {
        RandomStream random(9, 0, i);
        uv.emplace_back(random.uniformDouble(), random.uniformDouble());
        places.push_back(object_.local().localFrom(floor.corner + uv[i].x * floor.edge_u +
                                                   uv[i].y * floor.edge_v));
    }
    std::vector<Rgb> truth(places.size());
    hiddenIrradiance(object_, places, glm::vec3(0, 1, 0), truth);
    double irradiance = 0.0;
    for (const auto* list : {&object_.light.along, &object_.light.against, &object_.light.fine})
        for (const IrradianceVector& v : *list)
            irradiance += std::max(0.0f, v.along({0, 1, 0}).r);
    double square = 0.0;
    for (std::size_t i = 0; i < places.size(); ++i) {
        const double off = glm::length(field.at(uv[i]) - truth[i]);
        // What the last test samples showed bounds what is left but for kinks between them.
        EXPECT_LT(off, 3.0 * 0.03 * irradiance) << uv[i].x << " " << uv[i].y;
        square += off * off;
    }
    EXPECT_LT(std::sqrt(square / 2000.0), 0.006 * irradiance);
    EXPECT_LE(field.largestError(), 0.03);
    // Error decides where samples lie: a uniform grid as fine as the finest tile holds far more.
    EXPECT_LT(field.samples(), 16u * 16u * 129u * 129u / 20u);
    EXPECT_GT(field.samples(), 16u * 16u * 25u);
}

TEST_F(Field, PlaneWithoutShadowCostsTheLeast)
{
    const PlaneField field(object_, {{40, 0, 40}, {1, 0, 0}, {0, 0, 1}}, {8, 0.01, 6});
    EXPECT_EQ(field.samples(), 8u * 8u * 25u);
    const ObjectLight dark =
        lightObject(mesh_,
                    atlas_,
                    splitLight({Image<Rgb>(16, 8, Rgb(0.0f))}, glm::dmat3(1.0), {12}),
                    {64, 2},
                    silent);
    const PlaneField black(dark, {{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}}, {8, 0.01, 6});
    EXPECT_EQ(black.samples(), 8u * 8u * 25u);
    EXPECT_EQ(black.at({0.5, 0.5}), Rgb(0.0f));
    EXPECT_EQ(black.largestError(), 0.0);
}

TEST_F(Field, TheUndersideOfTheTopReceivesToo)
{
    // On the underside itself; nothing but the legs hides what comes from below.
    const ReceiverPlane underside{{-0.5, 0.72, 0.3}, {1.0, 0, 0}, {0, 0, -0.6}};
    EXPECT_EQ(underside.normal(), glm::dvec3(0, -1, 0));
    const PlaneField own(object_, underside, {8, 0.01, 5, 1.0f});
    const PlaneField naive(object_, underside, {8, 0.01, 5, 0.0f});
    const double sky = 0.25 * pi;
    // Four legs of 3 cm at half a metre: some per cent. Without a bias the top hides half of it all
    // from itself.
    EXPECT_LT(own.at({0.5, 0.5}).g, 0.1 * sky);
    EXPECT_GT(own.at({0.5, 0.5}).g, 0.0);
    EXPECT_GT(naive.at({0.5, 0.5}).g, 0.3 * sky);
}

// Azimuth, polar angle and logarithm of the distance in double precision.
TEST(ShellLookUp, CornersAreWhereTheAnglesSay)
{
    const fiv::ShellGrid grid{12, 7, 5, 0.5f, 8.0f, 1.0f};
    RandomStream random(42, 0, 0);
    for (int trial = 0; trial < 500; ++trial) {
        const double azimuth = 12.0 * random.uniformDouble();
        const double polar = 6.0 * random.uniformDouble();
        const double shell = 5.0 * random.uniformDouble();  // the last fifth beyond the last shell
        const double distance = 0.5 * std::exp2(shell);
        const double theta = pi * polar / 6.0;
        const double phi = 2.0 * pi * azimuth / 12.0;
        const fiv::ShellCorners corners =
            fiv::shellCorners(grid,
                              glm::vec3(distance * glm::dvec3(std::sin(theta) * std::cos(phi),
                                                              std::cos(theta),
                                                              std::sin(theta) * std::sin(phi))));
        // Centre of gravity of the corners' numbers; a turn is a turn.
        glm::dvec3 at(0.0);
        double sum = 0.0;
        for (int k = 0; k < 8; ++k) {
            const double w = corners.weights[static_cast<std::size_t>(k)];
            sum += w;
            at += w * glm::dvec3(k & 1, k >> 1 & 1, k >> 2);
        }
        at = at / sum +
             glm::dvec3(corners.node % 13, corners.node / 13 % 7, corners.node / (13 * 7));
        const double fall = shell > 4.0 ? std::exp2(2.0 * (4.0 - shell)) : 1.0;
        EXPECT_NEAR(sum, fall, 1e-5) << shell;
        EXPECT_NEAR(std::remainder(at.x - azimuth, 12.0), 0.0, 2e-5 / std::sin(theta)) << trial;
        EXPECT_NEAR(at.y, polar, 2e-5) << trial;
        EXPECT_NEAR(at.z, std::min(shell, 4.0), 2e-5) << trial;
    }
}

TEST(ShellLookUp, EveryInstructionSetGivesTheSameBytes)
{
    const fiv::ShellGrid grid{12, 7, 4, 0.5f, 4.0f, 1.0f};
    std::vector<fiv::ShellNode> nodes(13 * 7 * 4 + 1);
    RandomStream random(41, 0, 0);
    for (fiv::ShellNode& node : nodes)
        for (auto& axis : node.axis)
            for (int c = 0; c < 3; ++c)
                axis[static_cast<std::size_t>(c)] = 2.0f * random.uniform() - 1.0f;
    // Inside the first shell, beyond the last, on the axis, in the centre; no multiple of a batch.
    std::vector<glm::vec3> places = {{0, 0, 0}, {0, 1, 0}, {0, -2, 0}, {1e-20f, 0, 0}, {9, 0, -9}};
    while (places.size() < 203)
        places.push_back(6.0f * glm::vec3(random.uniform(), random.uniform(), random.uniform()) -
                         3.0f);
    std::vector<glm::vec3> normals;
    for (std::size_t i = 0; i < places.size(); ++i)
        normals.push_back(glm::normalize(
            glm::vec3(random.uniform() - 0.5f, random.uniform(), random.uniform() - 0.5f)));
    const auto with = [&](InstructionSet isa) {
        std::vector<Rgb> hidden(places.size());
        fiv::lookUpShells(isa, grid, nodes, glm::vec3(1.0f), places, normals, hidden);
        return hidden;
    };
    const std::vector<Rgb> base = with(InstructionSet::Base);
    for (int isa = 1; isa <= static_cast<int>(bestInstructionSet()); ++isa)
        EXPECT_EQ(with(static_cast<InstructionSet>(isa)), base) << isa;
    for (std::size_t i = 0; i < places.size(); ++i) {
        // The same by the corners one place at a time.
        const fiv::ShellCorners corners = fiv::shellCorners(grid, places[i]);
        glm::vec3 sum(0.0f);
        for (std::size_t k = 0; k < 8; ++k) {
            const auto node = static_cast<std::size_t>(corners.node) + (k & 1) + (k >> 1 & 1) * 13 +
                              (k >> 2) * 13 * 7;
            for (int c = 0; c < 3; ++c)
                for (int axis = 0; axis < 3; ++axis)
                    sum[c] += corners.weights[k] * normals[i][axis] *
                              nodes[node].axis[axis][static_cast<std::size_t>(c)];
        }
        const float extent = glm::dot(glm::vec3(1.0f), glm::abs(normals[i]));
        const float height = -glm::dot(places[i], normals[i]) / extent;
        const float share = std::clamp(0.5f * (height + 1.0f), 0.0f, 1.0f);
        for (int c = 0; c < 3; ++c)
            EXPECT_NEAR(base[i][c], std::max(0.0f, share * sum[c]), 1e-5f) << i;
    }
}

TEST_F(Field, RefusesBadOptions)
{
    EXPECT_THAT(inputErrorOf([&] {
                    (void)ShellField(object_, {2, 2, 1, 3.0, 1.0});
                }),
                testing::AllOf(HasSubstr("azimuths is 2"),
                               HasSubstr("polars is 2"),
                               HasSubstr("shells is 1"),
                               HasSubstr("radii from 3 to 1")));
    const ReceiverPlane floor{{-1, 0, -1}, {2, 0, 0}, {0, 0, 2}};
    EXPECT_THAT(
        inputErrorOf([&] {
            (void)PlaneField(object_, floor, {0, 0.0, 9});
        }),
        testing::AllOf(
            HasSubstr("tiles is 0"), HasSubstr("max_error is 0"), HasSubstr("max_level is 9")));
    EXPECT_THAT(inputErrorOf([&] {
                    (void)PlaneField(object_, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {});
                }),
                HasSubstr("no area"));
}

}  // namespace
}  // namespace insitu
