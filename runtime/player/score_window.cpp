// SPDX-License-Identifier: Apache-2.0

// The scores of the last attempt.
#include <imgui.h>

#include <cmath>
#include <cstdio>

#include "formats/exercise/metric_table.h"
#include "runtime/display/theme.h"
#include "runtime/player/app.h"

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

}  // namespace

void draw_score_window(App& app) {
    const SessionScore& score = *app.score;
    const float s = app.window->scale();
    const ImGuiIO& io = ImGui::GetIO();
    ImGui::SetNextWindowPos({0.5f * io.DisplaySize.x, 0.5f * io.DisplaySize.y}, ImGuiCond_Appearing,
                            {0.5f, 0.5f});
    ImGui::SetNextWindowSize({620 * s, 520 * s}, ImGuiCond_Appearing);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 7 * s);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    ImGui::PushStyleColor(ImGuiCol_WindowBg, colour::rgba(24, 29, 36, 252));
    ImGui::PushStyleColor(ImGuiCol_TitleBgActive, colour::rgba(30, 37, 46));
    if (ImGui::Begin("Scores", &app.show_score,
                     ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoSavedSettings)) {
        if (!score.pass_marks.empty()) {
            ImGui::PushFont(fonts().heading);
            ImGui::PushStyleColor(ImGuiCol_Text, score.passed ? colour::kGood : colour::kWarn);
            ImGui::TextUnformatted(score.passed ? "Passed" : "Not passed yet");
            ImGui::PopStyleColor();
            ImGui::PopFont();
            if (ImGui::BeginTable("marks", 3, ImGuiTableFlags_RowBg)) {
                ImGui::TableSetupColumn("what", ImGuiTableColumnFlags_WidthStretch);
                ImGui::TableSetupColumn("limit", ImGuiTableColumnFlags_WidthFixed, 150 * s);
                ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, 90 * s);
                for (const PassResult& mark : score.pass_marks) {
                    ImGui::TableNextRow();
                    ImGui::TableNextColumn();
                    ImGui::TextUnformatted(title(mark.metric).c_str());
                    const std::string limit =
                        std::isfinite(mark.at_most)
                            ? "at most " + with_unit(mark.metric, mark.at_most)
                        : std::isfinite(mark.at_least)
                            ? "at least " + with_unit(mark.metric, mark.at_least)
                            : "";
                    right_cell(colour::kDim, limit);
                    right_cell(mark.passed ? colour::kGood : colour::kBad,
                               with_unit(mark.metric, mark.value));
                }
                ImGui::EndTable();
            }
            ImGui::Dummy({0, 4 * s});
        }
        for (const std::string& warning : score.warnings) {
            ImGui::PushStyleColor(ImGuiCol_Text, colour::kWarn);
            ImGui::TextWrapped("%s", warning.c_str());
            ImGui::PopStyleColor();
        }
        ImGui::BeginChild("all", {0, -2.2f * ImGui::GetTextLineHeightWithSpacing()}, false,
                          ImGuiWindowFlags_NoBackground);
        ImGui::PushFont(fonts().small);
        std::string group;
        if (ImGui::BeginTable("metrics", 2, ImGuiTableFlags_RowBg)) {
            ImGui::TableSetupColumn("what", ImGuiTableColumnFlags_WidthStretch);
            ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, 110 * s);
            for (const Metric& metric : score.metrics) {
                if (!std::isfinite(metric.value)) continue;
                const MetricInfo* info = find_metric(metric.name);
                if (info && group != info->group) {
                    group = info->group;
                    std::string heading = group;
                    heading[0] = static_cast<char>(heading[0] - 'a' + 'A');
                    ImGui::TableNextRow();
                    ImGui::TableNextColumn();
                    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour::kAccent), "%s",
                                       heading.c_str());
                }
                ImGui::TableNextRow();
                ImGui::TableNextColumn();
                ImGui::TextUnformatted(title(metric.name).c_str());
                right_cell(colour::kText, with_unit(metric.name, metric.value));
            }
            ImGui::EndTable();
        }
        ImGui::PopFont();
        ImGui::EndChild();
        ImGui::PushFont(fonts().small);
        ImGui::TextDisabled("Recorded in %s", app.score_file.c_str());
        ImGui::PopFont();
    }
    ImGui::End();
    ImGui::PopStyleColor(2);
    ImGui::PopStyleVar(2);
}

}  // namespace sonocase::runtime
