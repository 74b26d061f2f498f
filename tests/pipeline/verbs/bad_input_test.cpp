// SPDX-License-Identifier: Apache-2.0

// What no machine can hold, and disks that fill up: one line, and nothing half-written.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>

#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace {

using sonocase::testing::CommandResult;
using sonocase::testing::read_text;
using sonocase::testing::TemporaryFolder;

const char* const kTinyRecipe =
    "name = \"tiny\"\npreset = \"draft\"\nexercises = []\n[analytic]\nvoxel_mm = 8\nslice_mm = 8\n"
    "points = 600\nknown_map = true\n[resample]\nvoxel_mm = 6\n[texture]\nedge = 8\nspeckle_edge = "
    "8\n";

CommandResult run_in(const TemporaryFolder& folder,
                     const std::string& arguments,
                     const std::string& first = "true") {
    return sonocase::testing::run_command("cd " + folder.path() + " && " + first +
                                          " && " SONOCASE_BIN "/sonocase " + arguments);
}

// Status 1 and, besides warnings, one line.
void expect_one_line(const CommandResult& result, const std::string& what) {
    EXPECT_EQ(result.status, 1) << result.error;
    std::string line = result.error;
    while (line.find(": warning: ") < line.find('\n')) line.erase(0, line.find('\n') + 1);
    EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << result.error;
    EXPECT_NE(line.find(what), std::string::npos) << result.error;
}

// A NIfTI header of voxels of 16 bits, .05 mm apart, and none of the voxels.
std::string header_of(std::int16_t across, std::int16_t along) {
    std::string bytes(352, '\0');
    const auto put = [&](std::size_t at, auto value) {
        std::memcpy(bytes.data() + at, &value, sizeof value);
    };
    put(0, std::int32_t{348});
    const std::int16_t sizes[] = {3, across, across, along, 1, 1, 1, 1};
    std::memcpy(bytes.data() + 40, sizes, sizeof sizes);
    put(70, std::int16_t{4});
    put(72, std::int16_t{16});
    for (std::size_t n = 0; n < 4; ++n) put(76 + 4 * n, n == 0 ? 1.0f : 0.05f);
    put(108, 352.0f);
    put(112, 1.0f);
    bytes[123] = 2;
    put(254, std::int16_t{1});
    for (std::size_t row = 0; row < 3; ++row) put(280 + 20 * row, 0.05f);
    std::memcpy(bytes.data() + 344, "n+1", 4);
    return bytes;
}

std::string sweep_of_a_torso() {
    std::string csv = "x,y,z\n";
    for (int k = 0; k < 60; ++k)
        for (int n = 0; n < 40; ++n)
            csv += std::to_string(170 * std::cos(0.157 * n)) + "," +
                   std::to_string(110 * std::sin(0.157 * n)) + "," + std::to_string(10 * k) + "\n";
    return csv;
}

TEST(BadInput, AMapOfTwoHundredGigabytesIsRefusedBeforeWork) {
    const TemporaryFolder folder;
    folder.write("huge.nii", header_of(6000, 2800));   // 100 thousand million voxels of two bytes
    folder.write("large.nii", header_of(2000, 1500));  // 6 thousand million
    folder.write("sweep.csv", sweep_of_a_torso());
    folder.write("huge.toml",
                 "name = \"huge\"\nexercises = []\n[inputs]\nlabels = \"huge.nii\"\n"
                 "surface = \"sweep.csv\"\n");
    const auto before = folder.names();
    expect_one_line(run_in(folder, "build huge.toml"), "MB for 100800.0 million voxels");
    expect_one_line(run_in(folder, "import huge.nii -o a.labels"), "187 GB of voxels");
    // Neither is room made for voxels that the file does not hold.
    expect_one_line(run_in(folder, "import large.nii -o a.labels", "ulimit -v 4000000"),
                    "large.nii: holds 352 bytes");
    EXPECT_EQ(folder.names(), before);
}

TEST(BadInput, AMemoryLimitBelowTheLeastIsRefusedBeforeWork) {
    const TemporaryFolder folder;
    folder.write("tiny.toml", kTinyRecipe);
    expect_one_line(run_in(folder, "build tiny.toml --memory-mb 100"), "100 MB are allowed");
    EXPECT_EQ(folder.names(), std::vector<std::string>{"tiny.toml"});
}

TEST(BadInput, ADiskThatFillsUpLeavesNothingHalfWritten) {
    const TemporaryFolder folder;
    folder.write("tiny.toml", kTinyRecipe);
    expect_one_line(run_in(folder, "build tiny.toml -o /dev/full"), "/dev/full: cannot write");
    // No file may grow beyond so many blocks: the cache's fill up, and then the bundle.
    for (const char* blocks : {"1", "40", "300"}) {
        const std::string limit = std::string("ulimit -f ") + blocks;
        expect_one_line(run_in(folder, "build tiny.toml --cache cache", limit),
                        "tiny.sonocase: cannot write");
        for (const std::string& name : folder.names())
            EXPECT_EQ(name.find(".tmp"), std::string::npos) << name;
        EXPECT_EQ(read_text(folder / "tiny.sonocase"), "");
    }
    // What the cache kept is whole: the case is made of it.
    const CommandResult whole = run_in(folder, "build tiny.toml --cache cache");
    EXPECT_EQ(whole.status, 0) << whole.error;
    const CommandResult fresh = run_in(folder, "build tiny.toml -o fresh.sonocase");
    EXPECT_EQ(fresh.status, 0) << fresh.error;
    EXPECT_EQ(read_text(folder / "tiny.sonocase"), read_text(folder / "fresh.sonocase"));
    // An older bundle of the name stays as it was.
    const std::string kept = read_text(folder / "fresh.sonocase");
    expect_one_line(
        run_in(folder, "build tiny.toml --set case.seed=2 -o fresh.sonocase", "ulimit -f 300"),
        "cannot write");
    EXPECT_EQ(read_text(folder / "fresh.sonocase"), kept);
}

}  // namespace
