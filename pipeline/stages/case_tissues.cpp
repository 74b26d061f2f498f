// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/case_tissues.h"

#include <algorithm>

#include "formats/base/digest.h"
#include "formats/bundle/stage_files.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/import/mesh/node_table.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

// The tissues that the palette uses, in the table's order, outside first.
std::vector<Tissue> used_tissues(const std::vector<Tissue>& all, const std::vector<Label>& labels) {
    std::vector<Tissue> used;
    for (const Tissue& tissue : all) {
        const bool wanted = tissue.name == "outside" ||
                            std::any_of(labels.begin(), labels.end(), [&](const Label& label) {
                                return label.tissue == tissue.name;
                            });
        if (wanted) used.push_back(tissue);
    }
    return used;
}

Result<StageValue> run(StageInputs& inputs, const Progress&) {
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    CaseTissues result;
    result.palette = labels->volume.labels;
    SONOCASE_TRY_DONE(assign_tissues(inputs.recipe(), result.palette));
    result.tissues = used_tissues(inputs.recipe().tissues, result.palette);
    return StageValue::of(kTissues, std::move(result));
}

// Empty for a tissue without figures of its own, whose bundle holds none either.
std::string mechanics_text(const Tissue& tissue) {
    if (!tissue.mechanics) return {};
    const TissueMechanics& m = *tissue.mechanics;
    return key_text("mechanics",
                    {m.stiffness_kpa, m.drains ? 1.0 : 0.0, m.puncture_n, m.rigid ? 1.0 : 0.0});
}

std::string palette_text(const std::vector<Label>& palette) {
    std::string text;
    for (const Label& label : palette) text += label.name + "=" + label.tissue + "\n";
    return text;
}

bool is_pathology(const Recipe& recipe, const std::string& label) {
    for (const PathologyRequest& request : recipe.settings.of<PathologyOptions>().requests)
        for (const std::string& name : pathology_labels(request))
            if (name == label) return true;
    return false;
}

}  // namespace

Status assign_tissues(const Recipe& recipe, std::vector<Label>& labels) {
    std::vector<std::string> names, tissues;
    for (const Label& label : labels) names.push_back(label.name);
    for (const Tissue& tissue : recipe.tissues) tissues.push_back(tissue.name);
    const auto known_class = total_segmentator_labels();
    for (const LabelChoice& choice : recipe.labels) {
        const std::string where = recipe.path + ":" + std::to_string(choice.line);
        if (std::find(tissues.begin(), tissues.end(), choice.tissue) == tissues.end())
            return Error{"unknown tissue '" + choice.tissue + "'", where,
                         suggest_name(choice.tissue, tissues)};
        if (choice.label.find('*') != std::string::npos) {
            bool any = false;
            for (Label& label : labels) {
                if (!matches_pattern(choice.label, label.name)) continue;
                label.tissue = choice.tissue;
                any = true;
            }
            if (!any)
                return Error{"no label matches '" + choice.label + "'", where,
                             "expected a pattern of the label map's names"};
            continue;
        }
        auto found = std::find(names.begin(), names.end(), choice.label);
        if (found == names.end())  // the label map may spell it so
            found = std::find(names.begin(), names.end(), standard_name(choice.label));
        if (found == names.end()) {
            if (std::find(known_class.begin(), known_class.end(), choice.label) !=
                known_class.end())
                continue;
            if (is_pathology(recipe, choice.label)) continue;  // not painted yet
            return Error{"label '" + choice.label + "' is not in the label map", where,
                         suggest_name(choice.label, names)};
        }
        labels[found - names.begin()].tissue = choice.tissue;
    }
    return Done{};
}

std::string tissues_text(const std::vector<Tissue>& tissues) {
    std::string text;
    for (const Tissue& t : tissues)
        text += t.name + "|" + t.texture +
                key_text("", {static_cast<double>(t.kind), t.casts_shadow ? 1.0 : 0.0, t.grey_mean,
                              t.grey_sd, t.echo_db, t.structure_db, t.attenuation_db_cm_mhz,
                              t.impedance_mrayl, t.sound_speed_m_s}) +
                mechanics_text(t) + "\n";
    return text;
}

StageDescriptor tissues_step() {
    StageDescriptor step;
    step.name = "tissues";
    step.takes = {kLabels};
    step.provides = kTissues;
    // Which tissues a case uses is known once its labels exist; the plan takes all of them.
    step.key_texts = [](const Recipe& recipe, const InputDigests&) {
        std::vector<std::string> texts{tissues_text(recipe.tissues)};
        for (const LabelChoice& choice : recipe.labels)
            texts.push_back(choice.label + "=" + choice.tissue);
        return texts;
    };
    step.run = run;
    step.digest = [](const StageValue& value) {
        const CaseTissues& result = value.as(kTissues);
        return digest_of(tissues_text(result.tissues) + palette_text(result.palette));
    };
    return step;
}

}  // namespace sonocase::pipeline::inline stages
