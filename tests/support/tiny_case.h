// A case of a few voxels that fills every field of a bundle.
#pragma once

#include <cmath>

#include "formats/boundary_record.h"
#include "formats/case_bundle.h"

namespace sonocase::testing {

inline CaseBundle tiny_case() {
    CaseBundle bundle;
    bundle.manifest.case_name = "tiny";
    bundle.manifest.producer = "sonocase test";
    bundle.manifest.recipe = "name = \"tiny\"\n";
    bundle.manifest.inputs = {{"ct.nii.gz", "0123456789abcdef0123456789abcdef"}};
    bundle.manifest.stages = {
        {"warp", 3, 1.25, {{"skin_rms_mm", 1.5}, {"min_det_jacobian", 0.4}}, {"A warning."}}};
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

}  // namespace sonocase::testing
