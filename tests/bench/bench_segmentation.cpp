// SPDX-License-Identifier: Apache-2.0

// Resampling and smoothing of labels: each knob with its error against its time.
//
// Counters: dice (mean over labels), wrong_percent (voxels), lost, volume_percent (mean |dV|)
// against the analytic torso, sampled at 2 x 2 x 6 mm and carried through its known warp into 2 mm,
// so that a row takes a second or two; real rows use the segmentation in SONOCASE_DATA where it is:
//   real/...          into cubic voxels through a tilt
//   real/thick6mm/... every second slice of it back into 3 mm, against the slices left out too
//   layers/...        a ball of each label in its own 14 mm cell, 25 and 100 of them in one volume
//   real/3mm/eq10_... eq. (10) as printed, every voxel of the grid for each label, and how many
//   voxels
//                     come out as by the method `paper`; at 1 mm it would take 26 times as long
//   itk_antialias     ITK's AntiAliasBinaryImageFilter on each label's layer at 3 mm, recomposed
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "peer_eq10.h"
#include "peer_itk.h"
#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/segmentation/resample_labels.h"
#include "segmentation_row.h"
#include "support/label_score.h"
#include "support/paths.h"

namespace sonocase::pipeline {
namespace {

using bench::itk_antialiased;

struct Torso {
    LabelVolume ct = sample_analytic_torso(analytic_torso_grid({2, 2, 6}));
    Registration registration = analytic_torso_truth();
    Torso() { registration.ct_box = ct.grid.bounds(); }
};

const Torso& torso() {
    static const Torso instance;
    return instance;
}

void score(const LabelVolume& volume, benchmark::State& state) {
    const auto truth = testing::truth_on(volume.grid, torso().registration, torso().ct.grid,
                                         [](Point3 p) { return analytic_torso_label(p); });
    const testing::LabelScore score = testing::score_labels(volume, truth);
    state.counters["dice"] = score.dice;
    state.counters["wrong_percent"] = 100 * score.wrong;
    state.counters["volume_percent"] = 100 * score.volume_change;
    state.counters["lost"] = score.lost;
}

void resample_torso(benchmark::State& state, ResampleOptions options) {
    if (options.voxel_mm == 1) options.voxel_mm = 2;
    Result<ResampleResult> result = Error{};
    for (auto _ : state) {
        result = resample_labels({torso().ct, torso().registration}, options);
        benchmark::DoNotOptimize(result);
    }
    score(result->volume, state);
}

constexpr const char* kRealLabels = SONOCASE_DATA "/ct/labels.nii.gz";

Registration tilt_of(const Box3& box) {
    Registration registration;
    const Rigid tilt{rotation_about(normalized({0.5, 1, 0.2}), 0.2), {10, 20, 30}};
    registration.quadratic = QuadraticMap::from_rigid(tilt, box.centre(), 200);
    registration.ct_box = box;
    return registration;
}

void resample_real(benchmark::State& state, ResampleOptions options) {
    if (!std::filesystem::exists(kRealLabels)) {
        state.SkipWithError("no real data");
        return;
    }
    const auto imported = import_label_map(kRealLabels);
    const Registration registration = tilt_of(imported->labels.grid.bounds());
    for (auto _ : state) {
        auto result = resample_labels({imported->labels, registration}, options);
        state.counters["voxels"] = static_cast<double>(result->volume.grid.voxel_count());
        for (const Measure& m : result->report.measures) {
            if (m.name == "lost_labels") state.counters["lost"] = m.value;
        }
    }
}

void eq10_as_printed(benchmark::State& state) {
    if (!std::filesystem::exists(kRealLabels)) {
        state.SkipWithError("no real data");
        return;
    }
    const auto imported = import_label_map(kRealLabels);
    const Registration registration = tilt_of(imported->labels.grid.bounds());
    ResampleOptions options;
    options.method = "nearest";
    options.voxel_mm = 3;
    const auto steps = resample_labels({imported->labels, registration}, options);
    LabelVolume smooth;
    for (auto _ : state) smooth = bench::eq10_over_whole_grid(steps->volume, options.level_set);
    const auto paper = level_set_smoothing(steps->volume, options.level_set);
    double same = 0;
    for (std::size_t v = 0; v < smooth.voxels.size(); ++v)
        same += smooth.voxels[v] == paper->volume.voxels[v];
    const auto voxels = static_cast<double>(smooth.voxels.size());
    state.counters["voxels"] = voxels;
    state.counters["labels"] = static_cast<double>(smooth.labels.size());
    state.counters["as_paper_percent"] = 100 * same / voxels;
}

LabelVolume real_labels(const char* file) {
    return std::move(import_label_map(std::string(SONOCASE_DATA "/ct/") + file)->labels);
}

// Mean over labels of `truth` of the overlap with `volume`, on the same grid.
void score_against(const LabelVolume& truth, const LabelVolume& volume, benchmark::State& state) {
    std::array<double, 256> ours{}, theirs{}, both{};
    double wrong = 0, count = 0;
    for (std::size_t v = 0; v < truth.voxels.size(); ++v) {
        ours[volume.voxels[v]] += 1;
        theirs[truth.voxels[v]] += 1;
        if (truth.voxels[v] == volume.voxels[v]) both[truth.voxels[v]] += 1;
        if (truth.voxels[v] == 0 && volume.voxels[v] == 0) continue;
        wrong += truth.voxels[v] != volume.voxels[v];
        count += 1;
    }
    double dice = 0, lost = 0, present = 0;
    for (std::size_t l = 1; l < 256; ++l) {
        if (theirs[l] == 0) continue;
        dice += 2 * both[l] / (ours[l] + theirs[l]);
        lost += ours[l] == 0;
        present += 1;
    }
    state.counters["dice"] = dice / present;
    state.counters["wrong_percent_of_body"] = 100 * wrong / count;
    state.counters["lost"] = lost;
}

void resample_thick6mm(benchmark::State& state, const ResampleOptions& options) {
    if (!std::filesystem::exists(SONOCASE_DATA "/ct/labels_thick6mm.nii.gz")) {
        state.SkipWithError("no real data");
        return;
    }
    LabelVolume full = real_labels("labels.nii.gz"), thick = real_labels("labels_thick6mm.nii.gz");
    // Cooked grids start at whole voxels: with this shift every cooked voxel is one of the map.
    Registration registration;
    const Point3 origin = full.grid.origin_mm;
    registration.quadratic = QuadraticMap::from_rigid({{}, Point3{} - origin}, origin, 200);
    registration.ct_box = thick.grid.bounds();
    Result<ResampleResult> result = Error{};
    for (auto _ : state) result = resample_labels({thick, registration}, options);
    LabelVolume on_full = full;
    std::fill(on_full.voxels.begin(), on_full.voxels.end(), 0);
    const Grid& g = result->volume.grid;
    for (int k = 0; k < full.grid.size.z; ++k) {
        for (int j = 0; j < full.grid.size.y; ++j) {
            for (int i = 0; i < full.grid.size.x; ++i) {
                const Point3 v = g.voxel_from_point({3.0 * i, 3.0 * j, 3.0 * k});
                const int a = static_cast<int>(std::lround(v.x)),
                          b = static_cast<int>(std::lround(v.y)),
                          c = static_cast<int>(std::lround(v.z));
                if (g.contains(a, b, c))
                    on_full.voxels[full.grid.index(i, j, k)] =
                        result->volume.voxels[g.index(a, b, c)];
            }
        }
    }
    score_against(full, on_full, state);
}

// The same number of voxels and of surface whatever the number of labels.
void many_labels(benchmark::State& state, int labels) {
    constexpr int kCells = 8, kEdge = 14;
    LabelVolume ct;
    ct.grid.size = {kCells * kEdge, kCells * kEdge, kCells * kEdge};
    ct.grid.spacing_mm = {1, 1, 1};
    ct.voxels.resize(ct.grid.voxel_count());
    for (int l = 0; l <= labels; ++l) ct.labels.push_back({"label", "muscle", l, {}});
    for (int k = 0; k < ct.grid.size.z; ++k) {
        for (int j = 0; j < ct.grid.size.y; ++j) {
            for (int i = 0; i < ct.grid.size.x; ++i) {
                const int cell = i / kEdge + kCells * (j / kEdge + kCells * (k / kEdge));
                const Vector3 p{i % kEdge - 6.5, j % kEdge - 6.5, k % kEdge - 6.5};
                ct.voxels[ct.grid.index(i, j, k)] =
                    norm(p) < 5.5
                        ? static_cast<std::uint8_t>(2 + cell * labels / 513 % (labels - 1))
                        : std::uint8_t{1};
            }
        }
    }
    Registration registration;
    registration.quadratic = QuadraticMap::from_rigid({}, {}, 200);
    registration.ct_box = ct.grid.bounds();
    for (auto _ : state) {
        auto result = resample_labels({ct, registration});
        benchmark::DoNotOptimize(result);
    }
}

// The peer of eq. (10): each label's layer smoothed by ITK, the least level set wins.
void itk_antialias(benchmark::State& state) {
    if (!std::filesystem::exists(SONOCASE_DATA "/ct/labels.nii.gz")) {
        state.SkipWithError("no real data");
        return;
    }
    const LabelVolume full = real_labels("labels.nii.gz");
    LabelVolume smooth = full;
    for (auto _ : state) {
        std::vector<float> best(full.voxels.size(), 1e30f);
        for (std::size_t l = 0; l < full.labels.size(); ++l) {
            const std::vector<float> phi = itk_antialiased(full, static_cast<std::uint8_t>(l));
            for (std::size_t v = 0; v < phi.size(); ++v) {
                if (phi[v] >= best[v]) continue;
                best[v] = phi[v];
                smooth.voxels[v] = static_cast<std::uint8_t>(l);
            }
        }
    }
    score_against(full, smooth, state);
}

template <class Change>
ResampleOptions with(const Change& change) {
    ResampleOptions options;
    change(options);
    return options;
}

void add(const std::string& name, const ResampleOptions& options, bool real = false) {
    add_run(name, [=](benchmark::State& state) {
        real ? resample_real(state, options) : resample_torso(state, options);
    });
}

[[maybe_unused]] const bool registered = [] {
    add("nearest", with([](auto& o) { o.method = "nearest"; }));
    add("shape", {});
    for (const double k0 : {0.1, 0.3, 1.0}) {
        char name[40];
        std::snprintf(name, sizeof name, "paper/k0:%g", k0);
        add(name, with([&](auto& o) { o.method = "paper", o.level_set.k0 = k0; }));
    }
    for (const int n : {10, 40, 160}) {
        add("paper/iterations:" + std::to_string(n),
            with([&](auto& o) { o.method = "paper", o.level_set.iterations = n; }));
    }
    for (const char* sigma : {"0.5", "1", "1.7", "2", "3"}) {
        add(std::string("sigma_vx:") + sigma,
            with([&](auto& o) { o.sigma_vx = std::stod(sigma); }));
    }
    for (const char* detail : {"0.3", "0.5", "0.8", "1.5"}) {
        add(std::string("detail_vx:") + detail,
            with([&](auto& o) { o.detail_vx = std::stod(detail); }));
    }
    for (const char* snap : {"0", "0.03", "0.07", "0.15"}) {
        add(std::string("snap_vx:") + snap, with([&](auto& o) { o.snap_vx = std::stod(snap); }));
    }
    for (const int n : {0, 2, 4, 8, 16}) {
        add("volume_iterations:" + std::to_string(n),
            with([&](auto& o) { o.volume_iterations = n; }));
    }
    for (const int block : {4, 8, 16}) {
        add("block_vx:" + std::to_string(block), with([&](auto& o) { o.block_vx = block; }));
    }
    add("follow_shift:false", with([](auto& o) { o.follow_shift = false; }));
    for (const char* voxel : {"1.5", "2", "3"}) {
        add(std::string("voxel_mm:") + voxel,
            with([&](auto& o) { o.voxel_mm = std::stod(voxel); }));
    }
    add("real/1mm/shape", {}, true);
    add("real/1mm/nearest", with([](auto& o) { o.method = "nearest"; }), true);
    add("real/0.5mm/shape", with([](auto& o) { o.voxel_mm = 0.5; }), true);
    add("real/1mm/paper", with([](auto& o) { o.method = "paper"; }), true);
    add("real/3mm/paper", with([](auto& o) { o.method = "paper", o.voxel_mm = 3; }), true);
    add("real/3mm/shape", with([](auto& o) { o.voxel_mm = 3; }), true);
    add_run("real/3mm/eq10_as_printed", eq10_as_printed);
    for (const char* method : {"shape", "nearest"}) {
        const auto options = with([&](auto& o) { o.method = method, o.voxel_mm = 3; });
        add_run(std::string("real/thick6mm/") + method,
                [=](benchmark::State& state) { resample_thick6mm(state, options); });
    }
    for (const int n : {25, 100}) {
        add_run("layers/" + std::to_string(n),
                [=](benchmark::State& state) { many_labels(state, n); });
    }
    add_run("itk_antialias", itk_antialias);
    return true;
}();

}  // namespace
}  // namespace sonocase::pipeline
