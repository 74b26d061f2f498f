// SPDX-License-Identifier: Apache-2.0

#include "pipeline/flow/cook_flow.h"

#include <algorithm>
#include <cstdio>

#include "formats/bundle/codec/flow_codec.h"
#include "formats/flow/flow_summary.h"
#include "pipeline/flow/flow_network.h"

namespace sonocase::pipeline {
namespace {

// Diameters that adults have, mm: what a label map that has them narrower or wider has wrong.
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
    out.report.stage = "flow";
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
    auto rounded = detail::flow_from_bytes(bytes, "flow");
    if (!rounded) return rounded.error();
    out.field = std::move(*rounded);
    report_field(out.field, bytes.size(), options, out.report);
    return out;
}

}  // namespace sonocase::pipeline
