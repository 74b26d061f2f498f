// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/flow_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "formats/flow/flow_at.h"
#include "formats/flow/flow_profile.h"
#include "formats/flow/flow_summary.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr std::array<std::array<std::uint8_t, 3>, 3> kColours{
    {{{200, 40, 40}}, {{50, 80, 200}}, {{130, 60, 160}}}};

std::array<std::uint8_t, 3> colour_of(const FlowVessel& vessel) {
    return kColours[static_cast<std::size_t>(vessel.kind)];
}

// Walls of the courses seen along one axis: both sides of each vessel.
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
            const FlowNode& n = field.nodes[static_cast<std::size_t>(vessel.first_node + i)];
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

}  // namespace sonocase::pipeline
