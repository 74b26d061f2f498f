// SPDX-License-Identifier: Apache-2.0

// press_block DIR: how far the press field is from the finite elements of a block. Prints one JSON
// object: states[] {pressed_mm, mean_mm, p95_mm, vein_area, artery_area, force_n}, with the same of
// the finite elements as fem_*; an area is null where there is no such vessel.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "runtime/imaging/press/fem_block.h"

namespace {

nlohmann::ordered_json area(double value) {
    if (value < 0) return nullptr;
    return value;
}

}  // namespace

int main(int count, char** words) {
    using namespace sonocase;
    if (count != 2 || std::string(words[1]).rfind("-", 0) == 0) {
        std::fprintf(
            stderr,
            "usage: press_block DIR, a folder with block.json, materials and displacements\n");
        return 2;
    }
    const auto block = testing::read_fem_block(words[1]);
    if (!block) {
        std::fprintf(stderr, "press_block: %s\n", block.error().message().c_str());
        return 1;
    }
    nlohmann::ordered_json out;
    out["half_face_mm"] = {block->face.half_width_mm, block->face.half_height_mm};
    out["states"] = nlohmann::ordered_json::array();
    runtime::press::PressField field(block->face);
    for (const testing::FemState& state : block->states) {
        const testing::BlockError e = testing::compare(*block, state, field);
        out["states"].push_back({{"pressed_mm", e.pressed_mm},
                                 {"mean_mm", e.mean_mm},
                                 {"p95_mm", e.p95_mm},
                                 {"vein_area", area(e.vein_area)},
                                 {"artery_area", area(e.artery_area)},
                                 {"force_n", e.force_n},
                                 {"off_plane_mean_mm", e.off_plane_mean_mm},
                                 {"fem_moved_mm", e.moved_mm},
                                 {"fem_vein_area", area(e.fem_vein_area)},
                                 {"fem_artery_area", area(e.fem_artery_area)},
                                 {"fem_force_n", e.fem_force_n},
                                 {"least_determinant", field.state().least_determinant}});
    }
    std::printf("%s\n", out.dump(1).c_str());
    return 0;
}
