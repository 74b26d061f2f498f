// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "pipeline/registration/register_surfaces.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
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
    if (const Status s = apply_settings(stage_settings, options); !s) return s.error();
    const auto skin = extract_skin_surface(known.ct, options.of<SkinSurfaceOptions>("surface"));
    if (!skin) return skin.error();
    // The noise of one set of readings moves the error by a third: several sets are averaged.
    Measured measured;
    for (std::uint64_t draw = 1; draw <= kDraws; ++draw) {
        readings.seed = draw;
        const Surface mannequin = analytic_torso_mannequin(readings);
        // The hints of the demo torso's recipe.
        RegisterOptions fit = options.of<RegisterOptions>("warp");
        fit.up = Vector3{0, 1, 0};
        fit.landmark_mm = 0.5;
        for (const AnalyticLandmark& mark : analytic_torso_landmarks(14, 0.5, readings))
            fit.landmarks.push_back({mark.name, mark.ct, mark.mannequin});
        const auto fitted = register_surfaces({*skin, mannequin}, fit);
        if (!fitted) return fitted.error();
        double sum = 0;
        for (const Point3 target : known.targets) {
            sum += distance(mannequin_from_ct(fitted->registration, target),
                            mannequin_from_ct(known.truth, target));
        }
        measured.error += sum / static_cast<double>(known.targets.size()) / kDraws;
        measured.seconds += fitted->report.seconds / kDraws;
        if (!fitted->report.warnings.empty()) measured.note = fitted->report.warnings.front();
    }
    measured.seconds += skin->report.seconds;
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
        "The demo torso's skin, from labels at 3 mm, is fitted to 2,000 readings (0.7 mm noise) of "
        "a mannequin made "
        "from it by a known rigid motion and a known quadratic warp of 9 mm, with the recipe's up "
        "direction and 14 markers good to 0.5 mm; the error is the mean "
        "distance of 2,000 "
        "points inside the body from where the known map puts them, averaged over six sets of "
        "readings and markers. Motion along the skin cannot "
        "be seen by any fit "
        "of surfaces; the markers see it, and their error is the floor of the curve.";
    suite.knobs = {{"mannequin.points",
                    {"200", "500", "1000", "2000", "4000"},
                    "2000",
                    "",
                    "readings of the mannequin",
                    "noise of the readings",
                    ""}};
    for (Knob& knob : knobs_of(built_in_stages(), suite.name)) suite.knobs.push_back(knob);
    suite.pairs = {{"mannequin.points", "warp.spacing_mm"}, {"align.starts", "warp.trials"}};
    suite.named = {{TrialRole::paper, "paper, eqs. (3)-(9)", {{"warp.paper", "true"}}},
                   {TrialRole::peer, "quadratic without residual", {{"warp.residual", "false"}}}};
    suite.measure = [known](const Settings& settings) { return measure_fit(*known, settings); };
    return suite;
}

}  // namespace sonocase::pipeline
