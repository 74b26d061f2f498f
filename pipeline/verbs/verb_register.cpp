// SPDX-License-Identifier: Apache-2.0

// sonocase register, align and warp: lay the patient's skin on the mannequin, in one call or step
// by step. sonocase landmarks: lists candidates for the rows of a landmark file, on the skin of a
// label map and on a mannequin.
//
// These are more than the verb that a descriptor would give the stage "warp": align and warp are
// two halves of it, register takes several mannequins and keeps the best, and all of them take
// their inputs from flags or a recipe and print the fit.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "formats/base/result.h"
#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/import/mesh/surface_file.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/registration/fit_pictures.h"
#include "pipeline/registration/landmark_candidates.h"
#include "pipeline/registration/landmark_file.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/registration/organ_pictures.h"
#include "pipeline/registration/register_surfaces.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/import_stage.h"
#include "pipeline/stages/read_recipe.h"
#include "pipeline/stages/recipe.h"
#include "pipeline/verbs/stage_verb.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {

namespace {

// Inputs and options that all four verbs have in common.
struct RegisterArguments {
    RegisterArguments() { recipe.settings = StageSettings(built_in_stages()); }

    Recipe recipe;                      // inputs, and the options of the stages that the fit needs
    std::vector<std::string> surfaces;  // mannequins; the first is that of the recipe
    std::string out, up;
    std::string recipe_path, data;
    CommonOptions common;
};

// Reads "X,Y,Z", the value of a flag. Error: not three numbers, or a vector without a length.
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

// Where the command line says --recipe CASE.toml (and --data DIR), the recipe's [inputs], [import],
// [body] and fit options become the defaults of the flags, with paths resolved. Call it before
// add_register_options.
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
    SONOCASE_TRY(auto recipe, load_recipe(path, overrides));
    RecipeInputs& in = recipe.inputs;
    if (in.analytic)
        return Error{"the recipe names no files: it has [analytic]", path,
                     "expected [inputs] with labels and surface"};
    for (std::string* file :
         {&in.labels, &in.label_table, &in.surface, &in.landmarks, &in.surface_landmarks})
        if (!file->empty()) *file = recipe.resolve(*file);
    recipe.folder.clear();  // paths of flags start from the working folder
    recipe.data.clear();
    a.recipe = std::move(recipe);
    if (!a.recipe.inputs.surface.empty()) a.surfaces = {a.recipe.inputs.surface};
    return Done{};
}

// Adds inputs, every option of the stage "warp", --seed, and what all verbs have.
// several  --surface takes more than one
void add_register_options(CLI::App& app, RegisterArguments& a, bool several) {
    RecipeInputs& in = a.recipe.inputs;
    app.add_option(
           "--recipe", a.recipe_path,
           "Take inputs and options of a recipe, case.toml or its folder; flags override it")
        ->type_name("CASE.toml");
    app.add_option("--data", a.data, "Folder that the recipe's input paths start from")
        ->type_name("DIR");
    app.add_option("--labels", in.labels,
                   "Label map: NIfTI, NRRD, MetaImage, DICOM or a folder of masks; or organ meshes")
        ->type_name("FILE")
        ->required(in.labels.empty());
    auto* surface =
        app.add_option("--surface", a.surfaces,
                       several
                           ? "Mannequin: a mesh (PLY, STL, OBJ, VTP, VTK, GLB) or CSV of readings; "
                             "of several, "
                             "the one that fits best is taken"
                           : "Mannequin: a mesh (PLY, STL, OBJ, VTP, VTK, GLB) or CSV of readings")
            ->type_name("FILE")
            ->required(a.surfaces.empty());
    surface->expected(1, several ? 100 : 1);
    app.add_option("--table", in.label_table, "CSV of value,name[,tissue_class] for the label map")
        ->type_name("FILE.csv");
    app.add_option("--names", in.label_names,
                   "Whose numbers the values are that neither the file nor a table names")
        ->check(CLI::IsMember(names_options()))
        ->capture_default_str();
    app.add_option("--orientation", in.orientation,
                   "Which transform of a NIfTI header places the voxels")
        ->check(CLI::IsMember(std::vector<std::string>{"auto", "sform", "qform"}))
        ->capture_default_str();
    app.add_flag("--resample-shear", in.resample_shear,
                 "Resample a label map whose axes are not at right angles");
    app.add_option("--up", a.up, "The patient's head direction in the surface's frame")
        ->type_name("X,Y,Z");
    app.add_option("--landmarks", in.landmarks,
                   "Rows name,ct_x,ct_y,ct_z,x,y,z in mm; or the patient's marks alone")
        ->type_name("FILE");
    app.add_option("--surface-landmarks", in.surface_landmarks,
                   "The marks of --landmarks on the surface, by name: CSV, .fcsv or .mrk.json")
        ->type_name("FILE");
    app.add_option("--axes", in.surface_axes,
                   "Axes of the surface file's coordinates, whatever it says")
        ->check(CLI::IsMember({"file", "ras", "lps"}))
        ->capture_default_str();
    app.add_option("--scale", in.surface_scale, "Millimetres per unit of the surface file")
        ->check(CLI::Range(kMinScale, kMaxScale))
        ->capture_default_str();
    const StageTable& table = a.recipe.settings.table();
    add_option_flags(app, table.common, a.recipe.settings);
    add_option_flags(app, table.options_of<RegisterOptions>(), a.recipe.settings);
    add_common_options(app, a.common);
}

// Label map, skin and mannequin as read, hints parsed; with the warnings of all of them.
struct RegisterInputs {
    LabelVolume labels;
    SkinSurfaceResult skin;
    Surface mannequin;
    RegisterOptions options;
    double import_seconds = 0;
    std::vector<Measure> reduction;  // of a dense mannequin, as import_surface reports it
    std::vector<Note> notes;  // of the import: what axes and units were taken for, the anatomy
    std::vector<std::string> warnings;
};
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

SurfaceFileOptions surface_options(const RegisterArguments& a) {
    SurfaceFileOptions options;
    options.scale = a.recipe.inputs.surface_scale;
    options.axes = axes_named(a.recipe.inputs.surface_axes);
    return options;
}

// The notes of a surface under names of their own: the labels may have such notes too.
std::vector<Note> surface_notes(const StageReport& report) {
    std::vector<Note> notes;
    for (const Note& note : report.notes) notes.push_back({"surface_" + note.name, note.text});
    return notes;
}

// Reads and prepares what the fit needs. The stages import and surface do the same for a case; here
// their reports become part of the fit's report.
Result<RegisterInputs> read_register_inputs(const RegisterArguments& a, const Progress& progress) {
    const Stopwatch watch;
    const RecipeInputs& in = a.recipe.inputs;
    const std::string mannequin = a.surfaces.front();
    RegisterInputs inputs;
    inputs.options = a.recipe.settings.of<RegisterOptions>();
    inputs.options.seed = case_seed(a.recipe.settings);
    if (in.up) inputs.options.up = *in.up;
    if (!a.up.empty()) {
        SONOCASE_TRY(const Vector3 up, parse_direction(a.up, "--up"));
        inputs.options.up = up;
    }
    if (!in.landmarks.empty()) {
        SONOCASE_TRY(std::vector<Landmark> landmarks,
                     load_landmarks(in.landmarks, in.surface_landmarks));
        inputs.options.landmarks = std::move(landmarks);
    }
    StageReport surface_report;
    SONOCASE_TRY(Surface surface, import_surface(mannequin, surface_options(a), &surface_report));
    inputs.mannequin = std::move(surface);
    inputs.reduction = reduction_of(surface_report);
    inputs.notes = surface_notes(surface_report);
    SONOCASE_TRY(ImportedLabels labels,
                 import_inputs(a.recipe, a.recipe.settings.of<MeshImportOptions>(), progress));
    for (const Note& note : labels.report.notes)
        if (note.name == "anatomy" || note.name == "axes") inputs.notes.push_back(note);
    inputs.warnings = surface_report.warnings;
    inputs.warnings.insert(inputs.warnings.end(), labels.report.warnings.begin(),
                           labels.report.warnings.end());
    inputs.import_seconds = watch.seconds();
    Result<SkinSurfaceResult> skin =
        extract_skin_surface(labels.labels, a.recipe.settings.of<SkinSurfaceOptions>());
    if (!skin) {
        Error error = skin.error();
        if (error.where.empty()) error.where = in.labels;
        return error;
    }
    inputs.skin = std::move(*skin);
    inputs.labels = std::move(labels.labels);
    inputs.warnings.insert(inputs.warnings.end(), inputs.skin.report.warnings.begin(),
                           inputs.skin.report.warnings.end());
    return inputs;
}

// Reads another mannequin in place of the one in the inputs; the patient stays.
Status read_other_mannequin(const RegisterArguments& a,
                            const std::string& path,
                            RegisterInputs& inputs) {
    StageReport report;
    SONOCASE_TRY(Surface surface, import_surface(path, surface_options(a), &report));
    inputs.mannequin = std::move(surface);
    inputs.reduction = reduction_of(report);
    std::erase_if(inputs.notes, [](const Note& n) { return n.name.starts_with("surface_"); });
    const std::vector<Note> notes = surface_notes(report);
    inputs.notes.insert(inputs.notes.end(), notes.begin(), notes.end());
    inputs.warnings.insert(inputs.warnings.end(), report.warnings.begin(), report.warnings.end());
    return Done{};
}

// Adds to the stage's report what was reported when the inputs were read and the skin extracted.
void add_input_reports(const RegisterInputs& inputs, StageReport& report) {
    report.measures.insert(report.measures.end(), inputs.skin.report.measures.begin(),
                           inputs.skin.report.measures.end());
    report.measures.insert(report.measures.end(), inputs.reduction.begin(), inputs.reduction.end());
    report.measures.push_back({"import_seconds", inputs.import_seconds});
    report.measures.push_back({"surface_seconds", inputs.skin.report.seconds});
    report.seconds += inputs.skin.report.seconds;
    report.notes.insert(report.notes.end(), inputs.notes.begin(), inputs.notes.end());
    report.warnings.insert(report.warnings.begin(), inputs.warnings.begin(), inputs.warnings.end());
}

double measure_of(const StageReport& report, const char* name) {
    for (const Measure& m : report.measures) {
        if (m.name == name) return m.value;
    }
    return 0;
}

// Prints the fit's distances for people, as a table on standard output.
void print_fit(const RegisterResult& result) {
    const auto line = [](const char* step, const FitMeasure& fit) {
        std::printf("%-10s %7.2f %7.2f %7.2f %7.2f   %.2f\n", step, fit.rms_mm, fit.median_mm,
                    fit.p95_mm, fit.max_mm, fit.coverage);
    };
    std::printf("gap, mm        rms  median     p95     max   coverage\n");
    line("rigid", result.rigid_fit);
    line("quadratic", result.quadratic_fit);
    line("final", result.fit);
    std::printf("no fold: nothing shrinks below %.3f of its volume (det J, proven)\n",
                result.registration.min_det_jacobian);
    std::string at_worst;
    if (!result.unknown.empty()) {
        const auto [best, worst] = std::minmax_element(
            result.unknown.begin(), result.unknown.end(),
            [](const OrganUnknown& a, const OrganUnknown& b) { return a.p90_mm < b.p90_mm; });
        std::printf(
            "left open inside: at worst %s, %.1f mm (median), %.1f mm (90 %%), %.1f mm (95 %%); at "
            "best %s, %.1f mm (90 %%)\n",
            worst->label.c_str(), worst->median_mm, worst->p90_mm, worst->p95_mm,
            best->label.c_str(), best->p90_mm);
        if (worst->p90_with_landmarks_mm > 0 && worst->p90_with_landmarks_mm < worst->p90_mm)
            at_worst = text(", and of %s %.1f of %.1f mm (90 %%)", worst->label.c_str(),
                            worst->p90_with_landmarks_mm, worst->p90_mm);
    }
    const double with = measure_of(result.report, "interior_with_two_landmarks_mm");
    if (with > 0)
        std::printf(
            "two landmarks, one at either end of the body, would leave %.1f of %.1f mm inside "
            "(root mean square)%s: `sonocase landmarks` lists places, --landmarks FILE.csv takes "
            "them\n",
            with, measure_of(result.report, "predicted_interior_mm"), at_worst.c_str());
    for (const Note& note : result.report.notes) {
        if (note.name == "head") std::printf("head and feet: %s\n", note.text.c_str());
        if (note.name == "handedness") std::printf("right and left: %s\n", note.text.c_str());
        if (note.name == "front") std::printf("front and back: %s\n", note.text.c_str());
    }
}

void print_candidates(const char* whose, const std::vector<LandmarkCandidate>& candidates) {
    std::printf("%s\n", whose);
    for (const LandmarkCandidate& c : candidates)
        std::printf("  %-11s %-7s [%.1f, %.1f, %.1f]  %s\n", c.name.c_str(),
                    candidate_colour(c.name).name, c.place.x, c.place.y, c.place.z, c.how.c_str());
    if (candidates.empty()) std::printf("  none: expected at least 100 points\n");
}

}  // namespace

int verb_landmarks(int argc, char** argv) {
    CLI::App app("List places on skin and mannequin for a landmark file: navel, crotch, extremes");
    RegisterArguments arguments;
    std::string front, picture;
    if (const Status s = take_recipe(argc, argv, arguments); !s)
        return fail("landmarks", s.error());
    add_register_options(app, arguments, false);
    app.add_option("--front", front, "The patient's front in the surface's frame")
        ->type_name("X,Y,Z")
        ->required();
    app.add_option("--picture", picture, "Where to draw both, from the front and the right")
        ->type_name("PICTURE.png");
    app.add_option("-o,--output", arguments.out, "Where to write rows for --landmarks of register")
        ->type_name("LANDMARKS.csv");
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.threads);
    const auto forwards = parse_direction(front, "--front");
    if (!forwards) return fail("landmarks", forwards.error());
    const auto inputs = read_register_inputs(arguments, {});
    if (!inputs) return fail("landmarks", inputs.error());
    if (!inputs->options.up || norm(cross(*inputs->options.up, *forwards)) < 1e-6)
        return fail("landmarks",
                    {!inputs->options.up ? "--up is missing" : "--up and --front are parallel",
                     "--up", "the patient's head direction in the surface's frame, e.g. 0,1,0"});
    // The ct frame is RAS+.
    CandidateView patient{&inputs->skin.skin, {0, 0, 1}, {0, 1, 0}, {}},
        mannequin{&inputs->mannequin, *inputs->options.up, *forwards, {}};
    for (CandidateView* view : {&patient, &mannequin})
        view->candidates = landmark_candidates(*view->skin, view->up, view->front);
    print_candidates("patient, ct frame", patient.candidates);
    print_candidates("mannequin", mannequin.candidates);
    if (!arguments.out.empty())
        if (auto s =
                write_file(arguments.out, landmark_rows(patient.candidates, mannequin.candidates));
            !s)
            return fail("landmarks", s.error());
    if (!picture.empty())
        if (auto s = write_file(picture, landmark_picture({patient, mannequin})); !s)
            return fail("landmarks", s.error());
    std::printf("Candidates, not pairs: strike out rows that are not the same place on both.\n");
    return kDone;
}

namespace {

// What differs between register, align and warp.
struct FitVerb {
    const char* name;
    const char* about;
    bool from_rigid;     // starts from a registration that align wrote
    bool whole;          // surface to warp: draws pictures, and may write nothing
    const char* writes;  // help of -o
    std::function<Result<RegisterResult>(
        const RegisterInputs& inputs, const Registration& rigid, const Progress& progress)>
        fit;
};

struct FitArguments {
    RegisterArguments common;
    std::string rigid, pictures;
};

void add_options(CLI::App& app, const FitVerb& verb, FitArguments& arguments) {
    if (verb.from_rigid)
        app.add_option("registration", arguments.rigid, "What align wrote")
            ->type_name("REG.json")
            ->required();
    add_register_options(app, arguments.common, verb.whole);
    app.add_option("-o,--output", arguments.common.out, verb.writes)
        ->type_name("REG.json")
        ->required(!verb.whole);
    if (verb.whole)
        app.add_option("--pictures", arguments.pictures, "Write pictures of the fit to this folder")
            ->type_name("DIR");
}

struct Fitted {
    RegisterInputs inputs;
    RegisterResult result;
};

// Fits the other mannequins as well; the best fit and its mannequin stay. The report has the order.
Status try_others(const FitVerb& verb,
                  const FitArguments& arguments,
                  const Registration& rigid,
                  const Progress& progress,
                  RegisterInputs& inputs,
                  RegisterResult& fitted) {
    const std::vector<std::string>& names = arguments.common.surfaces;
    if (names.size() < 2) return Done{};
    std::vector<RegisterResult> results{std::move(fitted)};
    std::vector<Surface> mannequins{inputs.mannequin};
    for (std::size_t n = 1; n < names.size(); ++n) {
        if (auto status = read_other_mannequin(arguments.common, names[n], inputs); !status)
            return status;
        mannequins.push_back(inputs.mannequin);
        auto other = verb.fit(inputs, rigid, progress);
        if (!other) {
            Error error = other.error();
            if (error.where.empty()) error.where = names[n];
            return error;
        }
        results.push_back(std::move(*other));
    }
    const std::vector<std::size_t> order = rank_results(results);
    MeasureGroup ranking{"misfit", {}};
    std::printf("misfit  skin  volume  shape  coverage  (1 or less is good; best first)\n");
    for (const std::size_t n : order) {
        const Misfit m = misfit_of(results[n]);
        std::printf("%6.2f  %4.2f  %6.2f  %5.2f  %8.2f  %s%s\n", m.worst(), m.skin, m.volume,
                    m.shape, m.coverage, names[n].c_str(), m.proven ? "" : "  (not proven)");
        ranking.values.push_back({names[n], m.worst()});
    }
    inputs.mannequin = std::move(mannequins[order[0]]);
    fitted = std::move(results[order[0]]);
    fitted.report.notes.push_back({"mannequin", names[order[0]]});
    fitted.report.groups.push_back(std::move(ranking));
    return Done{};
}

Result<Fitted> fit(const FitVerb& verb, const FitArguments& arguments) {
    ProgressBar bar(arguments.common.common);
    Registration rigid;
    if (verb.from_rigid) {
        SONOCASE_TRY(auto start, load_registration(arguments.rigid));
        rigid = std::move(start);
    }
    SONOCASE_TRY(auto inputs, read_register_inputs(arguments.common, bar.progress()));
    auto fitted = verb.fit(inputs, rigid, bar.progress());
    if (!fitted) {
        Error error = fitted.error();
        if (error.where.empty()) error.where = arguments.common.surfaces.front();
        return error;
    }
    SONOCASE_TRY_DONE(try_others(verb, arguments, rigid, bar.progress(), inputs, *fitted));
    std::vector<StageReport>& reports = fitted->registration.reports;
    reports.insert(reports.begin(), rigid.reports.begin(), rigid.reports.end());
    return Fitted{std::move(inputs), std::move(*fitted)};
}

Status write_fit(const FitArguments& arguments, Fitted& fitted) {
    Registration& registration = fitted.result.registration;
    if (!arguments.pictures.empty()) {
        auto status = write_fit_pictures(fitted.inputs.skin, fitted.inputs.mannequin, registration,
                                         arguments.pictures);
        if (!status) return status;
        status = write_organ_pictures(fitted.inputs.labels, fitted.inputs.mannequin, registration,
                                      fitted.result.organs, arguments.pictures);
        if (!status) return status;
    }
    // The file holds no seconds, so that the same inputs give the same bytes; they go to --report.
    for (StageReport& report : registration.reports) report.seconds = 0;
    if (!arguments.common.out.empty())
        if (auto status = save_registration(registration, arguments.common.out); !status)
            return status;
    return write_report(arguments.common.common, fitted.result.report);
}

int run_fit_verb(const FitVerb& verb, int argc, char** argv) {
    CLI::App app(verb.about);
    FitArguments arguments;
    if (const auto status = take_recipe(argc, argv, arguments.common); !status)
        return fail(verb.name, status.error());
    add_options(app, verb, arguments);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(arguments.common.common.threads);
    auto fitted = fit(verb, arguments);
    if (!fitted) return fail(verb.name, fitted.error());
    add_input_reports(fitted->inputs, fitted->result.report);
    if (auto status = write_fit(arguments, *fitted); !status)
        return fail(verb.name, status.error());
    print_notes(verb.name, fitted->result.report);
    print_warnings(verb.name, fitted->result.report);
    print_fit(fitted->result);
    return kDone;
}

}  // namespace

int verb_register(int argc, char** argv) {
    const FitVerb verb{
        "register",
        "Lay the patient's skin on the mannequin: surface, align and warp in one call",
        false,
        true,
        "Where to write the registration",
        [](const RegisterInputs& in, const Registration&, const Progress& progress) {
            return register_surfaces({in.skin, in.mannequin, &in.labels}, in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

int verb_align(int argc, char** argv) {
    const FitVerb verb{
        "align",
        "Find the rigid motion that lays the patient's skin on the mannequin",
        false,
        false,
        "Where to write the rigid registration",
        [](const RegisterInputs& in, const Registration&, const Progress& progress) {
            return align_surfaces({in.skin, in.mannequin, &in.labels}, in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

int verb_warp(int argc, char** argv) {
    const FitVerb verb{
        "warp",
        "From a rigid registration to the quadratic and residual warps",
        true,
        false,
        "Where to write the registration",
        [](const RegisterInputs& in, const Registration& rigid, const Progress& progress) {
            return warp_surfaces({in.skin, in.mannequin, &in.labels}, rigid.mannequin_from_ct,
                                 in.options, progress);
        }};
    return run_fit_verb(verb, argc, argv);
}

}  // namespace sonocase::pipeline::inline verbs
