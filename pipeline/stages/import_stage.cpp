// SPDX-License-Identifier: Apache-2.0

// import: reads a segmented CT, or samples the analytic torso, into labels in the `ct` frame.
#include "pipeline/stages/import_stage.h"

#include <algorithm>
#include <map>

#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/text/excerpt.h"
#include "pipeline/anatomy/anatomy_check.h"
#include "pipeline/anatomy/torso_model.h"
#include "pipeline/import/body/scan_body.h"
#include "pipeline/import/mesh/node_table.h"
#include "pipeline/stages/built_in_stages.h"
#include "pipeline/stages/case_tissues.h"
#include "pipeline/stages/label_codec.h"
#include "pipeline/stages/roles.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {
namespace {

LabelFile sample_analytic(const AnalyticInput& in) {
    LabelFile file;
    file.frame = "ct";
    const double across = in.voxel_mm;
    file.volume =
        sample_analytic_torso(analytic_torso_grid({across, across, in.slice_mm}, in.body), in.body);
    StageReport report;
    report.stage = stage_names::kImport;
    report.version = kImportVersion;
    const Vector3 extent = body_box(file.volume).extent();
    report.measures = {{"labels", static_cast<double>(file.volume.labels.size() - 1)},
                       {"voxel_volume_mm3", file.volume.grid.voxel_volume_mm3()},
                       {"body_width_mm", extent.x},
                       {"body_depth_mm", extent.y},
                       {"body_height_mm", extent.z}};
    file.reports = {report};
    return file;
}

void add_meshes(OptionsOf<MeshImportOptions>& options) {
    options
        .choice(
            "anatomy", [](auto& o) { return &o.anatomy; }, {"check", "accept"}, "",
            "check: refuse labels that fit no human body; accept: warn only")
        .help_group("Organ meshes")
        .number(
            "voxel_mm", [](auto& o) { return &o.mesh.voxel_mm; }, 0.3, 10, "mm",
            "meshes: edge of the voxels")
        .number(
            "low_mm", [](auto& o) { return &o.mesh.low_mm; }, -1e9, 1e9, "mm",
            "meshes: lowest height that is kept")
        .number(
            "high_mm", [](auto& o) { return &o.mesh.high_mm; }, -1e9, 1e9, "mm",
            "meshes: greatest height that is kept")
        .number(
            "weld_mm", [](auto& o) { return &o.mesh.weld_mm; }, 0, 5, "mm",
            "meshes: corners nearer than this become one")
        .number(
            "cap_mm", [](auto& o) { return &o.mesh.cap_mm; }, 0, 5000, "mm",
            "meshes: longest opening that is closed")
        .toggle(
            "allow_long_caps", [](auto& o) { return &o.mesh.allow_long_caps; },
            "meshes: close longer openings as well")
        .number(
            "hole_mm2", [](auto& o) { return &o.mesh.hole_mm2; }, 1, 20000, "mm^2",
            "meshes: largest section of a lumen")
        .number(
            "accuracy", [](auto& o) { return &o.mesh.accuracy; }, 1, 10, "radii",
            "meshes: distance from which a box of triangles counts as one point of an open "
            "surface");
}

void add_body(OptionsOf<MeshImportOptions>& options) {
    options.section("body")
        .toggle(
            "enabled", [](auto& o) { return &o.body.enabled; }, "fill in what meshes lack")
        .flag("body")
        .number(
            "arms_off_mm", [](auto& o) { return &o.body.arms_off_mm; }, 0, 1000, "mm",
            "parts of slices farther from the midline are removed; 0: none")
        .number(
            "skin_mm", [](auto& o) { return &o.body.skin_mm; }, 0.5, 10, "mm", "thickness")
        .number(
            "fat_mm", [](auto& o) { return &o.body.fat_mm; }, 2, 80, "mm", "fat under the skin")
        .number(
            "cavity_mm", [](auto& o) { return &o.body.cavity_mm; }, 5, 60, "mm",
            "gaps between organs that belong to the belly")
        .number(
            "muscle_mm", [](auto& o) { return &o.body.muscle_mm; }, 2, 40, "mm",
            "wall of the belly")
        .number(
            "back_muscle_mm", [](auto& o) { return &o.body.back_muscle_mm; }, 5, 80, "mm",
            "muscle round spine, pelvis and thigh")
        .toggle(
            "spine", [](auto& o) { return &o.body.spine; }, "vertebrae, discs, canal")
        .number(
            "disc_pitch_mm", [](auto& o) { return &o.body.disc_pitch_mm; }, 15, 60, "mm",
            "distance from disc to disc in the lumbar spine")
        .toggle(
            "ribs", [](auto& o) { return &o.body.ribs; }, "ribs, cartilage, sternum")
        .number(
            "rib_mm", [](auto& o) { return &o.body.rib_mm; }, 4, 20, "mm", "height of a rib")
        .number(
            "rib_pitch_mm", [](auto& o) { return &o.body.rib_pitch_mm; }, 12, 50, "mm",
            "from rib to rib")
        .toggle(
            "lungs", [](auto& o) { return &o.body.lungs; }, "lungs and diaphragm")
        .number(
            "diaphragm_mm", [](auto& o) { return &o.body.diaphragm_mm; }, 1, 10, "mm",
            "thickness of the diaphragm");
    options
        .toggle(
            "stomach", [](auto& o) { return &o.body.stomach; }, "stomach")
        .number(
            "stomach_gas", [](auto& o) { return &o.body.stomach_gas; }, 0, 1, "",
            "share of the stomach's height that is gas")
        .toggle(
            "psoas", [](auto& o) { return &o.body.psoas; }, "psoas muscles")
        .toggle(
            "rectus", [](auto& o) { return &o.body.rectus; }, "rectus muscles")
        .toggle(
            "leg_vessels", [](auto& o) { return &o.body.leg_vessels; }, "iliac and femoral vessels")
        .number(
            "artery_mm", [](auto& o) { return &o.body.artery_mm; }, 2, 20, "mm",
            "diameter of the iliac artery")
        .toggle(
            "gall_bladder", [](auto& o) { return &o.body.gall_bladder; }, "gall bladder")
        .number(
            "bladder_ml", [](auto& o) { return &o.body.bladder_ml; }, 0, 1000, "ml",
            "volume to which the bladder is filled; 0: as it is");
}

OptionGroup options() {
    OptionsOf<MeshImportOptions> options("import");
    add_meshes(options);
    add_body(options);
    return options;
}

Result<StageValue> run(StageInputs& inputs, const Progress& progress) {
    const RecipeInputs& in = inputs.recipe().inputs;
    if (in.analytic) return StageValue::of(kCtLabels, sample_analytic(in.torso));
    SONOCASE_TRY(auto imported,
                 import_inputs(inputs.recipe(), inputs.options<MeshImportOptions>(), progress));
    return StageValue::of(
        kCtLabels,
        LabelFile{"ct", std::move(imported.labels), {}, {}, {std::move(imported.report)}});
}

constexpr int kRenamingVersion = 1;

// The values in quotes of a TOML text that spell a standard name otherwise. Names and titles are
// for people.
void add_own_names(std::string_view toml, std::vector<std::string>& own) {
    while (!toml.empty()) {
        const std::size_t end = std::min(toml.find('\n'), toml.size() - 1) + 1;
        const std::string_view line = toml.substr(0, end);
        toml.remove_prefix(end);
        const std::string_view key = line.substr(0, line.find_first_of(" ="));
        if (key == "name" || key == "title") continue;
        for (std::size_t at = 0; (at = line.find('"', at)) != line.npos;) {
            const std::size_t close = line.find('"', at + 1);
            if (close == line.npos) break;
            const std::string word(line.substr(at + 1, close - at - 1));
            const std::size_t next = line.find_first_not_of(" \t", close + 1);
            const bool is_key = next != line.npos && line[next] == '=';
            if (const std::string name = standard_name(word);
                !is_key && !name.empty() && name != word)
                own.push_back(word);
            at = close + 1;
        }
    }
}

// Names of labels as the file spells them that the recipe or its exercises use. Those labels keep
// their names. Lines of [labels] find a label by any spelling.
std::vector<std::string> own_names(const Recipe& recipe) {
    std::vector<std::string> own;
    add_own_names(recipe.text, own);
    for (const EmbeddedExercise& exercise : recipe.exercises) add_own_names(exercise.toml, own);
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    return own;
}

std::string renaming_text(const Recipe& recipe) {
    std::string text;
    for (const std::string& name : own_names(recipe)) text += " " + name;
    for (const LabelChoice& choice : recipe.labels)
        if (choice.label.find('*') != std::string::npos) text += " " + choice.label;
    if (recipe.inputs.label_table.empty())
        if (const auto side = table_beside(recipe.resolve(recipe.inputs.labels)); !side.empty())
            if (const auto digest = digest_of_file(side)) text += " " + *digest;
    return key_text(text, {double{kRenamingVersion}});
}

// Gives labels the names that exercises and checks know, where a file spells them otherwise.
void rename_to_standard(const Recipe& recipe, ImportedLabels& imported) {
    std::vector<Label>& labels = imported.labels.labels;
    std::vector<std::string> own = own_names(recipe);
    const auto by_pattern = [&](const std::string& name, const std::string& standard) {
        return std::any_of(recipe.labels.begin(), recipe.labels.end(),
                           [&](const LabelChoice& choice) {
                               return choice.label.find('*') != std::string::npos &&
                                      matches_pattern(choice.label, name) &&
                                      !matches_pattern(choice.label, standard);
                           });
    };
    std::map<std::string, int> meant;
    for (const Label& label : labels) ++meant[standard_name(label.name)];
    std::vector<std::string> renamed;
    for (Label& label : labels) {
        const std::string name = standard_name(label.name);
        if (name.empty() || name == label.name || meant[name] > 1 || by_pattern(label.name, name) ||
            std::find(own.begin(), own.end(), label.name) != own.end())
            continue;
        renamed.push_back("'" + label.name + "' is " + name);
        if (label.colour == label_colour(label.name)) label.colour = label_colour(name);
        label.name = name;
    }
    if (!renamed.empty()) imported.report.notes.push_back({"renamed", excerpt(renamed)});
}

// The texts hold everything that the labels and their report depend on; for the analytic torso,
// what its label map shows of it.
std::vector<std::string> key_texts(const Recipe& recipe, const InputDigests& digests) {
    const RecipeInputs& in = recipe.inputs;
    const AnalyticBody& body = in.torso.body;
    if (in.analytic)
        return {key_text(body.tubes ? "tubes" : "analytic",
                         {body.width_scale, body.depth_scale, body.belly_mm, in.torso.voxel_mm,
                          in.torso.slice_mm, static_cast<double>(body.neck_seed)})};
    std::string files = digests.labels + " " + digests.label_table;
    if (!in.scan.empty()) files += " " + digests.scan + " " + std::to_string(kScanBodyVersion);
    if (is_mesh_source(recipe.resolve(in.labels)))
        return {key_text(files + " axes " + in.labels_axes,
                         {in.labels_scale, kMeshImportVersion, kAnatomyCheckVersion})};
    return {renaming_text(recipe), key_text(files + " " + in.label_names + " " + in.orientation,
                                            {in.labels_scale, in.resample_shear ? 1.0 : 0.0,
                                             kVolumeReadingVersion, kAnatomyCheckVersion})};
}

StageVerb verb() {
    StageVerb verb;
    verb.inputs = {
        {"LABELS", "",
         "NIfTI, NRRD, .seg.nrrd, MetaImage, DICOM file or folder, folder of masks, or organ "
         "meshes (GLB, STL, PLY, OBJ, VTP, VTK, or a folder of them)",
         true, &RecipeInputs::labels},
        {"--table", "FILE.csv",
         "Names of the values: rows of value,name[,tissue_class], or a table of ITK-SNAP, Slicer, "
         "FreeSurfer or nnU-Net; of meshes: node,label,role",
         false, &RecipeInputs::label_table},
        {"--scan", "FILE",
         "The CT that the map was drawn on, DICOM folder or file: what the map leaves of the body "
         "without a label is filled in by density",
         false, &RecipeInputs::scan},
        {"--scale", "", "Millimetres per unit of the file", false, &RecipeInputs::labels_scale},
        {"--names", "", "Whose numbers the values are that neither the file nor a table names",
         false, &RecipeInputs::label_names, names_options()},
        {"--orientation",
         "",
         "Which transform of a NIfTI header places the voxels",
         false,
         &RecipeInputs::orientation,
         {"auto", "sform", "qform"}},
        {"--resample-shear", "", "Resample a map whose axes are not at right angles", false,
         &RecipeInputs::resample_shear},
        {"--axes",
         "",
         "Meshes: axes of the coordinates, whatever the files say",
         false,
         &RecipeInputs::labels_axes,
         {"file", "ras", "lps"}}};
    verb.output_type = "CT.labels";
    verb.output_meaning = "Where to write";
    verb.save = [](StageInputs&, const StageValue& value, const std::string& path) {
        LabelFile file = value.as(kCtLabels);
        file.reports = without_seconds(file.reports);
        return save_label_file(file, path);
    };
    return verb;
}

Result<ImportedLabels> read_inputs(const Recipe& recipe,
                                   const MeshImportOptions& given,
                                   const Progress& progress) {
    const RecipeInputs& in = recipe.inputs;
    const std::string path = recipe.resolve(in.labels), table = recipe.resolve(in.label_table);
    if (is_mesh_source(path)) {
        if (!in.scan.empty())
            return Error{"organ meshes with a scan", path, "leave out inputs.scan"};
        MeshImportOptions options = given;
        options.mesh.scale = in.labels_scale;
        options.mesh.axes = axes_named(in.labels_axes);
        return import_meshes(path, table, options, progress);
    }
    if (in.labels_axes != "file")
        return Error{"--axes is for organ meshes", path,
                     "a volume says its axes itself: leave the option out"};
    ImportOptions options;
    options.table = table;
    options.scale = in.labels_scale;
    options.names = in.label_names;
    options.reading.orientation = in.orientation == "sform"   ? Orientation::sform
                                  : in.orientation == "qform" ? Orientation::qform
                                                              : Orientation::automatic;
    options.reading.resample_shear = in.resample_shear;
    SONOCASE_TRY(auto imported, import_label_map(path, options, progress));
    rename_to_standard(recipe, imported);
    if (in.scan.empty()) return imported;
    const std::string scan_path = recipe.resolve(in.scan);
    report_progress(progress, 0.7, "reading the scan");
    SONOCASE_TRY(const auto scan, read_scan(scan_path, options.reading));
    report_progress(progress, 0.8, "filling in the body");
    SONOCASE_TRY_DONE(fill_from_scan(scan, scan_path, imported));
    return imported;
}

}  // namespace

Result<MeshExtent> mesh_inputs_extent(const Recipe& recipe) {
    const RecipeInputs& in = recipe.inputs;
    MeshOptions options = recipe.settings.of<MeshImportOptions>().mesh;
    options.scale = in.labels_scale;
    options.axes = axes_named(in.labels_axes);
    return mesh_extent(recipe.resolve(in.labels), recipe.resolve(in.label_table), options);
}

Result<ImportedLabels> import_inputs(const Recipe& recipe,
                                     const MeshImportOptions& given,
                                     const Progress& progress) {
    SONOCASE_TRY(auto imported, read_inputs(recipe, given, progress));
    const std::string path = recipe.resolve(recipe.inputs.labels);
    const auto odd =
        report_anatomy(imported.labels, {.mesh = is_mesh_source(path)}, imported.report);
    if (odd && given.anatomy != "accept")
        return Error{
            "the labels fit no human body: " + *odd, path,
            "if they are right, give --anatomy accept, or anatomy = \"accept\" in [import]"};
    return imported;
}

StageDescriptor import_stage() {
    StageDescriptor stage;
    stage.name = stage_names::kImport;
    stage.version = kImportVersion;
    stage.summary = "read a label map of any kind";
    stage.about = "Read a label map of any kind into labels in the ct frame (RAS+, mm)";
    stage.provides = kCtLabels;
    stage.options = options();
    stage.key_texts = key_texts;
    stage.run = run;
    stage.codec = label_codec(kCtLabels);
    stage.reports = reports_of(kCtLabels);
    // A mistake in the recipe's [labels] is reported now, long before its tissues are used.
    stage.check = [](const Recipe& recipe, const StageValue& value) -> Status {
        std::vector<Label> labels = value.as(kCtLabels).volume.labels;
        return assign_tissues(recipe, labels);
    };
    stage.share = 0.03;
    stage.cost = {.threads = 1, .per_label_mb = 1.2, .per_label_voxel = 4, .per_mesh_voxel = 20};
    stage.verb = verb();
    return stage;
}

}  // namespace sonocase::pipeline::inline stages
