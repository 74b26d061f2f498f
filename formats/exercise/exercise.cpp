// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/exercise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "formats/base/constants.h"
#include "formats/exercise/exercise_texts.h"
#include "formats/exercise/metric_table.h"
#include "formats/pathology/pathology_kinds.h"
#include "formats/text/nearest_name.h"
#include "formats/text/toml_reader.h"

namespace sonocase {
namespace {

// The names in the order of the enumerations.
const std::vector<std::string>& shape_names() {
    static const std::vector<std::string> names{"linear", "curvilinear", "phased"};
    return names;
}

const std::vector<std::string>& appearance_names() {
    static const std::vector<std::string> names{"none", "marker",  "lesion",
                                                "cyst", "abscess", "calyx"};
    return names;
}

std::vector<std::string> appearance_and_kind_names() {
    std::vector<std::string> names = appearance_names();
    const std::vector<std::string> kinds = kinds_drawn_per_attempt();
    names.insert(names.end(), kinds.begin(), kinds.end());
    return names;
}

const std::vector<std::string>& mode_names() {
    static const std::vector<std::string> names{"practice", "exam"};
    return names;
}

void read_probe(const TomlTable& table, Probe& probe) {
    if (const auto shape = table.choice("shape", shape_names()))
        probe.shape = static_cast<ProbeShape>(*shape);
    double degrees = 0;
    if (table.number("field_of_view_deg", degrees, 1, 179))
        probe.field_of_view_rad = degrees * kPi / 180;
    for (const ProbeNumber& number : probe_numbers()) {
        const bool given = table.number(number.name, probe.*number.value, number.min, number.max);
        if (given && degrees != 0 && number.value == &Probe::field_of_view_rad) {
            table.add_fault("field_of_view_rad", "is given twice, in degrees and in radians",
                            "keep one");
        }
    }
    table.finish();
}

void read_needle(const TomlTable& table, NeedleModel& needle) {
    const bool gauge = table.number("gauge", needle.gauge, kMinGauge, kMaxGauge);
    const bool diameter = table.number("diameter_mm", needle.diameter_mm, 0, kMaxNeedleDiameterMm);
    if (const auto make = table.choice("make", needle_make_names())) {
        needle.make = &needle_makes()[*make];
        if (!gauge && !diameter) needle.diameter_mm = needle.make->diameter_mm;
    }
    table.number("length_mm", needle.length_mm, 1, kMaxNeedleLengthMm);
    table.number("slab_mm", needle.slab_mm, 0, 50);
    table.number("tip_visibility", needle.tip_visibility, 0, 1);
    table.number("shaft_visibility", needle.shaft_visibility, 0, 1);
    table.number("bend_max_weight", needle.bend_max_weight, 0, 1);
    table.number("bend_alpha_per_m", needle.bend_alpha_per_m, 0, 1e5, true);
    table.number("bend_delta_m", needle.bend_delta_m, 0, 10);
    table.finish();
}

// What targets and findings share.
Target read_place_and_appearance(const TomlTable& table, const std::string& name) {
    Target target;
    target.name = name;
    table.text("name", target.name);
    if (!table.point("centre", target.centre) && !table.has("centre")) {
        table.add_fault("centre", "is missing",
                        "expected the centre of the target in mm, as in [10, 20, 30]");
    }
    table.number("radius_mm", target.radius_mm, 0.1, 200);
    static const std::vector<std::string> looks = appearance_and_kind_names();
    if (const auto look = table.choice("look", looks)) {
        const bool kind = *look >= appearance_names().size();
        target.look = kind ? TargetLook::lesion : static_cast<TargetLook>(*look);
        if (kind) target.kind = looks[*look];
    }
    table.text("inside", target.inside);
    table.number("spread_mm", target.spread_mm, 0, 200);
    table.number("clearance_mm", target.clearance_mm, 0, 100);
    return target;
}

void read_target(const TomlTable& table, std::vector<Target>& targets) {
    Target target =
        read_place_and_appearance(table, "target " + std::to_string(targets.size() + 1));
    if (!table.number("hit_radius_mm", target.hit_radius_mm, 0.1, 200) && table.has("radius_mm"))
        target.hit_radius_mm = target.radius_mm;
    table.finish();
    targets.push_back(std::move(target));
}

void read_finding(const TomlTable& table, std::vector<Finding>& findings) {
    Finding finding;
    finding.lesion =
        read_place_and_appearance(table, "finding " + std::to_string(findings.size() + 1));
    if (finding.lesion.look == TargetLook::none || finding.lesion.look == TargetLook::marker)
        table.add_fault("look", "is missing, or shows nothing",
                        "expected what the finding is, as in \"simple_cyst\"");
    table.number("radius_spread", finding.radius_spread, 0, 0.8);
    table.number("chance", finding.chance, 0, 1, true);
    table.finish();
    findings.push_back(std::move(finding));
}

void read_sweep(const TomlTable& table, std::vector<Sweep>& sweeps) {
    Sweep sweep;
    table.text("name", sweep.name);
    if (sweep.name.empty())
        table.add_fault("name", "is missing or empty", "the player starts it as sweep:NAME");
    table.flag("snap_to_skin", sweep.snap_to_skin);
    for (const TomlTable& item : table.tables("keys")) {
        SweepKey key;
        if (!item.has("time_s")) item.add_fault("time_s", "is missing", "");
        if (!item.has("probe"))
            item.add_fault("probe", "is missing", "expected the middle of the probe face in mm");
        item.number("time_s", key.time_s, 0, 1e6);
        item.point("probe", key.probe);
        item.direction("beam", key.beam);
        item.direction("lateral", key.lateral);
        const bool tip = item.point("needle_tip", key.needle_tip);
        const bool direction = item.direction("needle_direction", key.needle_direction);
        key.has_needle = tip;
        std::string acts, unread;
        item.text("acts", acts);
        key.acts = acts_of(acts, &unread);
        if (!unread.empty())
            item.add_fault("acts", "'" + unread + "' is not an act",
                           "expected such as \"inject=5;aspirate=10\", at most four");
        if (direction && !tip)
            item.add_fault("needle_tip", "is missing beside needle_direction",
                           "expected both or neither");
        if (norm(cross(key.beam, key.lateral)) < 1e-6) {
            item.add_fault("lateral", "is parallel to the beam", "expected a direction across it");
        }
        if (!sweep.keys.empty() && !(key.time_s > sweep.keys.back().time_s)) {
            item.add_fault("time_s", "does not increase", "expected key poses in order of time");
        }
        item.finish();
        sweep.keys.push_back(key);
    }
    if (sweep.keys.empty())
        table.add_fault("keys", "is empty", "expected at least one [[sweeps.keys]]");
    table.finish();
    for (const Sweep& other : sweeps) {
        if (other.name == sweep.name)
            table.add_fault("name", "'" + sweep.name + "' is given twice", "");
    }
    sweeps.push_back(std::move(sweep));
}

void read_pass_mark(const TomlTable& table, std::vector<Exercise::PassMark>& marks) {
    Exercise::PassMark mark;
    table.text("metric", mark.metric);
    if (mark.metric.empty())
        table.add_fault("metric", "is missing or empty", "expected a name from docs/metrics.md");
    if (!mark.metric.empty() && !find_metric(mark.metric)) {
        // Listing all names would hide the fault.
        const std::string nearest = nearest_name(mark.metric, metric_names());
        table.add_fault(
            "metric", "'" + mark.metric + "' is not a score",
            nearest.empty() ? "docs/metrics.md lists them" : "did you mean '" + nearest + "'?");
    }
    const bool has_max = table.number("at_most", mark.at_most, -1e12, 1e12);
    const bool has_min = table.number("at_least", mark.at_least, -1e12, 1e12);
    if (!has_max && !has_min && !table.has("at_most") && !table.has("at_least")) {
        table.add_fault("metric", "has no limit", "expected at_most or at_least beside it");
    }
    table.finish();
    marks.push_back(std::move(mark));
}

// The text without the line breaks within its paragraphs, which an empty line separates: the window
// breaks lines by itself.
std::string flowed(const std::string& lines) {
    std::string text;
    std::istringstream in(lines);
    bool parted = false;
    for (std::string line; std::getline(in, line);) {
        const std::size_t first = line.find_first_not_of(" \t\r");
        if (first == std::string::npos) {
            parted = !text.empty();
            continue;
        }
        if (!text.empty()) text += parted ? "\n" : " ";
        text += line.substr(first, line.find_last_not_of(" \t\r") + 1 - first);
        parted = false;
    }
    return text;
}

template <class List>
const typename List::value_type* named(const List& list, const std::string& name) {
    for (const auto& one : list)
        if (one.name == name) return &one;
    return nullptr;
}

// exercise: that the texts belong to; null: they are not compared with it here.
void read_procedure_texts(const TomlTable& own, const Exercise* exercise, ExerciseTexts& texts) {
    const auto unknown = [](const TomlTable& table, const std::string& name) {
        table.add_fault("name", "'" + name + "' is not in the procedure",
                        "expected the name of one of its [[steps]] or [[items]]");
    };
    for (const TomlTable& table : own.tables("steps")) {
        ExerciseTexts::Step step;
        table.text("name", step.name);
        table.text("title", step.title);
        table.text("instruction", step.instruction);
        if (exercise && !named(exercise->procedure.steps, step.name)) unknown(table, step.name);
        table.finish();
        texts.steps.push_back(std::move(step));
    }
    for (const TomlTable& table : own.tables("items")) {
        ExerciseTexts::Item item;
        table.text("name", item.name);
        table.text("title", item.title);
        table.text("question", item.question);
        table.texts("options", item.options, true);
        if (exercise) {
            const ProcedureItem* of = named(exercise->procedure.items, item.name);
            if (!of) unknown(table, item.name);
            if (of && !item.options.empty() && item.options.size() != of->options.size())
                table.add_fault(
                    "options", "has " + std::to_string(item.options.size()) + " texts",
                    "expected " + std::to_string(of->options.size()) + ", one for each option");
        }
        table.finish();
        texts.items.push_back(std::move(item));
    }
}

// exercise: that the texts belong to; null: they are not compared with it here.
std::vector<ExerciseTexts> read_texts(const TomlTable& table, const Exercise* exercise) {
    std::vector<ExerciseTexts> all;
    for (const std::string& language : table.keys()) {
        const auto own = table.table(language);
        if (language.size() != 2)
            table.add_fault(language, "is not a language code",
                            "expected two letters, as in [texts.de]");
        if (!own || language.size() != 2) continue;
        ExerciseTexts texts;
        texts.language = language;
        own->text("title", texts.title);
        own->text("description", texts.description);
        texts.description = flowed(texts.description);
        own->texts("hints", texts.hints, true);
        if (exercise && !texts.hints.empty() && texts.hints.size() != exercise->hints.size())
            own->add_fault("hints", "has " + std::to_string(texts.hints.size()) + " texts",
                           "expected " + std::to_string(exercise->hints.size()) +
                               ", one for each of the exercise's hints");
        read_procedure_texts(*own, exercise, texts);
        own->finish();
        all.push_back(std::move(texts));
    }
    table.finish();
    return all;
}

FreeFluid read_free_fluid(const TomlTable& table, bool named) {
    FreeFluid fluid;
    if (named) {
        fluid.name.clear();
        table.text("name", fluid.name);
        if (fluid.name.empty())
            table.add_fault("name", "is missing or empty", "expected where it lies");
        table.number("chance", fluid.chance, 0, 1, true);
    }
    if (!table.number("ml", fluid.ml, 1, 20000) && !table.has("ml"))
        table.add_fault("ml", "is missing", "expected a volume, as in ml = 2000");
    table.number("ml_spread", fluid.ml_spread, 0, 0.9);
    table.flag("blood", fluid.blood);
    table.text("lies_in", fluid.lies_in);
    if (fluid.lies_in.empty())
        table.add_fault("lies_in", "is missing or empty",
                        "expected the label of what lies between the bowels");
    if (!table.point("centre", fluid.centre) && !table.has("centre"))
        table.add_fault("centre", "is missing", "expected the middle of the abdomen");
    Point3 half;
    if (table.point("half_mm", half)) fluid.half_mm = half - Point3{};
    for (int axis = 0; axis < 3; ++axis) {
        if (fluid.half_mm[axis] >= 5 && fluid.half_mm[axis] <= 400) continue;
        table.add_fault("half_mm", "is missing or out of range",
                        "expected three lengths from 5 to 400 mm: across, front to back, head to "
                        "foot");
        break;
    }
    table.direction("up", fluid.up);
    table.direction("head", fluid.head);
    if (std::abs(dot(fluid.up, fluid.head)) > 0.7)
        table.add_fault("head", "points almost along up", "expected it along the spine");
    table.finish();
    return fluid;
}

// [free_fluid], or [[free_fluid]] for several that have names.
void read_free_fluids(const TomlTable& root, std::vector<FreeFluid>& fluids) {
    if (!root.has("free_fluid")) return;
    if (root.plain_value("free_fluid") == "(a table)") {
        if (auto table = root.table("free_fluid")) fluids = {read_free_fluid(*table, false)};
        return;
    }
    for (const TomlTable& table : root.tables("free_fluid")) {
        FreeFluid fluid = read_free_fluid(table, true);
        for (const FreeFluid& before : fluids)
            if (before.name == fluid.name)
                table.add_fault("name", "'" + fluid.name + "' is there twice",
                                "expected a name of its own");
        fluids.push_back(std::move(fluid));
    }
    if (fluids.size() > SceneChange::kMaxFluids) {
        root.add_fault("free_fluid", "is there " + std::to_string(fluids.size()) + " times",
                       "expected at most " + std::to_string(SceneChange::kMaxFluids));
        fluids.resize(SceneChange::kMaxFluids);
    }
}

Exercise read_exercise(const TomlTable& root) {
    Exercise e;
    root.text("name", e.name);
    if (e.name.empty())
        root.add_fault("name", "is missing or empty",
                       "expected a short name, as in \"liver-biopsy\"");
    e.title = e.name;
    root.text("title", e.title);
    root.text("description", e.description);
    e.description = flowed(e.description);
    root.text("kind", e.kind, {"biopsy", "drainage", "nephrostomy", "vascular", "scan"});
    root.whole("difficulty", e.difficulty, 1, 5);
    if (const auto mode = root.choice("mode", mode_names()))
        e.mode = static_cast<ExerciseMode>(*mode);
    root.texts("hints", e.hints, true);
    root.whole("mastery", e.mastery, 1, 100);
    root.text("model", e.model, {"physical", "paper"});
    root.texts("effects", e.effects, true);
    if (auto table = root.table("probe")) read_probe(*table, e.probe);
    if (auto table = root.table("needle")) read_needle(*table, e.needle);
    for (const TomlTable& table : root.tables("targets")) read_target(table, e.targets);
    for (const TomlTable& table : root.tables("findings")) read_finding(table, e.findings);
    root.texts("no_go", e.no_go);
    root.point("start_probe", e.start_probe);
    root.direction("start_beam", e.start_beam);
    root.direction("start_lateral", e.start_lateral);
    root.number("start_spread_mm", e.start_spread_mm, 0, 500);
    for (const TomlTable& table : root.tables("sweeps")) read_sweep(table, e.sweeps);
    if (auto table = root.table("breathing")) {
        table->number("amplitude_mm", e.breathing.amplitude_mm, 0, 100);
        table->number("period_s", e.breathing.period_s, 0.5, 60);
        table->direction("direction", e.breathing.direction);
        table->finish();
    }
    if (auto table = root.table("pulsation")) {
        table->number("amplitude_mm", e.pulsation.amplitude_mm, 0, 20);
        table->number("rate_per_min", e.pulsation.rate_per_min, 1, 400);
        table->finish();
    }
    if (auto table = root.table("deformation")) {
        Deformation& d = e.deformation;
        table->number("venous_pressure_mmhg", d.venous_pressure_mmhg, 0.5, 60);
        table->number("stiffness_scale", d.stiffness_scale, 0.05, 20);
        table->number("press_offset_mm", d.press_offset_mm, 0, 40);
        table->number("force_limit_n", d.force_limit_n, 0.1, 200);
        table->number("vein_level_mm", d.vein_level_mm, -2, 2);
        table->number("vein_swell_mm", d.vein_swell_mm, 0, 2);
        table->finish();
    }
    read_free_fluids(root, e.free_fluids);
    for (const TomlTable& table : root.tables("pass_marks")) read_pass_mark(table, e.pass_marks);
    e.procedure = read_procedure(root, e);
    if (!e.free_fluids.empty() && !e.procedure.given())
        root.add_fault("free_fluid", "stands alone",
                       "expected [[steps]] or [[items]], which say what to do about it");
    if (auto table = root.table("texts")) read_texts(*table, &e);
    root.finish();
    return e;
}

}  // namespace

Result<Exercise> parse_exercise(std::string_view text, const std::string& where) {
    SONOCASE_TRY(const auto root, TomlTable::parse(text, where));
    std::string frame = "mannequin";
    root.text("frame", frame, {"ct", "mannequin"});
    Exercise exercise = read_exercise(root);
    if (frame == "ct")
        return Error{"the positions are those of the CT", where,
                     "expected frame = \"mannequin\", or a case that is built with this file: "
                     "building moves them"};
    if (root.fault()) return *root.fault();
    return exercise;
}

Rigid start_pose(const Exercise& exercise) {
    Vector3 z = normalized(exercise.start_beam);
    if (norm(z) == 0) z = {0, 0, -1};
    const Vector3 across = exercise.start_lateral - dot(exercise.start_lateral, z) * z;
    const Vector3 x = norm(across) > 1e-6 ? normalized(across) : any_perpendicular(z);
    return {Matrix3::from_columns(x, cross(z, x), z), exercise.start_probe - Point3{}};
}

Result<std::vector<ExerciseTexts>> parse_exercise_texts(std::string_view toml,
                                                        const std::string& where) {
    SONOCASE_TRY(const auto root, TomlTable::parse(toml, where));
    std::vector<ExerciseTexts> texts;
    if (auto table = root.table("texts")) texts = read_texts(*table, nullptr);
    if (root.fault()) return *root.fault();
    return texts;
}

ExerciseTexts texts_in(const Exercise& exercise,
                       const std::vector<ExerciseTexts>& texts,
                       std::string_view language) {
    ExerciseTexts out{.language = std::string(language),
                      .title = exercise.title.empty() ? exercise.name : exercise.title,
                      .description = exercise.description,
                      .hints = exercise.hints,
                      .steps = {},
                      .items = {}};
    for (const ProcedureStep& step : exercise.procedure.steps)
        out.steps.push_back({step.name, step.title, step.instruction});
    for (const ProcedureItem& item : exercise.procedure.items)
        out.items.push_back({item.name, item.title, item.question, item.options});
    const auto take = [](std::string& to, const std::string& own) {
        if (!own.empty()) to = own;
    };
    for (const ExerciseTexts& own : texts) {
        if (own.language != language) continue;
        take(out.title, own.title);
        take(out.description, own.description);
        if (own.hints.size() == exercise.hints.size()) out.hints = own.hints;
        for (ExerciseTexts::Step& step : out.steps) {
            const ExerciseTexts::Step* other = named(own.steps, step.name);
            if (!other) continue;
            take(step.title, other->title);
            take(step.instruction, other->instruction);
        }
        for (ExerciseTexts::Item& item : out.items) {
            const ExerciseTexts::Item* other = named(own.items, item.name);
            if (!other) continue;
            take(item.title, other->title);
            take(item.question, other->question);
            if (other->options.size() == item.options.size()) item.options = other->options;
        }
    }
    return out;
}

std::vector<Target> shown_lesions(const Exercise& exercise) {
    std::vector<Target> shown;
    for (const Finding& finding : exercise.findings) shown.push_back(finding.lesion);
    shown.insert(shown.end(), exercise.targets.begin(), exercise.targets.end());
    return shown;
}

std::string lesion_kind_name(const Target& lesion) {
    return lesion.kind.empty() ? appearance_names()[static_cast<std::size_t>(lesion.look)]
                               : lesion.kind;
}

double shown_radius_mm(const Target& lesion) {
    double radius = lesion.radius_mm;
    if (const PathologyKind* kind = find_pathology_kind(lesion.kind))
        for (const LesionPart& part : kind->parts)
            if (part.place == PartPlace::shell && part.size >= kThinShellMm)
                radius = std::max(radius, lesion.radius_mm + part.size);
    return radius;
}

double outer_radius_mm(const Target& lesion) {
    const Vector3 l = lesion.axes.lengths;
    double reach = lesion.radius_mm * std::max({l.x, l.y, l.z});
    if (const PathologyKind* kind = find_pathology_kind(lesion.kind))
        for (const LesionPart& part : kind->parts)
            if (part.place == PartPlace::shell) reach += part.size;
    return reach;
}

const char* probe_shape_name(ProbeShape shape) {
    return shape_names()[static_cast<std::size_t>(shape)].c_str();
}

Matrix3 free_fluid_axes(const FreeFluid& fluid) {
    const Vector3 up = normalized(fluid.up);
    const Vector3 head = normalized(fluid.head - dot(fluid.head, up) * up);
    return Matrix3::from_columns(cross(up, head), up, head);
}

double half_face_mm(const Probe& probe) {
    return probe.shape == ProbeShape::curvilinear
               ? probe.radius_mm * std::sin(0.5 * probe.field_of_view_rad)
               : 0.5 * probe.width_mm;
}

std::span<const ProbeNumber> probe_numbers() {
    static constexpr ProbeNumber kNumbers[] = {
        {"radius_mm", &Probe::radius_mm, 1, 1000},
        {"field_of_view_rad", &Probe::field_of_view_rad, 0.01, 3.13},
        {"width_mm", &Probe::width_mm, 1, 300},
        {"depth_mm", &Probe::depth_mm, 1, 500},
        {"frequency_mhz", &Probe::frequency_mhz, 0.5, 50},
        {"focus_mm", &Probe::focus_mm, 1, 500},
        {"elevation_mm", &Probe::elevation_mm, 0, 50}};
    return kNumbers;
}

double needle_diameter_mm(const NeedleModel& needle) {
    if (needle.diameter_mm > 0) return needle.diameter_mm;
    // Outer diameters of regular hypodermic tubing, ISO 9626, mm; between whole gauges by
    // interpolation.
    static constexpr std::array<std::array<double, 2>, 21> kTable{
        {{6, 5.16},   {7, 4.57},   {8, 4.19},   {9, 3.76},   {10, 3.40},  {11, 3.05},
         {12, 2.77},  {13, 2.41},  {14, 2.11},  {15, 1.83},  {16, 1.65},  {17, 1.47},
         {18, 1.27},  {19, 1.07},  {20, 0.908}, {21, 0.819}, {22, 0.717}, {24, 0.566},
         {26, 0.464}, {30, 0.312}, {34, 0.185}}};
    const double g = std::clamp(needle.gauge, kTable.front()[0], kTable.back()[0]);
    for (std::size_t i = 1; i < kTable.size(); ++i) {
        if (g > kTable[i][0]) continue;
        const double t = (g - kTable[i - 1][0]) / (kTable[i][0] - kTable[i - 1][0]);
        return kTable[i - 1][1] + t * (kTable[i][1] - kTable[i - 1][1]);
    }
    return kTable.back()[1];
}

}  // namespace sonocase
