// SPDX-License-Identifier: Apache-2.0

#include <memory>

#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/tradeoff/boundary_error.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

// The demo torso as a scanner would give it, and the map that is known to be true.
struct KnownTorso {
    LabelVolume ct;
    Registration truth = analytic_torso_truth();
};

std::string note_of(const BoundaryError& error, const StageReport& report) {
    std::string note = std::to_string(error.lost_labels) + " labels lost";
    if (!report.warnings.empty()) note += "; " + report.warnings.front();
    return note;
}

Result<Measured> measure_resample(const KnownTorso& torso, const Settings& settings) {
    StageSettings options(built_in_stages());
    if (const Status s = apply_settings(settings, options); !s) return s.error();
    const auto made =
        resample_labels({torso.ct, torso.truth}, options.of<ResampleOptions>("resample"));
    if (!made) return made.error();
    const BoundaryError error = measure_boundary_error(made->volume, made->boundary, torso.truth);
    return Measured{error.displaced_mm, made->report.seconds, note_of(error, made->report)};
}

Suite resample_suite(Vector3 spacing_mm) {
    auto torso = std::make_shared<KnownTorso>();
    torso->ct = sample_analytic_torso(analytic_torso_grid(spacing_mm));
    Suite suite;
    suite.body = "demo-torso";
    suite.error_name = "mean displacement of surfaces";
    suite.error_unit = "mm";
    suite.measure = [torso](const Settings& settings) {
        return measure_resample(*torso, settings);
    };
    return suite;
}

}  // namespace

Suite warp_suite() {
    Suite suite = resample_suite({2, 2, 3});
    suite.name = "warp";
    suite.title = "Through the warp into cubic voxels";
    suite.truth =
        "The demo torso sampled at 2 x 2 x 3 mm goes through its known warp; at 200,000 random "
        "points the "
        "cooked class is compared with the analytic one, and the share of wrong points divided by "
        "the "
        "interface area is the mean distance by which surfaces are displaced.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.named = {{TrialRole::peer, "nearest label", {{"resample.method", "nearest"}}}};
    return suite;
}

Suite smooth_suite() {
    Suite suite = resample_suite({1, 1, 5});
    suite.name = "smooth";
    suite.title = "Thick slices without steps";
    suite.truth =
        "The demo torso sampled at 1 x 1 x 5 mm goes through its known warp into 1 mm; the measure "
        "is that of "
        "the suite warp.";
    suite.knobs = knobs_of(built_in_stages(), suite.name);
    suite.pairs = {{"resample.sigma_vx", "resample.volume_iterations"}};
    suite.named = {{TrialRole::paper,
                    "paper, eq. (10), K0 = 0.1",
                    {{"resample.method", "paper"}, {"resample.k0", "0.1"}}},
                   {TrialRole::paper,
                    "paper, eq. (10), K0 = 1",
                    {{"resample.method", "paper"}, {"resample.k0", "1"}}},
                   {TrialRole::peer, "nearest label", {{"resample.method", "nearest"}}}};
    return suite;
}

}  // namespace sonocase::pipeline
