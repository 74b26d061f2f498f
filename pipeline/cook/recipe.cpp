// SPDX-License-Identifier: Apache-2.0

#include "pipeline/cook/recipe.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>

#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "formats/exercise/exercise.h"
#include "formats/files/atomic_file.h"
#include "formats/text/nearest_name.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/cook/embedded_scenario.h"
#include "pipeline/cook/exercise_frame.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

std::string place(const std::string& path, const toml::source_region& source) {
    return source.begin.line > 0 ? path + ":" + std::to_string(source.begin.line) : path;
}

// The value as --set would have it: strings without quotes.
std::string text_of(const toml::node& node) {
    if (const auto text = node.value<std::string>(); node.is_string() && text) return *text;
    std::ostringstream out;
    if (node.is_boolean())
        out << (*node.value<bool>() ? "true" : "false");
    else if (node.is_integer())
        out << *node.value<std::int64_t>();
    else if (node.is_floating_point()) {
        char text[32];
        out << std::string(text,
                           std::to_chars(text, text + sizeof text, *node.value<double>()).ptr);
    } else {
        out << "(a " << (node.is_array() ? "list" : "table") << ")";
    }
    return out.str();
}

// Fills a Recipe from TOML; the first fault ends it.
class RecipeParser {
  public:
    RecipeParser(Recipe& recipe, std::string path) : recipe_(recipe), path_(std::move(path)) {}

    Status parse(const toml::table& root, std::vector<std::string>* exercises) {
        std::vector<std::string> known{"name",   "title",    "preset", "exercises",
                                       "inputs", "analytic", "labels", "tissues"};
        for (const std::string& section : option_sections()) known.push_back(section);
        for (const auto& [key, node] : root) {
            const std::string name(key.str());
            Status status = Done{};
            if (name == "name" || name == "title" || name == "preset")
                status = top_text(name, node);
            else if (name == "exercises")
                status = texts(node, name, exercises);
            else if (std::find(known.begin(), known.end(), name) == known.end())
                status = unknown_key(name, key.source(), known);
            else if (!node.is_table())
                status = Error{"'" + name + "' is no table", place(path_, node.source()),
                               "expected [" + name + "] with keys below it"};
            else if (name == "inputs")
                status = inputs(*node.as_table());
            else if (name == "analytic")
                status = analytic(*node.as_table());
            else if (name == "labels")
                status = labels(*node.as_table());
            else if (name == "tissues")
                status = tissues(*node.as_table());
            if (!status) return status;
        }
        return Done{};
    }

    // Stage options come after the preset, which may itself be set in the file.
    Status parse_options(const toml::table& root) {
        for (const std::string& section : option_sections()) {
            const toml::table* table = root[section].as_table();
            if (table == nullptr) continue;
            for (const auto& [key, node] : *table) {
                const OptionKey* option = find_option_key(section, key.str());
                if (option == nullptr)
                    return unknown_key(section + "." + std::string(key.str()), key.source(),
                                       option_names(section), std::string(key.str()));
                auto status = set_option(*option, text_of(node), recipe_.options,
                                         place(path_, node.source()));
                if (!status) return status;
            }
        }
        return Done{};
    }

  private:
    Status unknown_key(const std::string& name,
                       const toml::source_region& source,
                       const std::vector<std::string>& known,
                       const std::string& last = {}) {
        return Error{"unknown key '" + name + "'", place(path_, source),
                     suggest_name(last.empty() ? name : last, known)};
    }
    Status wrong_type(const std::string& name, const toml::node& node, const char* expected) {
        return Error{"'" + name + "' is " + text_of(node), place(path_, node.source()),
                     std::string("expected ") + expected};
    }
    Status text(const toml::node& node, const std::string& name, std::string* to) {
        if (!node.is_string()) return wrong_type(name, node, "text in quotes");
        *to = *node.value<std::string>();
        return Done{};
    }
    Status number(
        const toml::node& node, const std::string& name, double low, double high, double* to) {
        const auto value = node.value<double>();
        if (!node.is_number() || !value || !(*value >= low) || !(*value <= high)) {
            std::ostringstream range;
            range << "a number from " << low << " to " << high;
            return wrong_type(name, node, range.str().c_str());
        }
        *to = *value;
        return Done{};
    }
    Status whole(
        const toml::node& node, const std::string& name, double low, double high, double* to) {
        auto status = number(node, name, low, high, to);
        if (status && *to != std::floor(*to)) return wrong_type(name, node, "a whole number");
        return status;
    }
    Status flag(const toml::node& node, const std::string& name, bool* to) {
        if (!node.is_boolean()) return wrong_type(name, node, "true or false");
        *to = *node.value<bool>();
        return Done{};
    }
    Status texts(const toml::node& node, const std::string& name, std::vector<std::string>* to) {
        const toml::array* list = node.as_array();
        if (list == nullptr) return wrong_type(name, node, "a list of texts");
        to->clear();
        for (const toml::node& item : *list) {
            std::string one;
            if (auto status = text(item, name, &one); !status) return status;
            to->push_back(one);
        }
        return Done{};
    }
    Status top_text(const std::string& name, const toml::node& node) {
        std::string ignored;
        if (name == "name") return text(node, name, &recipe_.name);
        if (name == "title") return text(node, name, &ignored);
        if (auto status = text(node, name, &recipe_.preset); !status) return status;
        const std::vector<std::string> presets = preset_names();
        if (std::find(presets.begin(), presets.end(), recipe_.preset) == presets.end())
            return Error{"unknown preset '" + recipe_.preset + "'", place(path_, node.source()),
                         suggest_name(recipe_.preset, presets)};
        return Done{};
    }

    Status inputs(const toml::table& table) {
        RecipeInputs& in = recipe_.inputs;
        const std::vector<std::string> known{
            "labels",        "label_table", "labels_scale", "surface",
            "surface_scale", "examples",    "landmarks",    "up"};
        for (const auto& [key, node] : table) {
            const std::string name(key.str()), full = "inputs." + name;
            Status status = Done{};
            if (name == "labels")
                status = text(node, full, &in.labels);
            else if (name == "label_table")
                status = text(node, full, &in.label_table);
            else if (name == "surface")
                status = text(node, full, &in.surface);
            else if (name == "examples")
                status = text(node, full, &in.examples);
            else if (name == "landmarks")
                status = text(node, full, &in.landmarks);
            else if (name == "labels_scale")
                status = number(node, full, 1e-6, 1e6, &in.labels_scale);
            else if (name == "surface_scale")
                status = number(node, full, 1e-6, 1e6, &in.surface_scale);
            else if (name == "up")
                status = direction(node, full, &in.up);
            else
                status = unknown_key(full, key.source(), known, name);
            if (!status) return status;
        }
        return Done{};
    }

    Status direction(const toml::node& node, const std::string& name, std::optional<Vector3>* to) {
        const toml::array* list = node.as_array();
        Vector3 v;
        bool good = list != nullptr && list->size() == 3;
        for (int axis = 0; good && axis < 3; ++axis) {
            const auto value = (*list)[static_cast<std::size_t>(axis)].value<double>();
            good = value.has_value() && std::isfinite(*value);
            if (good) v[axis] = *value;
        }
        if (!good || !(norm(v) > 1e-9))
            return wrong_type(name, node, "a direction of three numbers");
        *to = normalized(v);
        return Done{};
    }

    Status analytic(const toml::table& table) {
        recipe_.inputs.analytic = true;
        AnalyticInput& in = recipe_.inputs.torso;
        const std::vector<std::string> known{
            "body",     "voxel_mm",  "slice_mm",   "points",    "noise_mm",         "mesh",
            "seed",     "known_map", "front_only", "strength",  "width_scale",      "depth_scale",
            "belly_mm", "examples",  "up",         "landmarks", "landmark_noise_mm"};
        // The named body comes first: the proportions beside it change it.
        if (const toml::node* node = table.get("body")) {
            std::string body;
            if (auto status = text(*node, "analytic.body", &body); !status) return status;
            const auto found = analytic_body(body);
            if (!found)
                return Error{"unknown body '" + body + "'", place(path_, node->source()),
                             suggest_name(body, analytic_body_names())};
            in.body = *found;
        }
        for (const auto& [key, node] : table) {
            const std::string name(key.str()), full = "analytic." + name;
            Status status = Done{};
            double value = 0;
            if (name == "body")
                continue;
            else if (name == "voxel_mm")
                status = number(node, full, 0.5, 10, &in.voxel_mm);
            else if (name == "up")
                status = direction(node, full, &recipe_.inputs.up);
            else if (name == "landmarks") {
                status = whole(node, full, 0, 14, &value);
                in.landmarks = static_cast<int>(value);
            } else if (name == "landmark_noise_mm")
                status = number(node, full, 0, 50, &in.landmark_noise_mm);
            else if (name == "slice_mm")
                status = number(node, full, 0.5, 10, &in.slice_mm);
            else if (name == "noise_mm")
                status = number(node, full, 0, 20, &in.mannequin.noise_mm);
            else if (name == "strength")
                status = number(node, full, 0, 2, &in.mannequin.strength);
            else if (name == "width_scale")
                status = number(node, full, 0.7, 1.4, &in.body.width_scale);
            else if (name == "depth_scale")
                status = number(node, full, 0.7, 1.4, &in.body.depth_scale);
            else if (name == "belly_mm")
                status = number(node, full, 0, 40, &in.body.belly_mm);
            else if (name == "mesh")
                status = flag(node, full, &in.mannequin.mesh);
            else if (name == "known_map")
                status = flag(node, full, &in.known_map);
            else if (name == "front_only")
                status = flag(node, full, &in.mannequin.front_only);
            else if (name == "examples")
                status = text(node, full, &recipe_.inputs.examples);
            else if (name == "points") {
                status = whole(node, full, 100, 1e6, &value);
                in.mannequin.points = static_cast<int>(value);
            } else if (name == "seed") {
                status = whole(node, full, 0, 2e9, &value);
                in.mannequin.seed = static_cast<std::uint64_t>(value);
            } else {
                status = unknown_key(full, key.source(), known, name);
            }
            if (!status) return status;
        }
        return Done{};
    }

    Status labels(const toml::table& table) {
        for (const auto& [key, node] : table) {
            LabelChoice choice{std::string(key.str()), "",
                               static_cast<int>(key.source().begin.line)};
            if (auto status = text(node, "labels." + choice.label, &choice.tissue); !status)
                return status;
            recipe_.labels.push_back(std::move(choice));
        }
        std::sort(recipe_.labels.begin(), recipe_.labels.end(),
                  [](const LabelChoice& a, const LabelChoice& b) { return a.line < b.line; });
        return Done{};
    }

    Status tissues(const toml::table& table) {
        for (const auto& [key, node] : table) {
            const std::string name(key.str());
            const toml::table* fields = node.as_table();
            if (fields == nullptr)
                return wrong_type("tissues." + name, node,
                                  "a table, [tissues."
                                  "x]");
            if (auto status = tissue(name, *fields); !status) return status;
        }
        return Done{};
    }

    Status tissue(const std::string& name, const toml::table& fields) {
        std::vector<Tissue>& all = recipe_.tissues;
        const auto named = [&](const std::string& wanted) {
            return std::find_if(all.begin(), all.end(),
                                [&](const Tissue& t) { return t.name == wanted; });
        };
        const std::vector<std::string> known{"like",
                                             "kind",
                                             "casts_shadow",
                                             "texture",
                                             "grey_mean",
                                             "grey_sd",
                                             "echo_db",
                                             "structure_db",
                                             "attenuation_db_cm_mhz",
                                             "impedance_mrayl",
                                             "sound_speed_m_s",
                                             "source"};
        Tissue tissue;
        if (const auto found = named(name); found != all.end())
            tissue = *found;
        else
            tissue = *named("soft_tissue");
        tissue.source = "recipe";
        if (const toml::node* like = fields.get("like")) {
            std::string other;
            if (auto status = text(*like, "tissues." + name + ".like", &other); !status)
                return status;
            const auto found = named(other);
            if (found == all.end()) {
                std::vector<std::string> names;
                for (const Tissue& t : all) names.push_back(t.name);
                return Error{"unknown tissue '" + other + "'", place(path_, like->source()),
                             suggest_name(other, names)};
            }
            tissue = *found;
        }
        tissue.name = name;
        for (const auto& [key, node] : fields) {
            const std::string field(key.str()), full = "tissues." + name + "." + field;
            Status status = Done{};
            if (field == "like") continue;
            if (field == "kind")
                status = kind(node, full, &tissue.kind);
            else if (field == "casts_shadow")
                status = flag(node, full, &tissue.casts_shadow);
            else if (field == "texture")
                status = text(node, full, &tissue.texture);
            else if (field == "source")
                status = text(node, full, &tissue.source);
            else if (field == "grey_mean")
                status = number(node, full, 0, 255, &tissue.grey_mean);
            else if (field == "grey_sd")
                status = number(node, full, 0, 255, &tissue.grey_sd);
            else if (field == "echo_db")
                status = number(node, full, -120, 60, &tissue.echo_db);
            else if (field == "structure_db")
                status = number(node, full, 0, 30, &tissue.structure_db);
            else if (field == "attenuation_db_cm_mhz")
                status = number(node, full, 0, 100, &tissue.attenuation_db_cm_mhz);
            else if (field == "impedance_mrayl")
                status = number(node, full, 0, 20, &tissue.impedance_mrayl);
            else if (field == "sound_speed_m_s")
                status = number(node, full, 100, 6000, &tissue.sound_speed_m_s);
            else
                status = unknown_key(full, key.source(), known, field);
            if (!status) return status;
        }
        if (const auto found = named(name); found != all.end())
            *found = tissue;
        else
            all.push_back(tissue);
        return Done{};
    }

    Status kind(const toml::node& node, const std::string& name, TissueKind* to) {
        const std::vector<std::string> kinds{"outside", "soft", "fluid", "gas", "bone"};
        std::string given;
        if (auto status = text(node, name, &given); !status) return status;
        const auto found = std::find(kinds.begin(), kinds.end(), given);
        if (found == kinds.end())
            return Error{"unknown kind '" + given + "'", place(path_, node.source()),
                         suggest_name(given, kinds)};
        *to = static_cast<TissueKind>(found - kinds.begin());
        return Done{};
    }

    Recipe& recipe_;
    std::string path_;
};

Status apply_sets(Recipe& recipe, const std::vector<std::string>& sets) {
    std::vector<std::string> known;
    for (const OptionKey& key : option_keys())
        known.push_back(std::string(key.section) + "." + key.key);
    for (const std::string& set : sets) {
        const std::size_t equals = set.find('=');
        if (equals == std::string::npos)
            return Error{"'" + set + "' has no '='", "--set", "expected --set section.key=value"};
        const std::string name = set.substr(0, equals), value = set.substr(equals + 1);
        const std::size_t dot = name.find('.');
        const OptionKey* key = dot == std::string::npos
                                   ? nullptr
                                   : find_option_key(name.substr(0, dot), name.substr(dot + 1));
        if (key == nullptr)
            return Error{"unknown key '" + name + "'", "--set", suggest_name(name, known)};
        if (auto status = set_option(*key, value, recipe.options, "--set"); !status) return status;
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
    if (in.surface.empty())
        return Error{"no inputs.surface", recipe.path, "expected the digitised mannequin"};
    return Done{};
}

// Exercises beside the recipe: those it names, or all that lie beside a case.toml.
Status load_exercises(Recipe& recipe, const std::vector<std::string>& named) {
    std::vector<std::string> names = named;
    if (names.empty() && fs::path(recipe.path).filename() == "case.toml") {
        std::error_code code;
        for (const auto& entry :
             fs::directory_iterator(recipe.folder.empty() ? "." : recipe.folder, code))
            if (entry.path().extension() == ".toml" && entry.path().filename() != "case.toml" &&
                !fs::equivalent(entry.path(), recipe.path, code))
                names.push_back(entry.path().stem().string());
        std::sort(names.begin(), names.end());
    }
    for (const std::string& name : names) {
        const std::string path = (fs::path(recipe.folder) / (name + ".toml")).string();
        auto text = read_text_file(path);
        if (!text) return text.error();
        recipe.exercises.push_back({name, std::move(*text)});
    }
    return Done{};
}

// Those named, in that order; all where none is named.
std::vector<EmbeddedExercise> chosen(const std::vector<EmbeddedExercise>& all,
                                     const std::vector<std::string>& named) {
    if (named.empty()) return all;
    std::vector<EmbeddedExercise> result;
    for (const std::string& name : named)
        for (const EmbeddedExercise& exercise : all)
            if (exercise.name == name) result.push_back(exercise);
    return result;
}

}  // namespace

std::string Recipe::resolve(const std::string& given) const {
    if (given.empty() || fs::path(given).is_absolute()) return given;
    std::error_code code;
    if (!data.empty()) {
        const std::string below = (fs::path(data) / given).string();
        if (fs::exists(below, code)) return below;
        const std::string beside = (fs::path(folder) / given).string();
        return fs::exists(beside, code) ? beside : below;
    }
    return (fs::path(folder) / given).string();
}

Result<Recipe> parse_recipe(std::string_view text,
                            const std::string& path,
                            const RecipeOverrides& overrides,
                            const std::vector<EmbeddedExercise>* exercises) {
    Recipe recipe;
    recipe.path = path;
    recipe.folder = fs::path(path).parent_path().string();
    recipe.data = overrides.data;
    recipe.text = std::string(text);
    const auto built_in = built_in_tissues();
    recipe.tissues.assign(built_in.begin(), built_in.end());

    const toml::parse_result parsed = toml::parse(text, path);
    if (!parsed)
        return Error{std::string(parsed.error().description()),
                     place(path, parsed.error().source()), "expected TOML"};
    RecipeParser parser(recipe, path);
    std::vector<std::string> named;
    if (auto status = parser.parse(parsed.table(), &named); !status) return status.error();
    if (!overrides.preset.empty()) recipe.preset = overrides.preset;
    const auto settings = preset_settings(recipe.preset);
    if (settings.empty())
        return Error{"unknown preset '" + recipe.preset + "'", "--preset",
                     suggest_name(recipe.preset, preset_names())};
    for (const PresetSetting& setting : settings) {
        const std::string name = setting.key;
        const std::size_t dot = name.find('.');
        const OptionKey* key = find_option_key(name.substr(0, dot), name.substr(dot + 1));
        if (auto status = set_option(*key, setting.value, recipe.options, "preset"); !status)
            return status.error();
    }
    if (auto status = parser.parse_options(parsed.table()); !status) return status.error();
    if (auto status = apply_sets(recipe, overrides.sets); !status) return status.error();
    if (auto status = check_inputs(recipe); !status) return status.error();
    if (recipe.name.empty()) recipe.name = fs::path(recipe.folder).filename().string();
    if (recipe.name.empty()) recipe.name = "case";

    if (exercises != nullptr)
        recipe.exercises = chosen(*exercises, named);
    else if (auto status = load_exercises(recipe, named); !status)
        return status.error();
    for (const EmbeddedExercise& exercise : recipe.exercises) {
        const std::string where = (fs::path(recipe.folder) / (exercise.name + ".toml")).string();
        auto framed = strip_frame(exercise.toml, where);
        if (!framed) return framed.error();
        if (auto parsed_exercise = parse_exercise(framed->toml, where); !parsed_exercise)
            return parsed_exercise.error();
    }
    return recipe;
}

Result<Recipe> load_recipe(const std::string& path, const RecipeOverrides& overrides) {
    std::error_code code;
    const std::string file =
        fs::is_directory(path, code) ? (fs::path(path) / "case.toml").string() : path;
    auto text = read_text_file(file);
    if (!text) return text.error();
    return parse_recipe(*text, file, overrides, nullptr);
}

Result<Recipe> embedded_recipe(const RecipeOverrides& overrides) {
    const std::vector<EmbeddedExercise> exercises = embedded_exercises();
    return parse_recipe(embedded_case_toml(), "(embedded)/case.toml", overrides, &exercises);
}

}  // namespace sonocase::pipeline
