#include "lighting/visibility_atlas.h"

#include "core/check.h"
#include "core/io/file.h"

#include <xxhash.h>

#include <array>
#include <cstring>
#include <optional>
#include <system_error>

namespace insitu {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxBytes = std::size_t{4} << 30;
/// To be raised whenever an atlas of the same mesh and options would come out differently.
constexpr std::uint32_t kVersion = 2;

/// First bytes of an atlas file. The arrays follow: frames, coverage, depths.
struct Header {
    std::array<char, 8> magic = {'i', 'n', 's', 'i', 't', 'u', 'V', 'A'};
    std::uint32_t version = kVersion;
    std::uint32_t byte_order = 0x01020304;
    std::int32_t face_size = 0, resolution = 0, samples = 0, unused = 0;
    std::array<double, 7> local{};  ///< centre, radius, half extent
    std::uint64_t payload_bytes = 0;
    std::uint64_t payload_hash = 0;
    std::array<std::uint64_t, 2> content{};  ///< hash of mesh and options
    std::uint64_t header_hash = 0;           ///< of all bytes before it
};

std::uint64_t hashOf(const Header& header)
{
    return XXH3_64bits(&header, offsetof(Header, header_hash));
}

template <class Item>
std::size_t bytesOf(const std::vector<Item>& items)
{
    return items.size() * sizeof(Item);
}

std::array<std::uint64_t, 2> contentHash(const TriangleMesh& mesh, const AtlasOptions& options)
{
    XXH3_state_t* const state = XXH3_createState();
    INSITU_CHECK(state != nullptr, "no memory for a hash");
    XXH3_128bits_reset(state);
    const std::array<std::int64_t, 6> numbers = {kVersion,
                                                 options.face_size,
                                                 options.resolution,
                                                 options.samples,
                                                 static_cast<std::int64_t>(mesh.positions.size()),
                                                 static_cast<std::int64_t>(mesh.triangles.size())};
    XXH3_128bits_update(state, numbers.data(), sizeof(numbers));
    XXH3_128bits_update(state, mesh.positions.data(), bytesOf(mesh.positions));
    XXH3_128bits_update(state, mesh.triangles.data(), bytesOf(mesh.triangles));
    const XXH128_hash_t hash = XXH3_128bits_digest(state);
    XXH3_freeState(state);
    return {hash.high64, hash.low64};
}

std::vector<glm::dvec3> cellDirections(const DirectionCells& cells)
{
    std::vector<glm::dvec3> directions(cells.pairCount());
    for (std::size_t i = 0; i < directions.size(); ++i)
        directions[i] = cells.direction(i);
    return directions;
}

/// Calls visit(data, bytes) for each array that a file holds.
template <class Set, class Visit>
void forEachArray(Set& set, const Visit& visit)
{
    visit(set.frames.data(), bytesOf(set.frames));
    visit(set.coverage.data(), bytesOf(set.coverage));
    visit(set.depths.data(), bytesOf(set.depths));
}

std::string fileBytes(const VisibilityAtlas& atlas, const std::array<std::uint64_t, 2>& content)
{
    std::string bytes(sizeof(Header), '\0');
    forEachArray(atlas.silhouettes, [&](const void* data, std::size_t count) {
        bytes.append(static_cast<const char*>(data), count);
    });
    const LocalFrame& local = atlas.silhouettes.local;
    Header header;
    header.face_size = atlas.options.face_size;
    header.resolution = atlas.options.resolution;
    header.samples = atlas.options.samples;
    header.local = {local.center.x,
                    local.center.y,
                    local.center.z,
                    local.radius,
                    local.half_extent.x,
                    local.half_extent.y,
                    local.half_extent.z};
    header.payload_bytes = bytes.size() - sizeof(Header);
    header.payload_hash = XXH3_64bits(bytes.data() + sizeof(Header), header.payload_bytes);
    header.content = content;
    header.header_hash = hashOf(header);
    std::memcpy(bytes.data(), &header, sizeof(header));
    return bytes;
}

/// Nothing when the bytes are not those of this atlas.
std::optional<VisibilityAtlas> atlasFromBytes(const std::vector<std::uint8_t>& bytes,
                                              const AtlasOptions& options,
                                              const std::array<std::uint64_t, 2>& content)
{
    Header header;
    if (bytes.size() < sizeof(Header)) return std::nullopt;
    std::memcpy(&header, bytes.data(), sizeof(header));
    const Header expected;
    const AtlasOptions written{header.face_size, header.resolution, header.samples};
    if (header.magic != expected.magic || header.version != kVersion ||
        header.byte_order != expected.byte_order || header.header_hash != hashOf(header) ||
        header.content != content || written != options)
        return std::nullopt;

    VisibilityAtlas atlas;
    atlas.options = options;
    SilhouetteSet& set = atlas.silhouettes;
    const auto& local = header.local;
    set.local.center = {local[0], local[1], local[2]};
    set.local.radius = local[3];
    set.local.half_extent = glm::vec3(glm::dvec3(local[4], local[5], local[6]));
    set.resolution = options.resolution;
    set.directions = cellDirections(atlas.cells());
    const std::size_t pairs = atlas.cells().pairCount();
    const std::size_t payload =
        pairs * (sizeof(SilhouetteFrame) + set.texels() * (1 + sizeof(DepthSpan)));
    if (header.payload_bytes != payload || bytes.size() != sizeof(Header) + payload ||
        header.payload_hash != XXH3_64bits(bytes.data() + sizeof(Header), payload))
        return std::nullopt;
    set.frames.resize(pairs);
    set.coverage.resize(pairs * set.texels());
    set.depths.resize(pairs * set.texels());
    const std::uint8_t* from = bytes.data() + sizeof(Header);
    forEachArray(set, [&](void* data, std::size_t count) {
        std::memcpy(data, from, count);
        from += count;
    });
    set.summarize();
    return atlas;
}

}  // namespace

Findings AtlasOptions::validate() const
{
    Findings problems;
    const auto range = [&](const char* name, int value, int least, int most) {
        if (value >= least && value <= most) return;
        problems.push_back({Severity::Error,
                            "atlas-options",
                            fmt::format("{} is {}, not in [{}, {}]", name, value, least, most)});
    };
    range("face_size", face_size, 2, 128);
    range("resolution", resolution, 16, 512);
    range("samples", samples, 1, 8);
    return problems;
}

VisibilityAtlas buildVisibilityAtlas(const TriangleMesh& mesh,
                                     const AtlasOptions& options,
                                     Progress& progress)
{
    requireValid(options.validate(), "atlas options");
    VisibilityAtlas atlas;
    atlas.options = options;
    const auto side = static_cast<std::size_t>(options.resolution);
    const std::size_t bytes = atlas.cells().pairCount() * side * side * (1 + sizeof(DepthSpan));
    if (bytes > kMaxBytes)
        throw InputError("atlas options",
                         fmt::format("an atlas of {} MiB is too large: lower face_size or "
                                     "resolution",
                                     bytes >> 20));
    atlas.silhouettes = drawSilhouettes(
        mesh, cellDirections(atlas.cells()), options.resolution, options.samples, progress);
    return atlas;
}

VisibilityAtlas placedAtlas(VisibilityAtlas atlas,
                            const Placement& placement,
                            const TriangleMesh& placed_mesh)
{
    const glm::dmat3 turn = placement.worldFromModelRotation();
    SilhouetteSet& set = atlas.silhouettes;
    atlas.axes = turn * atlas.axes;
    for (glm::dvec3& direction : set.directions)
        direction = turn * direction;
    for (SilhouetteFrame& frame : set.frames)
        for (glm::vec3* axis : {&frame.column_axis, &frame.row_axis, &frame.depth_axis})
            *axis = glm::vec3(turn * glm::dvec3(*axis));
    LocalFrame& local = set.local;
    local.center = placement.apply(local.center);
    local.radius *= placement.scale;
    glm::vec3 reach(0.0f);
    for (const glm::uvec3& t : placed_mesh.triangles)
        for (int corner = 0; corner < 3; ++corner)
            reach = glm::max(reach, glm::abs(local.localFrom(placed_mesh.positions[t[corner]])));
    local.half_extent = reach;
    return atlas;
}

fs::path atlasFile(const TriangleMesh& mesh, const AtlasOptions& options, const fs::path& folder)
{
    const auto content = contentHash(mesh, options);
    return folder / fmt::format("{:016x}{:016x}.atlas", content[0], content[1]);
}

CachedAtlas cachedVisibilityAtlas(const TriangleMesh& mesh,
                                  const AtlasOptions& options,
                                  const fs::path& folder,
                                  Progress& progress)
{
    CachedAtlas result;
    const auto content = contentHash(mesh, options);
    const fs::path path = atlasFile(mesh, options, folder);
    std::error_code error;
    if (fs::exists(path, error)) {
        try {
            if (auto atlas = atlasFromBytes(readFile(path), options, content)) {
                result.atlas = std::move(*atlas);
                result.from_file = true;
                return result;
            }
        } catch (const InputError&) {
            // Unreadable is as good as damaged.
        }
        result.findings.push_back({Severity::Info,
                                   "atlas-file-damaged",
                                   fmt::format("{}: damaged or of another version; the object's "
                                               "visibility is computed anew",
                                               path.string())});
    }
    result.atlas = buildVisibilityAtlas(mesh, options, progress);
    try {
        fs::create_directories(folder);
        writeTextFile(path, fileBytes(result.atlas, content));
    } catch (const std::exception& failure) {
        result.findings.push_back({Severity::Info,
                                   "atlas-not-kept",
                                   fmt::format("{}: the object's visibility is not kept for the "
                                               "next run: {}",
                                               folder.string(),
                                               failure.what())});
    }
    return result;
}

float hiddenShare(const VisibilityAtlas& atlas,
                  glm::vec3 x_local,
                  glm::dvec3 unit_direction,
                  float bias_texels)
{
    const DirectedPair cell = atlas.cells().cellAt(unit_direction);
    const HiddenShares shares = hiddenShares(atlas.silhouettes, cell.pair, x_local, bias_texels);
    return cell.side == 0 ? shares.along : shares.against;
}

}  // namespace insitu
