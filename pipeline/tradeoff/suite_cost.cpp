// SPDX-License-Identifier: Apache-2.0

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/files/atomic_file.h"
#include "pipeline/base/program_beside.h"
#include "pipeline/base/text.h"
#include "pipeline/tradeoff/suites.h"

namespace sonocase::pipeline::inline tradeoff {
namespace {

std::string recipe_text(const Settings& settings) {
    std::string map = "2", cooked = "1.5", region;
    for (const Setting& s : settings) {
        if (s.key == "cost.map_mm") map = s.value;
        if (s.key == "cost.voxel_mm") cooked = s.value;
        if (s.key == "cost.region_mm" && s.value != "off")
            region = "[[region]]\nlabel = \"liver\"\nvoxel_mm = " + s.value + "\n";
    }
    return "name = \"cost\"\n[analytic]\nvoxel_mm = " + map + "\nslice_mm = " + map +
           "\n[resample]\nvoxel_mm = " + cooked + "\n" + region;
}

// The time of one command from its start to the bundle on the disk, with an empty cache.
Result<Measured> build(TemporaryFolder& folder, const Settings& settings) {
    if (folder.path().empty()) SONOCASE_TRY_DONE(folder.make("sonocase-cost"));
    const std::string recipe = folder.path() + "/case.toml",
                      report = folder.path() + "/report.json";
    SONOCASE_TRY_DONE(write_file(recipe, recipe_text(settings)));
    SONOCASE_TRY_DONE(
        output_of_program_beside("sonocase",
                                 text("build '%s' -o '%s/cost.sonocase' --report '%s' --quiet 2>&1",
                                      recipe.c_str(), folder.path().c_str(), report.c_str()),
                                 "leave --suite cost out"));
    SONOCASE_TRY(const auto written, read_text_file(report));
    const auto json = nlohmann::json::parse(written, nullptr, false);
    if (json.is_discarded() || !json.contains("expected"))
        return Error{"is not the report of a build", report, ""};
    const auto& said = json["expected"];
    const double said_s = said.value("processor_seconds", 0.0),
                 said_mb = said.value("memory_mb", 0.0),
                 took_s = json.value("processor_seconds", 0.0),
                 took_mb = json.value("peak_mb", 0.0);
    if (!(took_s > 0 && took_mb > 0)) return Error{"has no seconds or no peak", report, ""};
    return Measured{100 * std::abs(said_s / took_s - 1), took_s,
                    text("said %.1f s and %.0f MB; peak %.0f MB, %+.0f %%", said_s, said_mb,
                         took_mb, 100 * (said_mb / took_mb - 1))};
}

}  // namespace

Suite cost_suite() {
    auto folder = std::make_shared<TemporaryFolder>();
    Suite suite;
    suite.name = "cost";
    suite.title = "Predicted cost of a build";
    suite.body = "demo-torso";
    suite.error_name = "error of the predicted seconds";
    suite.error_unit = "%";
    suite.truth =
        "A separate command builds the demo torso and predicts its processor seconds and its peak "
        "memory before it begins; both are compared with what it took, writing included.";
    const char* why = "neither error nor its sign follows the size: it is that of a fitted law";
    suite.knobs = {
        {"cost.voxel_mm",
         {"3", "2", "1.5", "1", "0.75"},
         "1.5",
         "mm",
         "edge of the cooked voxels",
         "surfaces between voxels (suite case)",
         why},
        {"cost.map_mm",
         {"4", "3", "2", "1.5", "1"},
         "2",
         "mm",
         "edge of the map's voxels",
         "nothing in the player",
         why},
        {"cost.region_mm",
         {"off", "0.75", "0.5", "0.4"},
         "off",
         "mm",
         "edge of the voxels of a region round the liver",
         "surfaces in the region (suite region)",
         why},
    };
    suite.measure = [folder](const Settings& settings) { return build(*folder, settings); };
    return suite;
}

}  // namespace sonocase::pipeline::inline tradeoff
