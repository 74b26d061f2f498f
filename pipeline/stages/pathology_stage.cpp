// SPDX-License-Identifier: Apache-2.0

// pathology: paints lesions and the like into the cooked labels as [[pathology]] asks. A case has
// this stage where its recipe has such a section.
#include <algorithm>
#include <cctype>

#include "formats/text/toml_reader.h"
#include "pipeline/pathology/carry_into_region.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

const std::vector<PathologyRequest>& requests_of(const Recipe& recipe) {
    return recipe.settings.of<PathologyOptions>().requests;
}

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
            item.add_fault("at", "is missing", "expected a point of the path in mm");
        item.finish();
        request.path.push_back(at);
    }
    if (request.path.size() == 1)
        table.add_fault("path", "has one point", "expected two or more [[pathology.path]]");
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
            table.add_fault("depth_mm", "does not rise", "expected [least, greatest] in mm");
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
        table.add_fault("volume_ml", "is given beside diameter_mm", "keep one");
    const bool in_vessel = kind.shape == LesionShape::tube && request.path.empty();
    if (in_vessel) return;
    if (kind.shape == LesionShape::tube && !(request.diameter_mm > 0))
        table.add_fault("diameter_mm", "is missing", "expected the tube's diameter in mm");
    else if (!(request.volume_ml > 0) && !(request.diameter_mm > 0))
        table.add_fault("volume_ml", "is missing", "expected volume_ml or diameter_mm");
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

// A lesion whose table gives figures has a tissue of its own, named as the lesion.
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
            table.add_fault("name", "'" + own.name + "' is a tissue already",
                            "give it another name, as it has figures of its own");
    tissues.push_back(own);
}

bool plain_name(const std::string& name) {
    return !name.empty() && std::all_of(name.begin(), name.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-';
    });
}

// Reads [[pathology]], and adds the tissues of its kinds, and those that it changes, to the
// recipe's.
void read_sections(const TomlTable& root, Recipe& recipe) {
    std::vector<PathologyRequest>& pathology = recipe.settings.of<PathologyOptions>().requests;
    std::vector<Tissue>& tissues = recipe.tissues;
    for (const TomlTable& table : root.tables("pathology")) {
        PathologyRequest request;
        request.line = table.line("");
        table.text("name", request.name);
        if (!plain_name(request.name))
            table.add_fault("name", "is missing or not plain",
                            "expected letters, digits, _ or -, as in \"metastasis_1\"");
        for (const PathologyRequest& other : pathology)
            if (other.name == request.name)
                table.add_fault("name", "'" + request.name + "' is given twice", "");
        if (!table.text("kind", request.kind, pathology_kind_names()) && !table.has("kind"))
            table.add_fault("kind", "is missing", "expected a kind of docs/pathology.md");
        table.texts("host", request.host, true);
        if (request.host.empty() && !table.has("host"))
            table.add_fault("host", "is missing", "expected the label that it lies in");
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

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const Recipe& recipe = inputs.recipe();
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    SONOCASE_TRY(const auto registration, inputs.get(kRegistration));
    std::vector<Label> palette = labels->volume.labels;
    SONOCASE_TRY_DONE(assign_tissues(recipe, palette));
    const Box3& box = registration->ct_box;
    SONOCASE_TRY(auto result,
                 place_pathology({labels->volume, labels->boundary, palette, recipe.tissues,
                                  requests_of(recipe), recipe.path,
                                  [&](Point3 ct) { return mannequin_from_ct(*registration, ct); },
                                  box.empty() ? Point3{} : box.centre()},
                                 progress));
    std::optional<FineRegion> region = labels->region;
    if (region) {
        const double reach_vx = recipe.settings.of<ResampleOptions>().record_band_vx;
        carry_into_region({labels->volume, labels->boundary}, {result.volume, result.boundary},
                          reach_vx, &*region);
    }
    return label_value(labels->frame, std::move(result), std::move(region));
}

std::string request_text(const PathologyRequest& r) {
    std::string text = r.name + "|" + r.kind + "|" + r.tissue;
    for (const auto* list : {&r.host, &r.into, &r.beside})
        for (const std::string& name : *list) text += "|" + name;
    for (const auto& [part, size] : r.parts) text += key_text("|" + part, {size});
    std::vector<double> values{r.volume_ml,
                               r.diameter_mm,
                               r.elongation,
                               r.roughness,
                               r.depth_low_mm,
                               r.depth_high_mm,
                               r.capsule_mm,
                               r.vessel_mm,
                               r.apart_mm,
                               r.near_mm,
                               r.length_mm,
                               r.share,
                               r.reach_mm,
                               r.mass_effect,
                               r.reach,
                               static_cast<double>(r.seed),
                               r.in_mannequin ? 1.0 : 0.0};
    const auto add = [&](Point3 p) { values.insert(values.end(), {p.x, p.y, p.z}); };
    values.push_back(r.centre ? 1 : 0);
    if (r.centre) add(*r.centre);
    values.push_back(r.near ? 1 : 0);
    if (r.near) add(*r.near);
    for (const Point3 p : r.path) add(p);
    for (const double value : values) text = key_text(std::move(text), {value});
    return text;
}

// Which labels are vessels, bone or skin goes by their tissues.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests&) {
    std::vector<std::string> texts;
    for (const PathologyRequest& request : requests_of(recipe))
        texts.push_back(request_text(request));
    texts.push_back(tissues_text(recipe.tissues));
    for (const LabelChoice& choice : recipe.labels)
        texts.push_back(choice.label + "=" + choice.tissue);
    return texts;
}

}  // namespace

StageDescriptor pathology_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kPathology;
    stage.version = kPathologyVersion;
    stage.summary = "put lesions into cooked labels";
    stage.about = "Put the lesions of a recipe into cooked labels";
    stage.takes = {kLabels, kRegistration};
    stage.provides = kLabels;
    stage.options = OptionsOf<PathologyOptions>("pathology");
    stage.read_sections = read_sections;
    stage.key_texts = key_texts;
    stage.active = [](const Recipe& recipe) { return !requests_of(recipe).empty(); };
    stage.run = run;
    stage.codec = label_codec(kLabels);
    stage.reports = reports_of(kLabels);
    stage.share = 0.05;
    stage.cost = {.threads = 2, .per_cooked_voxel = 2.5, .per_pool_voxel = 5.3};
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
