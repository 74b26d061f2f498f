// SPDX-License-Identifier: Apache-2.0

#include "pipeline/verbs/register_inputs.h"

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>

#include "formats/text/number_text.h"
#include "pipeline/import/surface/surface_file.h"
#include "pipeline/recipe/read_recipe.h"
#include "pipeline/registration/landmark_file.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/import_inputs.h"
#include "pipeline/verbs/stage/option_flags.h"

namespace sonocase::pipeline {
namespace {

// What becomes of a dense scan, without its size.
std::vector<Measure> reduction_of(const StageReport& report) {
    std::vector<Measure> reduction;
    for (const Measure& m : report.measures) {
        if (m.name.starts_with("given_") || m.name.starts_with("reduction_") ||
            m.name == "small_parts" || m.name == "sparse_points")
            reduction.push_back(m);
    }
    return reduction;
}

}  // namespace

Result<Vector3> parse_direction(const std::string& text, const char* flag) {
    Vector3 v;
    std::string_view rest = text;
    for (int axis = 0; axis < 3; ++axis) {
        const std::size_t comma = axis < 2 ? rest.find(',') : rest.size();
        if (comma == std::string_view::npos || !parse_number(rest.substr(0, comma), v[axis]) ||
            !std::isfinite(v[axis])) {
            return Error{"'" + text + "' is not a direction", flag,
                         "three numbers X,Y,Z, e.g. 0,1,0"};
        }
        rest = rest.substr(std::min(rest.size(), comma + 1));
    }
    if (!(norm(v) > 1e-9)) {
        return Error{"'" + text + "' has no length", flag,
                     "a direction of the patient in the surface's frame, e.g. 0,1,0"};
    }
    return v;
}

RegisterArguments::RegisterArguments() {
    recipe.settings = StageSettings(built_in_stages());
}

Status take_recipe(int argc, char** argv, RegisterArguments& a) {
    // CLI11 reads these two again, for the help and for typing errors.
    const auto value_of = [&](std::string_view flag) -> std::string {
        for (int n = 1; n < argc; ++n) {
            const std::string_view word = argv[n];
            if (word == flag && n + 1 < argc) return argv[n + 1];
            if (word.starts_with(flag) && word.size() > flag.size() && word[flag.size()] == '=')
                return std::string(word.substr(flag.size() + 1));
        }
        return {};
    };
    const std::string path = value_of("--recipe");
    if (path.empty()) return Done{};
    RecipeOverrides overrides;
    overrides.data = value_of("--data");
    auto recipe = load_recipe(path, overrides);
    if (!recipe) return recipe.error();
    RecipeInputs& in = recipe->inputs;
    if (in.analytic)
        return Error{"the recipe names no files: it has [analytic]", path,
                     "expected [inputs] with labels and surface"};
    for (std::string* file : {&in.labels, &in.label_table, &in.surface, &in.landmarks})
        if (!file->empty()) *file = recipe->resolve(*file);
    recipe->folder.clear();  // paths of flags start from the working folder
    recipe->data.clear();
    a.recipe = std::move(*recipe);
    if (!a.recipe.inputs.surface.empty()) a.surfaces = {a.recipe.inputs.surface};
    return Done{};
}

void add_register_options(CLI::App& app, RegisterArguments& a, bool several) {
    RecipeInputs& in = a.recipe.inputs;
    app.add_option("--recipe", a.recipe_path,
                   "Take inputs and options of a recipe, case.toml or its folder; flags go before")
        ->type_name("CASE.toml");
    app.add_option("--data", a.data, "Folder that the recipe's input paths start from")
        ->type_name("DIR");
    app.add_option("--labels", in.labels,
                   "Label map: NIfTI, NRRD, MetaImage, DICOM or a folder of masks; or organ meshes")
        ->type_name("FILE")
        ->required(in.labels.empty());
    auto* surface =
        app.add_option("--surface", a.surfaces,
                       several ? "Mannequin: PLY, STL, OBJ, VTP, or CSV of readings; of several, "
                                 "the one that fits best is taken"
                               : "Mannequin: PLY, STL, OBJ, VTP, or CSV of readings")
            ->type_name("FILE")
            ->required(a.surfaces.empty());
    surface->expected(1, several ? 100 : 1);
    app.add_option("--table", in.label_table, "CSV of value,name[,tissue_class] for the label map")
        ->type_name("FILE.csv");
    app.add_option("--up", a.up, "The patient's head direction in the surface's frame")
        ->type_name("X,Y,Z");
    app.add_option("--landmarks", in.landmarks, "Rows name,ct_x,ct_y,ct_z,x,y,z in mm")
        ->type_name("FILE.csv");
    app.add_option("--scale", in.surface_scale, "Millimetres per unit of the surface file")
        ->check(CLI::Range(kSmallestScale, kLargestScale))
        ->capture_default_str();
    const StageTable& table = a.recipe.settings.table();
    add_option_flags(app, table.common, a.recipe.settings.options(table.common.name));
    add_option_flags(app, table.find("warp")->options, a.recipe.settings.options("warp"));
    add_common_options(app, a.common);
}

Result<RegisterInputs> read_register_inputs(const RegisterArguments& a, const Progress& progress) {
    const Stopwatch watch;
    const RecipeInputs& in = a.recipe.inputs;
    const std::string mannequin = a.surfaces.front();
    RegisterInputs inputs;
    inputs.options = a.recipe.settings.of<RegisterOptions>("warp");
    inputs.options.seed = case_seed(a.recipe);
    if (in.up) inputs.options.up = *in.up;
    if (!a.up.empty()) {
        const Result<Vector3> up = parse_direction(a.up, "--up");
        if (!up) return up.error();
        inputs.options.up = *up;
    }
    if (!in.landmarks.empty()) {
        Result<std::vector<Landmark>> landmarks = load_landmarks(in.landmarks);
        if (!landmarks) return landmarks.error();
        inputs.options.landmarks = std::move(*landmarks);
    }
    StageReport surface_report;
    Result<Surface> surface = import_surface(mannequin, {in.surface_scale}, &surface_report);
    if (!surface) return surface.error();
    inputs.mannequin = std::move(*surface);
    inputs.reduction = reduction_of(surface_report);
    Result<ImportedLabels> labels =
        import_inputs(a.recipe, a.recipe.settings.of<MeshImportOptions>("import"), progress);
    if (!labels) return labels.error();
    inputs.warnings = surface_report.warnings;
    inputs.warnings.insert(inputs.warnings.end(), labels->report.warnings.begin(),
                           labels->report.warnings.end());
    inputs.import_seconds = watch.seconds();
    Result<SkinSurfaceResult> skin =
        extract_skin_surface(labels->labels, a.recipe.settings.of<SkinSurfaceOptions>("surface"));
    if (!skin) {
        Error error = skin.error();
        if (error.where.empty()) error.where = in.labels;
        return error;
    }
    inputs.skin = std::move(*skin);
    inputs.labels = std::move(labels->labels);
    inputs.warnings.insert(inputs.warnings.end(), inputs.skin.report.warnings.begin(),
                           inputs.skin.report.warnings.end());
    return inputs;
}

Status read_other_mannequin(const RegisterArguments& a,
                            const std::string& path,
                            RegisterInputs& inputs) {
    StageReport report;
    Result<Surface> surface = import_surface(path, {a.recipe.inputs.surface_scale}, &report);
    if (!surface) return surface.error();
    inputs.mannequin = std::move(*surface);
    inputs.reduction = reduction_of(report);
    inputs.warnings.insert(inputs.warnings.end(), report.warnings.begin(), report.warnings.end());
    return Done{};
}

void add_input_reports(const RegisterInputs& inputs, StageReport& report) {
    report.measures.insert(report.measures.end(), inputs.skin.report.measures.begin(),
                           inputs.skin.report.measures.end());
    report.measures.insert(report.measures.end(), inputs.reduction.begin(), inputs.reduction.end());
    report.measures.push_back({"import_seconds", inputs.import_seconds});
    report.measures.push_back({"surface_seconds", inputs.skin.report.seconds});
    report.seconds += inputs.skin.report.seconds;
    report.warnings.insert(report.warnings.begin(), inputs.warnings.begin(), inputs.warnings.end());
}

void print_fit(const RegisterResult& result) {
    const auto line = [](const char* step, const FitMeasure& fit) {
        std::printf("%-10s %7.2f %7.2f %7.2f %7.2f   %.2f\n", step, fit.rms_mm, fit.median_mm,
                    fit.p95_mm, fit.max_mm, fit.coverage);
    };
    std::printf("gap, mm        rms  median     p95     max   coverage\n");
    line("rigid", result.rigid_fit);
    line("quadratic", result.quadratic_fit);
    line("final", result.fit);
    std::printf("det J >= %.3f (proven)\n", result.registration.min_det_jacobian);
}

}  // namespace sonocase::pipeline
