// SPDX-License-Identifier: Apache-2.0

#include "formats/exercise/exercise.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <sstream>

#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "formats/exercise/metric_table.h"
#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"

namespace sonocase {
namespace {

// First fault wins; reading goes on with defaults.
struct Faults {
    std::string where;
    std::optional<Error> first;
    void add(const toml::source_region& region, std::string what, std::string expected) {
        if (first) return;
        const std::string line = region.begin ? ", line " + std::to_string(region.begin.line) : "";
        first = Error{std::move(what), where + line, std::move(expected)};
    }
};

// A table whose keys are all asked for by name: what nobody asked for is a typing error.
class Table {
  public:
    Table(const toml::table& table, std::string name, Faults& faults)
        : table_(&table), name_(std::move(name)), faults_(&faults) {}

    void text(const char* key, std::string& to, std::vector<std::string> choices = {}) {
        const toml::node* node = find(key);
        if (!node) return;
        if (!node->is_string()) return complain(key, "is no text", "put it in quotes");
        to = **node->as_string();
        if (!choices.empty() && std::find(choices.begin(), choices.end(), to) == choices.end()) {
            complain(key, "has the unknown value '" + to + "'", suggest_name(to, choices));
        }
    }
    void texts(const char* key, std::vector<std::string>& to, bool single_allowed = false) {
        const toml::node* node = find(key);
        if (!node) return;
        if (single_allowed && node->is_string()) {
            to = {**node->as_string()};
            return;
        }
        if (!node->is_array())
            return complain(key, "is no list", "a list of texts, as in [\"a\", \"b\"]");
        to.clear();
        for (const toml::node& item : *node->as_array()) {
            if (!item.is_string())
                return complain(key, "holds something that is no text", "put it in quotes");
            to.push_back(**item.as_string());
        }
    }
    // low and high belong to the range unless `open_low` excludes the lower end.
    bool number(const char* key, double& to, double low, double high, bool open_low = false) {
        const toml::node* node = find(key);
        if (!node) return false;
        const auto value = node->value<double>();
        if (!node->is_number() || !value) return complain(key, "is no number", ""), false;
        const bool inside = *value >= low && *value <= high && !(open_low && *value == low);
        if (!inside) {
            complain(key, "is " + number_text(*value, 6) + ", out of range",
                     std::string(open_low ? "above " : "from ") + number_text(low, 6) + " to " +
                         number_text(high, 6));
            return false;
        }
        to = *value;
        return true;
    }
    void whole(const char* key, int& to, int low, int high) {
        double value = to;
        if (!number(key, value, low, high)) return;
        if (value != std::floor(value)) return complain(key, "is no whole number", "");
        to = static_cast<int>(value);
    }
    void flag(const char* key, bool& to) {
        const toml::node* node = find(key);
        if (!node) return;
        if (!node->is_boolean()) return complain(key, "is neither true nor false", "");
        to = **node->as_boolean();
    }
    template <class V>
    bool triple(const char* key, V& to) {
        const toml::node* node = find(key);
        if (!node) return false;
        const toml::array* list = node->as_array();
        if (!list || list->size() != 3) return complain(key, "is no list of 3 numbers", ""), false;
        for (int a = 0; a < 3; ++a) {
            const auto value = (*list)[static_cast<std::size_t>(a)].value<double>();
            if (!value || !std::isfinite(*value) || std::abs(*value) > 1e5) {
                return complain(key, "is no list of 3 numbers", "millimetres"), false;
            }
            to[a] = *value;
        }
        return true;
    }
    bool direction(const char* key, Vector3& to) {
        Vector3 v;
        if (!triple(key, v)) return false;
        if (!(norm(v) > 1e-9)) return complain(key, "is a direction of length zero", ""), false;
        to = normalized(v);
        return true;
    }
    std::optional<Table> table(const char* key) {
        const toml::node* node = find(key);
        if (!node) return {};
        if (!node->is_table())
            return complain(key, "is no table", std::string("[") + key + "]"), std::nullopt;
        return Table(*node->as_table(), name_ + key + ".", *faults_);
    }
    std::vector<Table> tables(const char* key) {
        std::vector<Table> out;
        const toml::node* node = find(key);
        if (!node) return out;
        const toml::array* list = node->as_array();
        if (!list)
            return complain(key, "is no list of tables", std::string("[[") + key + "]]"), out;
        for (const toml::node& item : *list) {
            if (!item.is_table()) return complain(key, "holds something that is no table", ""), out;
            out.emplace_back(*item.as_table(),
                             name_ + key + "[" + std::to_string(out.size()) + "].", *faults_);
        }
        return out;
    }
    bool has(const char* key) const { return table_->contains(key); }
    // After every key was asked for.
    void finish() {
        for (const auto& [key, node] : *table_) {
            const std::string name(key.str());
            if (std::find(asked_.begin(), asked_.end(), name) != asked_.end()) continue;
            faults_->add(key.source(), "unknown key '" + name_ + name + "'",
                         suggest_name(name, asked_));
        }
    }
    void complain(const char* key, const std::string& what, std::string expected) {
        const toml::node* node = table_->get(key);
        faults_->add(node ? node->source() : table_->source(), name_ + key + " " + what,
                     std::move(expected));
    }

  private:
    const toml::node* find(const char* key) {
        asked_.emplace_back(key);
        return table_->get(key);
    }
    const toml::table* table_;
    std::string name_;
    Faults* faults_;
    std::vector<std::string> asked_;
};

constexpr double kPi = 3.14159265358979323846;
constexpr std::array<const char*, 3> kShapes{"linear", "curvilinear", "phased"};
constexpr std::array<const char*, 6> kLooks{"none", "marker", "lesion", "cyst", "abscess", "calyx"};

template <class Enum, std::size_t N>
void choice(Table& table, const char* key, Enum& to, const std::array<const char*, N>& names) {
    std::string text;
    table.text(key, text, {names.begin(), names.end()});
    const auto found = std::find(names.begin(), names.end(), text);
    if (found != names.end()) to = static_cast<Enum>(found - names.begin());
}

void read_probe(Table table, Probe& probe) {
    choice(table, "shape", probe.shape, kShapes);
    table.number("radius_mm", probe.radius_mm, 1, 1000);
    double degrees = 0;
    if (table.number("field_of_view_deg", degrees, 1, 179))
        probe.field_of_view_rad = degrees * kPi / 180;
    if (table.number("field_of_view_rad", probe.field_of_view_rad, 0.01, 3.13) && degrees != 0) {
        table.complain("field_of_view_rad", "is given twice, in degrees and in radians",
                       "keep one");
    }
    table.number("width_mm", probe.width_mm, 1, 300);
    table.number("depth_mm", probe.depth_mm, 1, 500);
    table.number("frequency_mhz", probe.frequency_mhz, 0.5, 50);
    table.number("focus_mm", probe.focus_mm, 1, 500);
    table.number("elevation_mm", probe.elevation_mm, 0, 50);
    table.finish();
}

void read_needle(Table table, NeedleModel& needle) {
    table.number("gauge", needle.gauge, 6, 34);
    table.number("diameter_mm", needle.diameter_mm, 0, 10);
    table.number("length_mm", needle.length_mm, 1, 1000);
    table.number("slab_mm", needle.slab_mm, 0, 50);
    table.number("tip_visibility", needle.tip_visibility, 0, 1);
    table.number("shaft_visibility", needle.shaft_visibility, 0, 1);
    table.number("bend_max_weight", needle.bend_max_weight, 0, 1);
    table.number("bend_alpha_per_m", needle.bend_alpha_per_m, 0, 1e5, true);
    table.number("bend_delta_m", needle.bend_delta_m, 0, 10);
    table.finish();
}

void read_target(Table table, std::vector<Target>& targets) {
    Target target;
    target.name = "target " + std::to_string(targets.size() + 1);
    table.text("name", target.name);
    if (!table.triple("centre", target.centre) && !table.has("centre")) {
        table.complain("centre", "is missing",
                       "the middle of the target in mm, as in [10, 20, 30]");
    }
    const bool radius = table.number("radius_mm", target.radius_mm, 0.1, 200);
    if (!table.number("hit_radius_mm", target.hit_radius_mm, 0.1, 200) && radius) {
        target.hit_radius_mm = target.radius_mm;
    }
    choice(table, "look", target.look, kLooks);
    table.text("inside", target.inside);
    table.finish();
    targets.push_back(std::move(target));
}

void read_sweep(Table table, std::vector<Sweep>& sweeps) {
    Sweep sweep;
    table.text("name", sweep.name);
    if (sweep.name.empty())
        table.complain("name", "is missing or empty", "sweep:NAME calls for it");
    table.flag("snap_to_skin", sweep.snap_to_skin);
    for (Table& item : table.tables("keys")) {
        SweepKey key;
        if (!item.has("time_s")) item.complain("time_s", "is missing", "");
        if (!item.has("probe"))
            item.complain("probe", "is missing", "the middle of the probe face in mm");
        item.number("time_s", key.time_s, 0, 1e6);
        item.triple("probe", key.probe);
        item.direction("beam", key.beam);
        item.direction("lateral", key.lateral);
        const bool tip = item.triple("needle_tip", key.needle_tip);
        const bool direction = item.direction("needle_direction", key.needle_direction);
        key.has_needle = tip;
        if (direction && !tip)
            item.complain("needle_tip", "is missing beside needle_direction", "");
        if (norm(cross(key.beam, key.lateral)) < 1e-6) {
            item.complain("lateral", "runs along the beam", "a direction across it");
        }
        if (!sweep.keys.empty() && !(key.time_s > sweep.keys.back().time_s)) {
            item.complain("time_s", "does not rise", "key poses in the order of their times");
        }
        item.finish();
        sweep.keys.push_back(key);
    }
    if (sweep.keys.empty()) table.complain("keys", "is empty", "at least one [[sweeps.keys]]");
    table.finish();
    for (const Sweep& other : sweeps) {
        if (other.name == sweep.name)
            table.complain("name", "'" + sweep.name + "' is there twice", "");
    }
    sweeps.push_back(std::move(sweep));
}

void read_pass_mark(Table table, std::vector<Exercise::PassMark>& marks) {
    Exercise::PassMark mark;
    table.text("metric", mark.metric);
    if (mark.metric.empty())
        table.complain("metric", "is missing or empty", "a name of docs/metrics.md");
    if (!mark.metric.empty() && !find_metric(mark.metric)) {
        // Some fifty names would bury the fault.
        const std::string nearest = nearest_name(mark.metric, metric_names());
        table.complain(
            "metric", "'" + mark.metric + "' is no score",
            nearest.empty() ? "docs/metrics.md lists them" : "did you mean '" + nearest + "'?");
    }
    const bool most = table.number("at_most", mark.at_most, -1e12, 1e12);
    const bool least = table.number("at_least", mark.at_least, -1e12, 1e12);
    if (!most && !least && !table.has("at_most") && !table.has("at_least")) {
        table.complain("metric", "has no limit", "at_most or at_least beside it");
    }
    table.finish();
    marks.push_back(std::move(mark));
}

// Lines of a file are as long as its author's screen: a single break is a space, an empty line
// parts paragraphs.
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

Exercise read_exercise(Table root) {
    Exercise e;
    root.text("name", e.name);
    if (e.name.empty())
        root.complain("name", "is missing or empty", "a short name, as in \"liver-biopsy\"");
    e.title = e.name;
    root.text("title", e.title);
    root.text("description", e.description);
    e.description = flowed(e.description);
    root.text("kind", e.kind, {"biopsy", "drainage", "nephrostomy", "vascular", "scan"});
    root.whole("difficulty", e.difficulty, 1, 5);
    root.text("model", e.model, {"physical", "paper"});
    root.texts("effects", e.effects, true);
    if (auto table = root.table("probe")) read_probe(*table, e.probe);
    if (auto table = root.table("needle")) read_needle(*table, e.needle);
    for (Table& table : root.tables("targets")) read_target(table, e.targets);
    root.texts("no_go", e.no_go);
    root.triple("start_probe", e.start_probe);
    root.direction("start_beam", e.start_beam);
    for (Table& table : root.tables("sweeps")) read_sweep(table, e.sweeps);
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
    for (Table& table : root.tables("pass_marks")) read_pass_mark(table, e.pass_marks);
    root.finish();
    return e;
}

}  // namespace

Result<Exercise> parse_exercise(std::string_view text, const std::string& where) {
    const toml::parse_result parsed = toml::parse(text, std::string_view(where));
    if (!parsed) {
        const toml::parse_error& error = parsed.error();
        return Error{std::string(error.description()),
                     where + ", line " + std::to_string(error.source().begin.line),
                     "TOML is expected"};
    }
    Faults faults{where, {}};
    Exercise exercise = read_exercise(Table(parsed.table(), "", faults));
    if (faults.first) return *faults.first;
    return exercise;
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
