// SPDX-License-Identifier: Apache-2.0

// flow: finds the courses of the vessels, and the blood that runs through them.
#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/stage_files.h"
#include "formats/files/atomic_file.h"
#include "formats/text/stage_report_json.h"
#include "pipeline/flow/cook_flow.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/roles.h"

#include <array>
#include <string_view>

namespace sonocase::pipeline::inline stages {
namespace {

constexpr std::string_view kFlowKind = "FLOW";
constexpr std::array<std::string_view, 2> kFlowChunks{"flow", "report"};

OptionGroup options() {
    return OptionsOf<FlowOptions>("flow")
        .toggle(
            "on", [](auto& o) { return &o.on; }, "blood flows in the vessels of the case")
        .number(
            "rate_per_min", [](auto& o) { return &o.rate_per_min; }, 30, 200, "/min",
            "heart rate at which peak velocities are fitted to normal ones")
        .number(
            "scale", [](auto& o) { return &o.scale; }, 0.05, 5, "", "scale of every flow")
        .number(
            "node_mm", [](auto& o) { return &o.node_mm; }, 1, 10, "mm",
            "between sections of a vessel")
        .number(
            "shortest_mm", [](auto& o) { return &o.shortest_mm; }, 10, 200, "mm",
            "vessels shorter than this are left out")
        .number(
            "unknown_ml_min", [](auto& o) { return &o.unknown_ml_min; }, 0, 10000, "mL/min",
            "flow through vessels of unknown name; 0: by their size")
        .choice(
            "unknown_wave", [](auto& o) { return &o.unknown_wave; }, {"steady", "artery", "vein"},
            "", "how the flow through vessels of unknown name pulses");
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    SONOCASE_TRY(const auto used, inputs.get(kTissues));
    // The same voxels with the tissues of the recipe; one byte per voxel is copied.
    LabelVolume volume = labels->volume;
    volume.labels = used->palette;
    SONOCASE_TRY(auto result, cook_flow(volume, inputs.options<FlowOptions>(), progress));
    return StageValue::of(kFlow, std::move(result));
}

Bytes encode(const FlowResult& result) {
    ChunkWriter writer{std::string(kFlowKind)};
    writer.add("flow", true, detail::flow_bytes(result.field));
    const std::string text = stage_report_json(without_seconds({result.report}).front());
    writer.add("report", true, Bytes(text.begin(), text.end()));
    return writer.write();
}

Result<FlowResult> decode(const Bytes& bytes, const std::string& where) {
    SONOCASE_TRY(const auto reader, ChunkReader::open(bytes, kFlowKind, kFlowChunks, where));
    SONOCASE_TRY(const auto flow, reader.read("flow", detail::kMaxFlowBytes));
    SONOCASE_TRY(auto field, detail::flow_from_bytes(flow, where));
    SONOCASE_TRY(const auto text, reader.read("report", reader.raw_bytes("report")));
    SONOCASE_TRY(
        auto report,
        parse_stage_report({reinterpret_cast<const char*>(text.data()), text.size()}, where));
    return FlowResult{std::move(field), std::move(report)};
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input(kLabels, "Cooked labels, as resample or smooth writes them")};
    verb.output_type = "OUT.csv";
    verb.output_meaning = "Where to write the table of the vessels";
    verb.save = [](StageInputs& inputs, const StageValue& value, const std::string& path) {
        return write_file(path, flow_table_csv(value.as(kFlow).field,
                                               inputs.options<FlowOptions>().rate_per_min));
    };
    verb.pictures_meaning = "Folder for pictures of courses, profiles and waveforms";
    verb.draw = [](StageInputs& inputs, const StageValue& value, const std::string& folder) {
        return draw_flow(value.as(kFlow).field, inputs.options<FlowOptions>().rate_per_min, folder);
    };
    return verb;
}

}  // namespace

StageDescriptor flow_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kFlow;
    stage.version = kFlowVersion;
    stage.summary = "find vessels and the blood that runs through them";
    stage.about = "Find the courses of labelled vessels and the blood that runs through them";
    stage.takes = {kLabels, kTissues};
    stage.provides = kFlow;
    stage.options = options();
    stage.run = run;
    stage.codec = codec_of(kFlow, encode, decode);
    stage.reports = reports_of(kFlow);
    stage.share = 0.03;
    stage.cost = {.threads = 1, .per_cooked_voxel = 3};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
