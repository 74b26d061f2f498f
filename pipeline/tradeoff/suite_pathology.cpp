// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <cstdlib>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/pathology/pathology.h"
#include "pipeline/pathology/requested_parts.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline {
namespace {

constexpr double kVolumeMl = 2;

std::vector<PathologyRequest> ten_lesions() {
    std::vector<PathologyRequest> requests;
    for (int n = 1; n <= 10; ++n) {
        PathologyRequest request;
        request.name = "lesion_" + std::to_string(n);
        request.kind = "haemangioma";
        request.host = {"liver"};
        request.volume_ml = kVolumeMl;
        request.seed = n;
        requests.push_back(request);
    }
    return requests;
}

// Mean error of ten volumes at a voxel size, and the time to place them.
Result<Measured> measure(const LabelVolume& volume) {
    const std::vector<PathologyRequest> requests = ten_lesions();
    const auto built_in = built_in_tissues();
    std::vector<Tissue> tissues(built_in.begin(), built_in.end());
    for (const Tissue& tissue : pathology_tissues(requests)) tissues.push_back(tissue);
    const Stopwatch watch;
    const auto placed =
        place_pathology({volume, {}, volume.labels, tissues, requests, "tradeoff", {}});
    const double seconds = watch.seconds();
    if (!placed) return placed.error();
    double error = 0;
    for (const PathologyEntry& entry : placed->key)
        error += 100 * std::abs(entry.volume_ml / kVolumeMl - 1) /
                 static_cast<double>(placed->key.size());
    return Measured{error, seconds, ""};
}

}  // namespace

Suite pathology_suite() {
    Suite suite;
    suite.name = "pathology";
    suite.title = "Ten lesions in one liver";
    suite.body = "demo-torso";
    suite.error_name = "volume error, mean";
    suite.error_unit = "%";
    suite.truth =
        "Ten lesions of 2 ml by seed in the liver of the analytic torso: the volume that the "
        "painted voxels have against the one asked for; seconds are those of placing and painting "
        "all ten.";
    suite.knobs = {{"resample.voxel_mm",
                    {"4", "3", "2", "1.5", "1"},
                    "1.5",
                    "mm",
                    "edge of the cooked voxels",
                    "half a voxel of each volume, and the shape's detail",
                    "the error is what is left of the last voxel, between none and half of it"}};
    suite.measure = [](const Settings& settings) {
        double voxel_mm = 1.5;
        for (const Setting& s : settings) voxel_mm = std::strtod(s.value.c_str(), nullptr);
        const LabelVolume volume =
            sample_analytic_torso(analytic_torso_grid({voxel_mm, voxel_mm, voxel_mm}));
        return measure(volume);
    };
    return suite;
}

}  // namespace sonocase::pipeline
