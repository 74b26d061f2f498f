// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/exercise_frame.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

#include "formats/text/nearest_name.h"
#include "formats/text/toml_reader.h"

// toml++ 3.3 asserts of input what hostile input ("[[[") does not hold; without the assertion it
// reports the error.
#define TOML_ASSERT(expr) static_cast<void>(0)
#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

namespace sonocase::pipeline::inline stages {
namespace {

Error not_toml(const toml::parse_error& error, const std::string& where) {
    return toml_fault(error.description(), where + ":" + std::to_string(error.source().begin.line));
}

std::optional<Vector3> triple_in(const toml::table& table, std::string_view key) {
    const toml::array* list = table[key].as_array();
    if (list == nullptr || list->size() != 3) return std::nullopt;
    Vector3 v;
    for (int axis = 0; axis < 3; ++axis) {
        const auto number = (*list)[axis].value<double>();
        if (!number) return std::nullopt;
        v[axis] = *number;
    }
    return v;
}

// Rounded to a thousandth of a millimetre, or to 1e-6 of a direction, for people who edit the text.
void set_triple(toml::table& table, std::string_view key, Vector3 v, double step) {
    toml::array list;
    for (int axis = 0; axis < 3; ++axis) list.push_back(std::round(v[axis] / step) * step);
    table.insert_or_assign(key, std::move(list));
}

// Probe x where none is given: to the patient's left, so that the picture shows the patient's right
// at its left.
constexpr Vector3 kAcrossPatient{-1, 0, 0};

class Mapper {
  public:
    explicit Mapper(const Registration& registration) : registration_(registration) {}

    Point3 point(Vector3 ct) const { return mannequin_from_ct(registration_, Point3{} + ct); }
    Vector3 direction(Vector3 at_ct, Vector3 d) const {
        return normalized(jacobian(registration_, Point3{} + at_ct) * d);
    }
    void map_point(toml::table& table, std::string_view key) const {
        if (const auto p = triple_in(table, key))
            set_triple(table, key, point(*p) - Point3{}, 1e-3);
    }

    // position_key and beam_key of a probe; `look_mm` in front of the face is where the beam aims.
    void map_beam(toml::table& table,
                  std::string_view position_key,
                  std::string_view beam_key,
                  std::string_view lateral_key,
                  double look_mm) const {
        const auto position = triple_in(table, position_key);
        const Vector3 beam = normalized(triple_in(table, beam_key).value_or(Vector3{0, 0, -1}));
        if (!position) return;
        const Vector3 mapped = normalized(point(*position + look_mm * beam) - point(*position));
        set_triple(table, beam_key, mapped, 1e-6);
        const Vector3 lateral = normalized(triple_in(table, lateral_key).value_or(kAcrossPatient));
        set_triple(table, lateral_key, across(*position, lateral, mapped), 1e-6);
    }

    void map_key(toml::table& key) const {
        const auto probe = triple_in(key, "probe");
        if (!probe) return;  // parse_exercise will say so
        const Vector3 beam = normalized(triple_in(key, "beam").value_or(Vector3{0, 0, -1}));
        const Vector3 lateral = normalized(triple_in(key, "lateral").value_or(Vector3{1, 0, 0}));
        const auto tip = triple_in(key, "needle_tip");
        const Vector3 needle =
            normalized(triple_in(key, "needle_direction").value_or(Vector3{0, 0, -1}));
        double look_mm = 60;
        if (tip) look_mm = std::max(30.0, dot(*tip - *probe, beam));
        const Vector3 mapped_beam = normalized(point(*probe + look_mm * beam) - point(*probe));
        const Vector3 mapped_lateral = across(*probe, lateral, mapped_beam);
        if (tip) {
            const Vector3 normal = normalized(cross(beam, lateral));
            const bool in_plane = std::abs(dot(*tip - *probe, normal)) < 1 &&
                                  std::abs(dot(needle, normal)) < std::sin(0.0175);
            Vector3 mapped_tip = point(*tip) - Point3{};
            Vector3 mapped_needle = direction(*tip, needle);
            if (in_plane) {
                const Vector3 mapped_normal = cross(mapped_beam, mapped_lateral);
                mapped_tip =
                    mapped_tip -
                    dot(mapped_tip - (point(*probe) - Point3{}), mapped_normal) * mapped_normal;
                mapped_needle =
                    normalized(mapped_needle - dot(mapped_needle, mapped_normal) * mapped_normal);
            }
            set_triple(key, "needle_tip", mapped_tip, 1e-3);
            set_triple(key, "needle_direction", mapped_needle, 1e-6);
        }
        set_triple(key, "probe", point(*probe) - Point3{}, 1e-3);
        set_triple(key, "beam", mapped_beam, 1e-6);
        set_triple(key, "lateral", mapped_lateral, 1e-6);
    }

  private:
    // The turn of a direction at a place, made orthogonal to a beam that is mapped already.
    Vector3 across(Vector3 at, Vector3 lateral, Vector3 mapped_beam) const {
        const Vector3 mapped = direction(at, lateral),
                      across = mapped - dot(mapped, mapped_beam) * mapped_beam;
        return norm(across) > 1e-6 ? normalized(across) : any_perpendicular(mapped_beam);
    }

    const Registration& registration_;
};

template <class Visit>
void each_table(toml::table& parent, std::string_view key, Visit visit) {
    toml::array* list = parent[key].as_array();
    if (list == nullptr) return;
    for (toml::node& node : *list)
        if (toml::table* table = node.as_table()) visit(*table);
}

// Gives a target the place and size of an entry of the key.
void take_from_key(toml::table& target, const KeyTarget& e) {
    set_triple(target, "centre", e.centre - Point3{}, 1e-3);
    const double radius_mm = std::round(1000 * e.radius_mm) / 1000;
    if (!target.contains("name")) target.insert("name", e.name);
    if (!target.contains("radius_mm")) target.insert("radius_mm", std::max(0.5, radius_mm));
    if (!target.contains("look")) target.insert("look", "none");
    if (!target.contains("inside")) target.insert("inside", e.name);
}

}  // namespace

Result<std::string> targets_from_key(const std::string& stripped_toml,
                                     const std::string& where,
                                     const std::vector<KeyTarget>& key) {
    toml::parse_result parsed = toml::parse(stripped_toml, std::string_view(where));
    if (!parsed) return not_toml(parsed.error(), where);
    toml::table& root = parsed.table();
    std::vector<std::string> names;
    for (const KeyTarget& e : key) names.push_back(e.name);
    bool changed = false;
    std::optional<Error> error;
    const auto find = [&](const std::string& name) {
        return std::find_if(key.begin(), key.end(),
                            [&](const KeyTarget& e) { return e.name == name; });
    };
    each_table(root, "targets", [&](toml::table& target) {
        const toml::node* node = target.get("pathology");
        if (node == nullptr || error) return;
        const auto name = node->value<std::string>();
        const auto found = find(name.value_or(""));
        if (found == key.end()) {
            error = Error{"no pathology '" + name.value_or("") + "' in this case",
                          where + ":" + std::to_string(node->source().begin.line),
                          suggest_name(name.value_or(""), names)};
            return;
        }
        target.erase("pathology");
        take_from_key(target, *found);
        changed = true;
    });
    if (error) return *error;
    const bool scan = root["kind"].value_or(std::string("biopsy")) == "scan";
    if (!root.contains("targets") && !scan) {
        toml::array targets;
        for (const KeyTarget& e : key) {
            if (!e.by_default) continue;
            toml::table target;
            take_from_key(target, e);
            targets.push_back(std::move(target));
        }
        if (!targets.empty()) {
            root.insert("targets", std::move(targets));
            changed = true;
        }
    }
    if (!changed) return stripped_toml;
    std::ostringstream out;
    out << toml::toml_formatter(root) << "\n";
    return out.str();
}

Result<FramedExercise> strip_frame(std::string_view text, const std::string& where) {
    const toml::parse_result parsed = toml::parse(text, std::string_view(where));
    if (!parsed) return not_toml(parsed.error(), where);
    FramedExercise result{std::string(text), false};
    const toml::node* frame = parsed.table().get("frame");
    if (frame == nullptr) return result;
    const auto name = frame->value<std::string>();
    if (!frame->is_string() || (*name != "ct" && *name != "mannequin"))
        return Error{"unknown frame", where + ":" + std::to_string(frame->source().begin.line),
                     "expected frame = \"ct\" or frame = \"mannequin\""};
    result.in_ct = *name == "ct";
    std::size_t begin = 0;
    for (auto line = frame->source().begin.line; line > 1; --line)
        begin = result.toml.find('\n', begin) + 1;
    const std::size_t end = result.toml.find('\n', begin);
    result.toml.erase(begin, end == std::string::npos ? end : end - begin);
    return result;
}

Result<std::string> exercise_to_mannequin(const std::string& stripped_toml,
                                          const std::string& where,
                                          const Registration& registration) {
    toml::parse_result parsed = toml::parse(stripped_toml, std::string_view(where));
    if (!parsed) return not_toml(parsed.error(), where);
    toml::table& root = parsed.table();
    const Mapper mapper(registration);
    // Directions before the points that they start from.
    if (root.contains("start_probe"))
        mapper.map_beam(root, "start_probe", "start_beam", "start_lateral", 60);
    if (toml::table* breathing = root["breathing"].as_table()) {
        // The turn of the organs, taken at the first target, else where the probe starts.
        std::optional<Vector3> at = triple_in(root, "start_probe");
        each_table(root, "targets", [&](toml::table& target) {
            if (const auto centre = triple_in(target, "centre")) at = centre;
        });
        const Vector3 d =
            normalized(triple_in(*breathing, "direction").value_or(Vector3{0, 0, -1}));
        if (at) set_triple(*breathing, "direction", mapper.direction(*at, d), 1e-6);
    }
    const auto map_fluid = [&](toml::table& fluid) {
        const auto centre = triple_in(fluid, "centre");
        const Vector3 usual[] = {{0, 1, 0}, {0, 0, 1}};  // in the CT: to the front, to the head
        int n = 0;
        for (const char* key : {"up", "head"}) {
            const Vector3 d = normalized(triple_in(fluid, key).value_or(usual[n++]));
            if (centre) set_triple(fluid, key, mapper.direction(*centre, d), 1e-6);
        }
        mapper.map_point(fluid, "centre");
    };
    if (toml::table* fluid = root["free_fluid"].as_table()) map_fluid(*fluid);
    each_table(root, "free_fluid", map_fluid);
    mapper.map_point(root, "start_probe");
    for (const char* list : {"targets", "findings"})
        each_table(root, list, [&](toml::table& table) { mapper.map_point(table, "centre"); });
    each_table(root, "sweeps", [&](toml::table& sweep) {
        each_table(sweep, "keys", [&](toml::table& key) { mapper.map_key(key); });
    });
    std::ostringstream out;
    out << toml::toml_formatter(root) << "\n";
    return out.str();
}

}  // namespace sonocase::pipeline::inline stages
