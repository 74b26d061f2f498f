// SPDX-License-Identifier: Apache-2.0

// press_block DIR [INCREMENTS ITERATIONS]: DIR is a block's folder, or a folder of such folders;
// then the object has blocks{} by name, each as below. INCREMENTS, ITERATIONS: of
// PressSolveOptions.
//
// How far the press field is from the finite elements of a block. Prints one JSON object: states[]
// {pressed_mm, mean_mm, p95_mm, vein_area, artery_area, force_n}, with the same of the finite
// elements as fem_*; an area is null where there is no such vessel. solve_ms: the fastest of twenty
// solutions at 8 mm, look-ups in the finite elements included.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "runtime/imaging/press/fem_block.h"

namespace fs = std::filesystem;

namespace {

nlohmann::ordered_json area(double value) {
    if (value < 0) return nullptr;
    return value;
}

sonocase::Result<nlohmann::ordered_json> errors_of(
    const std::string& folder, const sonocase::runtime::press::PressOptions& options) {
    using namespace sonocase;
    const auto block = testing::read_fem_block(folder);
    if (!block) return block.error();
    nlohmann::ordered_json out;
    out["half_face_mm"] = {block->face.half_width_mm, block->face.half_height_mm};
    out["states"] = nlohmann::ordered_json::array();
    runtime::press::PressField field(block->face);
    double fastest_ms = 1e9;
    const testing::PressedFemBlock deep{&*block, 8};
    for (int run = 0; run < 20; ++run) {
        const auto start = std::chrono::steady_clock::now();
        (void)field.press(runtime::available_simd_targets().front(),
                          {block->tissues, runtime::press::lookup_of(deep)}, options);
        const std::chrono::duration<double, std::milli> ms =
            std::chrono::steady_clock::now() - start;
        fastest_ms = std::min(fastest_ms, ms.count());
    }
    out["solve_ms"] = fastest_ms;
    for (const testing::FemState& state : block->states) {
        const testing::BlockError e = testing::compare(*block, state, field, options);
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
                                 {"min_determinant", field.state().min_determinant}});
    }
    return out;
}

// The folders of blocks in a folder, by name; none if it is a block's own.
std::vector<fs::path> blocks_in(const std::string& folder) {
    std::vector<fs::path> blocks;
    std::error_code failed;
    if (fs::exists(fs::path(folder) / "block.json", failed)) return blocks;
    for (const auto& entry : fs::directory_iterator(folder, failed))
        if (fs::exists(entry.path() / "block.json", failed)) blocks.push_back(entry.path());
    std::sort(blocks.begin(), blocks.end());
    return blocks;
}

}  // namespace

int main(int count, char** words) {
    sonocase::runtime::press::PressOptions options;
    bool usage = (count != 2 && count != 4) || std::string(words[1]).rfind("-", 0) == 0;
    if (!usage && count == 4) {
        options.solve.increments = std::atoi(words[2]);
        options.solve.iterations = std::atoi(words[3]);
        options.solve.first_iterations = options.solve.iterations * 4 / 3;
        usage = options.solve.increments < 1 || options.solve.increments > 64 ||
                options.solve.iterations < 1;
    }
    if (usage) {
        std::fprintf(stderr,
                     "usage: press_block DIR [INCREMENTS ITERATIONS]; DIR: a folder with "
                     "block.json, materials and "
                     "displacements, or a folder of such folders\n");
        return 2;
    }
    nlohmann::ordered_json out;
    const std::vector<fs::path> blocks = blocks_in(words[1]);
    for (const fs::path& folder : blocks.empty() ? std::vector<fs::path>{words[1]} : blocks) {
        const auto errors = errors_of(folder.string(), options);
        if (!errors) {
            std::fprintf(stderr, "press_block: %s\n", errors.error().message().c_str());
            return 1;
        }
        if (blocks.empty()) {
            out = *errors;
        } else {
            out["blocks"][folder.filename().string()] = *errors;
        }
    }
    std::printf("%s\n", out.dump(1).c_str());
    return 0;
}
