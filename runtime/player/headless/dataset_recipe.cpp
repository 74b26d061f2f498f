// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/headless/dataset_recipe.h"

#include "formats/exercise/exercise.h"
#include "formats/text/toml_reader.h"
#include "runtime/imaging/core/control_limits.h"

namespace sonocase::runtime::inline player_headless {
namespace {

void read_range(const TomlTable& table, const char* key, Range& to, double low, double high) {
    std::vector<double> two;
    table.numbers(key, two, low, high, 2, 2);
    if (two.size() != 2) return;
    to = {two[0], two[1]};
    if (!(to.low <= to.high)) table.add_fault(key, "falls", "expected [LOW, HIGH]");
}

void read_case(const TomlTable& table, std::vector<DatasetCase>& cases) {
    DatasetCase one;
    table.text("bundle", one.bundle);
    if (one.bundle.empty())
        table.add_fault("bundle", "is missing", "expected the path of a *.sonocase");
    table.text("split", one.split, {"train", "validate", "test"});
    table.texts("exercises", one.exercises, true);
    table.finish();
    cases.push_back(std::move(one));
}

void read_poses(const TomlTable& table, DatasetRecipe& r) {
    table.text("region", r.region, {"sweeps", "skin"});
    table.number("slide_mm", r.slide_mm, 0, 500);
    table.number("tilt_deg", r.tilt_deg, 0, 80);
    table.number("rock_deg", r.rock_deg, 0, 80);
    table.number("rotate_deg", r.rotate_deg, 0, 180);
    read_range(table, "pressed_mm", r.pressed_mm, -30, 60);
    read_range(table, "time_s", r.time_s, 0, 1e6);
    table.finish();
}

void read_machine(const TomlTable& table, DatasetRecipe& r) {
    table.text("model", r.model, {"physical", "paper"});
    table.texts("names", r.machines, true);
    table.numbers("depth_mm", r.depths_mm, 5, 500, 1, 64);
    read_range(table, "gain_db", r.gain_db, kGainDbLimits.min, kGainDbLimits.max);
    table.finish();
}

void read_needle(const TomlTable& table, DatasetRecipe& r) {
    table.number("share", r.needle_share, 0, 1);
    table.numbers("gauge", r.gauges, kMinGauge, kMaxGauge, 1, 64);
    read_range(table, "tip_depth_mm", r.tip_depth_mm, 0, 500);
    read_range(table, "angle_deg", r.needle_angle_deg, 0, 89);
    table.number("off_plane_mm", r.off_plane_mm, 0, 100);
    table.finish();
}

}  // namespace

Result<DatasetRecipe> parse_dataset_recipe(std::string_view toml, const std::string& where) {
    SONOCASE_TRY(const TomlTable root, TomlTable::parse(toml, where));
    DatasetRecipe r;
    root.text("name", r.name);
    root.text("format", r.format, {"png", "npy"});
    root.whole("chunk", r.chunk, 1, 10000);
    std::vector<double> size;
    root.numbers("size", size, 16, 4096, 2, 2);
    if (size.size() == 2) {
        r.width_px = static_cast<int>(size[0]);
        r.height_px = static_cast<int>(size[1]);
    }
    for (const TomlTable& item : root.tables("cases")) read_case(item, r.cases);
    if (r.cases.empty()) root.add_fault("cases", "is missing", "expected at least one [[cases]]");
    if (const auto table = root.table("poses")) read_poses(*table, r);
    if (const auto table = root.table("machine")) read_machine(*table, r);
    if (const auto table = root.table("needle")) read_needle(*table, r);
    root.finish();
    if (root.fault()) return *root.fault();
    return r;
}

}  // namespace sonocase::runtime::inline player_headless
