#include "reconstruct/scene_file.h"

#include "core/io/model_io.h"
#include "reconstruct/primitive_json.h"
#include "reconstruct/scene_keys.h"
#include "reconstruct/scene_names.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <set>

namespace insitu {

namespace {

constexpr std::string_view kFormat = "insitu-scene";
constexpr int kVersion = 1;
constexpr std::size_t kMaxPrimitives = 1000;
constexpr std::size_t kMaxConstraints = 100'000;
constexpr std::size_t kMaxModelVertices = 20'000;

double radians(double degrees)
{
    return degrees * std::numbers::pi / 180.0;
}

std::filesystem::path fileNamed(const JsonNode& node, const std::filesystem::path& folder)
{
    const std::filesystem::path path = (folder / node.text()).lexically_normal();
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error))
        node.fail(fmt::format("no file \"{}\" (looked for {})", node.text(), path.string()));
    return path;
}

SceneNumber readNumber(const JsonNode& node, const PrimitiveParameter& parameter)
{
    SceneNumber number;
    if (!node.value().is_object()) {
        number.value = readParameterValue(node, parameter);
        return number;
    }
    node.expectKeys(keys::kSceneNumber);
    number.value = readParameterValue(node.at("value"), parameter);
    if (const auto fixed = node.find("fixed")) number.fixed = fixed->boolean();
    if (const auto sigma = node.find("sigma")) number.sigma = sigma->positive();
    if (number.fixed && number.sigma)
        node.fail("is fixed and has a sigma; it is either held or known so well");
    return number;
}

/// Reads the file's primitives one by one; references wait until all names are known.
class SceneReader {
public:
    SceneReader(const JsonNode& root, std::filesystem::path folder)
        : root_(root), folder_(std::move(folder))
    {
    }

    SceneFile read()
    {
        root_.expectKeys(keys::kScene);
        if (root_.at("format").text() != kFormat)
            root_.at("format").fail(fmt::format("must be \"{}\"", kFormat));
        if (root_.at("version").integer() != kVersion)
            root_.at("version").fail(fmt::format("this program reads version {}", kVersion));
        readLibraries();
        const JsonNode list = root_.at("primitives");
        if (list.size() == 0) list.fail("is empty; name at least one primitive");
        if (list.size() > kMaxPrimitives)
            list.fail(fmt::format("at most {} primitives are solved", kMaxPrimitives));
        for (std::size_t i = 0; i < list.size(); ++i)
            readForm(list.at(i));
        names_.check(list);
        for (std::size_t i = 0; i < list.size(); ++i)
            readHierarchy(list.at(i), names_.primitives()[i]);

        SceneFile scene;
        sort(list, scene);
        if (const auto problem = sceneProblem(scene.graph))
            list.at(file_index_[problem->primitive]).fail(problem->cause);
        if (const auto constraints = root_.find("constraints"))
            readConstraints(*constraints, scene);
        if (const auto room = root_.find("room")) {
            (void)room->size();
            scene.room_items = room->value().dump();
        }
        return scene;
    }

private:
    void readLibraries()
    {
        library_ = builtinPrimitives();
        const auto node = root_.find("library");
        if (!node) return;
        const bool list = node->value().is_array();
        for (std::size_t i = 0; i < (list ? node->size() : 1); ++i) {
            const std::filesystem::path path = fileNamed(list ? node->at(i) : *node, folder_);
            PrimitiveLibrary added;
            addPrimitives(added, path);
            for (auto& [name, shape] : added) {
                library_of_[name] = path;
                library_.insert_or_assign(name, std::move(shape));
            }
        }
    }

    /// Name, shape, numbers and place.
    void readForm(const JsonNode& node)
    {
        node.expectKeys(keys::kScenePrimitive);
        ScenePrimitive primitive;
        ShapeSource source;
        primitive.name = node.at("name").text();
        if (node.has("shape") == node.has("model")) node.fail("give either a shape or a model");
        if (node.has("shape")) {
            primitive.shape = findShape(library_, node.at("shape"));
            const auto from = library_of_.find(primitive.shape.name);
            if (from != library_of_.end()) source.library = from->second;
        } else {
            source.model = fileNamed(node.at("model"), folder_);
            const Model model = readModel(source.model);
            if (model.mesh.positions.size() > kMaxModelVertices)
                node.at("model").fail(
                    fmt::format("has {} vertices; at most {} are solved: put it into the room "
                                "as a mesh",
                                model.mesh.positions.size(),
                                kMaxModelVertices));
            primitive.shape = shapeFromMesh(model.mesh, primitive.name);
        }
        for (const PrimitiveParameter& parameter : primitive.shape.parameters)
            primitive.parameters.push_back({parameter.initial, false, {}});
        if (const auto parameters = node.find("parameters"))
            for (const auto& [index, value] : namedParameters(*parameters, primitive.shape))
                primitive.parameters[index] = readNumber(value, primitive.shape.parameters[index]);
        if (const auto value = node.find("position_m")) primitive.position_m = value->vec3();
        if (const auto value = node.find("rotation_y_deg"))
            primitive.rotation_y_rad = radians(value->number());
        primitive.solid = node.has("solid") ? node.at("solid").boolean() : primitive.shape.solid;
        readFixed(node, primitive);
        names_.add(std::move(primitive));
        sources_.push_back(std::move(source));
    }

    static void readFixed(const JsonNode& node, ScenePrimitive& primitive)
    {
        const auto fixed = node.find("fixed");
        if (!fixed) return;
        std::vector<std::string> known{"position", "rotation"};
        for (const PrimitiveParameter& parameter : primitive.shape.parameters)
            known.push_back(parameter.name);
        for (std::size_t i = 0; i < fixed->size(); ++i) {
            const std::size_t which =
                indexOfName(fixed->at(i), fixed->at(i).text(), known, "number");
            if (which == 0) primitive.position_fixed = true;
            if (which == 1) primitive.rotation_fixed = true;
            if (which > 1) primitive.parameters[which - 2].fixed = true;
        }
    }

    /// What the primitive stands on, leans against, is beside of, flush and aligned with.
    void readHierarchy(const JsonNode& node, ScenePrimitive& primitive)
    {
        primitive.height = SceneHeight::Fixed;
        const double given_height = primitive.position_m.y;
        primitive.position_m.y = 0.0;
        if (const auto stands = node.find("stands_on")) {
            if (stands->value().is_object()) {
                stands->expectKeys(keys::kStandsOn);
                if (stands->has("face") == stands->has("height_m"))
                    stands->fail("give either the face or the height_m that it stands at");
                if (const auto gap = stands->find("gap_m")) primitive.support_gap_m = gap->number();
                if (const auto height = stands->find("height_m"))
                    primitive.position_m.y = height->number() + primitive.support_gap_m;
                else
                    setSupport(stands->at("face"), primitive);
            } else if (stands->text() == "nothing") {
                primitive.height = SceneHeight::Free;
                primitive.position_m.y = given_height;
            } else if (stands->text() != "ground") {
                setSupport(*stands, primitive);
            }
        }
        readContacts(node, "against", "back", false, primitive);
        readContacts(node, "beside", "", false, primitive);
        readContacts(node, "flush", "front", true, primitive);
        if (const auto aligned = node.find("aligned_with")) {
            const bool object = aligned->value().is_object();
            if (object) aligned->expectKeys(keys::kAlignedWith);
            SceneAlignment alignment;
            alignment.target = names_.primitive(object ? aligned->at("primitive") : *aligned);
            if (object && aligned->has("turn_deg"))
                alignment.turn_rad = radians(aligned->at("turn_deg").number());
            primitive.aligned = alignment;
        }
    }

    void setSupport(const JsonNode& node, ScenePrimitive& primitive)
    {
        const SceneNames::Part face = names_.face(node);
        primitive.height = SceneHeight::OnFace;
        primitive.support = face.primitive;
        primitive.support_face = face.part;
    }

    /// One contact or a list; without a `face` of its own the default one, and beside others the
    /// opposite of the target's.
    void readContacts(const JsonNode& node,
                      const char* key,
                      const std::string& own_face,
                      bool flush,
                      ScenePrimitive& primitive)
    {
        const auto found = node.find(key);
        if (!found) return;
        const bool list = found->value().is_array();
        for (std::size_t i = 0; i < (list ? found->size() : 1); ++i) {
            const JsonNode item = list ? found->at(i) : *found;
            const bool object = item.value().is_object();
            if (object) item.expectKeys(keys::kContact);
            const JsonNode target = object ? item.at("target") : item;
            const SceneNames::Part part = names_.face(target);
            SceneContact contact;
            contact.target = part.primitive;
            contact.target_face = part.part;
            contact.flush = flush;
            if (object && item.has("gap_m")) contact.gap_m = item.at("gap_m").number();
            std::string own = own_face.empty() ? oppositeOf(target, part) : own_face;
            if (object && item.has("face")) own = item.at("face").text();
            std::vector<std::string> faces;
            for (const PrimitiveFace& face : primitive.shape.faces)
                faces.push_back(face.name);
            contact.face = indexOfName(item, own, faces, "face of its own");
            primitive.contacts.push_back(contact);
        }
    }

    std::string oppositeOf(const JsonNode& node, const SceneNames::Part& part) const
    {
        const std::string& name = names_.primitives()[part.primitive].shape.faces[part.part].name;
        static const std::map<std::string, std::string> opposites = {
            {"left", "right"}, {"right", "left"}, {"front", "back"}, {"back", "front"}};
        const auto found = opposites.find(name);
        if (found == opposites.end())
            node.fail(
                fmt::format("face \"{}\" has no opposite by name; give the own face: "
                            "{{\"face\", \"target\"}}",
                            name));
        return found->second;
    }

    /// Targets first; otherwise in the file's order.
    void sort(const JsonNode& list, SceneFile& scene)
    {
        std::vector<std::size_t> place(names_.primitives().size(), kOpen);
        for (std::size_t i = 0; i < place.size(); ++i)
            visit(list, i, place, scene);
        for (ScenePrimitive& primitive : scene.graph.primitives) {
            primitive.support = place[primitive.support];
            for (SceneContact& contact : primitive.contacts)
                contact.target = place[contact.target];
            if (primitive.aligned) primitive.aligned->target = place[primitive.aligned->target];
        }
        names_.reorder(scene.graph.primitives);
    }

    void visit(const JsonNode& list,
               std::size_t index,
               std::vector<std::size_t>& place,
               SceneFile& scene)
    {
        if (place[index] == kVisiting)
            list.at(index).fail("stands on, or leans against, itself by way of others");
        if (place[index] != kOpen) return;
        place[index] = kVisiting;
        const ScenePrimitive& primitive = names_.primitives()[index];
        if (primitive.height == SceneHeight::OnFace) visit(list, primitive.support, place, scene);
        for (const SceneContact& contact : primitive.contacts)
            visit(list, contact.target, place, scene);
        if (primitive.aligned) visit(list, primitive.aligned->target, place, scene);
        place[index] = scene.graph.primitives.size();
        scene.graph.primitives.push_back(primitive);
        scene.sources.push_back(sources_[index]);
        file_index_.push_back(index);
    }

    void readConstraints(const JsonNode& list, SceneFile& scene)
    {
        if (list.size() > kMaxConstraints)
            list.fail(fmt::format("at most {} constraints are solved", kMaxConstraints));
        for (std::size_t i = 0; i < list.size(); ++i)
            names_.readConstraint(list.at(i), scene.graph);
    }

    static constexpr std::size_t kOpen = static_cast<std::size_t>(-1);
    static constexpr std::size_t kVisiting = static_cast<std::size_t>(-2);
    const JsonNode& root_;
    std::filesystem::path folder_;
    PrimitiveLibrary library_;
    std::map<std::string, std::filesystem::path> library_of_;
    SceneNames names_;
    std::vector<ShapeSource> sources_;
    std::vector<std::size_t> file_index_;  ///< of each of the graph's primitives
};

}  // namespace

SceneFile readScene(const std::filesystem::path& path)
{
    const Json json = readJson(path);
    const JsonNode root(json, path.string());
    return SceneReader(root, std::filesystem::absolute(path).parent_path()).read();
}

}  // namespace insitu
