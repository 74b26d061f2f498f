// SPDX-License-Identifier: Apache-2.0

// flow: courses of the vessels, and the blood that runs through them.
#include "formats/bundle/codec/flow_codec.h"
#include "formats/bundle/stage_files.h"
#include "formats/container/chunk_file.h"
#include "formats/files/atomic_file.h"
#include "formats/text/stage_report_json.h"
#include "pipeline/flow/cook_flow.h"
#include "pipeline/flow/flow_table.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/label_codec.h"

#include <array>
#include <string_view>

namespace sonocase::pipeline {
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
            "flow through vessels whose names say nothing; 0: by their size")
        .choice(
            "unknown_wave", [](auto& o) { return &o.unknown_wave; }, {"steady", "artery", "vein"},
            "", "how that flow pulses");
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const auto labels = inputs.get<LabelFile>("labels");
    if (!labels) return labels.error();
    const auto used = inputs.get<CaseTissues>("tissues");
    if (!used) return used.error();
    // The same voxels with the tissues of the recipe; one byte per voxel is copied.
    LabelVolume volume = (*labels)->volume;
    volume.labels = (*used)->palette;
    auto result = cook_flow(volume, inputs.options<FlowOptions>("flow"), progress);
    if (!result) return result.error();
    return StageValue::of(std::move(*result));
}

Bytes encode(const FlowResult& result) {
    ChunkWriter writer{std::string(kFlowKind)};
    writer.add("flow", true, detail::flow_bytes(result.field));
    const std::string text = stage_report_json(without_seconds({result.report}).front());
    writer.add("report", true, Bytes(text.begin(), text.end()));
    return writer.write();
}

Result<FlowResult> decode(const Bytes& bytes, const std::string& where) {
    const auto reader = ChunkReader::open(bytes, kFlowKind, kFlowChunks, where);
    if (!reader) return reader.error();
    const auto flow = reader->read("flow", detail::kMaxFlowBytes);
    if (!flow) return flow.error();
    auto field = detail::flow_from_bytes(*flow, where);
    if (!field) return field.error();
    const auto text = reader->read("report", reader->raw_bytes("report"));
    if (!text) return text.error();
    auto report =
        parse_stage_report({reinterpret_cast<const char*>(text->data()), text->size()}, where);
    if (!report) return report.error();
    return FlowResult{std::move(*field), std::move(*report)};
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input("labels", "Cooked labels, as resample or smooth writes them")};
    verb.output_type = "OUT.csv";
    verb.output_meaning = "Where to write the table of the vessels";
    verb.save = [](StageInputs& inputs, const StageValue& value, const std::string& path) {
        return write_file(path, flow_table_csv(value.as<FlowResult>().field,
                                               inputs.options<FlowOptions>("flow").rate_per_min));
    };
    verb.pictures_meaning = "Folder for pictures of courses, profiles and waveforms";
    verb.draw = [](StageInputs& inputs, const StageValue& value, const std::string& folder) {
        return draw_flow(value.as<FlowResult>().field,
                         inputs.options<FlowOptions>("flow").rate_per_min, folder);
    };
    return verb;
}

}  // namespace

StageDescriptor flow_stage() {
    StageDescriptor stage;
    stage.name = "flow";
    stage.version = kFlowVersion;
    stage.summary = "find vessels and the blood that runs through them";
    stage.about = "Find the courses of labelled vessels and the blood that runs through them";
    stage.takes = {"labels", "tissues"};
    stage.provides = "flow";
    stage.options = options();
    stage.run = run;
    stage.codec = codec_of<FlowResult>(encode, decode);
    stage.reports = [](const StageValue& value) {
        return std::vector<StageReport>{value.as<FlowResult>().report};
    };
    stage.share = 0.03;
    stage.cost = {1, 240, 0, 0, 3};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline
