#include "pipeline/cook/cook_case.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/nearest_name.h"
#include "pipeline/cook/input_files.h"
#include "pipeline/cook/pack_case.h"
#include "pipeline/cook/stage_codecs.h"
#include "pipeline/cook/stage_runner.h"
#include "pipeline/import/label_map.h"
#include "pipeline/import/plausible_size.h"
#include "pipeline/import/surface_file.h"
#include "pipeline/registration/landmark_file.h"
#include "pipeline/texture/speckle.h"
#include "pipeline/texture/tissue_table.h"

namespace sonocase::pipeline {
namespace {

// Of stages whose headers name none. A change of what a stage computes raises its number, and with
// it every key of the cache that the stage has a part in.
constexpr int kSmoothVersion = 2;
constexpr int kTextureVersion = 1;
constexpr int kStructureVersion = 1;

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

std::string number_text(double value) {
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", value);
    return text;
}

// Everything of the analytic torso that a result can depend on.
std::string analytic_text(const AnalyticInput& in) {
    std::string text = "analytic";
    for (const double value :
         {in.body.width_scale, in.body.depth_scale, in.body.belly_mm, in.voxel_mm, in.slice_mm,
          in.mannequin.noise_mm, in.mannequin.strength, static_cast<double>(in.mannequin.points),
          static_cast<double>(in.body.warp), static_cast<double>(in.landmarks),
          in.landmark_noise_mm, in.mannequin.mesh ? 1.0 : 0.0, in.mannequin.front_only ? 1.0 : 0.0,
          static_cast<double>(in.mannequin.seed)})
        text += " " + number_text(value);
    return text;
}

std::string tissues_text(const std::vector<Tissue>& tissues) {
    std::string text;
    for (const Tissue& t : tissues) {
        text += t.name + "|" + t.texture + "|" + std::to_string(static_cast<int>(t.kind)) + "|" +
                (t.casts_shadow ? "1" : "0");
        for (const double value : {t.grey_mean, t.grey_sd, t.echo_db, t.structure_db,
                                   t.attenuation_db_cm_mhz, t.impedance_mrayl, t.sound_speed_m_s})
            text += "|" + number_text(value);
        text += "\n";
    }
    return text;
}

std::string palette_text(const std::vector<Label>& labels) {
    std::string text;
    for (const Label& label : labels) text += label.name + "=" + label.tissue + "\n";
    return text;
}

std::string hint_text(const RecipeInputs& in) {
    if (in.analytic && in.torso.known_map) return "known";
    if (!in.up) return "";
    return "up " + number_text(in.up->x) + " " + number_text(in.up->y) + " " +
           number_text(in.up->z);
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

}  // namespace

Result<double> cooked_volume_mm3(const Recipe& recipe) {
    auto mannequin = mannequin_of(recipe, nullptr);
    if (!mannequin) return mannequin.error();
    Box3 box;
    for (const Point3 p : mannequin->points) box.include(p);
    const Vector3 e = box.extent();
    return e.x * e.y * e.z;
}

Result<CookResult> cook_case(const Recipe& recipe,
                             const CookOptions& options,
                             const Progress& progress) {
    StageRunner cook(options, progress);
    const StageOptions& stage = recipe.options;
    const RecipeInputs& in = recipe.inputs;

    std::vector<InputHash> inputs;
    const auto input_digest = [&](const std::string& given) -> Result<std::string> {
        if (given.empty()) return std::string();
        auto digest = digest_of_input(recipe.resolve(given));
        if (digest) inputs.push_back({given, *digest});
        return digest;
    };

    // Inputs. Every file is looked at before the first long stage.
    std::string labels_key = analytic_text(in.torso), surface_key = labels_key, examples_key;
    if (!in.analytic) {
        auto labels = input_digest(in.labels);
        if (!labels) return labels.error();
        auto table = input_digest(in.label_table);
        if (!table) return table.error();
        auto surface = input_digest(in.surface);
        if (!surface) return surface.error();
        labels_key = *labels + " " + *table + " " + number_text(in.labels_scale);
        surface_key = *surface + " " + number_text(in.surface_scale);
    }
    auto examples = input_digest(in.examples);
    if (!examples) return examples.error();
    auto landmarks_key = input_digest(in.landmarks);
    if (!landmarks_key) return landmarks_key.error();
    StageReport surface_report;
    auto mannequin = mannequin_of(recipe, &surface_report);
    if (!mannequin) return mannequin.error();

    auto imported =
        cook.run<LabelCodec>("import", kImportVersion, {labels_key}, 0.03,
                             [&](const Progress& p) { return import_labels(recipe, p); });
    if (!imported) return imported.error();
    for (const std::string& warning : surface_report.warnings)
        cook.runs.back().report.warnings.push_back("surface: " + warning);
    LabelFile& ct = imported->value;
    if (auto status = assign_tissues(recipe, ct.volume.labels); !status) return status.error();
    Box3 mannequin_box;
    for (const Point3 p : mannequin->points) mannequin_box.include(p);
    if (const auto error = check_same_unit(body_box(ct.volume).extent(), mannequin_box.extent(),
                                           in.analytic ? "(analytic)" : recipe.resolve(in.surface)))
        return *error;

    // Surface and registration.
    const StageClock surface_clock;
    auto skin = extract_skin_surface(ct.volume, stage.surface);
    if (!skin) return skin.error();
    skin->report.seconds = surface_clock.seconds();
    cook.runs.push_back({skin->report, "", false});
    auto registered = cook.run<RegistrationCodec>(
        "warp", kRegisterVersion,
        {imported->digest, surface_key, *landmarks_key, hint_text(in),
         canonical_options("surface", stage), canonical_options("align", stage),
         canonical_options("warp", stage), canonical_options("case", stage)},
        0.2, [&](const Progress& p) -> Result<Registration> {
            return fit(recipe, *skin, *mannequin, p);
        });
    if (!registered) return registered.error();
    const Registration& registration = registered->value;

    // Volumes.
    auto resampled = cook.run<LabelCodec>(
        "resample", kResampleVersion,
        {imported->digest, registered->digest, canonical_options("resample", stage)}, 0.4,
        [&](const Progress& p) -> Result<LabelFile> {
            auto result = resample_labels({ct.volume, registration}, stage.resample, p);
            if (!result) return result.error();
            return LabelFile{"mannequin",
                             std::move(result->volume),
                             std::move(result->boundary),
                             {},
                             {result->report}};
        });
    if (!resampled) return resampled.error();

    const std::string& method = stage.smooth_method;
    LabelFile cooked = std::move(resampled->value);
    std::string cooked_digest = resampled->digest;
    if (method == "joint" || method == "level_set" ||
        (method == "auto" && stage.resample.method == "nearest")) {
        auto smoothed = cook.run<LabelCodec>(
            "smooth", kSmoothVersion, {cooked_digest, canonical_options("smooth", stage)}, 0.1,
            [&](const Progress& p) -> Result<LabelFile> {
                SmoothOptions smooth = stage.smooth;
                smooth.method = method == "level_set" ? "level_set" : "joint";
                auto result = smooth_labels(cooked.volume, smooth, p);
                if (!result) return result.error();
                return LabelFile{"mannequin",
                                 std::move(result->volume),
                                 std::move(result->boundary),
                                 {},
                                 {result->report}};
            });
        if (!smoothed) return smoothed.error();
        cooked = std::move(smoothed->value);
        cooked_digest = smoothed->digest;
    }

    // Textures and structure.
    std::vector<Label>& palette = cooked.volume.labels;
    if (auto status = assign_tissues(recipe, palette); !status) return status.error();
    const std::vector<Tissue> tissues = used_tissues(recipe.tissues, palette);
    const std::string tissue_key = tissues_text(tissues) + palette_text(palette);
    auto textures = cook.run<TextureCodec>(
        "texture", kTextureVersion,
        {*examples, tissue_key, canonical_options("texture", stage),
         canonical_options("case", stage)},
        0.1, [&](const Progress& p) -> Result<TextureFile> {
            TextureBankOptions bank = stage.texture.bank;
            bank.mode =
                stage.texture_mode == "pyramid" ? TextureMode::pyramid : TextureMode::matched;
            bank.example_folder = recipe.resolve(in.examples);
            bank.seed = static_cast<std::uint64_t>(stage.seed);
            auto result = build_texture_bank(tissues, bank, p);
            if (!result) return result.error();
            return TextureFile{std::move(result->textures),
                               make_speckle(stage.texture.speckle_edge, bank.seed),
                               tissues,
                               {result->report}};
        });
    if (!textures) return textures.error();
    auto structure = cook.run<EchoCodec>(
        "structure", kStructureVersion,
        {cooked_digest, tissue_key, canonical_options("structure", stage),
         canonical_options("case", stage)},
        0.2, [&](const Progress& p) -> Result<EchoOffsets> {
            BakeStructureOptions bake = stage.structure;
            bake.seed = static_cast<std::uint64_t>(stage.seed);
            auto result = bake_structure(cooked.volume, tissues, bake, p);
            if (!result) return result.error();
            return EchoOffsets{std::move(result->echo_offset), {result->report}};
        });
    if (!structure) return structure.error();
    cooked.echo_offset = std::move(structure->value.offset);

    // Pack.
    const StageClock pack_clock;
    tell(progress, 0.95, "packing");
    auto packed = pack_case({recipe.name, recipe.text, recipe.exercises, &skin->skin, &registration,
                             *mannequin, cooked, textures->value, tissues});
    if (!packed) return packed.error();
    packed->report.seconds = pack_clock.seconds();
    cook.runs.push_back({packed->report, "", false});

    CookResult result{std::move(packed->bundle), std::move(cook.runs)};
    CaseManifest& manifest = result.bundle.manifest;
    manifest.producer = options.producer;
    manifest.inputs = std::move(inputs);
    for (const StageRun& run : result.stages) {
        manifest.stages.push_back(run.report);
        manifest.stages.back().seconds = 0;
        // What happened in the cache is this run's story, not the bundle's.
        std::erase_if(manifest.stages.back().warnings,
                      [](const std::string& w) { return w.find("cache") != std::string::npos; });
    }
    tell(progress, 1, "done");
    return result;
}

}  // namespace sonocase::pipeline
