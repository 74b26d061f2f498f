// SPDX-License-Identifier: Apache-2.0

#include "formats/bundle/codec/volume_json.h"

#include <algorithm>
#include <set>

namespace sonocase::detail {
namespace {

constexpr const char* kTissueKinds[] = {"outside", "soft", "fluid", "gas", "bone"};

// Written only where a recipe gave figures: the others come from the table of the program that
// reads, and bundles without them stay as they were, byte for byte.
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
    if (!(m.stiffness_kpa >= kLeastStiffnessKpa && m.stiffness_kpa <= kGreatestStiffnessKpa))
        object.complain("stiffness_kpa", "is out of range", "0.05 to 10000 kPa");
    if (!(m.puncture_n >= 0 && m.puncture_n <= kGreatestPunctureN))
        object.complain("puncture_n", "is out of range", "0 to 100 N");
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
        const double n = size[static_cast<std::size_t>(a)];
        voxels *= n;
        if (n != std::floor(n) || n < 0 || n > 65536) {
            object.complain("size", "is out of range", "whole numbers up to 65536");
            return grid;
        }
        grid.size[a] = static_cast<std::int32_t>(n);
    }
    if (voxels > 4e9) object.complain("size", "is out of range", "at most 4e9 voxels");
    grid.spacing_mm = object.vector("spacing_mm");
    grid.origin_mm = object.point("origin_mm");
    const std::vector<double> m = object.numbers("direction", 9);
    std::copy(m.begin(), m.end(), grid.direction.m.begin());
    if (!object.ok()) return grid;
    if (!(grid.spacing_mm.x > 0 && grid.spacing_mm.y > 0 && grid.spacing_mm.z > 0)) {
        object.complain("spacing_mm", "is not above zero");
    }
    if (orthonormality_error(grid.direction) > 1e-3)
        object.complain("direction", "is not orthonormal");
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
                if (c[i] < 0 || c[i] > 255) item.complain("colour", "is out of range", "0 to 255");
                label.colour[i] = static_cast<std::uint8_t>(std::clamp(c[i], 0.0, 255.0));
            }
        }
        if (!names.insert(label.name).second)
            item.complain("name", "'" + label.name + "' occurs twice");
        labels.push_back(std::move(label));
    }
    if (object.ok() && (labels.empty() || labels.size() > kMaxLabels)) {
        object.complain(key, "is of the wrong size",
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
            item.complain("kind", "'" + kind + "' is not known",
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

}  // namespace sonocase::detail
