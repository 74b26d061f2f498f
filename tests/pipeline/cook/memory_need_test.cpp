// SPDX-License-Identifier: Apache-2.0

// What a case needs of memory is known, and refused in one line, before anything is cooked.
#include "pipeline/cook/memory_need.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "pipeline/recipe/read_recipe.h"

namespace sonocase::pipeline {
namespace {

MemoryNeed need_of(const std::string& text) {
    const auto recipe = parse_recipe(text, "case.toml", {}, nullptr);
    EXPECT_TRUE(recipe) << recipe.error().message();
    return memory_need(*recipe);
}

// Peaks of `build --until resample` with two threads, /usr/bin/time: 424, 1,121 and 2,676 MB.
TEST(MemoryNeed, IsWithinFifteenPercentOfWhatResamplingTook) {
    const std::string head = "name = \"a\"\n[analytic]\n";
    const struct {
        const char* voxels;
        double peak_mb;
    } measured[] = {{"voxel_mm = 3\nslice_mm = 3\n", 424},
                    {"voxel_mm = 1.5\nslice_mm = 1.5\n", 1121},
                    {"voxel_mm = 1\nslice_mm = 1\n", 2676}};
    for (const auto& m : measured) {
        const MemoryNeed need = need_of(head + m.voxels);
        EXPECT_EQ(need.stage, "resample");
        EXPECT_NEAR(need.mb / m.peak_mb, 1, 0.15) << m.voxels;
    }
}

TEST(MemoryNeed, GrowsWithTheCookedVoxels) {
    const std::string head = "name = \"a\"\n[analytic]\npoints = 2000\n[resample]\nvoxel_mm = ";
    const MemoryNeed coarse = need_of(head + "2"), fine = need_of(head + "0.5");
    EXPECT_NEAR(fine.size.cooked_voxels / coarse.size.cooked_voxels, 64, 1e-6);
    EXPECT_GT(fine.mb, coarse.mb);
}

TEST(MemoryNeed, IsRefusedInOneLineWhereThereIsLess) {
    MemoryNeed need;
    need.stage = "resample";
    need.mb = 9000;
    EXPECT_TRUE(check_memory(need, 9001));
    const Status refused = check_memory(need, 8000);
    ASSERT_FALSE(refused);
    const std::string message = refused.error().message();
    EXPECT_NE(message.find("resample"), std::string::npos);
    EXPECT_NE(message.find("9000 MB"), std::string::npos);
    EXPECT_EQ(message.find('\n'), std::string::npos);
    // Without a limit of the caller's, that of the machine holds.
    EXPECT_GT(machine_memory_mb(), 100);
    need.mb = 0.5 * machine_memory_mb();
    EXPECT_TRUE(check_memory(need, 0));
    need.mb = std::numeric_limits<double>::max();
    EXPECT_EQ(static_cast<bool>(check_memory(need, 0)), std::isinf(machine_memory_mb()));
}

}  // namespace
}  // namespace sonocase::pipeline
