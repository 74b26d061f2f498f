// SPDX-License-Identifier: Apache-2.0

// warp: fits the map from the patient to the mannequin, rigid alignment and warps in one.
//
// The analytic torso may take the map that its mannequin was made by, which is exact.
#include "pipeline/base/source_checks.h"
#include "pipeline/registration/landmark_file.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/mannequin_step.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

using Fit = RegisterOptions;

void add_align(OptionsOf<Fit>& options) {
    options.section("align")
        .help_group("Rigid alignment")
        .number(
            "starts", [](auto& o) { return &o.rigid.starts; }, 1, 2000, "",
            "rotations to start from")
        .sweep({"register",
                {"10", "30", "60", "96", "240"},
                "the chance of a wrong pose",
                "once one start converges to the right pose, more of them end in the same place",
                "one start finds this torso, whose hints distinguish up from down; a slim body, or "
                "one without hints, fits nearly as well after a half turn"})
        .number(
            "offsets", [](auto& o) { return &o.rigid.offsets; }, 1, 20, "",
            "starts along the long axis for each rotation")
        .number(
            "offset_mm", [](auto& o) { return &o.rigid.offset_mm; }, 0, 200, "mm",
            "distance between starts along the long axis")
        .number(
            "candidates", [](auto& o) { return &o.rigid.candidates; }, 1, 50, "",
            "poses handed on to the warp")
        .number(
            "cone_rad", [](auto& o) { return &o.rigid.cone_rad; }, 0.05, 3.2, "rad",
            "largest tilt of the head from inputs.up")
        .number(
            "landmark_mm", [](auto& o) { return &o.landmark_mm; }, 0.1, 100, "mm",
            "standard deviation of a landmark along an axis")
        .choice(
            "open_side", [](auto& o) { return &o.open_side; }, {"auto", "back", "front", "none"},
            "", "side of the patient at the open side of the sweep; auto: the back")
        .toggle(
            "find_table", [](auto& o) { return &o.target.find_table; },
            "recognise readings of the table: they are left out, and the table's plane holds the "
            "back");
}

void add_quadratic(OptionsOf<Fit>& options) {
    options.section("warp")
        .help_group("Quadratic warp")
        .number(
            "trials", [](auto& o) { return &o.ransac.trials; }, 1, 100000, "",
            "trials of the paper's random consensus")
        .number(
            "correspondences", [](auto& o) { return &o.ransac.correspondences; }, 10, 200, "",
            "correspondences of each trial")
        .number(
            "match_ratio", [](auto& o) { return &o.ransac.match_ratio; }, 1, 10, "",
            "T_d of eq. (7)")
        .number(
            "constraint_mm", [](auto& o) { return &o.constraint_mm; }, 0, 1000, "mm",
            "weight of eqs. (4)-(6); 0: from the readings")
        .number(
            "strain", [](auto& o) { return &o.strain; }, 0.001, 1, "",
            "slopes that the map is expected to have")
        .toggle(
            "paper", [](auto& o) { return &o.paper_warp; },
            "the paper's random consensus, eqs. (3)-(9), instead of the refinement");
}

void add_residual(OptionsOf<Fit>& options) {
    options.help_group("Residual warp")
        .toggle(
            "residual", [](auto& o) { return &o.residual_warp; },
            "B-spline displacement after the quadratic")
        .choice(
            "path", [](auto& o) { return &o.path; }, {"auto", "residual", "elastic"}, "",
            "auto: the elastic warp where the residual warp does not suffice")
        .number(
            "spacing_mm", [](auto& o) { return &o.residual.spacing_mm; }, 10, 200, "mm",
            "spacing of the residual's control points")
        .sweep({"register",
                {"80", "60", "40", "30", "20"},
                "bumps of the skin",
                "control points closer together than the readings follow their noise"})
        .number(
            "bending", [](auto& o) { return &o.residual.bending; }, 1e-09, 10, "",
            "weight of the residual's bending")
        .number(
            "stretching", [](auto& o) { return &o.residual.stretching; }, 0, 10, "",
            "weight of the residual's stretching")
        .number(
            "inside_mm", [](auto& o) { return &o.residual.inside_mm; }, 0, 100, "mm",
            "greatest distance that the residual may move the inside of the body, on average")
        .number(
            "fade_mm", [](auto& o) { return &o.residual.fade_mm; }, 1, 500, "mm",
            "depth at which the residual has faded");
}

void add_uncertainty(OptionsOf<Fit>& options) {
    options.help_group("What is not known")
        .choice(
            "uncertainty", [](auto& o) { return &o.uncertainty; }, {"on", "off"}, "",
            "repeat the fit on halves of the readings, to find what they leave uncertain")
        .number(
            "refits", [](auto& o) { return &o.refits; }, 2, 200, "",
            "fits to halves of the readings, where uncertainty is on");
}

void add_elastic(OptionsOf<Fit>& options) {
    options.help_group("Elastic warp")
        .number(
            "stiffness", [](auto& o) { return &o.elastic.stiffness; }, 0.01, 100, "",
            "stiffness of all tissues; 0.33 follows the readings more closely, 1 preserves organs")
        .sweep({"elastic",
                {"3", "1", "0.33", "0.1"},
                "volume change of organs, against the distance to the readings",
                "stiffer tissues take no more time"})
        .number(
            "rounds", [](auto& o) { return &o.elastic.rounds; }, 1, 100, "",
            "rounds of matching of the elastic warp")
        .number(
            "cg_iterations", [](auto& o) { return &o.elastic.iterations; }, 1, 1000, "",
            "conjugate gradient iterations in each round of matching")
        .sweep({"elastic",
                {"8", "30", "60"},
                "how near each round comes to its minimum",
                "",
                "another number changes every elastic map, and builds further apart than these two "
                "have not been fitted with fewer iterations"});
}

OptionGroup options() {
    OptionsOf<Fit> options("warp");
    add_align(options);
    add_quadratic(options);
    add_residual(options);
    add_elastic(options);
    add_uncertainty(options);
    return options;
}

// The hints that the data do not hold: the head's direction, and landmarks.
Status add_hints(const Recipe& recipe, RegisterOptions& options) {
    const RecipeInputs& in = recipe.inputs;
    options.up = in.up;
    if (!in.landmarks.empty()) {
        SONOCASE_TRY(auto landmarks, load_landmarks(recipe.resolve(in.landmarks),
                                                    recipe.resolve(in.surface_landmarks)));
        options.landmarks = std::move(landmarks);
    }
    if (in.analytic)
        for (const AnalyticLandmark& mark : analytic_torso_landmarks(
                 in.torso.landmarks, in.torso.landmark_noise_mm, in.torso.mannequin, in.torso.body))
            options.landmarks.push_back({mark.name, mark.ct, mark.mannequin});
    return Done{};
}

Registration known_map(const AnalyticInput& torso) {
    Registration registration = analytic_torso_truth(torso.mannequin.strength, torso.body);
    StageReport report;
    report.stage = stage_names::kWarp;
    report.version = kRegisterVersion;
    report.warnings = {"the map is the analytic torso's own and was not fitted"};
    registration.reports = {report};
    return registration;
}

// The map of a case on the patient's own skin: every point stays where the scan has it.
Registration identity_map(const Box3& ct_box) {
    Registration registration;
    registration.quadratic = QuadraticMap::from_rigid({}, {}, 1);
    registration.ct_box = ct_box;
    registration.min_det_jacobian = 1;
    StageReport report;
    report.stage = stage_names::kWarp;
    report.version = kRegisterVersion;
    report.measures = {{"min_det_jacobian", 1}};
    report.notes = {{"path", "own_skin"},
                    {"mannequin",
                     "none: the case lies on the patient's own skin; give a surface "
                     "to fit it to a mannequin"}};
    registration.reports = {report};
    return registration;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const Recipe& recipe = inputs.recipe();
    if (recipe.inputs.own_skin) {
        SONOCASE_TRY(const auto own, inputs.get(kSkin));
        return StageValue::of(kRegistration, identity_map(own->box));
    }
    SONOCASE_TRY(const auto mannequin, inputs.get(kMannequin));
    SONOCASE_TRY(const auto skin, inputs.get(kSkin));
    const Surface& surface = mannequin->surface;
    const std::string name =
        recipe.inputs.analytic ? "(analytic)" : recipe.resolve(recipe.inputs.surface);
    if (const auto error = check_same_unit(extent_of(skin->skin), extent_of(surface), name))
        return *error;
    if (recipe.inputs.analytic && recipe.inputs.torso.known_map)
        return StageValue::of(kRegistration, known_map(recipe.inputs.torso));
    RegisterOptions options = inputs.options<RegisterOptions>();
    options.seed = case_seed(recipe.settings);
    SONOCASE_TRY_DONE(add_hints(recipe, options));
    // The tissues decide how the inside follows; the known map above does without them.
    SONOCASE_TRY(const auto ct, inputs.get(kCtLabels));
    SONOCASE_TRY(auto fitted, register_surfaces({*skin, surface, &ct->volume}, options, progress));
    return StageValue::of(kRegistration, std::move(fitted.registration));
}

std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests& digests) {
    const RecipeInputs& in = recipe.inputs;
    std::string hint;
    if (in.analytic && in.torso.known_map)
        hint = "known";
    else if (in.own_skin)
        hint = "own_skin";
    else if (in.up)
        hint = key_text("up", {in.up->x, in.up->y, in.up->z});
    return {digests.landmarks, hint};
}

Bytes encode(const Registration& registration) {
    Registration copy = registration;
    copy.reports = without_seconds(copy.reports);
    const std::string text = format_registration(copy);
    return {text.begin(), text.end()};
}

Result<Registration> decode(const Bytes& bytes, const std::string& where) {
    return parse_registration({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, where);
}

}  // namespace

// Without a verb: pipeline/verbs/verb_register.cpp does more than this stage.
StageDescriptor warp_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kWarp;
    stage.version = kRegisterVersion;
    stage.takes = {kCtLabels, kSkin, kMannequin};
    stage.provides = kRegistration;
    stage.options = options();
    stage.seeded = true;
    stage.key_texts = key_texts;
    stage.run = run;
    stage.codec = codec_of(kRegistration, encode, decode);
    stage.reports = reports_of(kRegistration);
    stage.share = 0.18;
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
