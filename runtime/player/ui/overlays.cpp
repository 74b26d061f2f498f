// SPDX-License-Identifier: Apache-2.0

// Help and notices, which are drawn over the page.
#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "runtime/display/theme.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/ui/shortcuts.h"

namespace sonocase::runtime {

void draw_help(bool& open, float s) {
    const ImGuiIO& io = ImGui::GetIO();
    ImGui::SetNextWindowPos({0.5f * io.DisplaySize.x, 0.5f * io.DisplaySize.y}, ImGuiCond_Always,
                            {0.5f, 0.5f});
    ImGui::SetNextWindowSize(
        {std::min(660 * s, io.DisplaySize.x - 20), std::min(680 * s, io.DisplaySize.y - 20)});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 7 * s);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    ImGui::PushStyleColor(ImGuiCol_WindowBg, colour::rgba(24, 29, 36, 252));
    ImGui::SetNextWindowFocus();
    if (ImGui::Begin("Help", &open,
                     ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                         ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings)) {
        ImGui::PushStyleVar(ImGuiStyleVar_CellPadding, {5 * s, 1 * s});
        if (ImGui::BeginTable("keys", 2)) {
            ImGui::TableSetupColumn("keys", ImGuiTableColumnFlags_WidthFixed, 218 * s);
            ImGui::TableSetupColumn("does");
            for (const Shortcut& entry : shortcuts()) {
                ImGui::TableNextRow();
                ImGui::TableNextColumn();
                if (!entry.keys) {
                    ImGui::PushFont(fonts().heading);
                    ImGui::PushStyleColor(ImGuiCol_Text, colour::kAccent);
                    ImGui::TextUnformatted(entry.does);
                    ImGui::PopStyleColor();
                    ImGui::PopFont();
                    continue;
                }
                ImGui::TextUnformatted(entry.keys);
                ImGui::TableNextColumn();
                ImGui::TextDisabled("%s", entry.does);
            }
            ImGui::EndTable();
        }
        ImGui::PopStyleVar();
    }
    ImGui::End();
    ImGui::PopStyleColor();
    ImGui::PopStyleVar(2);
}

namespace {

unsigned notice_colour(Notice::Kind kind) {
    switch (kind) {
        case Notice::Kind::error: return colour::kBad;
        case Notice::Kind::warning: return colour::kWarn;
        case Notice::Kind::news: break;
    }
    return colour::kAccent;
}

}  // namespace

void draw_notices(Notices& notices, float s) {
    const ImGuiIO& io = ImGui::GetIO();
    float y = io.DisplaySize.y - 16 * s;
    int id = 0;
    for (std::size_t i = notices.standing().size(); i-- > 0;) {  // the newest at the foot
        const Notice notice = notices.standing()[i];
        char name[24];
        std::snprintf(name, sizeof name, "notice%d", id++);
        const float width = std::min(680 * s, io.DisplaySize.x - 40 * s);
        ImGui::SetNextWindowPos({0.5f * io.DisplaySize.x, y}, ImGuiCond_Always, {0.5f, 1});
        ImGui::SetNextWindowSize({width, 0});
        ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 6 * s);
        ImGui::PushStyleColor(ImGuiCol_WindowBg, colour::rgba(30, 36, 44, 246));
        ImGui::Begin(name, nullptr,
                     ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                         ImGuiWindowFlags_NoNav | ImGuiWindowFlags_NoFocusOnAppearing |
                         ImGuiWindowFlags_NoSavedSettings);
        const ImVec2 corner = ImGui::GetWindowPos();
        ImGui::GetWindowDrawList()->AddRectFilled(
            corner, {corner.x + 4 * s, corner.y + ImGui::GetWindowHeight()},
            notice_colour(notice.kind), 6 * s, ImDrawFlags_RoundCornersLeft);
        ImGui::Indent(6 * s);
        ImGui::TextWrapped("%s", notice.text.c_str());
        y -= ImGui::GetWindowHeight() + 6 * s;
        if (ImGui::IsWindowHovered() && ImGui::IsMouseClicked(0)) notices.dismiss(i);
        ImGui::End();
        ImGui::PopStyleColor();
        ImGui::PopStyleVar();
    }
}

}  // namespace sonocase::runtime
