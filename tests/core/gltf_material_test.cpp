#include "core/io/model_io.h"
#include "tests/core/gltf_builder.h"
#include "tests/support/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tolerance.h"

#include <gmock/gmock.h>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace insitu {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using Json = GltfBuilder::Json;

/// One triangle with one material, an embedded 2x1 PNG (red opaque, green quarter) and a sampler.
class GltfMaterial : public ::testing::Test {
protected:
    GltfMaterial()
    {
        cv::Mat pixels(1, 2, CV_8UC4);
        pixels.at<cv::Vec4b>(0, 0) = {0, 0, 255, 255};
        pixels.at<cv::Vec4b>(0, 1) = {0, 255, 0, 64};
        std::vector<std::uint8_t> png;
        cv::imencode(".png", pixels, png);
        const int view = builder_.addView(png.data(), png.size());
        builder_.push("images", {{"bufferView", view}, {"mimeType", "image/png"}});
        builder_.push("samplers", {{"wrapS", 33071}, {"wrapT", 10497}});
        builder_.push("textures", {{"source", 0}, {"sampler", 0}});
        builder_.json["meshes"][0]["primitives"][0]["material"] = 0;
        material_["name"] = "cloth";
    }

    Model read()
    {
        builder_.json["materials"] = Json::array({material_});
        return readModel(folder_.add("m.glb", builder_.glb()));
    }

    TemporaryFolder folder_;
    GltfBuilder builder_ = triangleGltf();
    Json material_;
};

TEST_F(GltfMaterial, DefaultsAreThoseOfTheSpecification)
{
    const Material material = read().materials[0];
    EXPECT_EQ(material.name, "cloth");
    EXPECT_EQ(material.base_color, glm::vec3(1));
    EXPECT_EQ(material.metallic, 1.0f);
    EXPECT_EQ(material.roughness, 1.0f);
    EXPECT_EQ(material.specular, 1.0f);
    EXPECT_EQ(material.emissive, glm::vec3(0));
    EXPECT_FALSE(material.alpha_mask);
    EXPECT_FALSE(material.double_sided);
}

TEST_F(GltfMaterial, TakesFactorsAndExtensions)
{
    material_.update(Json::parse(R"({
        "doubleSided": true, "emissiveFactor": [0.5, 0.25, 1],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4],
                                 "metallicFactor": 0.6, "roughnessFactor": 0.7},
        "extensions": {"KHR_materials_specular": {"specularFactor": 0.25},
                       "KHR_materials_emissive_strength": {"emissiveStrength": 8}}})"));
    const Material material = read().materials[0];
    EXPECT_EQ(material.base_color, glm::vec3(0.1f, 0.2f, 0.3f));
    EXPECT_EQ(material.alpha, 1.0f) << "OPAQUE ignores alpha";
    EXPECT_EQ(material.metallic, 0.6f);
    EXPECT_EQ(material.roughness, 0.7f);
    EXPECT_EQ(material.specular, 0.25f);
    EXPECT_EQ(material.emissive, glm::vec3(4, 2, 8));
    EXPECT_TRUE(material.double_sided);
}

TEST_F(GltfMaterial, LoadsATextureOnceForEachUse)
{
    material_["pbrMetallicRoughness"] = {{"baseColorTexture", {{"index", 0}}},
                                         {"metallicRoughnessTexture", {{"index", 0}}}};
    material_["emissiveTexture"] = {{"index", 0}};
    const Model model = read();
    ASSERT_THAT(model.textures, SizeIs(2));
    const Material& material = model.materials[0];
    EXPECT_EQ(material.base_color_texture, material.emissive_texture);
    const auto& color = model.textures[static_cast<std::size_t>(material.base_color_texture)];
    const auto& data =
        model.textures[static_cast<std::size_t>(material.metallic_roughness_texture)];
    EXPECT_TRUE(color.srgb);
    EXPECT_FALSE(data.srgb);
    EXPECT_TRUE(color.clamp_s);
    EXPECT_FALSE(color.clamp_t);
    EXPECT_EQ(color.texels(0, 0), glm::u8vec4(255, 0, 0, 255));
    EXPECT_EQ(color.texels(1, 0), glm::u8vec4(0, 255, 0, 64));
}

TEST_F(GltfMaterial, MasksAndBlends)
{
    material_["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    material_["alphaMode"] = "MASK";
    material_["alphaCutoff"] = 0.3;
    Model model = read();
    EXPECT_TRUE(model.materials[0].alpha_mask);
    EXPECT_EQ(model.materials[0].alpha_cutoff, 0.3f);
    EXPECT_FALSE(hasFinding(model.findings, "model-blend-as-mask"));

    material_["alphaMode"] = "BLEND";
    model = read();
    EXPECT_TRUE(model.materials[0].alpha_mask);
    EXPECT_EQ(model.materials[0].alpha_cutoff, 0.5f);
    EXPECT_TRUE(hasFinding(model.findings, "model-blend-as-mask"));

    // Many exporters write BLEND for what is opaque everywhere.
    material_["pbrMetallicRoughness"].erase("baseColorTexture");
    model = read();
    EXPECT_FALSE(model.materials[0].alpha_mask);
    EXPECT_FALSE(hasFinding(model.findings, "model-blend-as-mask"));
}

TEST_F(GltfMaterial, TextureCoordinatesAreThoseOfTheMaterial)
{
    const int first = builder_.addAccessor(
        std::vector<glm::vec2>(3, glm::vec2(0.25f)), GltfBuilder::kFloat, "VEC2");
    const int second = builder_.addAccessor(
        std::vector<glm::vec2>(3, glm::vec2(0.75f)), GltfBuilder::kFloat, "VEC2");
    auto& attributes = builder_.json["meshes"][0]["primitives"][0]["attributes"];
    attributes["TEXCOORD_0"] = first;
    attributes["TEXCOORD_1"] = second;
    material_["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}, {"texCoord", 1}};
    EXPECT_EQ(read().mesh.texcoords[0], glm::vec2(0.75f));
    material_["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", 0}};
    EXPECT_TRUE(hasFinding(read().findings, "model-texcoord-set-ignored"));
}

TEST_F(GltfMaterial, MissingAndBrokenImagesLeaveThePlainColour)
{
    material_["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    folder_.add("broken.png", "no picture");
    for (const auto& [uri, code] :
         {std::pair("none.png", "model-texture-missing"),
          std::pair("broken.png", "model-texture-unreadable"),
          std::pair("data:image/png;base64,AAAA", "model-texture-unreadable")}) {
        builder_.json["images"] = {{{"uri", uri}}};
        const Model model = read();
        EXPECT_TRUE(hasFinding(model.findings, code)) << uri;
        EXPECT_EQ(model.materials[0].base_color_texture, kNoTexture);
    }
    builder_.json["images"] = {{{"uri", "..%2fsecret.png"}}};
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(read()); }), HasSubstr("own folder"));
    builder_.json["textures"] = Json::array({Json::object()});
    EXPECT_TRUE(hasFinding(read().findings, "model-texture-missing"));
    builder_.json["textures"] = Json::array();
    EXPECT_THAT(inputErrorOf([&] { static_cast<void>(read()); }), HasSubstr("texture 0"));
}

TEST_F(GltfMaterial, TellsWhatIsNotUsed)
{
    material_["normalTexture"] = {{"index", 0}};
    material_["extensions"]["KHR_materials_specular"] = {{"specularColorFactor", {1, 0, 0}}};
    builder_.json["samplers"][0]["wrapS"] = 33648;
    material_["emissiveTexture"] = {{"index", 0}};
    builder_.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = 0;
    builder_.json["nodes"][0]["skin"] = 0;
    const Findings findings = read().findings;
    for (const char* code : {"model-map-ignored",
                             "model-wrap-ignored",
                             "model-vertex-colors-ignored",
                             "model-skin-ignored"})
        EXPECT_TRUE(hasFinding(findings, code)) << code;
}

}  // namespace
}  // namespace insitu
