// SPDX-License-Identifier: Apache-2.0

// The case that tests of cooking share.
#pragma once

#include "pipeline/cook/cook_case.h"
#include "pipeline/stages/read_recipe.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline::testing {

using sonocase::testing::TemporaryFolder;

// The demonstration at coarse voxels: every stage runs, in seconds.
inline Result<Recipe> coarse_recipe(const std::string& extra = "",
                                    std::vector<std::string> sets = {}) {
    const std::string text =
        "name = \"coarse\"\npreset = \"draft\"\n[analytic]\nvoxel_mm = 6\nslice_mm = 6\n"
        "points = 800\nknown_map = true\n[resample]\nvoxel_mm = 4\n[texture]\nedge = 16\n"
        "speckle_edge = 16\n" +
        extra;
    const std::vector<EmbeddedExercise> exercises{
        {"aim",
         "frame = \"ct\"\nname = \"aim\"\nno_go = [\"aorta\"]\n[[targets]]\nname = \"t\"\n"
         "centre = [80, 20, 70]\ninside = \"liver\"\n[[findings]]\nname = \"f\"\n"
         "look = \"cyst\"\ncentre = [80, 20, 70]\n[[sweeps]]\nname = \"s\"\n[[sweeps.keys]]\n"
         "time_s = 0\nprobe = [80, 130, 70]\nbeam = [0, -1, 0]\nlateral = [1, 0, 0]\n"
         "needle_tip = [85, 60, 70]\nneedle_direction = [0, -1, 0]\n"}};
    RecipeOverrides overrides;
    overrides.sets = std::move(sets);
    return parse_recipe(text, "coarse.toml", overrides, &exercises);
}

// One cache for the tests that are not about it, so that the coarse case is cooked once.
inline CookOptions shared_cache() {
    static const TemporaryFolder folder;
    CookOptions options;
    options.cache_folder = folder.path();
    return options;
}

}  // namespace sonocase::pipeline::testing
