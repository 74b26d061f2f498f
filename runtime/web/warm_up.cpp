// SPDX-License-Identifier: Apache-2.0

#include "runtime/web/warm_up.h"

#include <cmath>
#include <utility>
#include <vector>

namespace sonocase::runtime::inline web {
namespace {

constexpr int kVoxels = 48;
constexpr double kSpacingMm = 2.5, kBodyMm = 50, kVesselMm = 6;

constexpr const char* kExercise = R"(name = "warm-up"
model = "physical"
start_probe = [0, 0, 50]
start_beam = [0, 0, -1]
[probe]
shape = "curvilinear"
radius_mm = 60
field_of_view_deg = 60
depth_mm = 90
)";

CaseBundle warm_up_case() {
    CaseBundle bundle;
    bundle.manifest.case_name = "warm-up";
    bundle.grid.size = {kVoxels, kVoxels, kVoxels};
    bundle.grid.spacing_mm = {kSpacingMm, kSpacingMm, kSpacingMm};
    const double first = -0.5 * (kVoxels - 1) * kSpacingMm;
    bundle.grid.origin_mm = {first, first, first};
    bundle.labels = {{"outside", "outside", 0, {0, 0, 0}},
                     {"muscle", "muscle", 1, {180, 90, 80}},
                     {"vessel", "blood", 2, {200, 30, 30}}};
    Tissue outside, muscle, blood;
    outside.name = "outside";
    outside.kind = TissueKind::outside;
    muscle.name = "muscle";
    muscle.attenuation_db_cm_mhz = 0.5;
    blood.name = "blood";
    blood.kind = TissueKind::fluid;
    blood.echo_db = -30;
    bundle.tissues = {outside, muscle, blood};
    std::vector<std::uint8_t> dense;
    dense.reserve(bundle.grid.voxel_count());
    for (int k = 0; k < kVoxels; ++k)
        for (int j = 0; j < kVoxels; ++j)
            for (int i = 0; i < kVoxels; ++i) {
                const double x = first + i * kSpacingMm, z = first + k * kSpacingMm;
                const bool vessel = std::hypot(x, z - 10) < kVesselMm;
                dense.push_back(vessel ? 2 : std::hypot(x, z) < kBodyMm ? 1 : 0);
            }
    bundle.label_bricks = bricks_from_dense<std::uint8_t>(dense, bundle.grid.size);
    bundle.exercises = {{"warm-up", kExercise}};
    return bundle;
}

}  // namespace

std::unique_ptr<PagePlayer> warm_up_player(int side_px) {
    auto player = PagePlayer::of(StreamedBundle(warm_up_case()), "warm-up");
    if (!player->choose_exercise(0, side_px, side_px)) return nullptr;
    return player;
}

}  // namespace sonocase::runtime::inline web
