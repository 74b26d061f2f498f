// SPDX-License-Identifier: Apache-2.0

// What lies over the page: help and notices.
#include <imgui.h>

#include <algorithm>

#include "runtime/display/theme.h"
#include "runtime/player/app.h"
#include "runtime/player/shortcuts.h"

namespace sonocase::runtime {

void draw_help(App& app) {
    const float s = app.window->scale();
    const ImGuiIO& io = ImGui::GetIO();
    ImGui::SetNextWindowPos({0.5f * io.DisplaySize.x, 0.5f * io.DisplaySize.y}, ImGuiCond_Always,
                            {0.5f, 0.5f});
    ImGui::SetNextWindowSize(
        {std::min(660 * s, io.DisplaySize.x - 20), std::min(680 * s, io.DisplaySize.y - 20)});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 7 * s);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowBorderSize, 1);
    ImGui::PushStyleColor(ImGuiCol_WindowBg, colour::rgba(24, 29, 36, 252));
    ImGui::SetNextWindowFocus();
    if (ImGui::Begin("Help", &app.show_help,
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

void draw_notices(App& app) {
    const float s = app.window->scale();
    const ImGuiIO& io = ImGui::GetIO();
    float y = io.DisplaySize.y - 16 * s;
    int id = 0;
    for (std::size_t i = app.notices.size(); i-- > 0;) {
        const Notice notice = app.notices[i];
        const double age = app.now_s - notice.since_s;
        const double life = notice.kind == Notice::Kind::error     ? 20
                            : notice.kind == Notice::Kind::warning ? 12
                                                                   : 5;
        if (age > life) {
            app.notices.erase(app.notices.begin() + static_cast<std::ptrdiff_t>(i));
            continue;
        }
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
        const unsigned packed = notice.kind == Notice::Kind::error     ? colour::kBad
                                : notice.kind == Notice::Kind::warning ? colour::kWarn
                                                                       : colour::kAccent;
        const ImVec2 corner = ImGui::GetWindowPos();
        ImGui::GetWindowDrawList()->AddRectFilled(
            corner, {corner.x + 4 * s, corner.y + ImGui::GetWindowHeight()}, packed, 6 * s,
            ImDrawFlags_RoundCornersLeft);
        ImGui::Indent(6 * s);
        ImGui::TextWrapped("%s", notice.text.c_str());
        y -= ImGui::GetWindowHeight() + 6 * s;
        if (ImGui::IsWindowHovered() && ImGui::IsMouseClicked(0)) {
            app.notices.erase(app.notices.begin() + static_cast<std::ptrdiff_t>(i));
        }
        ImGui::End();
        ImGui::PopStyleColor();
        ImGui::PopStyleVar();
    }
}

}  // namespace sonocase::runtime
