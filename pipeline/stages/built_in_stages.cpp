// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/built_in_stages.h"

namespace sonocase::pipeline::inline stages {
namespace {

StageTable make_table() {
    StageTable table;
    table.stages = {mannequin_step(), import_stage(),   surface_stage(),   own_skin_step(),
                    warp_stage(),     resample_stage(), smooth_stage(),    pathology_stage(),
                    tissues_step(),   texture_stage(),  structure_stage(), flow_stage(),
                    pack_stage()};
    table.common = OptionsOf<CaseOptions>("case").number(
        "seed", [](auto& o) { return &o.seed; }, 0, 2e9, "",
        "seed of everything random in the case");
    table.presets = {
        {"draft", {{"resample.voxel_mm", "2"}, {"texture.edge", "32"}}},
        {"balanced", {{"resample.voxel_mm", "1"}, {"warp.uncertainty", "on"}}},
        {"accurate",
         {{"resample.voxel_mm", "0.75"}, {"surface.working_mm", "2"}, {"warp.uncertainty", "on"}}}};
    return table;
}

}  // namespace

const StageTable& built_in_stages() {
    static const StageTable table = make_table();
    return table;
}

std::uint64_t case_seed(const StageSettings& settings) {
    return static_cast<std::uint64_t>(settings.of<CaseOptions>().seed);
}

}  // namespace sonocase::pipeline::inline stages
