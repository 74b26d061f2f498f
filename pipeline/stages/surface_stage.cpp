// SPDX-License-Identifier: Apache-2.0

// surface: extracts the patient's skin from the labels, in the `ct` frame.
#include <array>
#include <string_view>

#include "formats/bundle/codec/chunk_file.h"
#include "formats/bundle/stage_files.h"
#include "formats/files/load_save.h"
#include "pipeline/registration/skin/skin_surface.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/roles.h"

namespace sonocase::pipeline::inline stages {
namespace {

constexpr int kSurfaceVersion = 1;
constexpr std::string_view kSkinKind = "SKIN";
constexpr std::array<std::string_view, 3> kSkinChunks{"surface", "rim", "box"};

OptionGroup options() {
    return OptionsOf<SkinSurfaceOptions>("surface")
        .number(
            "working_mm", [](auto& o) { return &o.working_mm; }, 0.5, 20, "mm",
            "edge of the voxels to which the body is averaged to find its skin")
        .sweep({"register",
                {"8", "5", "3", "2"},
                "where the skin is",
                "the labels themselves are sampled at 3 mm"})
        .sweep({"case",
                {"8", "5", "3", "2"},
                "the skin that is fitted",
                "the readings of the mannequin, not the skin, set the error"})
        .number(
            "smoothing_mm", [](auto& o) { return &o.smoothing_mm; }, 0, 20, "mm",
            "standard deviation of the skin's smoothing")
        .number(
            "bridge_mm", [](auto& o) { return &o.bridge_mm; }, 0, 100, "mm",
            "thickness below which sheets and bridges are not body")
        .number(
            "least_part", [](auto& o) { return &o.min_part; }, 0, 1, "",
            "share of a slice's largest part below which a part is an arm and not body");
}

Result<StageValue> run(StageInputs& inputs, const Progress&) {
    SONOCASE_TRY(const auto ct, inputs.get(kCtLabels));
    SONOCASE_TRY(auto skin, extract_skin_surface(ct->volume, inputs.options<SkinSurfaceOptions>()));
    return StageValue::of(kSkin, std::move(skin));
}

Bytes encode(const SkinSurfaceResult& skin) {
    const Bytes surface = write_surface_file({"ct", skin.skin, without_seconds({skin.report})});
    const Point3 low = skin.box.lower, high = skin.box.upper;
    const std::vector<double> box{low.x, low.y, low.z, high.x, high.y, high.z};
    ChunkWriter writer{std::string(kSkinKind)};
    writer.add_view("surface", true, surface);
    writer.add_array("rim", true, skin.on_rim);
    writer.add_array("box", true, box);
    return writer.write();
}

Result<SkinSurfaceResult> decode(const Bytes& bytes, const std::string& where) {
    SONOCASE_TRY(auto reader, ChunkReader::open(bytes, kSkinKind, kSkinChunks, where));
    SONOCASE_TRY(auto inner, reader.read("surface", reader.raw_bytes("surface")));
    SONOCASE_TRY(auto surface, read_surface_file(inner, where));
    SONOCASE_TRY(auto rim, reader.read_array<std::uint8_t>("rim", surface.surface.points.size()));
    SONOCASE_TRY(auto box, reader.read_array<double>("box", 6));
    if (surface.reports.size() != 1)
        return Error{"a skin without its report", where, "remove the file"};
    SkinSurfaceResult skin;
    skin.skin = std::move(surface.surface);
    skin.on_rim = std::move(rim);
    const std::vector<double>& b = box;
    skin.box.lower = {b[0], b[1], b[2]};
    skin.box.upper = {b[3], b[4], b[5]};
    skin.report = std::move(surface.reports[0]);
    return skin;
}

StageVerb verb() {
    StageVerb verb;
    verb.inputs = {
        {"--labels", "FILE", "Label map: NIfTI, NRRD, MetaImage, DICOM or a folder of masks", true,
         &RecipeInputs::labels},
        {"--table", "FILE.csv", "CSV of value,name[,tissue_class]", false,
         &RecipeInputs::label_table}};
    verb.output_type = "SKIN.surface";
    verb.output_meaning = "Where to write the skin";
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        const SkinSurfaceResult& skin = value.as(kSkin);
        return save_surface_file({"ct", skin.skin, without_seconds({skin.report})}, path);
    };
    return verb;
}

}  // namespace

StageDescriptor surface_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kSurface;
    stage.version = kSurfaceVersion;
    stage.summary = "extract the patient's skin from a label map";
    stage.about =
        "Extract the patient's skin: points, outward normals and triangles in the ct frame";
    stage.takes = {kCtLabels};
    stage.provides = kSkin;
    stage.options = options();
    stage.run = run;
    stage.codec = codec_of(kSkin, encode, decode);
    stage.reports = reports_of(kSkin);
    stage.share = 0.02;
    stage.cost = {.threads = 1, .per_label_voxel = 4};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
