// SPDX-License-Identifier: Apache-2.0

// A small bundle made in memory: a round body of soft tissue with a vessel in it.
#pragma once

#include <cmath>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/exercise/exercise.h"

namespace sonocase::testing {

// An exercise on the body below, in the form stored in a bundle.
inline const char* small_exercise_toml() {
    return R"(name = "scan"
title = "Find the vessel"
description = "A vessel runs along the body. Show it in the middle of the picture, then bring the needle to it."
kind = "vascular"
model = "paper"
start_probe = [0, 0, 70]
start_beam = [0, 0, -1]
[probe]
shape = "curvilinear"
radius_mm = 60
field_of_view_deg = 65
depth_mm = 100
[needle]
gauge = 18
length_mm = 120
[[targets]]
name = "vessel"
centre = [0, 0, 25]
radius_mm = 5
hit_radius_mm = 6
[[sweeps]]
name = "along"
snap_to_skin = true
[[sweeps.keys]]
time_s = 0
probe = [0, -30, 62]
needle_tip = [35, -30, 60]
needle_direction = [-8, 0, -9]
[[sweeps.keys]]
time_s = 1
probe = [0, 0, 62]
needle_tip = [20, 0, 43]
needle_direction = [-8, 0, -9]
[[sweeps.keys]]
time_s = 2
probe = [0, 30, 62]
needle_tip = [6, 30, 28]
needle_direction = [-8, 0, -9]
)";
}

// A procedure on it: each kind of item, and an expert who does all but press.
inline const char* small_procedure_toml() {
    return R"(name = "line"
title = "Draw blood"
description = "Numb the way, bring the needle into the vessel, draw blood, press."
kind = "vascular"
model = "paper"
start_probe = [0, 0, 70]
start_beam = [0, 0, -1]
[probe]
shape = "curvilinear"
radius_mm = 60
field_of_view_deg = 65
depth_mm = 100
[needle]
gauge = 18
length_mm = 120
[[targets]]
name = "vessel"
centre = [0, 0, 25]
radius_mm = 5
hit_radius_mm = 6
[procedure]
cut = 3
[[steps]]
name = "look"
title = "Look first"
instruction = "Show the vessel. No needle yet."
done = { shows = "vessel", needle_in = false, hold_s = 0.5 }
[[steps]]
name = "numb"
title = "Numb the way"
instruction = "Inject 3 ml on the way."
done = { act = "inject", at_least = 3, tip_in = "body" }
[[steps]]
name = "draw"
title = "Draw blood"
instruction = "Tip in the vessel; draw 2 ml."
done = { act = "aspirate", at_least = 2, tip_in = "vessel" }
[[steps]]
name = "press"
title = "Press"
instruction = "Needle out; press for ten seconds."
done = { act = "compress", at_least = 10, needle_in = false }
[[items]]
name = "looked"
title = "Looked first"
step = "look"
[[items]]
name = "numbed"
title = "Way numbed"
step = "numb"
weight = 2
[[items]]
name = "drawn"
title = "Blood drawn"
critical = true
step = "draw"
[[items]]
name = "pressed"
title = "Pressed"
step = "press"
[[items]]
name = "deep"
title = "Never deeper than 45 mm"
never = { depth_at_least_mm = 45, needle_in = true }
[[items]]
name = "asked"
title = "Asked before"
question = "What is below the skin?"
options = ["Air", "A vessel"]
answer = 1
[[sweeps]]
name = "expert"
snap_to_skin = true
[[sweeps.keys]]
time_s = 0
probe = [0, 0, 62]
acts = "answer:5=1"
[[sweeps.keys]]
time_s = 1
probe = [0, 0, 62]
needle_tip = [40, 0, 70]
needle_direction = [-8, 0, -9]
[[sweeps.keys]]
time_s = 2
probe = [0, 0, 62]
needle_tip = [16, 0, 43]
needle_direction = [-8, 0, -9]
acts = "inject=3"
[[sweeps.keys]]
time_s = 3
probe = [0, 0, 62]
needle_tip = [0, 0, 25]
needle_direction = [-8, 0, -9]
acts = "aspirate=2"
[[sweeps.keys]]
time_s = 4
probe = [0, 0, 62]
needle_tip = [40, 0, 70]
needle_direction = [-8, 0, -9]
)";
}

// A cylinder along y of radius 60 mm about (0, *, 0), 160 mm long, in a box of 140 x 160 x 140 mm
// with voxels of 2 mm; a vessel of radius 6 mm along y through (0, *, 25). Outside is label 0.
inline CaseBundle small_case() {
    CaseBundle bundle;
    bundle.manifest.case_name = "cylinder";
    bundle.manifest.producer = "test";
    bundle.grid.size = {70, 80, 70};
    bundle.grid.spacing_mm = {2, 2, 2};
    bundle.grid.origin_mm = {-69, -79, -69};
    bundle.labels = {{"outside", "outside", 0, {0, 0, 0}},
                     {"muscle", "muscle", 1, {180, 90, 80}},
                     {"vessel", "blood", 2, {200, 30, 30}}};
    Tissue outside, muscle, blood;
    outside.name = "outside";
    outside.kind = TissueKind::outside;
    muscle.name = "muscle";
    muscle.grey_mean = 110;
    muscle.grey_sd = 20;
    muscle.attenuation_db_cm_mhz = 0.5;
    blood.name = "blood";
    blood.kind = TissueKind::fluid;
    blood.grey_mean = 15;
    blood.echo_db = -30;
    bundle.tissues = {outside, muscle, blood};
    std::vector<std::uint8_t> dense(bundle.grid.voxel_count());
    for (int k = 0; k < bundle.grid.size.z; ++k) {
        for (int j = 0; j < bundle.grid.size.y; ++j) {
            for (int i = 0; i < bundle.grid.size.x; ++i) {
                const Point3 p = bundle.grid.point_from_voxel({double(i), double(j), double(k)});
                std::uint8_t label = std::hypot(p.x, p.z) <= 60 ? 1 : 0;
                if (std::hypot(p.x, p.z - 25) <= 6) label = 2;
                dense[bundle.grid.index(i, j, k)] = label;
            }
        }
    }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(dense, bundle.grid.size);
    bundle.exercises = {{"scan", small_exercise_toml()}};
    bundle.speckle.edge = 32;
    bundle.speckle.voxels.resize(2 * 32 * 32 * 32);
    std::uint32_t state = 1;
    for (std::int8_t& value : bundle.speckle.voxels) {
        int sum = 0;
        for (int n = 0; n < 4; ++n) {
            state = state * 1664525u + 1013904223u;
            sum += static_cast<int>(state >> 24) - 128;
        }
        value = static_cast<std::int8_t>(sum / 5);
    }
    return bundle;
}

// Blood in the vessel of the case above: 10 mL/s along y, which pulses.
inline void add_flow(CaseBundle& bundle) {
    FlowVessel vessel;
    vessel.name = "vessel";
    vessel.mean_ml_s = 10;
    vessel.wave[0] = {0.4f, -0.5f};
    vessel.nodes = 41;
    for (int i = 0; i < vessel.nodes; ++i) {
        FlowNode node;
        node.centre = {0, 3.75 * (i - 20), 25};
        node.direction = {0, 1, 0};
        node.radius_mm.fill(6);
        bundle.flow.nodes.push_back(node);
    }
    bundle.flow.vessels = {vessel};
}

// A curvilinear probe above the middle, looking down -z, with a sweep along y and a needle in it.
inline Exercise small_exercise() {
    Exercise exercise;
    exercise.name = "scan";
    exercise.title = "Find the vessel";
    exercise.start_probe = {0, 0, 70};
    exercise.start_beam = {0, 0, -1};
    exercise.probe.depth_mm = 100;
    Target target;
    target.name = "vessel";
    target.centre = {0, 0, 25};
    exercise.targets = {target};
    Sweep sweep;
    sweep.name = "along";
    sweep.snap_to_skin = true;
    for (int i = 0; i < 3; ++i) {
        SweepKey key;
        key.time_s = i;
        key.probe = {0, -30.0 + 30 * i, 62};
        key.beam = {0, 0, -1};
        key.lateral = {1, 0, 0};
        key.has_needle = true;
        key.needle_tip = {20.0 - 8 * i, 0, 50.0 - 10 * i};
        key.needle_direction = normalized(Vector3{-8, 0, -10});
        sweep.keys.push_back(key);
    }
    exercise.sweeps = {sweep};
    return exercise;
}

}  // namespace sonocase::testing
