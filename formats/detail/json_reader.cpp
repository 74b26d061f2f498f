#include "formats/detail/json_reader.h"

#include <algorithm>
#include <set>

#include "formats/grid.h"

namespace sonocase::detail {
namespace {

const Json& nothing() {
    static const Json none = Json::object();
    return none;
}

constexpr const char* kTissueKinds[] = {"outside", "soft", "fluid", "gas", "bone"};

}  // namespace

JsonObject::JsonObject(const Json& value, std::string path, JsonFault& fault)
    : value_(&value), path_(std::move(path)), fault_(&fault) {
    if (!value.is_object()) {
        if (!fault.error) fault.error = Error{path_ + " is no object", fault.where, ""};
        value_ = &nothing();
    }
}

void JsonObject::complain(const char* key, const std::string& what, const std::string& expected) {
    if (fault_->error) return;
    fault_->error =
        Error{(path_.empty() ? "" : path_ + ".") + key + " " + what, fault_->where, expected};
}

const Json* JsonObject::member(const char* key) {
    const auto found = value_->find(key);
    if (found == value_->end()) {
        complain(key, "is missing");
        return nullptr;
    }
    return &*found;
}

bool JsonObject::has(const char* key) const {
    const auto found = value_->find(key);
    return found != value_->end() && !found->is_null();
}

std::vector<std::string> JsonObject::keys() const {
    std::vector<std::string> out;
    for (const auto& item : value_->items()) out.push_back(item.key());
    return out;
}

std::string JsonObject::text(const char* key) {
    const Json* found = member(key);
    if (!found) return {};
    if (!found->is_string()) {
        complain(key, "is no text");
        return {};
    }
    return found->get<std::string>();
}

std::string JsonObject::text_or(const char* key, const std::string& otherwise) {
    return has(key) ? text(key) : otherwise;
}

bool JsonObject::flag_or(const char* key, bool otherwise) {
    if (!has(key)) return otherwise;
    const Json* found = member(key);
    if (!found->is_boolean()) {
        complain(key, "is neither true nor false");
        return otherwise;
    }
    return found->get<bool>();
}

double JsonObject::number(const char* key) {
    const Json* found = member(key);
    if (!found) return 0;
    if (!found->is_number() || !std::isfinite(found->get<double>())) {
        complain(key, "is no number");
        return 0;
    }
    return found->get<double>();
}

double JsonObject::number_or(const char* key, double otherwise) {
    return has(key) ? number(key) : otherwise;
}

std::int64_t JsonObject::integer(const char* key, std::int64_t low, std::int64_t high) {
    const double value = number(key);
    if (value != std::floor(value) || value < static_cast<double>(low) ||
        value > static_cast<double>(high)) {
        complain(key, "is out of range",
                 "a whole number from " + std::to_string(low) + " to " + std::to_string(high) +
                     " is expected");
        return low;
    }
    return static_cast<std::int64_t>(value);
}

std::int64_t JsonObject::integer_or(const char* key,
                                    std::int64_t otherwise,
                                    std::int64_t low,
                                    std::int64_t high) {
    return has(key) ? integer(key, low, high) : otherwise;
}

std::vector<double> JsonObject::numbers(const char* key, std::size_t count) {
    const Json* found = member(key);
    std::vector<double> values;
    if (found && (!found->is_array() || (count != 0 && found->size() != count))) {
        complain(key, "has the wrong shape",
                 "a list of " + std::to_string(count) + " numbers is expected");
    } else if (found) {
        values.reserve(found->size());
        for (const Json& item : *found) {
            if (!item.is_number() || !std::isfinite(item.get<double>())) {
                complain(key, "holds something that is no number");
                break;
            }
            values.push_back(item.get<double>());
        }
    }
    if (!ok() && count != 0) values.assign(count, 0);
    return values;
}

std::vector<std::string> JsonObject::texts_or_none(const char* key) {
    std::vector<std::string> out;
    if (!has(key)) return out;
    const Json* found = member(key);
    if (!found->is_array()) complain(key, "is no list");
    if (!ok()) return out;
    for (const Json& item : *found) {
        if (!item.is_string()) {
            complain(key, "holds something that is no text");
            return out;
        }
        out.push_back(item.get<std::string>());
    }
    return out;
}

Vector3 JsonObject::vector(const char* key) {
    const std::vector<double> v = numbers(key, 3);
    return {v[0], v[1], v[2]};
}

Point3 JsonObject::point(const char* key) {
    const std::vector<double> v = numbers(key, 3);
    return {v[0], v[1], v[2]};
}

JsonObject JsonObject::object(const char* key) {
    const Json* found = member(key);
    return JsonObject(found ? *found : nothing(), (path_.empty() ? "" : path_ + ".") + key,
                      *fault_);
}

std::vector<JsonObject> JsonObject::objects(const char* key) {
    std::vector<JsonObject> out;
    const Json* found = member(key);
    if (found && !found->is_array()) complain(key, "is no list");
    if (!found || !ok()) return out;
    const std::string base = (path_.empty() ? "" : path_ + ".") + key;
    for (std::size_t i = 0; i < found->size(); ++i) {
        out.emplace_back((*found)[i], base + "[" + std::to_string(i) + "]", *fault_);
    }
    return out;
}

bool parse_json(std::string_view text, Json& out, JsonFault& fault) {
    try {
        out = Json::parse(text.begin(), text.end());
    } catch (const std::exception& failure) {
        std::string what = failure.what();
        const std::size_t start = what.find("parse error");
        what = start == std::string::npos ? "is no JSON" : what.substr(start);
        std::replace(what.begin(), what.end(), '\n', ' ');
        fault.error = Error{what, fault.where, "JSON is expected"};
        return false;
    }
    if (!out.is_object()) {
        fault.error = Error{"is no JSON object", fault.where, ""};
        return false;
    }
    return true;
}

std::string json_text(const Json& value, bool indented) {
    return value.dump(indented ? 2 : -1, ' ', false, Json::error_handler_t::replace);
}

Json json_number(double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Json json_of(Vector3 v) {
    return Json::array({v.x, v.y, v.z});
}
Json json_of(Point3 p) {
    return Json::array({p.x, p.y, p.z});
}

Json json_of(const Rigid& t) {
    Json out = Json::object();
    out["rotation"] = t.rotation.m;
    out["translation"] = json_of(t.translation);
    return out;
}

Rigid rigid_from(JsonObject object) {
    Rigid t;
    const std::vector<double> m = object.numbers("rotation", 9);
    std::copy(m.begin(), m.end(), t.rotation.m.begin());
    t.translation = object.vector("translation");
    // 1e-3: what six printed decimals of nine entries leave, with room.
    if (object.ok() && (orthonormality_error(t.rotation) > 1e-3 || determinant(t.rotation) < 0)) {
        object.complain("rotation", "is no rotation",
                        "nine numbers, row by row, of a right-handed rotation");
    }
    return t;
}

Json json_of(const Grid& grid) {
    Json out = Json::object();
    out["size"] = Json::array({grid.size.x, grid.size.y, grid.size.z});
    out["spacing_mm"] = json_of(grid.spacing_mm);
    out["origin_mm"] = json_of(grid.origin_mm);
    out["direction"] = grid.direction.m;
    return out;
}

Grid grid_from(JsonObject object) {
    Grid grid;
    const std::vector<double> size = object.numbers("size", 3);
    double voxels = 1;
    for (int a = 0; a < 3; ++a) {
        const double n = size[static_cast<std::size_t>(a)];
        voxels *= n;
        if (n != std::floor(n) || n < 0 || n > 65536) {
            object.complain("size", "is out of range", "whole numbers up to 65536");
            return grid;
        }
        grid.size[a] = static_cast<std::int32_t>(n);
    }
    if (voxels > 4e9) object.complain("size", "is out of range", "at most 4e9 voxels");
    grid.spacing_mm = object.vector("spacing_mm");
    grid.origin_mm = object.point("origin_mm");
    const std::vector<double> m = object.numbers("direction", 9);
    std::copy(m.begin(), m.end(), grid.direction.m.begin());
    if (!object.ok()) return grid;
    if (!(grid.spacing_mm.x > 0 && grid.spacing_mm.y > 0 && grid.spacing_mm.z > 0)) {
        object.complain("spacing_mm", "is not above zero");
    }
    if (orthonormality_error(grid.direction) > 1e-3)
        object.complain("direction", "is not orthonormal");
    return grid;
}

Json json_of(const StageReport& report) {
    Json out = Json::object();
    out["stage"] = report.stage;
    out["version"] = report.version;
    out["seconds"] = json_number(report.seconds);
    Json measures = Json::object();
    for (const Measure& m : report.measures) measures[m.name] = json_number(m.value);
    out["measures"] = std::move(measures);
    out["warnings"] = report.warnings;
    return out;
}

StageReport report_from(JsonObject object) {
    StageReport report;
    report.stage = object.text("stage");
    report.version = static_cast<int>(object.integer_or("version", 1, 0, 1000000));
    report.seconds = object.has("seconds") ? object.number("seconds") : 0;
    report.warnings = object.texts_or_none("warnings");
    if (!object.has("measures")) return report;
    JsonObject measures = object.object("measures");
    for (const std::string& name : measures.keys()) {
        const double nan = std::numeric_limits<double>::quiet_NaN();
        report.measures.push_back({name, measures.number_or(name.c_str(), nan)});
    }
    return report;
}

Json json_of(const std::vector<StageReport>& reports) {
    Json out = Json::array();
    for (const StageReport& report : reports) out.push_back(json_of(report));
    return out;
}

std::vector<StageReport> reports_from(JsonObject& object, const char* key) {
    std::vector<StageReport> reports;
    if (!object.has(key)) return reports;
    for (const JsonObject& item : object.objects(key)) reports.push_back(report_from(item));
    return reports;
}

Json json_of(const std::vector<Label>& labels) {
    Json out = Json::array();
    for (const Label& label : labels) {
        Json item = Json::object();
        item["name"] = label.name;
        item["tissue"] = label.tissue;
        item["source_value"] = label.source_value;
        item["colour"] = label.colour;
        out.push_back(std::move(item));
    }
    return out;
}

std::vector<Label> labels_from(JsonObject& object, const char* key) {
    std::vector<Label> labels;
    std::set<std::string> names;
    for (JsonObject& item : object.objects(key)) {
        Label label;
        label.name = item.text("name");
        label.tissue = item.text_or("tissue", "");
        label.source_value =
            static_cast<int>(item.integer_or("source_value", 0, INT32_MIN, INT32_MAX));
        if (item.has("colour")) {
            const std::vector<double> c = item.numbers("colour", 3);
            for (std::size_t i = 0; i < 3; ++i) {
                if (c[i] < 0 || c[i] > 255) item.complain("colour", "is out of range", "0 to 255");
                label.colour[i] = static_cast<std::uint8_t>(std::clamp(c[i], 0.0, 255.0));
            }
        }
        if (!names.insert(label.name).second)
            item.complain("name", "'" + label.name + "' is there twice");
        labels.push_back(std::move(label));
    }
    if (object.ok() && (labels.empty() || labels.size() > kMaxLabels)) {
        object.complain(key, "is of the wrong size",
                        "1 to " + std::to_string(kMaxLabels) + " labels");
    }
    return labels;
}

Json json_of(const std::vector<Tissue>& tissues) {
    Json out = Json::array();
    for (const Tissue& t : tissues) {
        Json item = Json::object();
        item["name"] = t.name;
        item["kind"] = kTissueKinds[static_cast<std::size_t>(t.kind)];
        item["casts_shadow"] = t.casts_shadow;
        item["texture"] = t.texture;
        item["grey_mean"] = t.grey_mean;
        item["grey_sd"] = t.grey_sd;
        item["echo_db"] = t.echo_db;
        item["structure_db"] = t.structure_db;
        item["attenuation_db_cm_mhz"] = t.attenuation_db_cm_mhz;
        item["impedance_mrayl"] = t.impedance_mrayl;
        item["sound_speed_m_s"] = t.sound_speed_m_s;
        item["source"] = t.source;
        out.push_back(std::move(item));
    }
    return out;
}

std::vector<Tissue> tissues_from(JsonObject& object, const char* key) {
    std::vector<Tissue> tissues;
    if (!object.has(key)) return tissues;
    for (JsonObject& item : object.objects(key)) {
        Tissue t;
        t.name = item.text("name");
        const std::string kind = item.text("kind");
        const auto found = std::find(std::begin(kTissueKinds), std::end(kTissueKinds), kind);
        if (found == std::end(kTissueKinds)) {
            item.complain("kind", "'" + kind + "' is not known",
                          "outside, soft, fluid, gas or bone");
            return tissues;
        }
        t.kind = static_cast<TissueKind>(found - std::begin(kTissueKinds));
        t.casts_shadow = item.flag_or("casts_shadow", false);
        t.texture = item.text_or("texture", "");
        t.grey_mean = item.number_or("grey_mean", 0);
        t.grey_sd = item.number_or("grey_sd", 0);
        t.echo_db = item.number_or("echo_db", 0);
        t.structure_db = item.number_or("structure_db", 0);
        t.attenuation_db_cm_mhz = item.number_or("attenuation_db_cm_mhz", 0);
        t.impedance_mrayl = item.number_or("impedance_mrayl", t.impedance_mrayl);
        t.sound_speed_m_s = item.number_or("sound_speed_m_s", t.sound_speed_m_s);
        t.source = item.text_or("source", "");
        tissues.push_back(std::move(t));
    }
    return tissues;
}

}  // namespace sonocase::detail
