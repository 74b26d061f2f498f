// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/bundle_parts.h"

namespace sonocase::detail {
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
    const auto bytes = reader.read("manifest", kMaxManifestBytes);
    if (!bytes) return bytes.error();
    Json manifest;
    JsonFault fault{reader.where() + ": manifest", {}};
    if (!parse_json({reinterpret_cast<const char*>(bytes->data()), bytes->size()}, manifest,
                    fault)) {
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
        if (!is_power_of_two(texture.edge)) item.complain("edge", "is not a power of two");
        texture.voxel_mm = item.number("voxel_mm");
        if (!(texture.voxel_mm > 0)) item.complain("voxel_mm", "is not above zero");
        const auto edge = static_cast<std::size_t>(texture.edge);
        total += edge * edge * edge;
        textures.push_back(std::move(texture));
    }
    if (!manifest.ok() || textures.empty()) return textures;
    auto bytes = reader.read_array<std::uint8_t>("textures", total);
    if (!bytes) return bytes.error();
    std::size_t from = 0;
    for (SolidTexture& texture : textures) {
        const auto edge = static_cast<std::size_t>(texture.edge);
        const auto first = bytes->begin() + static_cast<std::ptrdiff_t>(from);
        texture.voxels.assign(first, first + static_cast<std::ptrdiff_t>(edge * edge * edge));
        from += edge * edge * edge;
    }
    return textures;
}

Result<SpeckleVolume> read_speckle(const ChunkReader& reader, JsonObject& manifest) {
    SpeckleVolume speckle;
    speckle.edge = static_cast<int>(manifest.integer_or("speckle_edge", 0, 0, 512));
    if (speckle.edge == 0) return speckle;
    if (!is_power_of_two(speckle.edge)) manifest.complain("speckle_edge", "is not a power of two");
    const auto edge = static_cast<std::size_t>(speckle.edge);
    auto voxels = reader.read_array<std::int8_t>("speckle", 2 * edge * edge * edge);
    if (!voxels) return voxels.error();
    speckle.voxels = std::move(*voxels);
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
    const auto bytes = reader.read(type, kMaxSurfaceItems * 24);
    if (!bytes) return bytes.error();
    std::array<std::uint64_t, 3> counts{};
    if (bytes->size() < sizeof(counts)) return reader.fault("surface '" + type + "' has no counts");
    std::memcpy(counts.data(), bytes->data(), sizeof(counts));
    const auto [points, normals, triangles] = counts;
    const bool plausible = points <= kMaxSurfaceItems && triangles <= kMaxSurfaceItems &&
                           (normals == 0 || normals == points);
    if (!plausible || bytes->size() != 24 + 24 * points + 24 * normals + 12 * triangles) {
        return reader.fault("surface '" + type +
                            "' does not have the size that its counts call for");
    }
    surface.points.resize(points);
    surface.normals.resize(normals);
    surface.triangles.resize(triangles);
    const std::uint8_t* from = bytes->data() + 24;
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
