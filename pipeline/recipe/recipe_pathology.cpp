// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cctype>

#include "pipeline/pathology/requested_parts.h"
#include "pipeline/recipe/recipe_sections.h"

namespace sonocase::pipeline {
namespace {

void read_points(const TomlTable& table, PathologyRequest& request) {
    std::string frame = "ct";
    table.text("frame", frame, {"ct", "mannequin"});
    request.in_mannequin = frame == "mannequin";
    Point3 point;
    if (table.point("centre", point)) request.centre = point;
    if (table.point("near", point)) request.near = point;
    table.number("near_mm", request.near_mm, 1, 500);
    for (const TomlTable& item : table.tables("path")) {
        Point3 at;
        if (!item.point("at", at))
            item.complain("at", "is missing", "expected a point of the path in mm");
        item.finish();
        request.path.push_back(at);
    }
    if (request.path.size() == 1)
        table.complain("path", "has one point", "expected two or more [[pathology.path]]");
}

void read_shape(const TomlTable& table, PathologyRequest& request) {
    table.number("volume_ml", request.volume_ml, 0.001, 5000);
    table.number("diameter_mm", request.diameter_mm, 0.5, 300);
    table.number("elongation", request.elongation, 1, 3);
    table.number("roughness", request.roughness, 0, 0.3);
    std::vector<double> depth;
    if (table.numbers("depth_mm", depth, 0, 500, 2, 2)) {
        request.depth_low_mm = depth[0];
        request.depth_high_mm = depth[1];
        if (depth[0] >= depth[1])
            table.complain("depth_mm", "does not rise", "expected [least, greatest] in mm");
    }
    table.number("capsule_mm", request.capsule_mm, 0, 50);
    table.number("vessel_mm", request.vessel_mm, 0, 50);
    table.number("apart_mm", request.apart_mm, 0, 100);
    table.number("length_mm", request.length_mm, 1, 500);
    table.number("share", request.share, 0.01, 1);
    table.number("reach_mm", request.reach_mm, 1, 100);
    table.number("mass_effect", request.mass_effect, 0, 1);
    table.number("reach", request.reach, 1.2, 5);
    table.whole("seed", request.seed, 0, 2e9);
    table.flag("target", request.target);
}

// A stretch of a vessel needs a length, a path a diameter, everything else a volume.
void check_size(const TomlTable& table,
                const PathologyRequest& request,
                const PathologyKind& kind) {
    if (request.volume_ml > 0 && request.diameter_mm > 0)
        table.complain("volume_ml", "is given beside diameter_mm", "keep one");
    const bool in_vessel = kind.shape == LesionShape::tube && request.path.empty();
    if (in_vessel) return;
    if (kind.shape == LesionShape::tube && !(request.diameter_mm > 0))
        table.complain("diameter_mm", "is missing", "expected the tube's diameter in mm");
    else if (!(request.volume_ml > 0) && !(request.diameter_mm > 0))
        table.complain("volume_ml", "is missing", "expected volume_ml or diameter_mm");
}

void read_parts(const TomlTable& table, PathologyRequest& request, const PathologyKind& kind) {
    for (const LesionPart& part : kind.parts) {
        const bool sheet = part.place == PartPlace::shell || part.place == PartPlace::rim;
        const bool share = part.place == PartPlace::core || part.place == PartPlace::debris;
        double size = part.size;
        const std::string key = part.name + (sheet ? "_mm" : share ? "_share" : "");
        if (table.number(key, size, 0, sheet ? 30 : share ? 0.95 : 20))
            request.parts[part.name] = size;
    }
}

// Figures of its own make a tissue of its own, named as the lesion.
void read_own_tissue(const TomlTable& table,
                     PathologyRequest& request,
                     const PathologyKind& kind,
                     std::vector<Tissue>& tissues) {
    Tissue own = kind.tissue;
    read_figures(table, own);
    const bool same = own.grey_mean == kind.tissue.grey_mean &&
                      own.grey_sd == kind.tissue.grey_sd && own.echo_db == kind.tissue.echo_db &&
                      own.structure_db == kind.tissue.structure_db &&
                      own.attenuation_db_cm_mhz == kind.tissue.attenuation_db_cm_mhz &&
                      own.impedance_mrayl == kind.tissue.impedance_mrayl &&
                      own.sound_speed_m_s == kind.tissue.sound_speed_m_s;
    if (same) return;
    own.name = request.name;
    own.source = "recipe";
    request.tissue = own.name;
    for (const Tissue& tissue : tissues)
        if (tissue.name == own.name)
            table.complain("name", "'" + own.name + "' is a tissue already",
                           "give it another name, as it has figures of its own");
    tissues.push_back(own);
}

bool plain_name(const std::string& name) {
    return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
    });
}

}  // namespace

void read_pathology(const TomlTable& root,
                    std::vector<PathologyRequest>& pathology,
                    std::vector<Tissue>& tissues) {
    for (const TomlTable& table : root.tables("pathology")) {
        PathologyRequest request;
        request.line = table.line("");
        table.text("name", request.name);
        if (!plain_name(request.name))
            table.complain("name", "is missing or not plain",
                           "expected letters, digits, _ or -, as in \"metastasis_1\"");
        for (const PathologyRequest& other : pathology)
            if (other.name == request.name)
                table.complain("name", "'" + request.name + "' is given twice", "");
        if (!table.text("kind", request.kind, pathology_kind_names()) && !table.has("kind"))
            table.complain("kind", "is missing", "expected a kind of docs/pathology.md");
        table.texts("host", request.host, true);
        if (request.host.empty() && !table.has("host"))
            table.complain("host", "is missing", "expected the label that it lies in");
        table.texts("into", request.into, true);
        table.texts("beside", request.beside, true);
        read_points(table, request);
        read_shape(table, request);
        if (const PathologyKind* kind = find_pathology_kind(request.kind)) {
            check_size(table, request, *kind);
            read_parts(table, request, *kind);
            read_own_tissue(table, request, *kind, tissues);
        }
        table.finish();
        pathology.push_back(std::move(request));
    }
    for (const Tissue& tissue : pathology_tissues(pathology)) tissues.push_back(tissue);
}

}  // namespace sonocase::pipeline
