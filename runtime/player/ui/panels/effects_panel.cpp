// SPDX-License-Identifier: Apache-2.0

// What each effect of the image costs.
#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "runtime/player/ui/panels/panels.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {

void draw_effects_panel(const ScanFrame& frame, float s) {
    heading("Effects");
    char total[48];
    std::snprintf(total, sizeof total, tr("%.2f ms per frame"), frame.frame_ms);
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(total).x);
    ImGui::TextDisabled("%s", total);
    ImGui::PushFont(fonts().small);
    const Renderer::Accuracy& accuracy = frame.accuracy;
    char lines[48];
    std::snprintf(lines, sizeof lines, "%s, %d x %d", tr(accuracy.level == 0 ? "full" : "reduced"),
                  accuracy.scanlines, accuracy.samples);
    row("Accuracy", lines, accuracy.level == 0 ? colour::kText : colour::kWarn);
    const float right = ImGui::GetWindowContentRegionMax().x;
    for (int i = 0; i < frame.cost_count; ++i) {
        const EffectCost& cost = frame.costs[static_cast<std::size_t>(i)];
        const ImVec2 at = ImGui::GetCursorScreenPos();
        const float line = ImGui::GetTextLineHeight();
        if (cost.ran && frame.frame_ms > 0) {
            const float part = static_cast<float>(std::min(cost.ms / frame.frame_ms, 1.0));
            ImGui::GetWindowDrawList()->AddRectFilled(
                at, {at.x + part * ImGui::GetContentRegionAvail().x, at.y + line},
                colour::rgba(72, 186, 214, 46), 2);
        }
        ImGui::PushStyleColor(ImGuiCol_Text, cost.ran ? colour::kText : colour::kFaint);
        ImGui::TextUnformatted(cost.name);
        char value[64];
        if (cost.ran) {
            std::snprintf(value, sizeof value, "%.2f", cost.ms);
        } else {
            std::snprintf(value, sizeof value, "%s", cost.skipped_because);
        }
        ImGui::SameLine(std::max(right - ImGui::CalcTextSize(value).x, 90 * s));
        ImGui::TextUnformatted(value);
        ImGui::PopStyleColor();
    }
    ImGui::PopFont();
}

}  // namespace sonocase::runtime
