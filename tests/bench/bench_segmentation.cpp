// Resampling and smoothing of labels: each knob with its error against its time.
//
// Counters: dice (mean over labels), wrong_percent (voxels), lost, volume_percent (mean |dV|)
// against the analytic torso, sampled at 2 x 2 x 6 mm and carried through its known warp into 2 mm,
// so that a row takes a second or two; Real rows use the segmentation in SONOCASE_DATA where it is.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdio>
#include <filesystem>

#include "pipeline/import/analytic_torso.h"
#include "pipeline/import/label_map.h"
#include "pipeline/parallel.h"
#include "pipeline/registration/inverse_map.h"
#include "pipeline/segmentation/cooked_grid.h"
#include "pipeline/segmentation/resample_labels.h"

namespace sonocase::pipeline {
namespace {

struct Torso {
    LabelVolume ct = sample_analytic_torso(analytic_torso_grid({2, 2, 6}));
    Registration registration = analytic_torso_truth();
    Torso() { registration.ct_box = ct.grid.bounds(); }
};

const Torso& torso() {
    static const Torso instance;
    return instance;
}

// -1 where the voxel comes from outside the CT.
std::vector<int> truth_on(const Grid& grid) {
    const InverseMap inverse_map(with_voxel_rim(torso().registration, torso().ct.grid));
    std::vector<int> truth(grid.voxel_count(), -1);
    const auto slices = static_cast<std::size_t>(grid.size.z);
    parallel_for(slices, 1, [&](std::size_t begin, std::size_t end) {
        const auto nx = static_cast<std::size_t>(grid.size.x);
        std::vector<float> x(nx), y(nx), z(nx);
        std::vector<MapStatus> status(nx);
        for (std::size_t k = begin; k < end; ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                const Point3 start =
                    grid.point_from_voxel({0, static_cast<double>(j), static_cast<double>(k)});
                inverse_map.invert_row(start, {grid.spacing_mm.x, 0, 0}, grid.size.x, x.data(),
                                       y.data(), z.data(), status.data());
                for (std::size_t i = 0; i < nx; ++i) {
                    if (status[i] != MapStatus::ok) continue;
                    truth[grid.index(static_cast<int>(i), j, static_cast<int>(k))] =
                        analytic_torso_label({x[i], y[i], z[i]});
                }
            }
        }
    });
    return truth;
}

void score(const LabelVolume& volume, benchmark::State& state) {
    const std::vector<int> truth = truth_on(volume.grid);
    const std::size_t labels = volume.labels.size();
    std::vector<double> ours(labels), theirs(labels), both(labels);
    double wrong = 0, count = 0;
    for (std::size_t v = 0; v < truth.size(); ++v) {
        if (truth[v] < 0) continue;
        const auto a = static_cast<std::size_t>(volume.voxels[v]);
        const auto b = static_cast<std::size_t>(truth[v]);
        ours[a] += 1;
        theirs[b] += 1;
        (a == b ? both[a] : wrong) += 1;
        count += 1;
    }
    double dice = 0, change = 0, lost = 0, present = 0;
    for (std::size_t l = 1; l < labels; ++l) {
        if (theirs[l] == 0) continue;
        dice += 2 * both[l] / (ours[l] + theirs[l]);
        change += std::abs(ours[l] / theirs[l] - 1);
        lost += ours[l] == 0;
        present += 1;
    }
    state.counters["dice"] = dice / present;
    state.counters["wrong_percent"] = 100 * wrong / count;
    state.counters["volume_percent"] = 100 * change / present;
    state.counters["lost"] = lost;
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

void resample_real(benchmark::State& state, ResampleOptions options) {
    const std::string path = SONOCASE_DATA "/ct/labels.nii.gz";
    if (!std::filesystem::exists(path)) {
        state.SkipWithError("no real data");
        return;
    }
    const auto imported = import_label_map(path);
    Registration registration;
    const Box3 box = imported->labels.grid.bounds();
    const Rigid tilt{rotation_about(normalized({0.5, 1, 0.2}), 0.2), {10, 20, 30}};
    registration.quadratic = QuadraticMap::from_rigid(tilt, box.centre(), 200);
    registration.ct_box = box;
    for (auto _ : state) {
        auto result = resample_labels({imported->labels, registration}, options);
        state.counters["voxels"] = static_cast<double>(result->volume.grid.voxel_count());
        for (const Measure& m : result->report.measures) {
            if (m.name == "lost_labels") state.counters["lost"] = m.value;
        }
    }
}

template <class Change>
ResampleOptions with(const Change& change) {
    ResampleOptions options;
    change(options);
    return options;
}

void add(const std::string& name, const ResampleOptions& options, bool real = false) {
    benchmark::RegisterBenchmark(("Segmentation/" + name).c_str(),
                                 [=](benchmark::State& state) {
                                     real ? resample_real(state, options)
                                          : resample_torso(state, options);
                                 })
        ->Unit(benchmark::kMillisecond)
        ->MeasureProcessCPUTime()
        ->UseRealTime()
        ->Iterations(1);
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
    add("follow_shift:false", with([](auto& o) { o.follow_shift = false; }));
    for (const char* voxel : {"1.5", "2", "3"}) {
        add(std::string("voxel_mm:") + voxel,
            with([&](auto& o) { o.voxel_mm = std::stod(voxel); }));
    }
    add("real/1mm/shape", {}, true);
    add("real/1mm/nearest", with([](auto& o) { o.method = "nearest"; }), true);
    add("real/0.5mm/shape", with([](auto& o) { o.voxel_mm = 0.5; }), true);
    add("real/3mm/paper", with([](auto& o) { o.method = "paper", o.voxel_mm = 3; }), true);
    add("real/3mm/shape", with([](auto& o) { o.voxel_mm = 3; }), true);
    return true;
}();

}  // namespace
}  // namespace sonocase::pipeline
