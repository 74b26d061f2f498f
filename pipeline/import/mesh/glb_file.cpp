// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/glb_file.h"

#include <cmath>
#include <cstring>

#ifndef JSON_NOEXCEPTION
#define JSON_NOEXCEPTION
#endif
#include <nlohmann/json.hpp>

#include "pipeline/import/mesh/polygon_file.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;
constexpr std::size_t kTriangles = 4, kStrip = 5, kFan = 6;  // modes of a primitive

std::uint32_t word_at(std::span<const std::uint8_t> bytes, std::size_t at) {
    std::uint32_t word = 0;
    std::memcpy(&word, bytes.data() + at, 4);
    return word;
}

// An affine map, 4 x 4 and column by column as in glTF.
struct Affine {
    std::array<double, 16> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    Point3 operator*(Point3 p) const {
        return {m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12],
                m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13],
                m[2] * p.x + m[6] * p.y + m[10] * p.z + m[14]};
    }
    Affine operator*(const Affine& o) const {
        Affine out;
        for (std::size_t c = 0; c < 4; ++c)
            for (std::size_t r = 0; r < 4; ++r) {
                out.m[4 * c + r] = 0;
                for (std::size_t k = 0; k < 4; ++k)
                    out.m[4 * c + r] += m[4 * k + r] * o.m[4 * c + k];
            }
        return out;
    }
};

class Reader {
  public:
    Reader(const Json& json, std::span<const std::uint8_t> bin, const std::string& where)
        : json_(json), bin_(bin), where_(where) {}

    Result<std::vector<MeshNode>> read(std::vector<std::string>* aside) {
        for (const Json& required : member(json_, "extensionsRequired"))
            if (!is_of_looks(required))
                return Error{"the file needs the extension " +
                                 required.dump(-1, ' ', true, Json::error_handler_t::replace),
                             where_, "export it without compression"};
        const Json& nodes = member(json_, "nodes");
        if (!nodes.is_array()) return fault("it has no nodes");
        std::vector<int> parent(nodes.size(), -1);
        for (std::size_t n = 0; n < nodes.size(); ++n)
            for (const Json& child : member(nodes[n], "children")) {
                const std::size_t c = index(child);
                if (c >= nodes.size() || c == n)
                    return fault("a node has a child that is not there");
                parent[c] = static_cast<int>(n);
            }
        const std::vector<bool> shown = nodes_of_scene(nodes);
        for (std::size_t n = 0; n < nodes.size(); ++n) {
            if (!nodes[n].is_object() || !nodes[n].contains("mesh")) continue;
            Affine to_scene;
            int up = static_cast<int>(n);
            for (std::size_t steps = 0; up >= 0; up = parent[up]) {
                if (++steps > nodes.size()) return fault("its nodes go round in a circle");
                to_scene = transform(nodes[up]) * to_scene;
            }
            MeshNode node;
            node.name = "node_" + std::to_string(n);
            // Some programs name the meshes alone.
            const Json& meshes = member(json_, "meshes");
            const std::size_t mesh = index(nodes[n]["mesh"]);
            if (meshes.is_array() && mesh < meshes.size())
                if (const Json& name = member(meshes[mesh], "name"); is_name(name))
                    node.name = name.get<std::string>();
            if (const Json& name = member(nodes[n], "name"); is_name(name))
                node.name = name.get<std::string>();
            if (!shown[n]) {
                if (aside != nullptr) aside->push_back(node.name);
                continue;
            }
            if (nodes[n].contains("skin"))
                return Error{"'" + node.name + "' is bent by bones (a skin)", where_,
                             "apply the pose to the mesh (Blender: the modifier Armature, Apply) "
                             "and export it again"};
            SONOCASE_TRY_DONE(read_mesh(index(nodes[n]["mesh"]), node.surface));
            if (is_morphed(nodes[n], index(nodes[n]["mesh"])))
                return Error{"'" + node.name + "' is bent by shape keys (weights of targets)",
                             where_, "apply the shape keys to the mesh and export it again"};
            if (node.surface.triangles.empty()) {  // lines or points alone, such as a grid
                if (aside != nullptr) aside->push_back(node.name);
                continue;
            }
            for (Point3& p : node.surface.points) p = to_scene * p;
            nodes_.push_back(std::move(node));
        }
        if (nodes_.empty()) return fault("no node has a mesh");
        return std::move(nodes_);
    }

  private:
    // Without a scene all nodes count; of several, those of the one that the file opens with.
    std::vector<bool> nodes_of_scene(const Json& nodes) const {
        const Json& scenes = member(json_, "scenes");
        const std::size_t scene = index_or(json_, "scene", 0);
        if (!scenes.is_array() || scene >= scenes.size() ||
            !member(scenes[scene], "nodes").is_array())
            return std::vector<bool>(nodes.size(), true);
        std::vector<bool> shown(nodes.size(), false);
        std::vector<std::size_t> open;
        const auto add = [&](const Json& list) {
            for (const Json& node : list)
                if (const std::size_t n = index(node); n < nodes.size() && !shown[n]) {
                    shown[n] = true;
                    open.push_back(n);
                }
        };
        add(member(scenes[scene], "nodes"));
        while (!open.empty()) {
            const std::size_t n = open.back();
            open.pop_back();
            add(member(nodes[n], "children"));
        }
        return shown;
    }

    static bool is_name(const Json& name) {
        return name.is_string() && !name.get_ref<const std::string&>().empty();
    }

    // Extensions that change how a surface looks, and not where it lies.
    static bool is_of_looks(const Json& extension) {
        if (!extension.is_string()) return false;
        const auto name = extension.get<std::string>();
        for (const char* start : {"KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_",
                                  "KHR_xmp", "MSFT_texture_"})
            if (name.starts_with(start)) return true;
        return false;
    }

    bool is_morphed(const Json& node, std::size_t mesh) const {
        const Json& meshes = member(json_, "meshes");
        for (const Json* weights : {&member(node, "weights"), &member(meshes[mesh], "weights")}) {
            if (!weights->is_array()) continue;
            return std::any_of(weights->begin(), weights->end(), [](const Json& weight) {
                return !weight.is_number() || weight.get<double>() != 0;
            });
        }
        return false;
    }

    static const Json& member(const Json& object, const char* key) {
        static const Json none;
        if (!object.is_object()) return none;
        const auto found = object.find(key);
        return found == object.end() ? none : *found;
    }
    static std::size_t index(const Json& value) {
        return value.is_number_unsigned() ? value.get<std::size_t>() : SIZE_MAX;
    }
    static std::size_t index_or(const Json& object, const char* key, std::size_t otherwise) {
        const Json& value = member(object, key);
        return value.is_null() ? otherwise : index(value);
    }
    Error fault(const std::string& what) const { return {what, where_, kExportMeshAgain}; }

    static Affine transform(const Json& node) {
        Affine out;
        const auto numbers = [&](const char* key, std::size_t count) -> std::vector<double> {
            std::vector<double> values;
            const Json& list = member(node, key);
            if (!list.is_array() || list.size() != count) return values;
            for (const Json& v : list) values.push_back(v.is_number() ? v.get<double>() : 0);
            return values;
        };
        if (const auto m = numbers("matrix", 16); !m.empty()) {
            std::copy(m.begin(), m.end(), out.m.begin());
            return out;
        }
        Matrix3 r;
        if (const auto q = numbers("rotation", 4); !q.empty())
            r = rotation_from_quaternion({q[3], q[0], q[1], q[2]});
        auto s = numbers("scale", 3), t = numbers("translation", 3);
        if (s.empty()) s = {1, 1, 1};
        if (t.empty()) t = {0, 0, 0};
        for (int c = 0; c < 3; ++c)
            for (int row = 0; row < 3; ++row) out.m[4 * c + row] = r(row, c) * s[c];
        for (std::size_t a = 0; a < 3; ++a) out.m[12 + a] = t[a];
        return out;
    }

    struct View {
        std::span<const std::uint8_t> bytes;
        std::size_t stride = 0, count = 0;
        int component = 0;
    };
    // components: values per element.
    Result<View> view(std::size_t accessor, std::size_t components, const char* type) const {
        const Json& list = member(json_, "accessors");
        if (!list.is_array() || accessor >= list.size()) return fault("an accessor is not there");
        const Json& a = list[accessor];
        if (a.contains("sparse")) return fault("it has sparse accessors, which are not read");
        if (member(a, "type") != type)
            return fault("an accessor is not of type " + std::string(type));
        View out;
        out.component = static_cast<int>(index_or(a, "componentType", 0));
        out.count = index_or(a, "count", 0);
        const std::size_t size = out.component == 5126 || out.component == 5125 ? 4
                                 : out.component == 5123                        ? 2
                                 : out.component == 5121                        ? 1
                                                                                : 0;
        if (size == 0) return fault("an accessor has components of an unknown type");
        const Json& views = member(json_, "bufferViews");
        const std::size_t v = index_or(a, "bufferView", SIZE_MAX);
        if (!views.is_array() || v >= views.size()) return fault("a buffer view is not there");
        const Json& buffers = member(json_, "buffers");
        if (index_or(views[v], "buffer", 0) != 0 || !buffers.is_array() || buffers.empty() ||
            member(buffers[0], "uri").is_string())
            return fault("its buffers lie in other files");
        const std::size_t start =
            index_or(views[v], "byteOffset", 0) + index_or(a, "byteOffset", 0);
        out.stride = index_or(views[v], "byteStride", size * components);
        const std::size_t element = size * components;
        if (out.count == 0 || out.count > bin_.size() || out.stride > 4096 || start > bin_.size() ||
            out.stride * (out.count - 1) + element > bin_.size() - start)
            return fault("it is cut off: its accessors reach beyond its data");
        out.bytes = bin_.subspan(start);
        return out;
    }

    Status read_mesh(std::size_t mesh, Surface& surface) const {
        const Json& meshes = member(json_, "meshes");
        if (!meshes.is_array() || mesh >= meshes.size()) return fault("a mesh is not there");
        for (const Json& primitive : member(meshes[mesh], "primitives")) {
            const std::size_t mode = index_or(primitive, "mode", kTriangles);
            if (mode < kTriangles) continue;  // points and lines bound nothing
            if (mode > kFan) return fault("a mesh is made of what glTF does not know");
            SONOCASE_TRY(
                auto points,
                view(index_or(member(primitive, "attributes"), "POSITION", SIZE_MAX), 3, "VEC3"));
            if (points.component != 5126) return fault("positions are not 32-bit floats");
            const std::size_t first = surface.points.size();
            for (std::size_t n = 0; n < points.count; ++n) {
                float p[3];
                std::memcpy(p, points.bytes.data() + n * points.stride, sizeof p);
                if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2]))
                    return fault("a position is not a number");
                surface.points.push_back({p[0], p[1], p[2]});
            }
            if (auto status = read_triangles(primitive, first, points.count, surface); !status)
                return status;
        }
        return Done{};
    }

    Status read_triangles(const Json& primitive,
                          std::size_t first,
                          std::size_t points,
                          Surface& surface) const {
        std::vector<std::uint32_t> corners;
        if (primitive.contains("indices")) {
            SONOCASE_TRY(auto list, view(index(primitive["indices"]), 1, "SCALAR"));
            for (std::size_t n = 0; n < list.count; ++n) {
                std::uint32_t corner = 0;
                const std::size_t size = list.component == 5125   ? 4
                                         : list.component == 5123 ? 2
                                                                  : 1;
                std::memcpy(&corner, list.bytes.data() + n * list.stride, size);
                if (corner >= points) return fault("a triangle has a corner that is not there");
                corners.push_back(corner);
            }
        } else {
            for (std::size_t n = 0; n < points; ++n)
                corners.push_back(static_cast<std::uint32_t>(n));
        }
        const auto base = static_cast<std::uint32_t>(first);
        const std::size_t mode = index_or(primitive, "mode", kTriangles);
        const auto add = [&](std::size_t a, std::size_t b, std::size_t c) {
            // A strip turns its corners by triangles without an area.
            const bool flat =
                corners[a] == corners[b] || corners[b] == corners[c] || corners[c] == corners[a];
            if (mode == kTriangles || !flat)
                surface.triangles.push_back(
                    {base + corners[a], base + corners[b], base + corners[c]});
        };
        const std::size_t step = mode == kTriangles ? 3 : 1;
        for (std::size_t n = 0; n + 2 < corners.size(); n += step) {
            if (mode == kFan)
                add(0, n + 1, n + 2);
            else if (mode == kStrip && n % 2 == 1)  // every second one is wound the other way
                add(n + 1, n, n + 2);
            else
                add(n, n + 1, n + 2);
        }
        return Done{};
    }

    const Json& json_;
    std::span<const std::uint8_t> bin_;
    const std::string& where_;
    std::vector<MeshNode> nodes_;
};

}  // namespace

Point3 ras_from_gltf(Point3 p, Axes told) {
    return told == Axes::unsaid ? Point3{-p.x, p.z, p.y} : to_ras(p, told);
}

std::string gltf_axes_sentence(Axes told) {
    if (told != Axes::unsaid) return axes_sentence(Axes::unsaid, told);
    return "a GLB is in metres, y to the head, z to the front, x to the left: turned to RAS+";
}

Result<std::vector<MeshNode>> read_glb(std::span<const std::uint8_t> bytes,
                                       const std::string& where,
                                       std::vector<std::string>* aside) {
    if (bytes.size() < 20 || word_at(bytes, 0) != kMagic)
        return Error{"not a binary glTF file", where, "expected .glb, version 2"};
    if (word_at(bytes, 4) != 2)
        return Error{"glTF version " + std::to_string(word_at(bytes, 4)), where,
                     "expected version 2"};
    if (word_at(bytes, 8) > bytes.size())
        return Error{"the file is cut off: " + std::to_string(bytes.size()) + " of " +
                         std::to_string(word_at(bytes, 8)) + " bytes",
                     where, kExportMeshAgain};
    const std::size_t json_bytes = word_at(bytes, 12);
    if (word_at(bytes, 16) != kJsonChunk || json_bytes > bytes.size() - 20)
        return Error{"its first chunk is not its description", where, kExportMeshAgain};
    const char* text = reinterpret_cast<const char*>(bytes.data() + 20);
    const Json json = Json::parse(text, text + json_bytes, nullptr, false);
    if (json.is_discarded() || !json.is_object())
        return Error{"its description is not JSON", where, kExportMeshAgain};
    std::span<const std::uint8_t> bin;
    const std::size_t next = 20 + json_bytes;
    if (bytes.size() >= next + 8 && word_at(bytes, next + 4) == kBinChunk)
        bin = bytes.subspan(next + 8,
                            std::min<std::size_t>(word_at(bytes, next), bytes.size() - next - 8));
    return Reader(json, bin, where).read(aside);
}

}  // namespace sonocase::pipeline::inline import_mesh
