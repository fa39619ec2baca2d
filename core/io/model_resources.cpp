#include "core/io/model_resources.h"

#include "core/check.h"
#include "core/io/encoded_header.h"
#include "core/io/file.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <cctype>
#include <utility>
#include <vector>

namespace insitu {

namespace fs = std::filesystem;

namespace {

bool hasSchemeOrDrive(std::string_view name)
{
    const std::size_t colon = name.find(':');
    if (colon == std::string_view::npos || colon == 0) return false;
    return std::all_of(name.begin(), name.begin() + static_cast<std::ptrdiff_t>(colon), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '+' || c == '-' || c == '.';
    });
}

bool isInside(const fs::path& file, const fs::path& folder)
{
    const fs::path relative = file.lexically_relative(folder);
    return !relative.empty() && *relative.begin() != "..";
}

cv::Mat decodeToRgba8(std::span<const std::uint8_t> bytes, const std::string& name)
{
    const std::vector<std::uint8_t> copy(bytes.begin(), bytes.end());
    cv::Mat decoded;
    try {
        decoded = cv::imdecode(copy, cv::IMREAD_UNCHANGED);
    } catch (const cv::Exception& error) {
        throw InputError(name, "damaged image: " + error.err);
    }
    if (decoded.empty()) throw InputError(name, "damaged image");
    if (decoded.depth() == CV_16U) decoded.convertTo(decoded, CV_8U, 1.0 / 257.0);
    if (decoded.depth() != CV_8U) throw InputError(name, "pixels are neither 8 nor 16 bit");
    return decoded;
}

}  // namespace

void checkElementCount(std::uint64_t count, const std::string& path)
{
    if (count > kMaxModelElements)
        throw InputError(
            path, fmt::format("more than {} vertices; reduce the model first", kMaxModelElements));
}

fs::path resourceBeside(const fs::path& model, std::string_view name)
{
    std::string cleaned(name);
    std::replace(cleaned.begin(), cleaned.end(), '\\', '/');
    const auto refuse = [&](const std::string& cause) {
        throw InputError(model.string(),
                         fmt::format("names the file '{}', which {}; a model may only use files in "
                                     "its own folder",
                                     cleaned,
                                     cause));
    };
    if (cleaned.empty() || cleaned.find('\0') != std::string::npos) refuse("is no file name");
    if (cleaned.front() == '/' || hasSchemeOrDrive(cleaned)) refuse("is not relative");
    const fs::path relative(cleaned);
    if (std::find(relative.begin(), relative.end(), "..") != relative.end())
        refuse("leaves the model's folder");

    const fs::path folder = model.has_parent_path() ? model.parent_path() : fs::path(".");
    const fs::path file = folder / relative;
    std::error_code error;
    const fs::path real_folder = fs::weakly_canonical(folder, error);
    if (error) refuse("cannot be reached: " + error.message());
    const fs::path real_file = fs::weakly_canonical(file, error);
    if (error) refuse("cannot be reached: " + error.message());
    if (!isInside(real_file, real_folder)) refuse("leaves the model's folder through a link");
    return file;
}

Image<glm::u8vec4> decodeTexture(std::span<const std::uint8_t> bytes, const std::string& name)
{
    static_cast<void>(parseEncodedHeader(bytes, name, kMaxTexturePixels));
    const cv::Mat decoded = decodeToRgba8(bytes, name);
    const int channels = decoded.channels();
    Image<glm::u8vec4> image(decoded.cols, decoded.rows);
    for (int y = 0; y < decoded.rows; ++y) {
        const std::uint8_t* in = decoded.ptr<std::uint8_t>(y);
        for (glm::u8vec4& out : image.row(y)) {
            // OpenCV hands out grey, grey + alpha (as BGRA), BGR or BGRA.
            out = channels >= 3 ? glm::u8vec4(in[2], in[1], in[0], channels == 4 ? in[3] : 255)
                                : glm::u8vec4(in[0], in[0], in[0], channels == 2 ? in[1] : 255);
            in += channels;
        }
    }
    return image;
}

int addTexture(Model& model,
               std::span<const std::uint8_t> bytes,
               const std::string& name,
               bool srgb)
{
    Texture texture;
    try {
        texture.texels = decodeTexture(bytes, name);
    } catch (const InputError& cause) {
        model.findings.push_back({Severity::Warning,
                                  "model-texture-unreadable",
                                  fmt::format("{}; the plain colour is used", cause.what())});
        return kNoTexture;
    }
    texture.srgb = srgb;
    std::size_t texels = texture.texels.pixelCount();
    for (const Texture& other : model.textures)
        texels += other.texels.pixelCount();
    if (texels > static_cast<std::size_t>(kMaxTexturePixels))
        throw InputError(
            name, fmt::format("the model's textures exceed {} texels in all", kMaxTexturePixels));
    model.textures.push_back(std::move(texture));
    return static_cast<int>(model.textures.size()) - 1;
}

int addTextureFile(Model& model, const fs::path& model_path, std::string_view name, bool srgb)
{
    const fs::path file = resourceBeside(model_path, name);
    std::error_code error;
    if (!fs::is_regular_file(file, error)) {
        model.findings.push_back({Severity::Warning,
                                  "model-texture-missing",
                                  fmt::format("{}: texture {} does not exist; the plain colour is "
                                              "used",
                                              model_path.string(),
                                              file.string())});
        return kNoTexture;
    }
    return addTexture(model, readFile(file, kMaxModelBytes), file.string(), srgb);
}

}  // namespace insitu
