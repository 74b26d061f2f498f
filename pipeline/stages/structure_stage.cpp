// SPDX-License-Identifier: Apache-2.0

// structure: bakes what lies inside the organs and no label shows into echo offsets.
#include "pipeline/stages/structure_stage.h"

#include <array>
#include <string_view>

#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/stage_files.h"
#include "formats/text/stage_report_json.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/roles.h"

namespace sonocase::pipeline::inline stages {
namespace {

constexpr int kStructureVersion = 3;
constexpr std::string_view kEchoKind = "ECHO";
constexpr std::array<std::string_view, 5> kEchoChunks{"size", "table", "uniform", "pool", "report"};

OptionGroup options() {
    return OptionsOf<BakeStructureOptions>("structure")
        .toggle(
            "parenchyma", [](auto& o) { return &o.parenchyma; }, "grain of every soft tissue")
        .toggle(
            "liver_vessels", [](auto& o) { return &o.liver_vessels; },
            "portal and hepatic venous trees in the liver")
        .toggle(
            "kidney", [](auto& o) { return &o.kidney; },
            "cortex, pyramids and sinus fat of the kidneys")
        .toggle(
            "muscle_fibres", [](auto& o) { return &o.muscle_fibres; }, "fascicles of the muscles")
        .toggle(
            "fat_septa", [](auto& o) { return &o.fat_septa; }, "septa of the fat under the skin")
        .toggle(
            "bowel_wall", [](auto& o) { return &o.bowel_wall; },
            "layers of the bowel's wall, and its contents")
        .toggle(
            "fascia", [](auto& o) { return &o.fascia; }, "bright layer between muscle and fat");
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto labels, inputs.get(kLabels));
    SONOCASE_TRY(const auto used, inputs.get(kTissues));
    BakeStructureOptions options = inputs.options<BakeStructureOptions>();
    options.seed = case_seed(inputs.recipe().settings);
    // The same voxels with the tissues of the recipe; one byte per voxel is copied.
    LabelVolume volume = labels->volume;
    volume.labels = used->palette;
    SONOCASE_TRY(auto result, bake_structure_in_cells(volume, used->tissues, options, progress));
    return StageValue::of(kStructure, EchoOffsets{std::move(result.echo_offset), {result.report}});
}

Bytes encode(const EchoOffsets& offsets) {
    const Int3 size = offsets.offset.size;
    const std::vector<std::int32_t> sizes{size.x, size.y, size.z};
    std::string text;
    for (const StageReport& report : without_seconds(offsets.reports))
        text += stage_report_json(report);
    const Bytes report(text.begin(), text.end());
    ChunkWriter writer{std::string(kEchoKind)};
    writer.add_array("size", true, sizes);
    writer.add_array("table", true, offsets.offset.table);
    writer.add_array("uniform", true, offsets.offset.uniform);
    writer.add_array("pool", true, offsets.offset.pool);
    writer.add_view("report", true, report);
    return writer.write();
}

Result<EchoOffsets> decode(const Bytes& bytes, const std::string& where) {
    SONOCASE_TRY(auto reader, ChunkReader::open(bytes, kEchoKind, kEchoChunks, where));
    EchoOffsets result;
    SONOCASE_TRY(auto size, reader.read_array<std::int32_t>("size", 3));
    result.offset.size = {size[0], size[1], size[2]};
    SONOCASE_TRY(auto table, reader.read_array<std::uint32_t, RawVector<std::uint32_t>>(
                                 "table", reader.raw_bytes("table") / 4));
    SONOCASE_TRY(auto uniform,
                 reader.read_array<std::int8_t>("uniform", reader.raw_bytes("uniform")));
    SONOCASE_TRY(auto pool, reader.read_array<std::int8_t, RawVector<std::int8_t>>(
                                "pool", reader.raw_bytes("pool")));
    result.offset.table = std::move(table);
    result.offset.uniform = std::move(uniform);
    result.offset.pool = std::move(pool);
    SONOCASE_TRY(auto text, reader.read("report", reader.raw_bytes("report")));
    SONOCASE_TRY(
        auto report,
        parse_stage_report({reinterpret_cast<const char*>(text.data()), text.size()}, where));
    result.reports = {std::move(report)};
    return result;
}

// Depths are sampled every 2 and 3 mm, or in every voxel of coarser ones: 4.5 bytes for one of 1.4
// mm and 0.65 for one of 1 mm.
double more_mb(const CaseSize& size, bool) {
    return structure_depth_bytes(size.cooked_mm) * size.cooked_voxels;
}

StageVerb verb() {
    StageVerb verb;
    verb.files = {label_input(kLabels, "Cooked labels, as resample or smooth writes them")};
    verb.output_type = "OUT.labels";
    verb.output_meaning = "Where to write the labels with their echo offsets";
    verb.save = [](StageInputs& inputs, const StageValue& value,
                   const std::string& path) -> Status {
        SONOCASE_TRY(const auto labels, inputs.get(kLabels));
        const EchoOffsets& offsets = value.as(kStructure);
        LabelFile file = *labels;
        file.echo_offset = offsets.offset;
        file.reports = offsets.reports;
        return save_labels(file, labels->reports, path);
    };
    return verb;
}

}  // namespace

StageDescriptor structure_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kStructure;
    stage.version = kStructureVersion;
    stage.summary = "bake structure inside organs into cooked labels";
    stage.about = "Bake structure inside organs into the echo offsets of cooked labels";
    stage.takes = {kLabels, kTissues};
    stage.provides = kStructure;
    stage.options = options();
    stage.seeded = true;
    stage.run = run;
    stage.codec = codec_of(kStructure, encode, decode);
    stage.reports = reports_of(kStructure);
    stage.share = 0.2;
    stage.cost = {.threads = 2,
                  .base_mb = 93,
                  .per_cooked_voxel = 5,
                  .per_region_voxel = 1.5,
                  .more_mb = more_mb};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
