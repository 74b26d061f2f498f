// SPDX-License-Identifier: Apache-2.0

// texture: makes solid textures of the tissues that the labels are made of, and the speckle volume.
//
// The descriptor has no verb: pipeline/verbs/verb_texture.cpp does more than this stage.
#include "pipeline/stages/texture_stage.h"

#include <cmath>

#include "formats/bundle/stage_files.h"
#include "formats/files/thread_jobs.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/roles.h"
#include "pipeline/texture/speckle_volume.h"

namespace sonocase::pipeline::inline stages {
namespace {

constexpr int kTextureVersion = 1;

OptionGroup options() {
    return OptionsOf<TextureStageOptions>("texture")
        .choice(
            "edge", [](auto& o) { return &o.bank.edge; }, {"8", "16", "32", "64", "128"}, "voxels",
            "edge of the solid textures")
        .sweep({"texture",
                {"16", "32", "64", "128"},
                "coarse structure that does not fit",
                "coarse examples are thinned to fit small cubes, which changes the grain that is "
                "compared"})
        .number(
            "pixel_mm", [](auto& o) { return &o.bank.pixel_mm; }, 0.01, 10, "mm",
            "size of an example pixel in tissue")
        .choice(
            "speckle_edge", [](auto& o) { return &o.speckle_edge; },
            {"0", "8", "16", "32", "64", "128", "256"}, "voxels",
            "edge of the speckle volume; 0: none")
        .choice(
            "mode", [](auto& o) { return &o.mode; }, {"matched", "pyramid"}, "",
            "matched keeps direction, pyramid is eq. (15)")
        .help_group("Mode pyramid")
        .number(
            "levels", [](auto& o) { return &o.bank.pyramid.levels; }, 1, 5, "",
            "mode pyramid: levels of the pyramid")
        .number(
            "weight", [](auto& o) { return &o.bank.pyramid.weight; }, 0, 1, "",
            "mode pyramid: K_l of eq. (15)")
        .toggle(
            "decimate", [](auto& o) { return &o.bank.pyramid.decimate; },
            "mode pyramid: halve the resolution from level to level");
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    SONOCASE_TRY(const auto used, inputs.get(kTissues));
    const auto& options = inputs.options<TextureStageOptions>();
    const Recipe& recipe = inputs.recipe();
    TextureBankOptions bank = bank_options(options, case_seed(recipe.settings));
    bank.example_folder = recipe.resolve(recipe.inputs.examples);
    SONOCASE_TRY(auto result, build_texture_bank(used->tissues, bank, progress));
    TextureFile file{std::move(result.textures), {}, used->tissues, {result.report}};
    if (options.speckle_edge > 0) file.speckle = make_speckle(options.speckle_edge, bank.seed);
    return StageValue::of(kTextures, std::move(file));
}

// The transforms of the largest cubes that are matched to each other.
double more_mb(const CaseSize& size, bool) {
    return 31 * std::pow(size.texture_edge / 64, 3) + size.image_mb;
}

Bytes encode(const TextureFile& file) {
    TextureFile copy = file;
    copy.reports = without_seconds(copy.reports);
    ThreadJobs jobs;
    return write_texture_file(copy, jobs);
}

Result<TextureFile> decode(const Bytes& bytes, const std::string& where) {
    return read_texture_file(bytes, where);
}

}  // namespace

TextureBankOptions bank_options(const TextureStageOptions& options, std::uint64_t seed) {
    TextureBankOptions bank = options.bank;
    bank.mode = options.mode == "pyramid" ? TextureMode::pyramid : TextureMode::matched;
    bank.seed = seed;
    return bank;
}

StageDescriptor texture_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kTexture;
    stage.version = kTextureVersion;
    stage.takes = {kTissues};
    stage.provides = kTextures;
    stage.options = options();
    stage.seeded = true;
    stage.key_texts = [](const Recipe&, const InputDigests& digests) {
        return std::vector<std::string>{digests.examples};
    };
    stage.run = run;
    stage.codec = codec_of(kTextures, encode, decode);
    stage.reports = reports_of(kTextures);
    stage.share = 0.1;
    stage.cost = {.threads = 1, .per_cooked_voxel = 1.6, .more_mb = more_mb};
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
