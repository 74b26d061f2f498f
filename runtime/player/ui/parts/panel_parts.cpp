// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/parts/panel_parts.h"

#include <imgui.h>

#include <algorithm>
#include <cstdio>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui_parts {

std::string text(const char* format, double value) {
    return filled(format, value);
}

void small_dim(const char* words) {
    ImGui::PushFont(fonts().small);
    ImGui::TextDisabled("%s", words);
    ImGui::PopFont();
}

void heading(const char* words) {
    ImGui::PushFont(fonts().heading);
    ImGui::TextUnformatted(tr(words));
    ImGui::PopFont();
}

void coloured(unsigned packed, const std::string& words) {
    ImGui::PushStyleColor(ImGuiCol_Text, packed);
    ImGui::TextWrapped("%s", words.c_str());
    ImGui::PopStyleColor();
}

void row(const char* name, const char* value, unsigned packed) {
    ImGui::TextDisabled("%s", tr(name));
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(value).x);
    ImGui::PushStyleColor(ImGuiCol_Text, packed);
    ImGui::TextUnformatted(value);
    ImGui::PopStyleColor();
}

void row(const char* name, const char* format, double number, unsigned packed) {
    char value[48];
    std::snprintf(value, sizeof value, format, number);
    row(name, value, packed);
}

void row_distance(const char* name, double mm, double good_mm) {
    row(name, "%.1f mm", mm, mm <= good_mm ? colour::kGood : colour::kText);
}

bool slider(
    const char* name, const char* id, double& value, double low, double high, const char* format) {
    const float s = ImGui::GetFontSize() / 14;
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("%s", name);
    ImGui::SameLine(58 * s);
    char text[24];
    std::snprintf(text, sizeof text, format, value);
    ImGui::SetNextItemWidth(-52 * s);
    float shown = static_cast<float>(value);
    const bool moved =
        ImGui::SliderFloat(id, &shown, static_cast<float>(low), static_cast<float>(high), "");
    if (ImGui::IsItemClicked(1)) {
        value = 0.5 * (low + high);
        return true;
    }
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(text).x);
    ImGui::TextUnformatted(text);
    if (moved) value = shown;
    return moved;
}

std::string clock_words(double seconds) {
    char words[32];
    const int whole = static_cast<int>(seconds);
    std::snprintf(words, sizeof words, "%d:%02d", whole / 60, whole % 60);
    return words;
}

}  // namespace sonocase::runtime::inline player_ui_parts
