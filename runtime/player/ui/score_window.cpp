// SPDX-License-Identifier: Apache-2.0

// The scores of the last attempt.
#include <imgui.h>

#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

std::string number(double value) {
    if (!std::isfinite(value)) return "-";
    char text[32];
    const bool whole = std::abs(value - std::round(value)) < 1e-9 || std::abs(value) >= 1000;
    std::snprintf(text, sizeof text,
                  whole                   ? "%.0f"
                  : std::abs(value) >= 10 ? "%.1f"
                                          : "%.2f",
                  value);
    return text;
}

std::string with_unit(const std::string& metric, double value) {
    return number(value) + " " + std::string(metric_unit(metric));
}

std::string title(const std::string& metric) {
    const MetricInfo* info = find_metric(metric);
    return info ? info->title : metric;
}

void right_cell(unsigned packed, const std::string& words) {
    ImGui::TableNextColumn();
    ImGui::SetCursorPosX(ImGui::GetCursorPosX() + ImGui::GetContentRegionAvail().x -
                         ImGui::CalcTextSize(words.c_str()).x);
    ImGui::PushStyleColor(ImGuiCol_Text, packed);
    ImGui::TextUnformatted(words.c_str());
    ImGui::PopStyleColor();
}

void draw_pass_marks(const SessionScore& score, float s) {
    if (score.pass_marks.empty()) return;
    ImGui::PushFont(fonts().heading);
    ImGui::PushStyleColor(ImGuiCol_Text, score.passed ? colour::kGood : colour::kWarn);
    ImGui::TextUnformatted(score.passed ? "Passed" : "Not passed yet");
    ImGui::PopStyleColor();
    ImGui::PopFont();
    if (ImGui::BeginTable("marks", 3, ImGuiTableFlags_RowBg)) {
        ImGui::TableSetupColumn("what", ImGuiTableColumnFlags_WidthStretch);
        ImGui::TableSetupColumn("limit", ImGuiTableColumnFlags_WidthFixed, 150 * s);
        ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, 90 * s);
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        right_cell(colour::kDim, "Required");
        right_cell(colour::kDim, "Result");
        for (const PassResult& mark : score.pass_marks) {
            ImGui::TableNextRow();
            ImGui::TableNextColumn();
            ImGui::TextUnformatted(title(mark.metric).c_str());
            const std::string limit =
                std::isfinite(mark.at_most)    ? "at most " + with_unit(mark.metric, mark.at_most)
                : std::isfinite(mark.at_least) ? "at least " + with_unit(mark.metric, mark.at_least)
                                               : "";
            right_cell(colour::kDim, limit);
            right_cell(mark.passed ? colour::kGood : colour::kBad,
                       with_unit(mark.metric, mark.value));
        }
        ImGui::EndTable();
    }
    ImGui::Dummy({0, 4 * s});
}

// Every metric that has a value, in groups. evidence: those with some, or those without.
void draw_metrics(const SessionScore& score, bool evidence, float s) {
    std::string group;
    if (!ImGui::BeginTable(evidence ? "metrics" : "more", 2, ImGuiTableFlags_RowBg)) return;
    ImGui::TableSetupColumn("what", ImGuiTableColumnFlags_WidthStretch);
    ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, 110 * s);
    for (const Metric& metric : score.metrics) {
        if (!std::isfinite(metric.value)) continue;
        const MetricInfo* info = find_metric(metric.name);
        if (!info || (info->evidence[0] != 0) != evidence) continue;
        if (group != info->group) {
            group = info->group;
            std::string capitalised = group;
            capitalised[0] = static_cast<char>(capitalised[0] - 'a' + 'A');
            ImGui::TableNextRow();
            ImGui::TableNextColumn();
            ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour::kAccent), "%s",
                               capitalised.c_str());
        }
        ImGui::TableNextRow();
        ImGui::TableNextColumn();
        ImGui::TextUnformatted(info->title);
        if (ImGui::IsItemHovered()) {
            ImGui::SetTooltip("%s: %s%s%s", info->name, metric_range(info->name),
                              evidence ? "; evidence: " : "", info->evidence);
        }
        right_cell(colour::kText, with_unit(metric.name, metric.value));
    }
    ImGui::EndTable();
}

}  // namespace

void draw_score_window(const SessionScore& score, const std::string& file, bool& open, float s) {
    if (begin_dialog("Scores", open, 620 * s, 520 * s, s)) {
        draw_pass_marks(score, s);
        for (const std::string& warning : score.warnings) coloured(colour::kWarn, warning);
        ImGui::BeginChild("all", {0, -2.2f * ImGui::GetTextLineHeightWithSpacing()}, false,
                          ImGuiWindowFlags_NoBackground);
        ImGui::PushFont(fonts().small);
        draw_metrics(score, true, s);
        if (ImGui::CollapsingHeader("More measures, without published evidence"))
            draw_metrics(score, false, s);
        ImGui::PopFont();
        ImGui::EndChild();
        small_dim(("Recorded in " + file).c_str());
    }
    end_dialog();
}

}  // namespace sonocase::runtime
