// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <memory>

#include "pipeline/base/line_text.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// The torso as a patient, and as a mannequin with broader and deeper proportions.
struct OtherBuild {
    LabelVolume ct = sample_analytic_torso(analytic_torso_grid({3, 3, 3}));
    SkinSurfaceResult skin = *extract_skin_surface(ct);
    Surface mannequin;
    std::vector<Landmark> landmarks;

    OtherBuild() {
        AnalyticBody body;
        body.width_scale = 1.15;
        body.depth_scale = 1.2;
        body.belly_mm = 40;
        AnalyticMannequinOptions made;
        made.strength = 0;
        made.noise_mm = 1;
        mannequin = analytic_torso_mannequin(made, body);
        const auto here = analytic_torso_landmarks(9, 0),
                   there = analytic_torso_landmarks(9, 0, made, body);
        for (std::size_t n = 0; n < here.size(); ++n) {
            if (here[n].name == "navel" || here[n].name == "pubis")
                landmarks.push_back({here[n].name, here[n].ct, there[n].mannequin});
        }
    }
};

// Percent, of the bones together or the solid organ that changes most.
double worst_volume_change(const std::vector<OrganChange>& organs) {
    double worst = std::abs(joint_change(organs, "bones", is_bone).volume_ratio - 1);
    for (const OrganChange& c : organs) {
        if (is_solid_organ(c.tissue) && c.before_ml > 20)
            worst = std::max(worst, std::abs(c.volume_ratio - 1));
    }
    return 100 * worst;
}

Result<Measured> measure_fit(const OtherBuild& build, const Settings& settings) {
    StageSettings options(built_in_stages());
    if (const Status s = apply_settings(settings, options); !s) return s.error();
    RegisterOptions fit = options.of<RegisterOptions>("warp");
    fit.up = analytic_torso_truth().mannequin_from_ct.rotation.column(2);
    fit.landmarks = build.landmarks;
    const auto fitted = register_surfaces({build.skin, build.mannequin, &build.ct}, fit);
    if (!fitted) return fitted.error();
    Measured measured;
    measured.error = worst_volume_change(fitted->organs);
    measured.seconds = fitted->report.seconds;
    measured.note = text("readings end %.2f mm from the skin, %.2f at the 95th percentile",
                         fitted->fit.median_mm, fitted->fit.p95_mm);
    return measured;
}

}  // namespace

Suite elastic_suite() {
    auto build = std::make_shared<OtherBuild>();
    Suite suite;
    suite.name = "elastic";
    suite.title = "Fit of the patient to a mannequin of another build";
    suite.body = "demo-torso";
    suite.error_name = "volume change of the organ that changes most";
    suite.error_unit = "%";
    suite.truth =
        "The demo torso's skin, from labels at 3 mm, is fitted to 2,000 readings (1 mm noise) of a "
        "torso 15 % wider, 20 % deeper and with a belly 28 mm larger, with the head direction, "
        "navel and pubis. The skin can be reached in many ways; the error is the change of volume "
        "of the solid organ, or of all bones together, that changes most, in percent.";
    for (Knob& knob : knobs_of(built_in_stages(), suite.name)) suite.knobs.push_back(knob);
    suite.named = {{TrialRole::paper, "paper, eqs. (3)-(9)", {{"warp.paper", "true"}}},
                   {TrialRole::peer, "residual warp", {{"warp.path", "residual"}}}};
    suite.measure = [build](const Settings& settings) { return measure_fit(*build, settings); };
    return suite;
}

}  // namespace sonocase::pipeline
