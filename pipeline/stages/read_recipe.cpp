// SPDX-License-Identifier: Apache-2.0

// Faults in sections and options are kept in the document that the tables belong to
// (formats/text/toml_reader.h); the first of them becomes the error.
#include "pipeline/stages/read_recipe.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>
#include <vector>

#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "formats/text/nearest_name.h"
#include "formats/text/toml_reader.h"
#include "formats/volume/tissue.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/import/volume/label_map.h"
#include "pipeline/pathology/place_pathology.h"
#include "pipeline/segmentation/resample_labels.h"
#include "pipeline/stages/embedded_scenario.h"
#include "pipeline/stages/exercise_frame.h"
#include "pipeline/stages/recipe.h"

namespace sonocase::pipeline::inline stages {
namespace {

namespace fs = std::filesystem;

void read_up(const TomlTable& table, RecipeInputs& inputs) {
    Vector3 up;
    if (table.direction("up", up)) inputs.up = up;
}

Tissue* find_tissue(std::vector<Tissue>& tissues, const std::string& name) {
    const auto found = std::find_if(tissues.begin(), tissues.end(),
                                    [&](const Tissue& t) { return t.name == name; });
    return found == tissues.end() ? nullptr : &*found;
}

// Figures that the recipe leaves out stay as built in, for a tissue whose label says nothing.
void read_mechanics(const TomlTable& table, Tissue& tissue) {
    TissueMechanics m = mechanics_of(tissue, "");
    bool given = table.number("stiffness_kpa", m.stiffness_kpa, kMinStiffnessKpa, kMaxStiffnessKpa);
    given |= table.flag("drains", m.drains);
    given |= table.number("puncture_n", m.puncture_n, 0, kMaxPunctureN);
    given |= table.flag("rigid", m.rigid);
    if (given) tissue.mechanics = m;
}

void read_tissue(const TomlTable& table, const std::string& name, std::vector<Tissue>& tissues) {
    const Tissue* start = find_tissue(tissues, name);
    if (start == nullptr) start = find_tissue(tissues, "soft_tissue");
    Tissue tissue = *start;
    tissue.source = "recipe";
    std::vector<std::string> names;
    for (const Tissue& known : tissues) names.push_back(known.name);
    std::string like;
    if (table.text("like", like, names)) {
        tissue = *find_tissue(tissues, like);
        // A vein by another name stays one: blood alone is told apart by its labels.
        if (like != "blood") tissue.mechanics = mechanics_of(tissue, "");
    }
    tissue.name = name;
    if (const auto kind = table.choice("kind", {"outside", "soft", "fluid", "gas", "bone"}))
        tissue.kind = static_cast<TissueKind>(*kind);
    table.flag("casts_shadow", tissue.casts_shadow);
    table.text("texture", tissue.texture);
    table.text("source", tissue.source);
    read_figures(table, tissue);
    read_mechanics(table, tissue);
    table.finish();
    if (Tissue* known = find_tissue(tissues, name))
        *known = tissue;
    else
        tissues.push_back(tissue);
}

void read_inputs(const TomlTable& table, RecipeInputs& inputs) {
    table.text("labels", inputs.labels);
    table.text("label_table", inputs.label_table);
    table.text("scan", inputs.scan);
    table.text("surface", inputs.surface);
    table.flag("own_skin", inputs.own_skin);
    table.text("examples", inputs.examples);
    table.text("landmarks", inputs.landmarks);
    table.text("surface_landmarks", inputs.surface_landmarks);
    table.text("labels_axes", inputs.labels_axes, {"file", "ras", "lps"});
    table.text("surface_axes", inputs.surface_axes, {"file", "ras", "lps"});
    table.number("labels_scale", inputs.labels_scale, kMinScale, kMaxScale);
    table.text("label_names", inputs.label_names, names_options());
    table.text("orientation", inputs.orientation, {"auto", "sform", "qform"});
    table.flag("resample_shear", inputs.resample_shear);
    table.number("surface_scale", inputs.surface_scale, kMinScale, kMaxScale);
    read_up(table, inputs);
    table.finish();
}

void read_analytic(const TomlTable& table, RecipeInputs& inputs) {
    inputs.analytic = true;
    AnalyticInput& torso = inputs.torso;
    // The named body comes first: the proportions beside it change it.
    std::string body;
    if (table.text("body", body, analytic_body_names())) torso.body = *analytic_body(body);
    int neck_seed = 0;
    if (table.whole("neck_seed", neck_seed, 1, 1e6)) {
        if (torso.body.neck_seed == 0)
            table.add_fault("neck_seed", "without a neck", "body = \"neck\" beside it");
        torso.body.neck_seed = neck_seed;
    }
    table.number("width_scale", torso.body.width_scale, 0.7, 1.4);
    table.number("depth_scale", torso.body.depth_scale, 0.7, 1.4);
    table.number("belly_mm", torso.body.belly_mm, 0, 40);
    table.number("voxel_mm", torso.voxel_mm, 0.5, 10);
    table.number("slice_mm", torso.slice_mm, 0.5, 10);
    table.flag("known_map", torso.known_map);
    table.whole("landmarks", torso.landmarks, 0, 14);
    table.number("landmark_noise_mm", torso.landmark_noise_mm, 0, 50);
    AnalyticMannequinOptions& mannequin = torso.mannequin;
    table.whole("points", mannequin.points, 100, 1e6);
    table.number("noise_mm", mannequin.noise_mm, 0, 20);
    table.number("strength", mannequin.strength, 0, 2);
    table.flag("mesh", mannequin.mesh);
    table.flag("front_only", mannequin.front_only);
    int seed = 0;
    if (table.whole("seed", seed, 0, 2e9)) mannequin.seed = static_cast<std::uint64_t>(seed);
    table.text("examples", inputs.examples);
    read_up(table, inputs);
    table.finish();
}

void read_labels(const TomlTable& table, std::vector<LabelChoice>& labels) {
    for (const std::string& label : table.keys()) {
        LabelChoice choice{label, "", table.line(label)};
        if (table.text(label, choice.tissue)) labels.push_back(std::move(choice));
    }
    std::sort(labels.begin(), labels.end(),
              [](const LabelChoice& a, const LabelChoice& b) { return a.line < b.line; });
}

void read_tissues(const TomlTable& table, std::vector<Tissue>& tissues) {
    for (const std::string& name : table.keys())
        if (const auto fields = table.table(name)) read_tissue(*fields, name, tissues);
}

// Reads everything but the options of the stages, which come after the preset.
void read_contents(const TomlTable& root, Recipe& recipe, std::vector<std::string>* exercises) {
    std::string title;  // for people
    root.text("name", recipe.name);
    root.text("title", title);
    root.text("preset", recipe.preset, recipe.settings.table().preset_names());
    root.texts("exercises", *exercises);
    if (const auto table = root.table("inputs")) read_inputs(*table, recipe.inputs);
    if (const auto table = root.table("analytic")) read_analytic(*table, recipe.inputs);
    if (const auto table = root.table("labels")) read_labels(*table, recipe.labels);
    for (const StageDescriptor& stage : recipe.settings.table().stages)
        if (stage.read_sections) stage.read_sections(root, recipe);
    if (const auto table = root.table("tissues")) read_tissues(*table, recipe.tissues);
}

void read_options(const TomlTable& root, StageSettings& settings) {
    for (const std::string& section : settings.table().sections()) {
        const auto table = root.table(section);
        if (!table) continue;
        for (const OptionGroup* group : settings.table().option_groups())
            for (const Option& option : group->options) {
                if (option.section != section) continue;
                const auto value = table->plain_value(option.key);
                if (!value) continue;
                const Status set =
                    set_option(option, *value, settings.values(*group), table->place(option.key));
                if (!set) table->keep(set.error());
            }
        table->finish();
    }
}

Status apply_preset(const std::string& name, StageSettings& settings) {
    const StageTable& table = settings.table();
    const Preset* preset = table.find_preset(name);
    if (preset == nullptr)
        return Error{"unknown preset '" + name + "'", "--preset",
                     suggest_name(name, table.preset_names())};
    for (const auto& [option, value] : preset->settings)
        if (auto status = settings.set(option, value, "preset " + name); !status) return status;
    return Done{};
}

Status apply_sets(const std::vector<std::string>& sets, StageSettings& settings) {
    for (const std::string& set : sets) {
        const std::size_t equals = set.find('=');
        if (equals == std::string::npos)
            return Error{"'" + set + "' has no '='", "--set", "expected --set section.key=value"};
        auto status = settings.set(set.substr(0, equals), set.substr(equals + 1), "--set");
        if (!status) return status;
    }
    return Done{};
}

Status check_inputs(const Recipe& recipe) {
    const RecipeInputs& in = recipe.inputs;
    if (in.analytic && (!in.labels.empty() || !in.surface.empty()))
        return Error{"both [analytic] and files in [inputs]", recipe.path, "keep one of the two"};
    if (in.analytic) return Done{};
    if (in.labels.empty())
        return Error{"no inputs.labels", recipe.path, "expected the label map of a torso"};
    if (in.own_skin && !in.surface.empty())
        return Error{"both a surface and own_skin in [inputs]", recipe.path,
                     "keep the mannequin's surface, or the patient's own skin"};
    if (in.surface.empty() && !in.own_skin)
        return Error{"no inputs.surface", recipe.path,
                     "expected the digitised mannequin, or own_skin = true"};
    return Done{};
}

// Exercises beside the recipe: those it names, or all others beside a case.toml.
Status load_exercises(Recipe& recipe, std::vector<std::string> names) {
    if (names.empty() && fs::path(recipe.path).filename() == "case.toml") {
        std::error_code code;
        for (const auto& entry :
             fs::directory_iterator(recipe.folder.empty() ? "." : recipe.folder, code))
            if (entry.path().extension() == ".toml" && entry.path().filename() != "case.toml" &&
                !entry.path().filename().string().starts_with('.') &&
                !fs::equivalent(entry.path(), recipe.path, code))
                names.push_back(entry.path().stem().string());
        std::sort(names.begin(), names.end());
    }
    for (const std::string& name : names) {
        const std::string path = (fs::path(recipe.folder) / (name + ".toml")).string();
        SONOCASE_TRY(auto text, read_text_file(path));
        recipe.exercises.push_back({name, std::move(text)});
    }
    return Done{};
}

// The named ones, in that order; all where none is named.
std::vector<EmbeddedExercise> chosen(const std::vector<EmbeddedExercise>& all,
                                     const std::vector<std::string>& named) {
    if (named.empty()) return all;
    std::vector<EmbeddedExercise> result;
    for (const std::string& name : named)
        for (const EmbeddedExercise& exercise : all)
            if (exercise.name == name) result.push_back(exercise);
    return result;
}

Status check_exercises(const Recipe& recipe) {
    std::map<std::string, std::string> files;  // by the exercise's own name
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        const std::string where = (fs::path(recipe.folder) / (exercise.name + ".toml")).string();
        SONOCASE_TRY(auto framed, strip_frame(exercise.toml, where));
        // Places are known once the lesions are there; names can be checked now.
        std::vector<KeyTarget> names;
        if (recipe.settings.has<PathologyOptions>())
            for (const PathologyRequest& request : recipe.settings.of<PathologyOptions>().requests)
                names.push_back({request.name, {}, 5, request.target});
        SONOCASE_TRY(auto aimed, targets_from_key(framed.toml, where, names));
        SONOCASE_TRY(const auto parsed, parse_exercise(aimed, where));
        const auto [first, is_new] = files.insert({parsed.name, where});
        if (!is_new)
            return Error{
                "the exercise is named '" + parsed.name + "', as is that of " + first->second,
                where, "give each a name of its own"};
    }
    return Done{};
}

// Gives a region round a target its centre, in the frame of the exercise.
Status aim_region(Recipe& recipe) {
    if (!recipe.settings.has<ResampleOptions>()) return Done{};
    auto& region = recipe.settings.of<ResampleOptions>().region;
    if (!region || region->target.empty()) return Done{};
    std::vector<std::string> names;
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        SONOCASE_TRY(const auto framed, strip_frame(exercise.toml, exercise.name));
        const auto parsed = parse_exercise(framed.toml, exercise.name);
        if (!parsed) continue;  // its targets are lesions, whose places are not known yet
        for (const Target& target : parsed->targets) {
            names.push_back(target.name);
            if (target.name != region->target) continue;
            region->centre = target.centre;
            region->in_ct = framed.in_ct;
            return Done{};
        }
    }
    return Error{"no target '" + region->target + "' with a centre in the exercises",
                 recipe.path + ": region.target", suggest_name(region->target, names)};
}

// Reports what a stage cannot do before any of them runs.
Status check_stages(const Recipe& recipe) {
    for (const StageDescriptor& stage : recipe.settings.table().stages) {
        if (!stage.can_do || (stage.active && !stage.active(recipe))) continue;
        if (auto status = stage.can_do(recipe); !status) {
            Error error = status.error();
            error.where = recipe.path + ": " + error.where;
            return error;
        }
    }
    return Done{};
}

Status read_text(std::string_view text,
                 const RecipeOverrides& overrides,
                 Recipe& recipe,
                 std::vector<std::string>* exercises) {
    SONOCASE_TRY(const auto root, TomlTable::parse(text, recipe.path));
    read_contents(root, recipe, exercises);
    if (!root.fault()) {
        if (!overrides.preset.empty()) recipe.preset = overrides.preset;
        if (auto status = apply_preset(recipe.preset, recipe.settings); !status) return status;
        read_options(root, recipe.settings);
        root.finish();
    }
    if (root.fault()) return *root.fault();
    if (auto status = apply_sets(overrides.sets, recipe.settings); !status) return status;
    if (!overrides.surface.empty()) {
        if (recipe.inputs.analytic)
            return Error{"the analytic torso makes its own mannequin", "--surface",
                         "take a recipe with [inputs]"};
        recipe.inputs.surface = fs::absolute(overrides.surface).string();
        recipe.inputs.own_skin = false;
    }
    return check_inputs(recipe);
}

}  // namespace

void read_figures(const TomlTable& table, Tissue& tissue) {
    table.number("grey_mean", tissue.grey_mean, 0, 255);
    table.number("grey_sd", tissue.grey_sd, 0, 255);
    table.number("echo_db", tissue.echo_db, -120, 60);
    table.number("structure_db", tissue.structure_db, 0, 30);
    table.number("attenuation_db_cm_mhz", tissue.attenuation_db_cm_mhz, 0, 100);
    table.number("impedance_mrayl", tissue.impedance_mrayl, 0, 20);
    table.number("sound_speed_m_s", tissue.sound_speed_m_s, 100, 6000);
}

Result<Recipe> parse_recipe(std::string_view text,
                            const std::string& path,
                            const RecipeOverrides& overrides,
                            const std::vector<EmbeddedExercise>* exercises,
                            const StageTable& table) {
    Recipe recipe;
    recipe.settings = StageSettings(table);
    recipe.path = path;
    recipe.folder = fs::path(path).parent_path().string();
    recipe.data = overrides.data;
    recipe.text = std::string(text);
    const auto built_in = built_in_tissues();
    recipe.tissues.assign(built_in.begin(), built_in.end());
    std::vector<std::string> named;
    SONOCASE_TRY_DONE(read_text(text, overrides, recipe, &named));
    if (recipe.name.empty()) recipe.name = fs::path(recipe.folder).filename().string();
    if (recipe.name.empty()) recipe.name = "case";

    if (exercises != nullptr)
        recipe.exercises = chosen(*exercises, named);
    else
        SONOCASE_TRY_DONE(load_exercises(recipe, named));
    SONOCASE_TRY_DONE(check_exercises(recipe));
    SONOCASE_TRY_DONE(aim_region(recipe));
    SONOCASE_TRY_DONE(check_stages(recipe));
    return recipe;
}

Result<Recipe> load_recipe(const std::string& path,
                           const RecipeOverrides& overrides,
                           const StageTable& table) {
    std::error_code code;
    const std::string file =
        fs::is_directory(path, code) ? (fs::path(path) / "case.toml").string() : path;
    SONOCASE_TRY(auto text, read_text_file(file));
    return parse_recipe(text, file, overrides, nullptr, table);
}

Result<Recipe> embedded_recipe(const RecipeOverrides& overrides, const StageTable& table) {
    const std::vector<EmbeddedExercise> exercises = embedded_exercises();
    return parse_recipe(embedded_case_toml(), "(embedded)/case.toml", overrides, &exercises, table);
}

}  // namespace sonocase::pipeline::inline stages
