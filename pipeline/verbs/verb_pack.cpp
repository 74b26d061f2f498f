// SPDX-License-Identifier: Apache-2.0

// sonocase pack: puts the files of the stages into one bundle.
//
// More than the verb that a descriptor would give the stage "pack": skin and registration may be
// missing, structure is baked where the labels carry none, exercises are files of their own, and
// the reports of the stages before come from the files that they wrote.
#include <CLI/CLI.hpp>

#include "formats/base/build_facts.h"
#include "formats/bundle/stage_files.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "pipeline/anatomy/bake_structure.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/parallel.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/registration/fit/fit_measure.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/stages/pack_case.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

struct PackFiles {
    std::string labels, textures, mannequin, skin, registration, out, name, axes = "file";
    std::vector<std::string> exercises;
    bool structure = true;
    std::uint64_t seed = 1;
};

// Reads a .surface file, or any surface file that import reads.
Result<Surface> load_any_surface(const std::string& path, Axes axes) {
    SONOCASE_TRY(const auto bytes, sonocase::read_file(path));
    if (container_kind(bytes) != "SURF") return import_surface(path, {.axes = axes});
    SONOCASE_TRY(auto file, load_surface_file(path));
    return std::move(file.surface);
}

Result<PackResult> pack(const PackFiles& files, const Progress& progress) {
    SONOCASE_TRY(auto labels, load_label_file(files.labels));
    if (labels.frame != "mannequin")
        return Error{"labels are in the frame '" + labels.frame + "'", files.labels,
                     "expected resampled labels, in the frame 'mannequin'"};
    SONOCASE_TRY(auto textures, load_texture_file(files.textures));
    SONOCASE_TRY(auto mannequin, load_any_surface(files.mannequin, axes_named(files.axes)));
    std::vector<EmbeddedExercise> exercises;
    for (const std::string& path : files.exercises) {
        SONOCASE_TRY(auto text, sonocase::read_text_file(path));
        std::string name = path.substr(path.rfind('/') + 1);
        if (name.ends_with(".toml")) name.resize(name.size() - 5);
        exercises.push_back({name, std::move(text)});
    }
    Surface skin;
    Registration registration;
    const bool has_skin = !files.skin.empty(), has_fit = !files.registration.empty();
    if (has_skin) {
        SONOCASE_TRY(auto loaded, load_any_surface(files.skin, Axes::unsaid));
        skin = std::move(loaded);
    }
    if (has_fit) {
        SONOCASE_TRY(auto fit, load_registration(files.registration));
        registration = std::move(fit);
    }
    std::vector<Tissue> tissues = textures.tissues;
    if (tissues.empty()) {
        const auto built_in = built_in_tissues();
        tissues.assign(built_in.begin(), built_in.end());
    }
    if (files.structure && labels.echo_offset.table.empty()) {
        BakeStructureOptions options;
        options.seed = files.seed;
        SONOCASE_TRY(auto baked,
                     bake_structure_in_cells(labels.volume, tissues, options, progress));
        labels.echo_offset = std::move(baked.echo_offset);
        labels.reports.push_back(baked.report);
    }
    std::vector<std::uint8_t> unfitted;
    if (has_skin && has_fit) {
        SONOCASE_TRY(auto found, unfitted_skin(skin, mannequin, registration));
        unfitted = std::move(found);
    }
    auto packed = pack_case({.case_name = files.name,
                             .recipe_text = "",
                             .exercises = exercises,
                             .ct_skin = has_skin ? &skin : nullptr,
                             .registration = has_fit ? &registration : nullptr,
                             .mannequin = mannequin,
                             .cooked = labels.volume,
                             .palette = labels.volume.labels,
                             .boundary = labels.boundary,
                             .echo_offset = labels.echo_offset,
                             .textures = textures,
                             .tissues = tissues,
                             .skin_unfitted = std::move(unfitted)});
    if (!packed) return packed;
    auto& stages = packed->bundle.manifest.stages;
    for (const auto* reports : {&labels.reports, &textures.reports})
        stages.insert(stages.end(), reports->begin(), reports->end());
    if (has_fit)
        stages.insert(stages.begin(), registration.reports.begin(), registration.reports.end());
    stages.push_back(packed->report);
    for (StageReport& report : stages) report.seconds = 0;
    packed->bundle.manifest.producer = producer();
    return packed;
}

}  // namespace

int verb_pack(int argc, char** argv) {
    CLI::App app("Pack the files of the stages into a case bundle");
    PackFiles files;
    CommonOptions common;
    app.add_option("--labels", files.labels,
                   "Cooked labels, with boundary records and echo offsets")
        ->type_name("FILE.labels")
        ->required();
    app.add_option("--textures", files.textures, "Texture bank")
        ->type_name("FILE.textures")
        ->required();
    app.add_option("--surface", files.mannequin, "The mannequin, as digitised")
        ->type_name("FILE")
        ->required();
    app.add_option("--axes", files.axes, "Axes of the surface file's coordinates, whatever it says")
        ->check(CLI::IsMember({"file", "ras", "lps"}))
        ->capture_default_str();
    auto* skin =
        app.add_option("--skin", files.skin, "The patient's skin, ct frame")->type_name("FILE");
    auto* fit = app.add_option("--registration", files.registration,
                               "The fit, for the skin and for exercises in ct")
                    ->type_name("REG.json");
    skin->needs(fit);
    app.add_option("--exercise", files.exercises, "Exercise to include; may be repeated")
        ->type_name("FILE.toml")
        ->take_all();
    app.add_flag("--structure,!--no-structure", files.structure,
                 "Bake structure inside organs where the labels carry none; on by default");
    app.add_option("--seed", files.seed, "Seed of that structure")->capture_default_str();
    app.add_option("--name", files.name, "Name of the case")->default_val("case");
    app.add_option("-o,--output", files.out, "Bundle to write")
        ->type_name("OUT.sonocase")
        ->required();
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(common.threads);
    Result<PackResult> packed = Error{};
    {
        ProgressBar bar(common);
        packed = pack(files, bar.progress());
    }
    if (!packed) return fail("pack", packed.error());
    print_warnings("pack", packed->report);
    if (auto status = save_bundle(packed->bundle, files.out); !status)
        return fail("pack", status.error());
    if (auto status = write_report(common, packed->report); !status)
        return fail("pack", status.error());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
