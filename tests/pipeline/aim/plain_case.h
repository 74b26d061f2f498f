// SPDX-License-Identifier: Apache-2.0

// A small case of ellipsoids that has nothing wrong with it.
#pragma once

#include <string>
#include <vector>

#include "formats/bundle/case_bundle.h"

namespace sonocase::testing {

inline constexpr const char* kPlainExercise = R"(name = "biopsy"
kind = "biopsy"
no_go = ["aorta"]
start_probe = [60, 130, 330]
start_beam = [0, -1, 0]
[[targets]]
name = "lesion"
centre = [60, 20, 330]
radius_mm = 8
inside = "liver"
[[sweeps]]
name = "look"
[[sweeps.keys]]
time_s = 0
probe = [60, 100, 330]
beam = [0, -1, 0]
lateral = [1, 0, 0]
)";

// x to the right, y to the front, z to the head, as a patient who stands.
inline CaseBundle plain_case() {
    CaseBundle bundle;
    Grid& grid = bundle.grid;
    const double mm = 4;
    grid.size = {84, 60, 120};
    grid.spacing_mm = {mm, mm, mm};
    grid.origin_mm = {-166, -118, 0};
    const char* names[][2] = {{"outside", "outside"},
                              {"skin", "skin"},
                              {"other_fat", "fat"},
                              {"liver", "liver"},
                              {"spleen", "spleen"},
                              {"kidney_right", "kidney_cortex"},
                              {"kidney_left", "kidney_cortex"},
                              {"aorta", "blood"},
                              {"inferior_vena_cava", "blood"},
                              {"vertebrae", "bone"},
                              {"hip_right", "bone"},
                              {"hip_left", "bone"},
                              {"urinary_bladder", "urine"}};
    const TissueKind kinds[] = {TissueKind::outside, TissueKind::soft,  TissueKind::soft,
                                TissueKind::soft,    TissueKind::soft,  TissueKind::soft,
                                TissueKind::soft,    TissueKind::fluid, TissueKind::fluid,
                                TissueKind::bone,    TissueKind::bone,  TissueKind::bone,
                                TissueKind::fluid};
    for (std::size_t l = 0; l < std::size(kinds); ++l) {
        bundle.labels.push_back({names[l][0], names[l][1], static_cast<int>(l), {}});
        bool there = false;
        for (const Tissue& t : bundle.tissues) there = there || t.name == names[l][1];
        if (there) continue;
        Tissue tissue;
        tissue.name = names[l][1];
        tissue.kind = kinds[l];
        tissue.texture = l == 3 ? "liver" : "";
        bundle.tissues.push_back(tissue);
    }
    bundle.textures.push_back({});
    bundle.textures.back().name = "liver";
    std::vector<std::uint8_t> voxels;
    const auto ball = [](Point3 p, Point3 c, double r) { return distance(p, c) < r; };
    for (int k = 0; k < grid.size.z; ++k)
        for (int j = 0; j < grid.size.y; ++j)
            for (int i = 0; i < grid.size.x; ++i) {
                const Point3 p = grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k});
                const double r = std::hypot(p.x / 150, p.y / 100);
                std::uint8_t label = r < 0.96 ? 2 : r < 1 ? 1 : 0;
                if (ball(p, {65, 20, 330}, 70)) label = 3;
                if (ball(p, {-85, -20, 340}, 35)) label = 4;
                if (ball(p, {60, -45, 250}, 33)) label = 5;
                if (ball(p, {-60, -45, 250}, 33)) label = 6;
                if (std::hypot(p.x + 10, p.y + 30) < 9) label = 7;
                if (std::hypot(p.x - 14, p.y + 30) < 11) label = 8;
                if (std::hypot(p.x, p.y + 62) < 20) label = 9;
                if (ball(p, {80, -10, 60}, 40)) label = 10;
                if (ball(p, {-80, -10, 60}, 40)) label = 11;
                if (ball(p, {0, 40, 70}, 32)) label = 12;
                voxels.push_back(label);
            }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(voxels, grid.size);
    bundle.manifest.case_name = "plain";
    bundle.manifest.stages = {{"warp", 1, 0, {{"min_det_jacobian", 0.4}}, {}, {}, {}}};
    bundle.exercises = {{"biopsy", kPlainExercise}};
    return bundle;
}

// Changes every voxel: label = change(point, label).
template <class Change>
void repaint(CaseBundle& bundle, Change change) {
    std::vector<std::uint8_t> voxels = dense_from_bricks(bundle.label_bricks);
    std::size_t n = 0;
    for (int k = 0; k < bundle.grid.size.z; ++k)
        for (int j = 0; j < bundle.grid.size.y; ++j)
            for (int i = 0; i < bundle.grid.size.x; ++i, ++n)
                voxels[n] = static_cast<std::uint8_t>(
                    change(bundle.grid.point_from_voxel({1.0 * i, 1.0 * j, 1.0 * k}), voxels[n]));
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(voxels, bundle.grid.size);
}

}  // namespace sonocase::testing
