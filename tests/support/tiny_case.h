// SPDX-License-Identifier: Apache-2.0

// A case of a few voxels that fills every field of a bundle.
#pragma once

#include <algorithm>
#include <cmath>

#include "formats/bundle/case_bundle.h"
#include "formats/volume/boundary_record.h"
#include "formats/volume/surface_patch.h"

namespace sonocase::testing {

inline CaseBundle tiny_case() {
    CaseBundle bundle;
    bundle.manifest.case_name = "tiny";
    bundle.manifest.producer = "sonocase test";
    bundle.manifest.recipe = "name = \"tiny\"\n";
    bundle.manifest.inputs = {{"ct.nii.gz", "0123456789abcdef0123456789abcdef"}};
    bundle.manifest.stages = {{"warp",
                               3,
                               1.25,
                               {{"skin_rms_mm", 1.5}, {"min_det_jacobian", 0.4}},
                               {},
                               {},
                               {"A warning."}}};
    bundle.grid = {{9, 6, 5}, {2, 2, 2}, {-8, 1.5, 1.0 / 3}, {}};
    bundle.labels = {{"outside", "outside", 0, {0, 0, 0}},
                     {"body", "muscle", 1, {200, 120, 100}},
                     {"liver", "liver", 5, {150, 60, 40}}};
    Tissue outside, muscle, liver;
    outside.name = "outside";
    outside.kind = TissueKind::outside;
    muscle.name = "muscle";
    muscle.texture = "grain";
    muscle.grey_mean = 90;
    muscle.grey_sd = 20;
    muscle.echo_db = -11;
    muscle.attenuation_db_cm_mhz = 1;
    liver.name = "liver";
    liver.attenuation_db_cm_mhz = 0.5;
    liver.casts_shadow = true;
    liver.source = "S1";
    bundle.tissues = {outside, muscle, liver};
    bundle.exercises = {{"first", "name = \"first\"\n"}};
    const Grid& grid = bundle.grid;
    std::vector<std::uint8_t> labels;
    std::vector<std::int8_t> echo;
    std::vector<std::uint32_t> boundary;
    for (std::size_t i = 0; i < grid.voxel_count(); ++i) {
        labels.push_back(i < 40 ? 0 : static_cast<std::uint8_t>(1 + (i / 7) % 2));
        echo.push_back(static_cast<std::int8_t>(static_cast<int>(i % 50) - 25));
        boundary.push_back(i % 3 ? kNoBoundary : pack_boundary({1, 0.25, {0, 0.6, 0.8}}));
    }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(labels, grid.size);
    bundle.echo_offset = bricks_from_dense<std::int8_t>(echo, grid.size);
    bundle.boundary = bricks_from_dense<std::uint32_t>(boundary, grid.size);
    SolidTexture grain{"grain", 8, 0.5, {}};
    for (int i = 0; i < 512; ++i) grain.voxels.push_back(static_cast<std::uint8_t>(i * 37));
    bundle.textures = {grain};
    bundle.speckle.edge = 4;
    for (int i = 0; i < 128; ++i) bundle.speckle.voxels.push_back(static_cast<std::int8_t>(i * 11));
    bundle.patient_skin.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.1, 0.2, 1.0 / 7}};
    bundle.patient_skin.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 1, 0}};
    bundle.patient_skin.triangles = {{0, 1, 2}, {0, 2, 3}};
    bundle.mannequin_skin.points = {{0, 0, 0.5}, {1, 0, 0.25}};
    bundle.preview_png = {1, 2, 3};
    return bundle;
}

// Surfaces as in cooked cases: a ball in a body, a layer and a corner of three labels, with
// records that are quadrics in most bricks; echo offsets in cells of 2 x 2 x 2 and finer.
inline CaseBundle curved_case() {
    CaseBundle bundle = tiny_case();
    bundle.grid = {{22, 21, 17}, {1, 1, 1}, {0, 0, 0}, {}};
    const Grid& grid = bundle.grid;
    const auto distance = [](Point3 p) { return 6.2 - norm(p - Point3{10.3, 9.8, 8.1}); };
    std::vector<std::uint8_t> labels;
    std::vector<std::int8_t> echo;
    std::vector<std::uint32_t> boundary;
    for (int k = 0; k < grid.size.z; ++k) {
        for (int j = 0; j < grid.size.y; ++j) {
            for (int i = 0; i < grid.size.x; ++i) {
                const Point3 p{static_cast<double>(i), static_cast<double>(j),
                               static_cast<double>(k)};
                const double ball = distance(p), layer = p.z - 5.6 - 0.05 * p.x;
                const int own = ball > 0 ? 2 : layer > 0 ? 1 : 0;
                const bool to_ball = own == 2 || std::abs(ball) < std::abs(layer);
                const double d = std::abs(to_ball ? ball : layer);
                const int other = to_ball ? (own == 2 ? (layer > 0 ? 1 : 0) : 2) : 1 - own;
                const Vector3 up = normalized(Vector3{-0.05, 0, 1});
                const Vector3 in = normalized(Point3{10.3, 9.8, 8.1} - p);
                const Vector3 n = to_ball ? (own == 2 ? in : -in) : (own == 1 ? up : -up);
                labels.push_back(static_cast<std::uint8_t>(own));
                boundary.push_back(d < 1.5 ? pack_boundary({static_cast<std::uint8_t>(other), d, n})
                                           : kNoBoundary);
                const int cell = k < 8 ? i / 2 * 3 + j / 2 * 5 + k / 2 : i * 3 + j * 5 + k;
                const bool level = i < 4 && j < 4 && k > 11;  // a brick alike
                echo.push_back(static_cast<std::int8_t>(level ? 7 : own == 0 ? 0 : cell % 40 - 20));
            }
        }
    }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(labels, grid.size);
    bundle.echo_offset = bricks_from_dense<std::int8_t>(echo, grid.size);
    bundle.boundary = bricks_from_dense<std::uint32_t>(boundary, grid.size);
    // Bricks of the layer's far side are quadrics exactly, as the cooker makes them.
    for (std::size_t b = 0; b < bundle.boundary.table.size(); ++b) {
        const std::uint32_t label = bundle.label_bricks.table[b], entry = bundle.boundary.table[b];
        if ((entry | label) & kUniformBrick) continue;
        BrickLabels own;
        BrickRecords records;
        std::copy_n(bundle.label_bricks.pool.begin() + 64 * label, 64, own.begin());
        std::copy_n(bundle.boundary.pool.begin() + 64 * entry, 64, records.begin());
        const std::vector<SurfacePatch> patches = fit_patches(own, records);
        if (patches.empty()) continue;
        records_from_patches(patches, own.data(), 72, records.data());
        std::copy_n(records.begin(), 64, bundle.boundary.pool.begin() + 64 * entry);
    }
    return bundle;
}

}  // namespace sonocase::testing
