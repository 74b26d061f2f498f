// SPDX-License-Identifier: Apache-2.0

#include "formats/text/stage_report_json.h"

#include <limits>

namespace sonocase {
namespace detail {

Json json_of(const StageReport& report) {
    Json out = Json::object();
    out["stage"] = report.stage;
    out["version"] = report.version;
    out["seconds"] = json_number(report.seconds);
    Json measures = Json::object();
    for (const Measure& m : report.measures) measures[m.name] = json_number(m.value);
    out["measures"] = std::move(measures);
    // Absent where a stage has none, so that the files of most stages stay as they were.
    for (const Note& note : report.notes) out["notes"][note.name] = note.text;
    for (const MeasureGroup& group : report.groups) {
        Json values = Json::object();
        for (const Measure& m : group.values) values[m.name] = json_number(m.value);
        out["groups"][group.name] = std::move(values);
    }
    out["warnings"] = report.warnings;
    return out;
}

std::vector<Measure> measures_from(JsonObject object) {
    std::vector<Measure> measures;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const std::string& name : object.keys())
        measures.push_back({name, object.number_or(name.c_str(), nan)});
    return measures;
}

StageReport report_from(JsonObject object) {
    StageReport report;
    report.stage = object.text("stage");
    report.version = static_cast<int>(object.integer_or("version", 1, 0, 1000000));
    report.seconds = object.has("seconds") ? object.number("seconds") : 0;
    report.warnings = object.texts_or_none("warnings");
    if (object.has("measures")) report.measures = measures_from(object.object("measures"));
    if (object.has("notes")) {
        JsonObject notes = object.object("notes");
        for (const std::string& name : notes.keys())
            report.notes.push_back({name, notes.text(name.c_str())});
    }
    if (object.has("groups")) {
        JsonObject groups = object.object("groups");
        for (const std::string& name : groups.keys())
            report.groups.push_back({name, measures_from(groups.object(name.c_str()))});
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

}  // namespace detail

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

std::string stage_report_json(const StageReport& report) {
    return detail::json_text(detail::json_of(report), true) + "\n";
}

Result<StageReport> parse_stage_report(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    StageReport report = detail::report_from(JsonObject(value, "", fault));
    if (fault.error) return *fault.error;
    return report;
}

}  // namespace sonocase
