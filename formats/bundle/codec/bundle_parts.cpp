// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/bundle_parts.h"

#include <algorithm>
#include <set>

namespace sonocase::detail {
namespace {

constexpr const char* kTissueKinds[] = {"outside", "soft", "fluid", "gas", "bone"};

// Written only where a recipe gave figures. Other tissues take theirs from the table of the program
// that reads, and their bundles keep their bytes.
Json json_of(const TissueMechanics& m) {
    Json out = Json::object();
    out["stiffness_kpa"] = m.stiffness_kpa;
    out["drains"] = m.drains;
    out["puncture_n"] = m.puncture_n;
    out["rigid"] = m.rigid;
    return out;
}

TissueMechanics mechanics_from(JsonObject object) {
    TissueMechanics m;
    m.stiffness_kpa = object.number("stiffness_kpa");
    m.drains = object.flag_or("drains", false);
    m.puncture_n = object.number_or("puncture_n", m.puncture_n);
    m.rigid = object.flag_or("rigid", false);
    if (!(m.stiffness_kpa >= kMinStiffnessKpa && m.stiffness_kpa <= kMaxStiffnessKpa))
        object.add_fault("stiffness_kpa", "is out of range", "0.05 to 10000 kPa");
    if (!(m.puncture_n >= 0 && m.puncture_n <= kMaxPunctureN))
        object.add_fault("puncture_n", "is out of range", "0 to 100 N");
    return m;
}

}  // namespace

Json json_of(const Grid& grid) {
    Json out = Json::object();
    out["size"] = Json::array({grid.size.x, grid.size.y, grid.size.z});
    out["spacing_mm"] = json_of(grid.spacing_mm);
    out["origin_mm"] = json_of(grid.origin_mm);
    out["direction"] = grid.direction.m;
    return out;
}

Grid grid_from(JsonObject object) {
    Grid grid;
    const std::vector<double> size = object.numbers("size", 3);
    double voxels = 1;
    for (int a = 0; a < 3; ++a) {
        const double n = size[a];
        voxels *= n;
        if (n != std::floor(n) || n < 0 || n > 65536) {
            object.add_fault("size", "is out of range", "whole numbers up to 65536");
            return grid;
        }
        grid.size[a] = static_cast<std::int32_t>(n);
    }
    if (voxels > 4e9) object.add_fault("size", "is out of range", "at most 4e9 voxels");
    grid.spacing_mm = object.vector("spacing_mm");
    grid.origin_mm = object.point("origin_mm");
    const std::vector<double> m = object.numbers("direction", 9);
    std::copy(m.begin(), m.end(), grid.direction.m.begin());
    if (!object.ok()) return grid;
    if (!(grid.spacing_mm.x > 0 && grid.spacing_mm.y > 0 && grid.spacing_mm.z > 0)) {
        object.add_fault("spacing_mm", "is not above zero");
    }
    if (orthonormality_error(grid.direction) > 1e-3)
        object.add_fault("direction", "is not orthonormal");
    return grid;
}

Json json_of(const std::vector<Label>& labels) {
    Json out = Json::array();
    for (const Label& label : labels) {
        Json item = Json::object();
        item["name"] = label.name;
        item["tissue"] = label.tissue;
        item["source_value"] = label.source_value;
        item["colour"] = label.colour;
        out.push_back(std::move(item));
    }
    return out;
}

std::vector<Label> labels_from(JsonObject& object, const char* key) {
    std::vector<Label> labels;
    std::set<std::string> names;
    for (JsonObject& item : object.objects(key)) {
        Label label;
        label.name = item.text("name");
        label.tissue = item.text_or("tissue", "");
        label.source_value =
            static_cast<int>(item.integer_or("source_value", 0, INT32_MIN, INT32_MAX));
        if (item.has("colour")) {
            const std::vector<double> c = item.numbers("colour", 3);
            for (std::size_t i = 0; i < 3; ++i) {
                if (c[i] < 0 || c[i] > 255) item.add_fault("colour", "is out of range", "0 to 255");
                label.colour[i] = static_cast<std::uint8_t>(std::clamp(c[i], 0.0, 255.0));
            }
        }
        if (!names.insert(label.name).second)
            item.add_fault("name", "'" + label.name + "' occurs twice");
        labels.push_back(std::move(label));
    }
    if (object.ok() && (labels.empty() || labels.size() > kMaxLabels)) {
        object.add_fault(key, "is of the wrong size",
                         "1 to " + std::to_string(kMaxLabels) + " labels");
    }
    return labels;
}

Json json_of(const std::vector<Tissue>& tissues) {
    Json out = Json::array();
    for (const Tissue& t : tissues) {
        Json item = Json::object();
        item["name"] = t.name;
        item["kind"] = kTissueKinds[static_cast<std::size_t>(t.kind)];
        item["casts_shadow"] = t.casts_shadow;
        item["texture"] = t.texture;
        item["grey_mean"] = t.grey_mean;
        item["grey_sd"] = t.grey_sd;
        item["echo_db"] = t.echo_db;
        item["structure_db"] = t.structure_db;
        item["attenuation_db_cm_mhz"] = t.attenuation_db_cm_mhz;
        item["impedance_mrayl"] = t.impedance_mrayl;
        item["sound_speed_m_s"] = t.sound_speed_m_s;
        item["source"] = t.source;
        if (t.mechanics) item["mechanics"] = json_of(*t.mechanics);
        out.push_back(std::move(item));
    }
    return out;
}

std::vector<Tissue> tissues_from(JsonObject& object, const char* key) {
    std::vector<Tissue> tissues;
    if (!object.has(key)) return tissues;
    for (JsonObject& item : object.objects(key)) {
        Tissue t;
        t.name = item.text("name");
        const std::string kind = item.text("kind");
        const auto found = std::find(std::begin(kTissueKinds), std::end(kTissueKinds), kind);
        if (found == std::end(kTissueKinds)) {
            item.add_fault("kind", "'" + kind + "' is not known",
                           "outside, soft, fluid, gas or bone");
            return tissues;
        }
        t.kind = static_cast<TissueKind>(found - std::begin(kTissueKinds));
        t.casts_shadow = item.flag_or("casts_shadow", false);
        t.texture = item.text_or("texture", "");
        t.grey_mean = item.number_or("grey_mean", 0);
        t.grey_sd = item.number_or("grey_sd", 0);
        t.echo_db = item.number_or("echo_db", 0);
        t.structure_db = item.number_or("structure_db", 0);
        t.attenuation_db_cm_mhz = item.number_or("attenuation_db_cm_mhz", 0);
        t.impedance_mrayl = item.number_or("impedance_mrayl", t.impedance_mrayl);
        t.sound_speed_m_s = item.number_or("sound_speed_m_s", t.sound_speed_m_s);
        t.source = item.text_or("source", "");
        if (item.has("mechanics")) t.mechanics = mechanics_from(item.object("mechanics"));
        tissues.push_back(std::move(t));
    }
    return tissues;
}

namespace {

template <class T>
void append_items(std::vector<std::uint8_t>& out, const std::vector<T>& items) {
    static_assert(std::is_trivially_copyable_v<T>);
    const auto* from = reinterpret_cast<const std::uint8_t*>(items.data());
    out.insert(out.end(), from, from + items.size() * sizeof(T));
}

bool is_power_of_two(std::int64_t n) {
    return n > 0 && (n & (n - 1)) == 0;
}

}  // namespace

void add_manifest(ChunkWriter& writer, const Json& manifest) {
    const std::string text = json_text(manifest, false);
    writer.add("manifest", true, std::vector<std::uint8_t>(text.begin(), text.end()));
}

Result<Json> read_manifest(const ChunkReader& reader) {
    SONOCASE_TRY(const auto bytes, reader.read("manifest", kMaxManifestBytes));
    Json manifest;
    JsonFault fault{reader.where() + ": manifest", {}};
    if (!parse_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, manifest, fault)) {
        return *fault.error;
    }
    return manifest;
}

Json json_of_textures(const std::vector<SolidTexture>& textures) {
    Json out = Json::array();
    for (const SolidTexture& texture : textures) {
        Json item = Json::object();
        item["name"] = texture.name;
        item["edge"] = texture.edge;
        item["voxel_mm"] = texture.voxel_mm;
        out.push_back(std::move(item));
    }
    return out;
}

void add_textures(ChunkWriter& writer, const std::vector<SolidTexture>& textures) {
    std::vector<std::uint8_t> bytes;
    for (const SolidTexture& texture : textures) append_items(bytes, texture.voxels);
    writer.add("textures", false, std::move(bytes));
}

Result<std::vector<SolidTexture>> read_textures(const ChunkReader& reader, JsonObject& manifest) {
    std::vector<SolidTexture> textures;
    if (!manifest.has("textures")) return textures;
    std::size_t total = 0;
    for (JsonObject& item : manifest.objects("textures")) {
        SolidTexture texture;
        texture.name = item.text("name");
        texture.edge = static_cast<int>(item.integer("edge", 8, 128));
        if (!is_power_of_two(texture.edge)) item.add_fault("edge", "is not a power of two");
        texture.voxel_mm = item.number("voxel_mm");
        if (!(texture.voxel_mm > 0)) item.add_fault("voxel_mm", "is not above zero");
        const auto edge = static_cast<std::size_t>(texture.edge);
        total += edge * edge * edge;
        textures.push_back(std::move(texture));
    }
    if (!manifest.ok() || textures.empty()) return textures;
    SONOCASE_TRY(auto bytes, reader.read_array<std::uint8_t>("textures", total));
    std::size_t from = 0;
    for (SolidTexture& texture : textures) {
        const auto edge = static_cast<std::size_t>(texture.edge);
        const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(from);
        texture.voxels.assign(first, first + static_cast<std::ptrdiff_t>(edge * edge * edge));
        from += edge * edge * edge;
    }
    return textures;
}

Result<SpeckleVolume> read_speckle(const ChunkReader& reader, JsonObject& manifest) {
    SpeckleVolume speckle;
    speckle.edge = static_cast<int>(manifest.integer_or("speckle_edge", 0, 0, 512));
    if (speckle.edge == 0) return speckle;
    if (!is_power_of_two(speckle.edge)) manifest.add_fault("speckle_edge", "is not a power of two");
    const auto edge = static_cast<std::size_t>(speckle.edge);
    SONOCASE_TRY(auto voxels, reader.read_array<std::int8_t>("speckle", 2 * edge * edge * edge));
    speckle.voxels = std::move(voxels);
    return speckle;
}

void add_surface(ChunkWriter& writer, const std::string& type, const Surface& surface) {
    std::vector<std::uint8_t> bytes;
    const std::vector<std::uint64_t> counts{surface.points.size(), surface.normals.size(),
                                            surface.triangles.size()};
    append_items(bytes, counts);
    append_items(bytes, surface.points);
    append_items(bytes, surface.normals);
    append_items(bytes, surface.triangles);
    writer.add(type, false, std::move(bytes));
}

Result<Surface> read_surface(const ChunkReader& reader, const std::string& type) {
    static_assert(sizeof(Point3) == 24 && sizeof(Vector3) == 24);
    Surface surface;
    if (!reader.has(type)) return surface;
    SONOCASE_TRY(const auto bytes, reader.read(type, kMaxSurfaceItems * 24));
    std::array<std::uint64_t, 3> counts{};
    if (bytes.size() < sizeof(counts)) return reader.fault("surface '" + type + "' has no counts");
    std::memcpy(counts.data(), bytes.data(), sizeof(counts));
    const auto [points, normals, triangles] = counts;
    const bool plausible = points <= kMaxSurfaceItems && triangles <= kMaxSurfaceItems &&
                           (normals == 0 || normals == points);
    if (!plausible || bytes.size() != 24 + 24 * points + 24 * normals + 12 * triangles) {
        return reader.fault("surface '" + type +
                            "' does not have the size that its counts call for");
    }
    surface.points.resize(points);
    surface.normals.resize(normals);
    surface.triangles.resize(triangles);
    const std::uint8_t* from = bytes.data() + 24;
    const auto take = [&](auto& items) {
        const std::size_t n = items.size() * sizeof(items[0]);
        if (n != 0) std::memcpy(items.data(), from, n);
        from += n;
    };
    take(surface.points);
    take(surface.normals);
    take(surface.triangles);
    bool good = true;
    for (const Point3& p : surface.points) {
        good &= std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
    }
    for (const Vector3& n : surface.normals) {
        good &= std::isfinite(n.x) && std::isfinite(n.y) && std::isfinite(n.z);
    }
    for (const auto& t : surface.triangles) good &= t[0] < points && t[1] < points && t[2] < points;
    if (!good) {
        return reader.fault(
            "surface '" + type +
            "' has a triangle whose points do not exist, or a point that is not finite");
    }
    return surface;
}

}  // namespace sonocase::detail
