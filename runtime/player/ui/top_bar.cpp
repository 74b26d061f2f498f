// SPDX-License-Identifier: Apache-2.0

// The bar at the top of the scan page: what is scanned on the left, health on the right.
#include <imgui.h>

#include <algorithm>

#include "runtime/player/ui/panel_parts.h"
#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {
namespace {

unsigned phase_colour(TrackerPhase phase) {
    switch (phase) {
        case TrackerPhase::streaming: return colour::kGood;
        case TrackerPhase::failed: return colour::kBad;
        case TrackerPhase::ended: return colour::kDim;
        default: return colour::kWarn;
    }
}

void dot(unsigned packed) {
    const float r = 0.27f * ImGui::GetTextLineHeight();
    const ImVec2 at = ImGui::GetCursorScreenPos();
    ImGui::GetWindowDrawList()->AddCircleFilled({at.x + r, at.y + 0.5f * ImGui::GetFrameHeight()},
                                                r, packed, 16);
    ImGui::Dummy({3.2f * r, ImGui::GetFrameHeight()});
    ImGui::SameLine(0, 0);
}

const std::string& title(const Exercise& exercise) {
    return exercise.title.empty() ? exercise.name : exercise.title;
}

void draw_choices(const TopBarInput& input, TopBarRequest& request, float s) {
    ImGui::SetNextItemWidth(250 * s);
    const Exercise& current = input.exercises[static_cast<std::size_t>(input.exercise_index)];
    if (ImGui::BeginCombo("##exercise", title(current).c_str())) {
        for (std::size_t i = 0; i < input.exercises.size(); ++i) {
            const Exercise& exercise = input.exercises[i];
            const std::string label = title(exercise) + "##" + exercise.name;
            const int index = static_cast<int>(i);
            if (ImGui::Selectable(label.c_str(), index == input.exercise_index))
                request.exercise = index;
        }
        ImGui::EndCombo();
    }
    ImGui::SameLine();
    ImGui::SetNextItemWidth(120 * s);
    struct Choice {
        const char *model, *machine, *name;
    };
    constexpr Choice kChoices[] = {
        {"physical", "", "Modern"}, {"physical", "classic", "Classic"}, {"paper", "", "Paper"}};
    const auto chosen = [&](const Choice& choice) {
        return input.model == choice.model &&
               (input.model == "paper" || input.machine == choice.machine);
    };
    std::string now = input.machine;  // of the command line
    for (const Choice& choice : kChoices) {
        if (chosen(choice)) now = choice.name;
    }
    if (ImGui::BeginCombo("##model", now.c_str())) {
        for (const Choice& choice : kChoices) {
            if (!ImGui::Selectable(choice.name, chosen(choice))) continue;
            request.model = choice.model;
            request.machine = choice.machine;
        }
        ImGui::EndCombo();
    }
}

// What an instructor looks for first when something feels wrong.
void draw_health(const TopBarInput& input, float s) {
    const std::string& device = input.tracker.device;
    const ScanFrame& frame = input.frame;
    const std::string latency =
        frame.pose_to_pixel_median_ms > 0
            ? text("pose to pixels %.1f ms", frame.pose_to_pixel_median_ms) +
                  text(" (99%%: %.1f)", frame.pose_to_pixel_p99_ms)
            : "no pose yet";
    const std::string rate = text("%.0f fps", input.pictures_per_s);
    const float wide = ImGui::CalcTextSize(device.c_str()).x +
                       ImGui::CalcTextSize(latency.c_str()).x +
                       ImGui::CalcTextSize(rate.c_str()).x + 70 * s;
    ImGui::SameLine(std::max(ImGui::GetCursorPosX() + 10, ImGui::GetWindowWidth() - wide));
    ImGui::AlignTextToFramePadding();
    dot(phase_colour(input.tracker.phase));
    ImGui::TextUnformatted(device.c_str());
    ImGui::SameLine(0, 18 * s);
    ImGui::TextDisabled("%s", latency.c_str());
    ImGui::SameLine(0, 18 * s);
    ImGui::TextDisabled("%s", rate.c_str());
}

}  // namespace

TopBarRequest draw_top_bar(const TopBarInput& input, float height, float s) {
    TopBarRequest request;
    ImGui::BeginChild("bar", {0, height}, false, ImGuiWindowFlags_NoScrollbar);
    ImGui::SetCursorPos({10 * s, 0.5f * (height - ImGui::GetFrameHeight())});
    ImGui::PushFont(fonts().heading);
    ImGui::AlignTextToFramePadding();
    ImGui::TextColored(ImGui::ColorConvertU32ToFloat4(colour::kAccent), "sonocase");
    ImGui::PopFont();
    ImGui::SameLine(0, 14 * s);
    request.show_bundles = ImGui::Button("Cases");
    ImGui::SameLine();
    draw_choices(input, request, s);
    ImGui::SameLine();
    request.toggle_setup = ImGui::Button("Set-up");
    ImGui::SameLine();
    request.toggle_help = ImGui::Button("Help");
    draw_health(input, s);
    ImGui::EndChild();
    return request;
}

}  // namespace sonocase::runtime
