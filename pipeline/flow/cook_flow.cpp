// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/cook_flow.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/base/constants.h"
#include "formats/bundle/codec/flow_codec.h"
#include "formats/flow/flow_summary.h"
#include "formats/flow/flow_velocity.h"
#include "pipeline/flow/flow_network.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline::inline flow {

namespace {

// Diameters that adults have, mm. A label map where they are narrower or wider is wrong.
struct UsualDiameter {
    const char* word;
    FlowKind kind;
    double low, high;
};
constexpr UsualDiameter kUsual[] = {
    {"aorta", FlowKind::artery, 12, 30}, {"iliac_artery", FlowKind::artery, 5, 16},
    {"cava", FlowKind::vein, 8, 30},     {"iliac_ve", FlowKind::vein, 6, 20},
    {"portal", FlowKind::portal, 7, 16},
};

void warn_of_diameters(const std::vector<VesselSummary>& vessels, StageReport& report) {
    for (const VesselSummary& v : vessels) {
        for (const UsualDiameter& usual : kUsual) {
            if (!v.course || v.kind != usual.kind || v.name.find(usual.word) == std::string::npos ||
                (v.diameter_mm >= usual.low && v.diameter_mm <= usual.high))
                continue;
            char text[200];
            std::snprintf(text, sizeof text,
                          "'%s' is %.1f mm wide; %g to %g mm are usual, so that its velocities are "
                          "those of a %s vessel: look at its label.",
                          v.name.c_str(), v.diameter_mm, usual.low, usual.high,
                          v.diameter_mm > usual.high ? "wider" : "narrower");
            report.warnings.push_back(text);
        }
    }
}

void report_field(const FlowField& field,
                  std::size_t bytes,
                  const FlowOptions& options,
                  StageReport& report) {
    const auto vessels = vessel_summaries(field, 60 / options.rate_per_min);
    report.measures = {{"vessels", static_cast<double>(field.vessels.size())},
                       {"nodes", static_cast<double>(field.nodes.size())},
                       {"field_kb", static_cast<double>(bytes) / 1000},
                       {"worst_balance", worst_balance(field)}};
    MeasureGroup flow{"flow_ml_min", {}}, width{"diameter_mm", {}}, peak{"peak_cm_s", {}};
    for (const VesselSummary& v : vessels) {
        flow.values.push_back({v.name, v.mean_ml_min});
        if (!v.course) continue;
        width.values.push_back({v.name, v.diameter_mm});
        peak.values.push_back({v.name, v.peak_cm_s});
    }
    report.groups = {flow, width, peak};
    warn_of_diameters(vessels, report);
}

}  // namespace

Result<FlowResult> cook_flow(const LabelVolume& labels,
                             const FlowOptions& options,
                             const Progress& progress) {
    FlowResult out;
    out.report.stage = stage_names::kFlow;
    out.report.version = kFlowVersion;
    if (!options.on) return out;
    report_progress(progress, 0, "finding vessels");
    std::vector<VesselPart> parts = vessel_parts(labels);
    // Arteries first: veins take away what they bring.
    std::stable_sort(parts.begin(), parts.end(),
                     [](const VesselPart& a, const VesselPart& b) { return a.kind < b.kind; });
    const Landmarks landmarks = find_landmarks(labels);
    const NetworkOptions network{options.rate_per_min, options.scale, options.unknown_ml_min,
                                 options.unknown_wave};
    SolvedOutlets solved;
    FlowField field;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        report_progress(progress,
                        static_cast<double>(i + 1) / static_cast<double>(parts.size() + 1),
                        "following vessels");
        const CentreTree tree = centre_tree(parts[i], options.shortest_mm, 2 * options.node_mm);
        auto courses = vessel_courses(labels, parts[i], tree, {options.node_mm, 5});
        add_network(labels, parts[i], tree, std::move(courses), landmarks, network, solved, field);
    }
    if (field.empty()) {
        out.report.warnings.push_back(
            "No label is a vessel of " + std::to_string(static_cast<int>(options.shortest_mm)) +
            " mm or more, so that the case has no flow: Doppler modes show none.");
        return out;
    }
    const auto bytes = detail::flow_bytes(field);
    SONOCASE_TRY(auto rounded, detail::flow_from_bytes(bytes, "flow"));
    out.field = std::move(rounded);
    report_field(out.field, bytes.size(), options, out.report);
    return out;
}

namespace {

constexpr std::array<std::array<std::uint8_t, 3>, 3> kColours{
    {{{200, 40, 40}}, {{50, 80, 200}}, {{130, 60, 160}}}};

std::array<std::uint8_t, 3> colour_of(const FlowVessel& vessel) {
    return kColours[static_cast<std::size_t>(vessel.kind)];
}

// Draws the walls of the courses, both sides of each vessel, seen along one axis.
Chart courses(const FlowField& field, int across, const char* title, const char* label) {
    Chart chart;
    chart.title = title;
    chart.x_label = label;
    chart.y_label = "mm, towards the head";
    chart.equal_axes = true;
    for (const FlowVessel& vessel : field.vessels) {
        if (vessel.nodes == 0) continue;
        Series left, right;
        left.colour = right.colour = colour_of(vessel);
        left.width_px = right.width_px = 1.5;
        for (int i = 0; i < vessel.nodes; ++i) {
            const FlowNode& n = field.nodes[vessel.first_node + i];
            const double r = std::sqrt(section_area_mm2(n.radius_mm) / kPi);
            const double du = n.direction[across], dv = n.direction.y, length = std::hypot(du, dv);
            const double u = length > 1e-3 ? -dv / length * r : r,
                         v = length > 1e-3 ? du / length * r : 0;
            left.x.push_back(n.centre[across] + u);
            left.y.push_back(n.centre.y + v);
            right.x.push_back(n.centre[across] - u);
            right.y.push_back(n.centre.y - v);
        }
        chart.series.push_back(left);
        chart.series.push_back(right);
    }
    return chart;
}

bool shown(const FlowVessel& v) {
    return v.nodes > 0 && !v.round;
}

Chart waveforms(const FlowField& field) {
    Chart chart;
    chart.title = "Flow over a beat";
    chart.x_label = "phase";
    chart.y_label = "mL/s";
    for (const FlowVessel& v : field.vessels) {
        if (!shown(v)) continue;
        Series s{v.name, {}, {}};
        for (int i = 0; i <= 100; ++i) {
            s.x.push_back(i / 100.0);
            s.y.push_back(flow_ml_s(v, i / 100.0, 0.5));
        }
        chart.series.push_back(std::move(s));
    }
    return chart;
}

Chart profiles(const FlowField& field, double beat_s) {
    Chart chart;
    chart.title = "Profile at the fastest moment";
    chart.x_label = "part of the radius";
    chart.y_label = "cm/s";
    for (const FlowVessel& v : field.vessels) {
        if (!shown(v)) continue;
        const double area = median_area_mm2(field, v);
        const FlowProfile profile(v, std::sqrt(area / kPi), beat_s);
        double best = -1e9, phase = 0;
        for (int p = 0; p < 100; ++p)
            if (const double q = flow_ml_s(v, p / 100.0, 0.5); q > best) {
                best = q;
                phase = p / 100.0;
            }
        const FlowProfile::Row row = profile.row(phase, 0.5);
        Series s{v.name, {}, {}};
        for (std::size_t i = 0; i < kProfileRadii; ++i) {
            s.x.push_back(static_cast<double>(i) / (kProfileRadii - 1));
            s.y.push_back(100 * v.mean_ml_s / area * static_cast<double>(row[i]));
        }
        chart.series.push_back(std::move(s));
    }
    return chart;
}

}  // namespace

std::string flow_table_csv(const FlowField& field, double rate_per_min) {
    std::string text =
        "name,kind,length_mm,diameter_mm,flow_ml_min,mean_cm_s,peak_cm_s,end_cm_s,"
        "resistive_index\n";
    for (const VesselSummary& v : vessel_summaries(field, 60 / rate_per_min)) {
        char row[256];
        if (v.course)
            std::snprintf(row, sizeof row, "%s,%.1f,%.2f,%.1f,%.2f,%.2f,%.2f,%.3f\n",
                          name_of(v.kind), v.length_mm, v.diameter_mm, v.mean_ml_min, v.mean_cm_s,
                          v.peak_cm_s, v.end_cm_s, v.resistive_index);
        else
            std::snprintf(row, sizeof row, "%s,,,%.1f,,,,\n", name_of(v.kind), v.mean_ml_min);
        text += "\"" + v.name + "\"," + row;
    }
    return text;
}

Status draw_flow(const FlowField& field, double rate_per_min, const std::string& folder) {
    std::error_code code;
    std::filesystem::create_directories(folder, code);
    ChartSheet sheet;
    sheet.columns = 2;
    sheet.charts = {courses(field, 0, "From the front", "mm"),
                    courses(field, 2, "From the side", "mm"), waveforms(field),
                    profiles(field, 60 / rate_per_min)};
    return write_chart_png(sheet, (std::filesystem::path(folder) / "flow.png").string());
}

}  // namespace sonocase::pipeline::inline flow
