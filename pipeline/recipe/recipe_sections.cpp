// SPDX-License-Identifier: Apache-2.0

#include "pipeline/recipe/recipe_sections.h"

#include <algorithm>

#include "formats/volume/tissue_mechanics.h"

namespace sonocase::pipeline {
namespace {

void read_up(const TomlTable& table, RecipeInputs& inputs) {
    Vector3 up;
    if (table.direction("up", up)) inputs.up = up;
}

Tissue* find_tissue(std::vector<Tissue>& tissues, const std::string& name) {
    const auto found = std::find_if(tissues.begin(), tissues.end(),
                                    [&](const Tissue& t) { return t.name == name; });
    return found == tissues.end() ? nullptr : &*found;
}

// Figures that the recipe leaves out stay as built in, for a tissue whose label says nothing.
void read_mechanics(const TomlTable& table, Tissue& tissue) {
    TissueMechanics m = mechanics_of(tissue, "");
    bool given =
        table.number("stiffness_kpa", m.stiffness_kpa, kLeastStiffnessKpa, kGreatestStiffnessKpa);
    given |= table.flag("drains", m.drains);
    given |= table.number("puncture_n", m.puncture_n, 0, kGreatestPunctureN);
    given |= table.flag("rigid", m.rigid);
    if (given) tissue.mechanics = m;
}

void read_tissue(const TomlTable& table, const std::string& name, std::vector<Tissue>& tissues) {
    const Tissue* start = find_tissue(tissues, name);
    if (start == nullptr) start = find_tissue(tissues, "soft_tissue");
    Tissue tissue = *start;
    tissue.source = "recipe";
    std::vector<std::string> names;
    for (const Tissue& known : tissues) names.push_back(known.name);
    std::string like;
    if (table.text("like", like, names)) {
        tissue = *find_tissue(tissues, like);
        // A vein by another name stays one: blood alone is told apart by its labels.
        if (like != "blood") tissue.mechanics = mechanics_of(tissue, "");
    }
    tissue.name = name;
    if (const auto kind = table.choice("kind", {"outside", "soft", "fluid", "gas", "bone"}))
        tissue.kind = static_cast<TissueKind>(*kind);
    table.flag("casts_shadow", tissue.casts_shadow);
    table.text("texture", tissue.texture);
    table.text("source", tissue.source);
    read_figures(table, tissue);
    read_mechanics(table, tissue);
    table.finish();
    if (Tissue* known = find_tissue(tissues, name))
        *known = tissue;
    else
        tissues.push_back(tissue);
}

}  // namespace

void read_figures(const TomlTable& table, Tissue& tissue) {
    table.number("grey_mean", tissue.grey_mean, 0, 255);
    table.number("grey_sd", tissue.grey_sd, 0, 255);
    table.number("echo_db", tissue.echo_db, -120, 60);
    table.number("structure_db", tissue.structure_db, 0, 30);
    table.number("attenuation_db_cm_mhz", tissue.attenuation_db_cm_mhz, 0, 100);
    table.number("impedance_mrayl", tissue.impedance_mrayl, 0, 20);
    table.number("sound_speed_m_s", tissue.sound_speed_m_s, 100, 6000);
}

void read_inputs(const TomlTable& table, RecipeInputs& inputs) {
    table.text("labels", inputs.labels);
    table.text("label_table", inputs.label_table);
    table.text("surface", inputs.surface);
    table.text("examples", inputs.examples);
    table.text("landmarks", inputs.landmarks);
    table.number("labels_scale", inputs.labels_scale, kSmallestScale, kLargestScale);
    table.number("surface_scale", inputs.surface_scale, kSmallestScale, kLargestScale);
    read_up(table, inputs);
    table.finish();
}

void read_analytic(const TomlTable& table, RecipeInputs& inputs) {
    inputs.analytic = true;
    AnalyticInput& torso = inputs.torso;
    // The named body comes first: the proportions beside it change it.
    std::string body;
    if (table.text("body", body, analytic_body_names())) torso.body = *analytic_body(body);
    table.number("width_scale", torso.body.width_scale, 0.7, 1.4);
    table.number("depth_scale", torso.body.depth_scale, 0.7, 1.4);
    table.number("belly_mm", torso.body.belly_mm, 0, 40);
    table.number("voxel_mm", torso.voxel_mm, 0.5, 10);
    table.number("slice_mm", torso.slice_mm, 0.5, 10);
    table.flag("known_map", torso.known_map);
    table.whole("landmarks", torso.landmarks, 0, 14);
    table.number("landmark_noise_mm", torso.landmark_noise_mm, 0, 50);
    AnalyticMannequinOptions& mannequin = torso.mannequin;
    table.whole("points", mannequin.points, 100, 1e6);
    table.number("noise_mm", mannequin.noise_mm, 0, 20);
    table.number("strength", mannequin.strength, 0, 2);
    table.flag("mesh", mannequin.mesh);
    table.flag("front_only", mannequin.front_only);
    int seed = 0;
    if (table.whole("seed", seed, 0, 2e9)) mannequin.seed = static_cast<std::uint64_t>(seed);
    table.text("examples", inputs.examples);
    read_up(table, inputs);
    table.finish();
}

void read_labels(const TomlTable& table, std::vector<LabelChoice>& labels) {
    for (const std::string& label : table.keys()) {
        LabelChoice choice{label, "", table.line(label)};
        if (table.text(label, choice.tissue)) labels.push_back(std::move(choice));
    }
    std::sort(labels.begin(), labels.end(),
              [](const LabelChoice& a, const LabelChoice& b) { return a.line < b.line; });
}

void read_tissues(const TomlTable& table, std::vector<Tissue>& tissues) {
    for (const std::string& name : table.keys())
        if (const auto fields = table.table(name)) read_tissue(*fields, name, tissues);
}

}  // namespace sonocase::pipeline
