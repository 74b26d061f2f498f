// SPDX-License-Identifier: Apache-2.0

// The machine's console.
#include <imgui.h>

#include <cstdio>

#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

unsigned switch_colour(bool on) {
    return on ? colour::rgba(38, 104, 124) : colour::rgba(40, 49, 60);
}

// A name, minus and plus. Returns -1, 0 or 1.
int step_buttons(const char* name, const char* minus_id, const char* plus_id, float s) {
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("%s", name);
    ImGui::SameLine(58 * s);
    const float side = ImGui::GetFrameHeight();
    int step = 0;
    if (ImGui::Button(minus_id, {side, 0})) step = -1;
    ImGui::SameLine(0, 4 * s);
    if (ImGui::Button(plus_id, {side, 0})) step = 1;
    ImGui::SameLine();
    return step;
}

void draw_tgc(ImageSettings& image, double depth_mm, float s) {
    ImGui::TextDisabled("TGC");
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - 52 * s);
    if (ImGui::SmallButton("Level")) image.tgc_db = {};
    ImGui::PushStyleVar(ImGuiStyleVar_ItemSpacing, {7 * s, 2 * s});
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding, {7 * s, 0});
    ImGui::PushFont(fonts().small);
    for (int i = 0; i < 8; ++i) {
        ImGui::PushID(i);
        double& gain_db = image.tgc_db[static_cast<std::size_t>(i)];
        float value = static_cast<float>(gain_db);
        ImGui::AlignTextToFramePadding();
        ImGui::TextDisabled("%.0f cm", depth_mm / 80 * (i + 0.5));
        ImGui::SameLine(58 * s);
        ImGui::SetNextItemWidth(-30 * s);
        if (ImGui::SliderFloat("##tgc", &value, -20, 20, "")) gain_db = value;
        if (ImGui::IsItemClicked(1)) gain_db = 0;
        char words[16];
        std::snprintf(words, sizeof words, "%+.0f", value);
        ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - ImGui::CalcTextSize(words).x);
        ImGui::TextDisabled("%s", value == 0 ? "0" : words);
        ImGui::PopID();
    }
    ImGui::PopFont();
    ImGui::PopStyleVar(2);
}

}  // namespace

ConsoleRequest draw_console_panel(ScanControls& controls,
                                  const ImageChoice& choice,
                                  bool& measuring,
                                  float s) {
    ConsoleRequest request;
    ImageSettings& image = controls.settings;
    const float half = 0.5f * (ImGui::GetContentRegionAvail().x - 7 * s);
    request.toggle_freeze =
        coloured_button(switch_colour(controls.frozen), controls.frozen ? "Live" : "Freeze", half);
    ImGui::SameLine();
    if (coloured_button(switch_colour(measuring), "Measure", half)) measuring = !measuring;
    slider("Gain", "##gain", image.gain_db, -30, 30, "%+.0f dB");
    slider("Range", "##range", image.dynamic_range_db, 40, 90, "%.0f dB");
    slider("Press", "##press", image.press_mm, 0, 40, "%.0f mm");
    request.depth_by_mm = 10 * step_buttons("Depth", "-##depth", "+##depth", s);
    ImGui::Text("%.0f cm", choice.depth_mm / 10);
    request.focus_by_mm = 5 * step_buttons("Focus", "-##focus", "+##focus", s);
    ImGui::Text("%.1f cm", choice.focus_mm / 10);
    ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - 52 * s);
    if (ImGui::Button("Flip", {52 * s, 0})) image.flip_left_right = !image.flip_left_right;
    draw_tgc(image, choice.depth_mm, s);
    return request;
}

}  // namespace sonocase::runtime
