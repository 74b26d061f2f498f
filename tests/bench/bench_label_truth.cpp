// SPDX-License-Identifier: Apache-2.0

// How true labels are on two bodies known in closed form, through one warp into voxels of 1 mm.
//
//   plain_body/...  the plain body from slices 1, 3 and 5 mm apart with pixels of 1 mm; those of
//                   5 mm also across the body, and in a grid that lies oblique to it.
//                   wrong_of_nearest is the share of nearest neighbour's wrong voxels
//   torso/...       the whole analytic torso. ..._mm, ..._deg: 95th percentiles over every eighth
//                   boundary record of an organ; liver_rms_deg: root mean square; class_...:
//                   percent of random points whose label is right, in voxels that have a record and
//                   within 3 and 4 mm of a surface; volume_...: change of a vessel in percent
#include <benchmark/benchmark.h>

#include <cmath>
#include <optional>
#include <string>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/segmentation/resample_labels.h"
#include "segmentation_row.h"
#include "support/label_score.h"
#include "support/plain_body.h"
#include "support/torso_block.h"

namespace sonocase::pipeline {
namespace {

using testing::LabelScore;
using testing::plain_body;
using testing::PlainBody;
using testing::score_labels;
using testing::truth_on;

void set_score(const LabelScore& score, benchmark::State& state) {
    state.counters["dice"] = score.dice;
    state.counters["wrong_percent"] = 100 * score.wrong;
    state.counters["volume_percent"] = 100 * score.volume_change;
    state.counters["lost"] = score.lost;
}

void resample_plain_body(benchmark::State& state, const std::string& method, const Grid& ct_grid) {
    const LabelVolume ct = plain_body().sample(ct_grid);
    Registration registration = analytic_torso_truth();
    registration.ct_box = ct_grid.bounds();
    ResampleOptions options;
    options.method = method;
    Result<ResampleResult> result = Error{};
    for (auto _ : state) result = resample_labels({ct, registration}, options);
    const auto truth =
        truth_on(result->volume.grid, registration, ct_grid, [&](Point3 p) -> std::uint8_t {
            const Point3 v = ct_grid.voxel_from_point(p);
            for (int a = 0; a < 3; ++a) {
                // The box of an oblique grid has corners that the grid has not.
                if (v[a] < -0.5 || v[a] > ct_grid.size[a] - 0.5) return testing::kNoTruth;
            }
            return plain_body().label(p);
        });
    const LabelScore score = score_labels(result->volume, truth);
    set_score(score, state);
    if (method == "nearest") return;
    options.method = "nearest";
    const auto nearest = resample_labels({ct, registration}, options);
    state.counters["wrong_of_nearest"] = score.wrong / score_labels(nearest->volume, truth).wrong;
}

void judge_torso(benchmark::State& state, double slice_mm) {
    using testing::percentile;
    std::optional<testing::TorsoBlock> torso;
    for (auto _ : state) torso.emplace(analytic_torso_grid({1, 1, slice_mm}));
    const LabelVolume& volume = torso->result().volume;
    set_score(score_labels(volume, truth_on(volume.grid, torso->registration(), torso->ct_grid(),
                                            [](Point3 p) { return analytic_torso_label(p); })),
              state);
    std::vector<double> all_mm, all_deg;
    for (const char* organ : {"liver", "kidney_left", "kidney_right", "gallbladder", "spleen",
                              "stomach", "pancreas", "small_bowel", "colon", "hepatic_vein_2mm"}) {
        const std::string name = organ;
        std::vector<double> mm, deg;
        for (const auto& e : torso->plane_errors(torso->label(name), 8)) {
            mm.push_back(e.distance_mm);
            deg.push_back(e.normal_deg);
        }
        state.counters[name + "_mm"] = percentile(mm, 0.95);
        state.counters[name + "_deg"] = percentile(deg, 0.95);
        if (name == "hepatic_vein_2mm") continue;
        all_mm.insert(all_mm.end(), mm.begin(), mm.end());
        all_deg.insert(all_deg.end(), deg.begin(), deg.end());
        if (name != "liver") continue;
        double square = 0;
        for (const double v : deg) square += v * v / static_cast<double>(deg.size());
        state.counters["liver_rms_deg"] = std::sqrt(square);
    }
    state.counters["organs_mm"] = percentile(all_mm, 0.95);
    state.counters["organs_deg"] = percentile(all_deg, 0.95);
    state.counters["class_records"] = 100 * torso->right_class(100000, 0, 31);
    state.counters["class_3mm"] = 100 * torso->right_class(100000, 3, 31);
    state.counters["class_4mm"] = 100 * torso->right_class(100000, 4, 31);
    for (const char* tube : {"portal_vein_and_splenic_vein", "hepatic_vein_3mm", "hepatic_vein_2mm",
                             "hepatic_artery_1p5mm"})
        state.counters[std::string("volume_") + tube] = 100 * torso->change(tube);
}

[[maybe_unused]] const bool registered = [] {
    for (const std::string method : {"nearest", "shape"}) {
        const auto add = [&](const std::string& name, const Grid& grid) {
            add_run("plain_body/" + method + "/" + name,
                    [=](benchmark::State& state) { resample_plain_body(state, method, grid); });
        };
        for (const int slice_mm : {1, 3, 5})
            add(std::to_string(slice_mm) + "mm", PlainBody::grid({1, 1, 1.0 * slice_mm}));
        add("5mm_sagittal",
            PlainBody::grid({1, 1, 5}, Matrix3::from_columns({0, 1, 0}, {0, 0, 1}, {1, 0, 0})));
        add("5mm_oblique",
            PlainBody::grid({1, 1, 5}, rotation_about(normalized({0.3, 1, 0.5}), 0.4)));
    }
    for (const int slice_mm : {1, 3, 5}) {
        add_run("torso/" + std::to_string(slice_mm) + "mm",
                [=](benchmark::State& state) { judge_torso(state, slice_mm); });
    }
    return true;
}();

}  // namespace
}  // namespace sonocase::pipeline
