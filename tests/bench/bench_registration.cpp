// SPDX-License-Identifier: Apache-2.0

// Registration: seconds of each part, and error against time for its knobs, on the analytic torso
// whose map is known. Counters: target_mm and target_p95_mm (distance to the true map inside the
// body), skin_rms_mm, min_det.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "pipeline/anatomy/analytic_torso.h"
#include "pipeline/base/parallel.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/map_proofs.h"
#include "pipeline/registration/register_surfaces.h"
#include "support/torso_builds.h"

namespace sonocase::pipeline {
namespace {

const SkinSurfaceResult& torso_skin() {
    static const SkinSurfaceResult skin =
        *extract_skin_surface(sample_analytic_torso(analytic_torso_grid({3, 3, 3})));
    return skin;
}

const Surface& readings() {
    static const Surface surface = analytic_torso_mannequin();
    return surface;
}

// With the hints of the demo torso's recipe: without them a torso may lie rolled.
RegisterOptions hinted(RegisterOptions options = {}) {
    options.up = Vector3{0, 1, 0};
    options.landmark_mm = 0.5;
    for (const AnalyticLandmark& mark : analytic_torso_landmarks(14, 0.5))
        options.landmarks.push_back({mark.name, mark.ct, mark.mannequin});
    return options;
}

const std::vector<Point3>& body_points() {
    static const std::vector<Point3> points = [] {
        std::vector<Point3> inside;
        const Grid grid = analytic_torso_grid({12, 12, 12});
        for (int k = 0; k < grid.size.z; ++k) {
            for (int j = 0; j < grid.size.y; ++j) {
                for (int i = 0; i < grid.size.x; ++i) {
                    const Point3 p = grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                    if (analytic_torso_label(p) != 0) inside.push_back(p);
                }
            }
        }
        return inside;
    }();
    return points;
}

void count_errors(benchmark::State& state, const RegisterResult& result) {
    const Registration truth = analytic_torso_truth();
    std::vector<double> error;
    for (Point3 p : body_points()) {
        error.push_back(
            distance(mannequin_from_ct(result.registration, p), mannequin_from_ct(truth, p)));
    }
    std::sort(error.begin(), error.end());
    double sum = 0;
    for (double e : error) sum += e;
    state.counters["target_mm"] = sum / static_cast<double>(error.size());
    state.counters["target_p95_mm"] = error[error.size() * 95 / 100];
    state.counters["skin_rms_mm"] = result.fit.rms_mm;
    state.counters["min_det"] = result.registration.min_det_jacobian;
}

void run(benchmark::State& state, const RegisterOptions& options, const Surface& surface) {
    const RegisterInput input{torso_skin(), surface};
    RegisterResult last;
    for (auto _ : state) {
        auto result = register_surfaces(input, hinted(options));
        if (!result) {
            state.SkipWithError(result.error().message().c_str());
            return;
        }
        last = std::move(*result);
    }
    count_errors(state, last);
}

void BM_Whole(benchmark::State& state) {
    run(state, {}, readings());
}
BENCHMARK(BM_Whole)
    ->Name("Registration/whole")
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

// With the elastic path: mannequins of another build, and their patient's tissues.
void BM_Elastic(benchmark::State& state) {
    const auto build = static_cast<testing::Build>(state.range(0));
    const testing::BuiltMannequin mannequin =
        testing::built_mannequin(build, 1, testing::usual_sweep(build));
    const testing::TorsoPatient& patient = testing::torso_patient();
    RegisterOptions options;
    options.up = mannequin.head;
    options.landmarks = mannequin.landmarks;
    RegisterResult last;
    for (auto _ : state)
        last = *register_surfaces({patient.skin, mannequin.sweep, &patient.labels}, options);
    state.SetLabel(testing::build_name(build));
    state.counters["skin_median_mm"] = last.fit.median_mm;
    state.counters["skin_p95_mm"] = last.fit.p95_mm;
    state.counters["min_det"] = last.registration.min_det_jacobian;
}
BENCHMARK(BM_Elastic)
    ->Name("Registration/elastic")
    ->DenseRange(0, 4)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

void BM_Starts(benchmark::State& state) {
    RegisterOptions options;
    options.rigid.starts = static_cast<int>(state.range(0));
    run(state, options, readings());
}
BENCHMARK(BM_Starts)
    ->Name("Registration/starts")
    ->Arg(12)
    ->Arg(24)
    ->Arg(48)
    ->Arg(96)
    ->Arg(192)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

void BM_Trials(benchmark::State& state) {  // the paper's warp: RANSAC alone decides
    RegisterOptions options = hinted();
    options.paper_warp = true;
    options.ransac.trials = static_cast<int>(state.range(0));
    const Rigid pose =
        align_surfaces({torso_skin(), readings()}, hinted())->registration.mannequin_from_ct;
    RegisterResult last;
    for (auto _ : state) last = *warp_surfaces({torso_skin(), readings()}, pose, options);
    count_errors(state, last);
}
BENCHMARK(BM_Trials)
    ->Name("Registration/trials")
    ->Arg(10)
    ->Arg(100)
    ->Arg(1000)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

void BM_Points(benchmark::State& state) {
    AnalyticMannequinOptions mannequin;
    mannequin.points = static_cast<int>(state.range(0));
    run(state, {}, analytic_torso_mannequin(mannequin));
}
BENCHMARK(BM_Points)
    ->Name("Registration/points")
    ->Arg(125)
    ->Arg(250)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Arg(4000)
    ->Arg(14868)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

void BM_Constraint(benchmark::State& state) {  // in tenths of a mm; 0: from the readings
    RegisterOptions options;
    options.residual_warp = false;
    options.constraint_mm = 0.1 * static_cast<double>(state.range(0));
    run(state, options, readings());
}
BENCHMARK(BM_Constraint)
    ->Name("Registration/constraint_tenth_mm")
    ->Arg(0)
    ->Arg(1000)
    ->Arg(300)
    ->Arg(100)
    ->Arg(30)
    ->Arg(10)
    ->Arg(3)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

void BM_ResidualGrid(benchmark::State& state) {
    RegisterOptions options;
    options.residual.spacing_mm = static_cast<double>(state.range(0));
    run(state, options, readings());
}
BENCHMARK(BM_ResidualGrid)
    ->Name("Registration/residual_grid_mm")
    ->Arg(60)
    ->Arg(40)
    ->Arg(30)
    ->Arg(20)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

// A map with a residual of some mm on a 30 mm grid over 360 x 300 x 340 mm.
Registration some_map() {
    Registration r = analytic_torso_truth();
    r.ct_box = {};
    r.ct_box.include(Point3{-180, -150, -170});
    r.ct_box.include(Point3{180, 150, 170});
    r.residual.spacing_mm = 30;
    r.residual.origin_mm = r.ct_box.lower;
    r.residual.size = {15, 13, 15};
    for (int n = 0; n < 15 * 13 * 15; ++n) {
        const auto wave = [n](int a) { return ((n * a) % 17 - 8) * 0.15; };
        r.residual.control_mm.push_back({wave(5), wave(7), wave(11)});
    }
    return r;
}

// The inverse of a point by so many Newton steps from the rigid answer, without check or damping.
void BM_NewtonSteps(benchmark::State& state) {
    const Registration r = some_map();
    const Rigid back = inverse(r.mannequin_from_ct);
    const std::vector<Point3>& points = body_points();
    std::vector<Point3> places;
    for (Point3 p : points) places.push_back(mannequin_from_ct(r, p));
    double worst = 0;
    for (auto _ : state) {
        worst = 0;
        for (std::size_t i = 0; i < points.size(); ++i) {
            Point3 x = back * places[i];
            for (int n = 0; n < state.range(0); ++n)
                x = x - inverse(jacobian(r, x)) * (mannequin_from_ct(r, x) - places[i]);
            worst = std::max(worst, distance(x, points[i]));
        }
    }
    state.counters["worst_mm"] = worst;
    state.counters["points"] = static_cast<double>(points.size());
}
BENCHMARK(BM_NewtonSteps)
    ->Name("Registration/newton_steps")
    ->DenseRange(1, 5)
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

void BM_Proof(benchmark::State& state) {
    const Registration r = some_map();
    FoldProof proof;
    for (auto _ : state) proof = prove_no_fold(r);
    state.counters["bound"] = proof.min_bound;
    state.counters["sample"] = proof.min_sample;
}
BENCHMARK(BM_Proof)->Name("Registration/proof")->Unit(benchmark::kMillisecond)->UseRealTime();

// 48 million voxels of 1 mm, two threads.
void BM_Inverse48M(benchmark::State& state) {
    const Registration r = some_map();
    const InverseMap inverse_map(r);
    const ThreadLimit limit(2);
    constexpr int kWidth = 400, kRows = 300 * 400;
    Box3 image;
    for (int c = 0; c < 8; ++c) {
        image.include(mannequin_from_ct(
            r, {c & 1 ? 180.0 : -180.0, c & 2 ? 150.0 : -150.0, c & 4 ? 170.0 : -170.0}));
    }
    const Point3 start = image.centre() - Vector3{200, 150, 200};
    for (auto _ : state) {
        parallel_for(kRows, 300, [&](std::size_t begin, std::size_t end) {
            std::vector<float> x(kWidth), y(kWidth), z(kWidth);
            std::vector<MapStatus> status(kWidth);
            for (std::size_t row = begin; row < end; ++row) {
                const double j = static_cast<double>(row % 300), k = static_cast<double>(row / 300);
                inverse_map.invert_row(start + Vector3{0, j, k}, {1, 0, 0}, kWidth, x.data(),
                                       y.data(), z.data(), status.data());
            }
        });
    }
    state.counters["ns_per_voxel"] = benchmark::Counter(
        48e6 * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_Inverse48M)
    ->Name("Registration/inverse_48M")
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace sonocase::pipeline
