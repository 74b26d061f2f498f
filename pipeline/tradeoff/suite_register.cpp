// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "pipeline/base/stopwatch.h"
#include "pipeline/base/text.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {

namespace {

constexpr int kDraws = 6;  // sets of readings

struct KnownFit {
    LabelVolume ct = sample_analytic_torso(analytic_torso_grid({3, 3, 3}));
    Registration truth = analytic_torso_truth();
    std::vector<Point3> targets;  // inside the body, `ct`

    KnownFit() {
        std::mt19937_64 engine(5);
        const auto uniform = [&](double half) {
            return half * (static_cast<double>(engine() >> 11) * 0x1p-52 - 1);
        };
        while (targets.size() < 2000) {
            const double x = uniform(160), y = uniform(120), z = uniform(150);
            if (analytic_torso_label({x, y, z}) != 0) targets.push_back({x, y, z});
        }
    }
};

Result<Measured> measure_fit(const KnownFit& known, const Settings& settings) {
    StageSettings options(built_in_stages());
    Settings stage_settings;
    AnalyticMannequinOptions readings;
    for (const Setting& s : settings) {
        if (s.key == "mannequin.points") {
            readings.points = std::stoi(s.value);
        } else {
            stage_settings.push_back(s);
        }
    }
    SONOCASE_TRY_DONE(apply_settings(stage_settings, options));
    double before = processor_seconds();
    SONOCASE_TRY(const auto skin, extract_skin_surface(known.ct, options.of<SkinSurfaceOptions>()));
    const double skin_s = processor_seconds() - before;
    // The noise of one set of readings moves the error by a third: several sets are averaged.
    Measured measured;
    for (std::uint64_t draw = 1; draw <= kDraws; ++draw) {
        readings.seed = draw;
        const Surface mannequin = analytic_torso_mannequin(readings);
        // The hints of the demo torso's recipe.
        RegisterOptions fit = options.of<RegisterOptions>();
        fit.up = Vector3{0, 1, 0};
        fit.landmark_mm = 0.5;
        for (const AnalyticLandmark& mark : analytic_torso_landmarks(14, 0.5, readings))
            fit.landmarks.push_back({mark.name, mark.ct, mark.mannequin});
        before = processor_seconds();
        SONOCASE_TRY(const auto fitted, register_surfaces({skin, mannequin}, fit));
        measured.seconds += (processor_seconds() - before) / kDraws;
        double sum = 0;
        for (const Point3 target : known.targets) {
            sum += distance(mannequin_from_ct(fitted.registration, target),
                            mannequin_from_ct(known.truth, target));
        }
        measured.error += sum / static_cast<double>(known.targets.size()) / kDraws;
        if (!fitted.report.warnings.empty()) measured.note = fitted.report.warnings.front();
    }
    measured.seconds += skin_s;
    return measured;
}

}  // namespace

Suite register_suite() {
    auto known = std::make_shared<KnownFit>();
    Suite suite;
    suite.name = "register";
    suite.title = "Fit of the patient to the mannequin";
    suite.body = "demo-torso";
    suite.error_name = "interior target error, mean";
    suite.error_unit = "mm";
    suite.truth =
        "The skin of the demo torso, from labels at 3 mm, is fitted to 2,000 readings (0.7 mm "
        "noise) of a mannequin. A known rigid motion and a known quadratic warp of 9 mm make the "
        "mannequin from the torso. The fit also has the recipe's up direction and 14 markers good "
        "to 0.5 mm. The error is the mean distance of 2,000 points inside the body from where the "
        "known map puts them, averaged over six sets of readings and markers. No fit of surfaces "
        "can see motion along the skin; the markers show it, and their error is the floor of the "
        "curve.";
    suite.knobs = {{"mannequin.points",
                    {"200", "500", "1000", "2000", "4000"},
                    "2000",
                    "",
                    "readings of the mannequin",
                    "noise of the readings",
                    ""}};
    for (Knob& knob : knobs_of(built_in_stages(), suite.name)) suite.knobs.push_back(knob);
    suite.pairs = {{"mannequin.points", "warp.spacing_mm"}};
    suite.named = {{TrialRole::paper, "paper, eqs. (3)-(9)", {{"warp.paper", "true"}}},
                   {TrialRole::peer,
                    "quadratic without residual",
                    {{"warp.residual", "false"}},
                    "the known warp is a quadratic, so that a residual only follows noise; the "
                    "warp to a mannequin of another build is not a quadratic"}};
    suite.measure = [known](const Settings& settings) { return measure_fit(*known, settings); };
    return suite;
}

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

// The change in percent of the bones together or of the solid organ that changes most.
double worst_volume_change(const std::vector<OrganChange>& organs) {
    double worst = std::abs(joint_change(organs, "bones", is_bone).volume_ratio - 1);
    for (const OrganChange& c : organs) {
        if (is_solid_organ(c.tissue) && c.before_ml > 20)
            worst = std::max(worst, std::abs(c.volume_ratio - 1));
    }
    return 100 * worst;
}

Result<Measured> measure_other_build(const OtherBuild& build, const Settings& settings) {
    StageSettings options(built_in_stages());
    SONOCASE_TRY_DONE(apply_settings(settings, options));
    RegisterOptions fit = options.of<RegisterOptions>();
    fit.up = analytic_torso_truth().mannequin_from_ct.rotation.column(2);
    fit.landmarks = build.landmarks;
    const double before = processor_seconds();
    SONOCASE_TRY(const auto fitted,
                 register_surfaces({build.skin, build.mannequin, &build.ct}, fit));
    Measured measured;
    measured.error = worst_volume_change(fitted.organs);
    measured.seconds = processor_seconds() - before;
    measured.note = text("readings end %.2f mm from the skin, %.2f at the 95th percentile",
                         fitted.fit.median_mm, fitted.fit.p95_mm);
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
        "torso that is 15 % wider, 20 % deeper and has a belly 28 mm larger. The fit also has the "
        "head direction, navel and pubis. Many maps reach the skin. The error is the volume "
        "change, in percent, of the solid organ that changes most; all bones together count as one "
        "organ.";
    for (Knob& knob : knobs_of(built_in_stages(), suite.name)) suite.knobs.push_back(knob);
    suite.named = {{TrialRole::paper, "paper, eqs. (3)-(9)", {{"warp.paper", "true"}}},
                   {TrialRole::peer, "residual warp", {{"warp.path", "residual"}}}};
    suite.measure = [build](const Settings& settings) {
        return measure_other_build(*build, settings);
    };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
