// SPDX-License-Identifier: Apache-2.0

// What lesions do to sound: painted by the pipeline into a block of liver, drawn by the player's
// renderer, measured in its envelope before the logarithm.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <memory>

#include "formats/machine/machine.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/pathology/place_pathology.h"
#include "runtime/imaging/physical/fast/physical_fast.h"
#include "support/phantom_bundle.h"

namespace sonocase {
namespace {

constexpr double kDepthMm = 60;  // of the lesion's middle, under the middle of the face

// Liver under skin, with a lesion painted as a recipe would have it; null: without one.
CaseBundle liver_with(const pipeline::PathologyRequest* request, std::uint64_t seed) {
    testing::PhantomOptions options;
    options.ribs = options.gas = options.vessels = options.kidney = options.layers = false;
    options.structure = false;
    options.lower = {-70, -12, -15};
    options.upper = {70, 12, 125};
    options.voxel_mm = 1;
    options.seed = seed;
    CaseBundle bundle = testing::Phantom(options).bundle();
    if (request == nullptr) return bundle;
    LabelVolume volume{bundle.grid, dense_from_bricks(bundle.label_bricks), bundle.labels};
    const std::vector<pipeline::PathologyRequest> requests{*request};
    for (const Tissue& tissue : pipeline::pathology_tissues(requests))
        bundle.tissues.push_back(tissue);
    auto placed = pipeline::place_pathology(
        {volume, bundle.boundary, bundle.labels, bundle.tissues, requests, "case.toml", {}});
    EXPECT_TRUE(placed) << placed.error().message();
    bundle.labels = placed->volume.labels;
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(placed->volume.voxels, bundle.grid.size);
    bundle.boundary = std::move(placed->boundary);
    return bundle;
}

pipeline::PathologyRequest in_the_liver(const char* kind, double diameter_mm) {
    pipeline::PathologyRequest request;
    request.name = "it";
    request.kind = kind;
    request.host = {"liver"};
    request.diameter_mm = diameter_mm;
    request.elongation = 1;
    request.roughness = 0;
    request.in_mannequin = true;
    request.centre = Point3{0, 0, kDepthMm};
    return request;
}

struct Window {
    double from_mm, to_mm;     // depth
    double left_mm, right_mm;  // beside the middle beam, at the lesion's depth
};

// Mean power of the envelope over windows of four draws of the speckle.
std::vector<double> powers(const pipeline::PathologyRequest* request,
                           const std::vector<Window>& windows) {
    using namespace runtime;
    std::vector<double> sum(windows.size(), 0.0), count(windows.size(), 0.0);
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        const CaseBundle bundle = liver_with(request, seed);
        Exercise exercise = testing::phantom_exercise();
        exercise.probe.depth_mm = 110;
        exercise.probe.focus_mm = kDepthMm;
        const ScanGeometry geometry = make_scan_geometry(exercise.probe, 192, 512, 512, 512);
        const PhysicalScene scene = *make_physical_scene(bundle);
        const physical::Tables tables =
            physical::make_tables(exercise.probe, *built_in_machine("classic"), geometry);
        const PhysicalNoise noise =
            make_physical_noise(scene.textures->normal_levels, 1, 192 + 128);
        SerialWorkers workers;
        PhysicalFast renderer(
            scene, geometry, tables, noise, press::press_face(exercise.probe),
            RenderContext{workers, serial_jobs(), available_simd_targets().front()});
        const std::vector<float> gain(512, 0.0f);
        PhysicalFrame frame;
        frame.row_gain_db = gain;
        std::vector<std::uint8_t> pixels(512 * 512);
        renderer.render(frame, {}, false, false, pixels);
        const double pitch = (geometry.radius_mm + kDepthMm) * geometry.line_step;
        for (std::size_t w = 0; w < windows.size(); ++w)
            for (int k = static_cast<int>(windows[w].from_mm / geometry.step_mm);
                 k < static_cast<int>(windows[w].to_mm / geometry.step_mm); ++k)
                for (int l = static_cast<int>(96 + windows[w].left_mm / pitch);
                     l <= static_cast<int>(95 + windows[w].right_mm / pitch); ++l) {
                    sum[w] += static_cast<double>(renderer.power_row(k)[l]);
                    count[w] += 1;
                }
    }
    for (std::size_t w = 0; w < windows.size(); ++w) sum[w] /= count[w];
    return sum;
}

// What the lesion changes in each window, dB: against the same liver and speckle without it.
std::vector<double> changes(const pipeline::PathologyRequest& request,
                            const std::vector<Window>& windows) {
    const std::vector<double> with = powers(&request, windows), without = powers(nullptr, windows);
    std::vector<double> db;
    for (std::size_t w = 0; w < windows.size(); ++w)
        db.push_back(10 * std::log10(with[w] / without[w]));
    return db;
}

// By how much a stone darkens the tissue behind it.
double shadow_db(const char* kind, double diameter_mm) {
    const double db =
        changes(in_the_liver(kind, diameter_mm), {{kDepthMm + 8, kDepthMm + 32, -0.8, 0.8}})[0];
    std::printf("%s of %.0f mm: %.1f dB behind it\n", kind, diameter_mm, db);
    return -db;
}

// Good (1979): gallstones cast a shadow from about 4 mm. Speckle is the same on both sides of the
// comparison, so that a change of 1 dB is a change. A shadow is seen from some 5 dB, as much as the
// spread of speckle itself; 2 dB are lost in it.
TEST(PathologyPictures, AStoneOfFiveMillimetresCastsAShadowOneOfTwoDoesNot) {
    for (const char* kind : {"gallstone", "kidney_stone"}) {
        EXPECT_GT(shadow_db(kind, 5), 5);
        EXPECT_LT(shadow_db(kind, 2), 2);
    }
}

TEST(PathologyPictures, ACystIsBlackAndWhatLiesBehindItBright) {
    const auto db =
        changes(in_the_liver("simple_cyst", 20), {{kDepthMm - 6, kDepthMm + 6, -4, 4},
                                                  {kDepthMm + 14, kDepthMm + 30, -3, 3},
                                                  {kDepthMm + 14, kDepthMm + 30, 18, 30}});
    std::printf("cyst %.1f dB, behind it %.1f dB, beside that %.1f dB\n", db[0], db[1], db[2]);
    EXPECT_LT(db[0], -20);
    // 20 mm of liver would have cost 7 dB on the way and back; beams at its rim meet less of it.
    EXPECT_GT(db[1], 3);
    EXPECT_LT(db[1], 8);
    EXPECT_NEAR(db[2], 0, 0.5);
}

TEST(PathologyPictures, AHaloIsDarkerThanLesionAndLiver) {
    pipeline::PathologyRequest request = in_the_liver("metastasis", 24);
    request.parts["halo"] = 3;
    const auto db = changes(
        request, {{kDepthMm - 5, kDepthMm + 5, -5, 5}, {kDepthMm - 5, kDepthMm + 5, 12.7, 14.3}});
    std::printf("lesion %.1f dB, halo %.1f dB re liver\n", db[0], db[1]);
    EXPECT_LT(db[1] - db[0], -4);  // -11 against -1 dB, blurred by a beam as wide as the halo
    EXPECT_LT(db[1], -4);
}

}  // namespace
}  // namespace sonocase
