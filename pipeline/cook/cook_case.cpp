// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/cook_case.h"

#include <algorithm>
#include <optional>

#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/structure_cells.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/plausible_size.h"
#include "pipeline/cook/error_budget.h"
#include "pipeline/cook/input_files.h"
#include "pipeline/cook/pack_case.h"
#include "pipeline/cook/stage_codecs.h"
#include "pipeline/cook/stage_runner.h"
#include "pipeline/import/label_map.h"
#include "pipeline/import/surface/surface_file.h"
#include "pipeline/registration/landmark_file.h"
#include "pipeline/texture/speckle.h"

namespace sonocase::pipeline {
namespace {

// The recipe's [labels] laid over the built-in choice of tissues.
Status assign_tissues(const Recipe& recipe, std::vector<Label>& labels) {
    std::vector<std::string> names, tissues;
    for (const Label& label : labels) names.push_back(label.name);
    for (const Tissue& tissue : recipe.tissues) tissues.push_back(tissue.name);
    const auto known_class = total_segmentator_labels();
    for (const LabelChoice& choice : recipe.labels) {
        const std::string where = recipe.path + ":" + std::to_string(choice.line);
        if (std::find(tissues.begin(), tissues.end(), choice.tissue) == tissues.end())
            return Error{"unknown tissue '" + choice.tissue + "'", where,
                         suggest_name(choice.tissue, tissues)};
        const auto found = std::find(names.begin(), names.end(), choice.label);
        if (found == names.end()) {
            // A recipe may serve many patients; a class that this one lacks is no typo.
            if (std::find(known_class.begin(), known_class.end(), choice.label) !=
                known_class.end())
                continue;
            return Error{"label '" + choice.label + "' is not in the label map", where,
                         suggest_name(choice.label, names)};
        }
        labels[static_cast<std::size_t>(found - names.begin())].tissue = choice.tissue;
    }
    return Done{};
}

Result<LabelFile> import_labels(const Recipe& recipe, const Progress& progress) {
    LabelFile file;
    file.frame = "ct";
    const RecipeInputs& in = recipe.inputs;
    if (in.analytic) {
        const double across = in.torso.voxel_mm;
        file.volume = sample_analytic_torso(
            analytic_torso_grid({across, across, in.torso.slice_mm}), in.torso.body);
        StageReport report;
        report.stage = "import";
        report.version = kImportVersion;
        const Vector3 extent = body_box(file.volume).extent();
        report.measures = {{"labels", static_cast<double>(file.volume.labels.size() - 1)},
                           {"voxel_volume_mm3", file.volume.grid.voxel_volume_mm3()},
                           {"body_width_mm", extent.x},
                           {"body_depth_mm", extent.y},
                           {"body_height_mm", extent.z}};
        file.reports = {report};
    } else {
        ImportOptions options;
        options.table = recipe.resolve(in.label_table);
        options.scale = in.labels_scale;
        auto imported = import_label_map(recipe.resolve(in.labels), options, progress);
        if (!imported) return imported.error();
        file.volume = std::move(imported->labels);
        file.reports = {imported->report};
    }
    return file;
}

// The map from the patient to the mannequin. The analytic torso may take its own, which is exact.
Result<Registration> fit(const Recipe& recipe,
                         const SkinSurfaceResult& skin,
                         const Surface& mannequin,
                         const Progress& progress) {
    if (recipe.inputs.analytic && recipe.inputs.torso.known_map) {
        Registration registration =
            analytic_torso_truth(recipe.inputs.torso.mannequin.strength, recipe.inputs.torso.body);
        StageReport report;
        report.stage = "warp";
        report.version = kRegisterVersion;
        report.warnings = {"the map is the analytic torso's own and was not fitted"};
        registration.reports = {report};
        return registration;
    }
    RegisterOptions options = recipe.options.fit;
    options.seed = static_cast<std::uint64_t>(recipe.options.seed);
    options.up = recipe.inputs.up;
    if (!recipe.inputs.landmarks.empty()) {
        auto landmarks = load_landmarks(recipe.resolve(recipe.inputs.landmarks));
        if (!landmarks) return landmarks.error();
        options.landmarks = std::move(*landmarks);
    }
    if (recipe.inputs.analytic) {
        const AnalyticInput& in = recipe.inputs.torso;
        for (const AnalyticLandmark& mark :
             analytic_torso_landmarks(in.landmarks, in.landmark_noise_mm, in.mannequin, in.body))
            options.landmarks.push_back({mark.name, mark.ct, mark.mannequin});
    }
    auto result = register_surfaces({skin, mannequin}, options, progress);
    if (!result) return result.error();
    return std::move(result->registration);
}

Result<Surface> mannequin_of(const Recipe& recipe, StageReport* report) {
    if (recipe.inputs.analytic)
        return analytic_torso_mannequin(recipe.inputs.torso.mannequin, recipe.inputs.torso.body);
    SurfaceFileOptions options;
    options.scale = recipe.inputs.surface_scale;
    return import_surface(recipe.resolve(recipe.inputs.surface), options, report);
}

// The tissues that the palette uses, in the table's order, outside first.
std::vector<Tissue> used_tissues(const std::vector<Tissue>& all, const std::vector<Label>& labels) {
    std::vector<Tissue> used;
    for (const Tissue& tissue : all) {
        const bool wanted = tissue.name == "outside" ||
                            std::any_of(labels.begin(), labels.end(), [&](const Label& label) {
                                return label.tissue == tissue.name;
                            });
        if (wanted) used.push_back(tissue);
    }
    return used;
}

Vector3 extent(const Surface& surface) {
    Box3 box;
    for (const Point3 p : surface.points) box.include(p);
    return box.extent();
}

template <class T>
const Error* failed(const Result<T>& result) {
    return result ? nullptr : &result.error();
}

// What is wrong with where the cook is to stop.
std::optional<Error> check_goal(const std::vector<PlannedStage>& stages,
                                const CookOptions& options,
                                const std::string& where) {
    const std::string until = options.until.empty() ? "pack" : options.until;
    std::vector<std::string> names;
    for (const PlannedStage& stage : stages) names.push_back(stage.stage);
    const auto found = std::find(names.begin(), names.end(), until);
    if (found == names.end())
        return Error{"this case has no stage '" + until + "'", where, suggest_name(until, names)};
    if (until != "pack" && options.cache_folder.empty())
        return Error{"stopping at " + until + " leaves nothing behind", "", "give --cache"};
    const auto index = static_cast<std::size_t>(found - names.begin());
    if (!options.plan_key.empty() && options.plan_key != stages[index].plan_key)
        return Error{"recipe or inputs of " + until + " have changed since the plan was made",
                     where, "plan again"};
    return std::nullopt;
}

}  // namespace

Result<double> cooked_volume_mm3(const Recipe& recipe) {
    auto mannequin = mannequin_of(recipe, nullptr);
    if (!mannequin) return mannequin.error();
    const Vector3 e = extent(*mannequin);
    return e.x * e.y * e.z;
}

Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options,
                             const Progress& progress) {
    StageRunner cook(options, progress);
    const StageOptions& option = recipe.options;
    const std::string input_name =
        recipe.inputs.analytic ? "(analytic)" : recipe.resolve(recipe.inputs.surface);

    // Inputs. Every file is looked at before the first long stage.
    auto inputs =
        digest_inputs(recipe, [](const std::string& path) { return digest_of_input(path); });
    if (!inputs) return inputs.error();
    const std::vector<PlannedStage> stages = plan_stages(recipe, *inputs);
    if (const auto error = check_goal(stages, options, recipe.path)) return *error;
    const auto stage = [&](std::string_view name) -> const PlannedStage& {
        return *std::find_if(stages.begin(), stages.end(),
                             [&](const PlannedStage& s) { return s.stage == name; });
    };
    const auto stopped = [&](const std::string& digest) {
        return CookResult{{}, std::move(cook.runs), digest};
    };
    StageReport surface_report;
    std::optional<Surface> mannequin;
    const auto need_mannequin = [&]() -> Status {
        if (mannequin) return Done{};
        auto read = mannequin_of(recipe, &surface_report);
        if (!read) return read.error();
        mannequin = std::move(*read);
        return Done{};
    };
    if (cook.whole())
        if (auto status = need_mannequin(); !status) return status.error();

    auto imported = cook.run<LabelCodec>(
        stage("import"), {}, 0.03, [&](const Progress& p) { return import_labels(recipe, p); });
    if (!imported) return imported.error();
    if (cook.wants("import")) {
        for (const std::string& warning : surface_report.warnings)
            cook.runs.back().report.warnings.push_back("surface: " + warning);
        // A recipe's mistake in labels is told now; its tissues are of the palette that comes out.
        auto ct = imported->get();
        if (!ct) return ct.error();
        std::vector<Label> labels = (*ct)->volume.labels;
        if (auto status = assign_tissues(recipe, labels); !status) return status.error();
    }
    if (options.until == "import") return stopped(imported->digest);

    // Surface and registration.
    auto skin = cook.run<SkinCodec>(stage("surface"), {imported->digest}, 0.02,
                                    [&](const Progress&) -> Result<SkinSurfaceResult> {
                                        auto ct = imported->get();
                                        if (!ct) return ct.error();
                                        return extract_skin_surface((*ct)->volume, option.surface);
                                    });
    if (!skin) return skin.error();
    if (options.until == "surface") return stopped(skin->digest);
    auto registered = cook.run<RegistrationCodec>(
        stage("warp"), {skin->digest}, 0.18, [&](const Progress& p) -> Result<Registration> {
            if (auto status = need_mannequin(); !status) return status.error();
            auto ct_skin = skin->get();
            if (!ct_skin) return ct_skin.error();
            if (const auto error =
                    check_same_unit(extent((*ct_skin)->skin), extent(*mannequin), input_name))
                return *error;
            return fit(recipe, **ct_skin, *mannequin, p);
        });
    if (!registered) return registered.error();
    if (options.until == "warp") return stopped(registered->digest);

    // Volumes.
    auto resampled = cook.run<LabelCodec>(
        stage("resample"), {imported->digest, registered->digest}, 0.4,
        [&](const Progress& p) -> Result<LabelFile> {
            auto ct = imported->get();
            if (!ct) return ct.error();
            auto registration = registered->get();
            if (!registration) return registration.error();
            auto result = resample_labels({(*ct)->volume, **registration}, option.resample, p);
            if (!result) return result.error();
            return LabelFile{"mannequin",
                             std::move(result->volume),
                             std::move(result->boundary),
                             {},
                             {result->report}};
        });
    if (!resampled) return resampled.error();
    imported->drop();
    if (options.until == "resample") return stopped(resampled->digest);
    Made<LabelCodec>* last = &*resampled;

    std::optional<Made<LabelCodec>> smoothed;
    if (stages[4].stage == "smooth") {
        auto made = cook.run<LabelCodec>(
            stage("smooth"), {resampled->digest}, 0.1, [&](const Progress& p) -> Result<LabelFile> {
                auto before = resampled->get();
                if (!before) return before.error();
                SmoothOptions smooth = option.smooth;
                smooth.method = option.smooth_method == "level_set" ? "level_set" : "joint";
                auto result = smooth_labels((*before)->volume, smooth, p);
                if (!result) return result.error();
                return LabelFile{"mannequin",
                                 std::move(result->volume),
                                 std::move(result->boundary),
                                 {},
                                 {result->report}};
            });
        if (!made) return made.error();
        smoothed = std::move(*made);
        last = &*smoothed;
        resampled->drop();
    }
    if (options.until == "smooth") return stopped(last->digest);

    // Textures and structure.
    auto cooked_file = last->get();
    if (!cooked_file) return cooked_file.error();
    LabelFile& cooked = **cooked_file;
    std::vector<Label>& palette = cooked.volume.labels;
    if (auto status = assign_tissues(recipe, palette); !status) return status.error();
    const std::vector<Tissue> tissues = used_tissues(recipe.tissues, palette);
    const std::string tissue_key = tissues_text(tissues) + palette_text(palette);
    std::optional<Made<TextureCodec>> textures;
    if (cook.wants("texture")) {
        auto made = cook.run<TextureCodec>(
            stage("texture"), {tissue_key}, 0.1, [&](const Progress& p) -> Result<TextureFile> {
                TextureBankOptions bank = option.texture.bank;
                bank.mode =
                    option.texture_mode == "pyramid" ? TextureMode::pyramid : TextureMode::matched;
                bank.example_folder = recipe.resolve(recipe.inputs.examples);
                bank.seed = static_cast<std::uint64_t>(option.seed);
                auto result = build_texture_bank(tissues, bank, p);
                if (!result) return result.error();
                return TextureFile{std::move(result->textures),
                                   make_speckle(option.texture.speckle_edge, bank.seed),
                                   tissues,
                                   {result->report}};
            });
        if (!made) return made.error();
        textures = std::move(*made);
        if (options.until == "texture") return stopped(textures->digest);
    }
    auto structure = cook.run<EchoCodec>(
        stage("structure"), {last->digest, tissue_key}, 0.2,
        [&](const Progress& p) -> Result<EchoOffsets> {
            BakeStructureOptions bake = option.structure;
            bake.seed = static_cast<std::uint64_t>(option.seed);
            auto result = bake_structure_in_cells(cooked.volume, tissues, bake, p);
            if (!result) return result.error();
            return EchoOffsets{std::move(result->echo_offset), {result->report}};
        });
    if (!structure) return structure.error();
    if (options.until == "structure") return stopped(structure->digest);

    // Pack. All answers are there.
    auto echo = structure->get();
    auto bank = textures->get();
    auto ct_skin = skin->get();
    auto registration = registered->get();
    for (const Error* error : {failed(echo), failed(bank), failed(ct_skin), failed(registration)})
        if (error != nullptr) return *error;
    cooked.echo_offset = std::move((*echo)->offset);
    const StageClock pack_clock;
    report_progress(progress, 0.95, "packing");
    auto packed = pack_case({recipe.name, recipe.text, recipe.exercises, &(*ct_skin)->skin,
                             *registration, *mannequin, cooked, **bank, tissues});
    if (!packed) return packed.error();
    packed->report.seconds = pack_clock.seconds();
    std::vector<StageReport> so_far;
    for (const StageRun& run : cook.runs) so_far.push_back(run.report);
    const ErrorBudget budget = error_budget(so_far);
    for (const BudgetEntry& entry : budget.entries)
        if (std::isfinite(entry.mm))
            packed->report.measures.push_back({entry.stage + "_error_mm", entry.mm});
    packed->report.measures.push_back({"known_error_mm", budget.known_mm});
    cook.runs.push_back({packed->report, "", false});

    CookResult result{std::move(packed->bundle), std::move(cook.runs), ""};
    CaseManifest& manifest = result.bundle.manifest;
    manifest.producer = options.producer;
    manifest.inputs = std::move(inputs->files);
    for (const StageRun& run : result.stages) {
        manifest.stages.push_back(run.report);
        manifest.stages.back().seconds = 0;
        // What happened in the cache is this run's story, not the bundle's.
        std::erase_if(manifest.stages.back().warnings,
                      [](const std::string& w) { return w.find("cache") != std::string::npos; });
    }
    report_progress(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline
