// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/fem_block.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/volume/tissue.h"
#include "runtime/imaging/core/simd_target.h"

namespace sonocase::testing {
namespace {

using runtime::press::BeamPoint;
using runtime::press::PressTissue;
using Json = nlohmann::json;

constexpr double kUnderFaceMm = 40, kOffPlaneMm = 10;

struct Nrrd {
    std::vector<int> sizes;
    std::vector<std::uint8_t> bytes;
    Point3 origin;
};

Result<std::string> text_of(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) return Error{"cannot be opened", path, "a file of a block"};
    return std::string(std::istreambuf_iterator<char>(in), {});
}

// gzip-encoded, little endian, one byte or one float a value.
Result<Nrrd> read_nrrd(const std::string& path, std::size_t bytes_per_value) {
    const auto text = text_of(path);
    if (!text) return text.error();
    const std::size_t end = text->find("\n\n");
    if (text->rfind("NRRD", 0) != 0 || end == std::string::npos)
        return Error{"is not NRRD", path, "NRRD with its data attached"};
    Nrrd out;
    std::size_t values = 1;
    std::istringstream header(text->substr(0, end));
    for (std::string line; std::getline(header, line);) {
        if (line.rfind("sizes: ", 0) == 0) {
            std::istringstream numbers(line.substr(7));
            for (int n = 0; numbers >> n;) out.sizes.push_back(n);
        }
        if (line.rfind("space origin: ", 0) == 0)
            std::sscanf(line.c_str() + 14, "(%lf,%lf,%lf)", &out.origin.x, &out.origin.y,
                        &out.origin.z);
    }
    for (const int n : out.sizes) {
        if (n < 1 || n > 4096) return Error{"has an impossible size", path, "1 to 4096"};
        values *= static_cast<std::size_t>(n);
    }
    if (out.sizes.size() < 3 || values > (std::size_t{1} << 28))
        return Error{"has an impossible size", path, "three or four sizes"};
    out.bytes.resize(values * bytes_per_value);
    z_stream z{};
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text->data() + end + 2));
    z.avail_in = static_cast<uInt>(text->size() - end - 2);
    z.next_out = out.bytes.data();
    z.avail_out = static_cast<uInt>(out.bytes.size());
    if (inflateInit2(&z, 15 + 16) != Z_OK) return Error{"cannot be unpacked", path, "gzip"};
    const int status = inflate(&z, Z_FINISH);
    inflateEnd(&z);
    if (status != Z_STREAM_END || z.avail_out != 0)
        return Error{"is cut short", path, std::to_string(out.bytes.size()) + " bytes of data"};
    return out;
}

// Materials have the names of docs/deformation.md; one may also be an object with its own figures.
PressTissue tissue_of(const Json& material, std::string& name) {
    name = material.is_string() ? material.get<std::string>() : material.value("name", "");
    Tissue tissue;
    tissue.name = name == "kidney" ? "kidney_cortex" : name == "fluid" ? "urine" : name;
    if (vessel_of_label(name) != Vessel::unknown) tissue.kind = TissueKind::fluid;
    TissueMechanics m = mechanics_of(tissue, name);
    if (material.is_object()) {
        m.stiffness_kpa = material.value("stiffness_kpa", m.stiffness_kpa);
        m.drains = material.value("drains", m.drains);
        m.rigid = material.value("rigid", m.rigid);
    }
    PressTissue out;
    out.stiffness_kpa = static_cast<float>(m.stiffness_kpa);
    out.drains = m.drains;
    out.rigid = m.rigid;
    out.membrane = name == "skin";
    return out;
}

void find_face(const Json& json, FemBlock& block) {
    if (json.contains("half_face_mm")) {
        block.face.half_width_mm = json["half_face_mm"][0];
        block.face.half_height_mm = json["half_face_mm"][1];
        return;
    }
    double x = 0, y = 0;
    for (const FemState& state : block.states)
        for (int k = 0; k < block.nodes.z; ++k)
            for (int j = 0; j < block.nodes.y; ++j)
                for (int i = 0; i < block.nodes.x; ++i) {
                    const Point3 p{block.origin_mm.x + i * block.spacing_mm.x,
                                   block.origin_mm.y + j * block.spacing_mm.y,
                                   block.origin_mm.z + k * block.spacing_mm.z};
                    const double end = p.z + block.shift(state, i, j, k).z;
                    const bool skin = block.material({p.x, p.y, p.z - 1e-3}) == 0 &&
                                      block.material({p.x, p.y, p.z + 1e-3}) != 0;
                    if (!skin || std::abs(end - state.pressed_mm) > 1e-3) continue;
                    x = std::max(x, std::abs(p.x));
                    y = std::max(y, std::abs(p.y));
                }
    const bool large = x > 20.01 || y > 4.01;
    block.face.half_width_mm = large ? 25 : 20;
    block.face.half_height_mm = large ? 6 : 4;
}

double quad_area(const std::array<Point3, 4>& p) {
    double twice = 0;
    for (std::size_t n = 0; n < 4; ++n) {
        const Point3 &a = p[n], &b = p[(n + 1) % 4];
        twice += a.x * b.z - b.x * a.z;
    }
    return std::abs(twice) / 2;
}

// The area of the elements of a material in the scan plane, over that at rest.
double fem_area(const FemBlock& block, const FemState& state, int material) {
    const int j = block.middle_row();
    double area = 0, rest = 0;
    for (int k = 0; k + 1 < block.nodes.z; ++k)
        for (int i = 0; i + 1 < block.nodes.x; ++i) {
            const auto place = [&](int di, int dk) {
                const Vector3 u = block.shift(state, i + di, j, k + dk);
                return Point3{(i + di) * block.spacing_mm.x + u.x, 0,
                              (k + dk) * block.spacing_mm.z + u.z};
            };
            const Point3 middle{block.origin_mm.x + (i + 0.5) * block.spacing_mm.x, 1e-6,
                                block.origin_mm.z + (k + 0.5) * block.spacing_mm.z};
            if (block.material(middle) != material) continue;
            area += quad_area({place(0, 0), place(1, 0), place(1, 1), place(0, 1)});
            rest += block.spacing_mm.x * block.spacing_mm.z;
        }
    return area / rest;
}

double shown_area(const FemBlock& block,
                  double pressed_mm,
                  const runtime::press::PressField& field,
                  int material) {
    constexpr double kStepMm = 0.2;
    double shown = 0, rest = 0;
    const double half = block.face.half_width_mm;
    for (double x = -half + kStepMm / 2; x < half; x += kStepMm)
        for (double z = kStepMm / 2; z < 55; z += kStepMm) {
            const Point3 p = field.pull_back({x, 0, z});
            shown += block.material({p.x, 1e-6, p.z + pressed_mm}) == material;
            rest += block.material({x, 1e-6, z}) == material;
        }
    return shown / rest;
}

}  // namespace

std::uint8_t FemBlock::material(Point3 rest) const {
    const double y = mirrored ? std::abs(rest.y) : rest.y;
    const int k = static_cast<int>(std::floor((rest.z - origin_mm.z) / spacing_mm.z));
    if (k < 0) return 0;
    if (k > nodes.z - 2) return 250;  // the block stands on something rigid
    const int i = static_cast<int>(std::floor((rest.x - origin_mm.x) / spacing_mm.x));
    const int j = static_cast<int>(std::floor((y - origin_mm.y) / spacing_mm.y));
    const int ci = std::clamp(i, 0, nodes.x - 2), cj = std::clamp(j, 0, nodes.y - 2);
    return materials[static_cast<std::size_t>((k * (nodes.y - 1) + cj) * (nodes.x - 1) + ci)];
}

Vector3 FemBlock::shift(const FemState& state, int i, int j, int k) const {
    const float* u =
        state.shift_mm.data() + 3 * static_cast<std::size_t>((k * nodes.y + j) * nodes.x + i);
    return {u[0], u[1], u[2]};
}

int FemBlock::middle_row() const {
    return std::clamp(static_cast<int>(std::lround(-origin_mm.y / spacing_mm.y)), 0, nodes.y - 1);
}

Result<FemBlock> read_fem_block(const std::string& folder) {
    const auto text = text_of(folder + "/block.json");
    if (!text) return text.error();
    const Json json = Json::parse(*text, nullptr, false);
    if (json.is_discarded() || !json.contains("states") || !json.contains("materials"))
        return Error{"is not a block", folder + "/block.json", "materials, spacing_mm and states"};
    FemBlock block;
    block.tissues.resize(runtime::press::kMaxPressTissues);
    block.tissues[0].outside = true;
    block.tissues[0].stiffness_kpa = 2;
    block.tissues[250] = {1e4f, false, false, true, false};
    for (const auto& [index, material] : json["materials"].items()) {
        std::string name;
        const int at = std::atoi(index.c_str());
        if (at < 1 || at > 254) return Error{"has material " + index, folder, "1 to 254"};
        block.tissues[static_cast<std::size_t>(at)] = tissue_of(material, name);
        if (block.tissues[static_cast<std::size_t>(at)].drains) block.vein = at;
        if (vessel_of_label(name) == Vessel::artery) block.artery = at;
    }
    const Json& spacing = json["spacing_mm"];
    block.spacing_mm = {spacing[0], spacing[1], spacing[2]};
    auto materials = read_nrrd(folder + "/materials.nrrd", 1);
    if (!materials) return materials.error();
    const std::vector<int>& n = materials->sizes;
    block.nodes = {n[0] + 1, n[1] + 1, n[2] + 1};
    block.origin_mm = materials->origin - 0.5 * block.spacing_mm;
    block.mirrored = block.origin_mm.y > -1e-6;
    block.materials = std::move(materials->bytes);
    for (const Json& entry : json["states"]) {
        FemState state{entry["pressed_mm"], entry.value("force_n", 0.0), {}};
        if (!entry.contains("file")) {
            block.states.push_back(std::move(state));
            continue;
        }
        const std::string path = folder + "/" + entry["file"].get<std::string>();
        const auto shifts = read_nrrd(path, 4);
        if (!shifts) return shifts.error();
        if (shifts->sizes != std::vector<int>{3, block.nodes.x, block.nodes.y, block.nodes.z})
            return Error{"does not fit the materials", path, "a displacement per node"};
        state.shift_mm.resize(shifts->bytes.size() / 4);
        std::memcpy(state.shift_mm.data(), shifts->bytes.data(), shifts->bytes.size());
        block.states.push_back(std::move(state));
    }
    find_face(json, block);
    return block;
}

BlockError compare(const FemBlock& block,
                   const FemState& state,
                   runtime::press::PressField& field,
                   const runtime::press::PressOptions& options) {
    const PressedFemBlock pressed{&block, state.pressed_mm};
    (void)field.press(runtime::available_simd_targets().front(),
                      {block.tissues, runtime::press::lookup_of(pressed)}, options);
    BlockError out;
    out.pressed_mm = state.pressed_mm;
    out.fem_force_n = state.force_n;
    out.force_n = field.state().force_n;
    if (state.shift_mm.empty()) return out;
    const auto errors_at = [&](int j, double& moved) {
        std::vector<double> errors;
        for (int k = 0; k < block.nodes.z; ++k)
            for (int i = 0; i < block.nodes.x; ++i) {
                const Point3 rest{block.origin_mm.x + i * block.spacing_mm.x,
                                  block.origin_mm.y + j * block.spacing_mm.y,
                                  block.origin_mm.z + k * block.spacing_mm.z};
                if (std::abs(rest.x) > block.face.half_width_mm + 1e-6 ||
                    rest.z > kUnderFaceMm + 1e-6)
                    continue;
                // Nodes in the air have no displacement; one corner in the body is enough.
                bool body = false;
                for (int n = 0; n < 4; ++n)
                    body |= block.material({rest.x + ((n & 1) ? 1e-3 : -1e-3), rest.y + 1e-3,
                                            rest.z + ((n & 2) ? 1e-3 : -1e-3)}) != 0;
                if (!body) continue;
                const Vector3 u = block.shift(state, i, j, k);
                const Point3 back =
                    field.pull_back({rest.x + u.x, rest.y, rest.z + u.z - state.pressed_mm});
                errors.push_back(std::hypot(back.x - rest.x, back.z + state.pressed_mm - rest.z));
                moved += std::hypot(u.x, u.z);
            }
        return errors;
    };
    const auto mean_of = [](const std::vector<double>& v) {
        double sum = 0;
        for (const double e : v) sum += e;
        return v.empty() ? 0 : sum / static_cast<double>(v.size());
    };
    std::vector<double> errors = errors_at(block.middle_row(), out.moved_mm);
    out.moved_mm /= static_cast<double>(std::max<std::size_t>(errors.size(), 1));
    out.mean_mm = mean_of(errors);
    std::sort(errors.begin(), errors.end());
    if (!errors.empty()) out.p95_mm = errors[errors.size() * 95 / 100];
    const int off = block.middle_row() + static_cast<int>(kOffPlaneMm / block.spacing_mm.y);
    double unused = 0;
    if (off < block.nodes.y) out.off_plane_mean_mm = mean_of(errors_at(off, unused));
    if (block.vein >= 0) {
        out.vein_area = shown_area(block, state.pressed_mm, field, block.vein);
        out.fem_vein_area = fem_area(block, state, block.vein);
    }
    if (block.artery >= 0) {
        out.artery_area = shown_area(block, state.pressed_mm, field, block.artery);
        out.fem_artery_area = fem_area(block, state, block.artery);
    }
    return out;
}

}  // namespace sonocase::testing
