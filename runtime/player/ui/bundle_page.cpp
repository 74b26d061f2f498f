// SPDX-License-Identifier: Apache-2.0

// The start page: the list of bundles.
#include <imgui.h>

#include <algorithm>

#include "runtime/player/app/user_folders.h"
#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

// One line of the list, `width` wide; true: chosen.
bool draw_entry(const BundleEntry& entry, bool under_cursor, float width, float s) {
    const ImVec2 at = ImGui::GetCursorPos();
    const float height = 46 * s;
    if (ImGui::Selectable("##row", under_cursor, 0, {width, height})) return true;
    ImGui::SetCursorPos({at.x + 12 * s, at.y + 5 * s});
    heading(entry.name.c_str());
    ImGui::SetCursorPos({at.x + 12 * s, at.y + 25 * s});
    ImGui::PushFont(fonts().small);
    ImGui::TextDisabled("%s", entry.folder.c_str());
    const std::string right = text("%.1f MB", entry.megabytes) + (entry.recent ? "   recent" : "");
    ImGui::SetCursorPos({width - ImGui::CalcTextSize(right.c_str()).x - 10 * s, at.y + 15 * s});
    ImGui::TextDisabled("%s", right.c_str());
    ImGui::PopFont();
    ImGui::SetCursorPos({at.x, at.y + height + 4 * s});
    return false;
}

std::optional<std::string> draw_list(BundleChooser& chooser, float width, float s) {
    std::optional<std::string> wanted;
    const float pad = 8 * s;
    ImGui::SetCursorPos({pad, pad});
    ImGui::BeginGroup();
    if (chooser.bundles.empty()) {
        ImGui::TextWrapped(
            "No case bundle was found in %s/cases, the system's data folders or this folder.",
            data_folder().empty() ? "~/.local/share/sonocase" : data_folder().c_str());
        ImGui::TextDisabled(
            "Make one with: sonocase build scenarios/demo-torso/case.toml -o demo.sonocase");
    }
    for (std::size_t i = 0; i < chooser.bundles.size() && !wanted; ++i) {
        ImGui::PushID(static_cast<int>(i));
        const bool under_cursor = static_cast<int>(i) == chooser.cursor;
        if (draw_entry(chooser.bundles[i], under_cursor, width - 2 * pad, s)) {
            chooser.cursor = static_cast<int>(i);
            wanted = chooser.bundles[i].path;
        }
        ImGui::PopID();
    }
    ImGui::EndGroup();
    return wanted;
}

}  // namespace

std::optional<std::string> draw_bundle_page(BundleChooser& chooser, float s) {
    const ImVec2 size = ImGui::GetContentRegionAvail();
    const float width = std::min(size.x, 760 * s);
    ImGui::SetCursorPos({0.5f * (ImGui::GetWindowWidth() - width), 0.09f * size.y});
    ImGui::BeginChild("start", {width, 0.84f * size.y}, false, ImGuiWindowFlags_NoBackground);
    ImGui::PushFont(fonts().title);
    ImGui::TextUnformatted("sonocase");
    ImGui::PopFont();
    ImGui::TextDisabled("Ultrasound-guided needle placement. Choose a case.");
    ImGui::Dummy({0, 8 * s});
    const float list_height = ImGui::GetContentRegionAvail().y - 74 * s;
    ImGui::BeginChild("list", {0, list_height});
    std::optional<std::string> wanted = draw_list(chooser, width, s);
    ImGui::EndChild();
    ImGui::Dummy({0, 4 * s});
    ImGui::SetNextItemWidth(width - 96 * s);
    const bool entered =
        ImGui::InputTextWithHint("##path", "Path of a *.sonocase file", chooser.path,
                                 sizeof chooser.path, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::SameLine();
    if ((ImGui::Button("Open", {-1, 0}) || entered) && chooser.path[0]) wanted = chooser.path;
    ImGui::TextDisabled("Arrow keys and Enter choose.  F1 help.  Ctrl+Q quits.");
    ImGui::EndChild();
    return wanted;
}

}  // namespace sonocase::runtime
