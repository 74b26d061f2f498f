// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/pages.h"

#include <cstdio>

#include <imgui.h>

#include "runtime/player/session/frame_stats.h"
#include "runtime/player/ui/panels.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {

Status write_boxes(const Ui& ui, const std::string& picture) {
    constexpr const char* kKinds[] = {"card", "control", "words", "picture"};
    std::string out;
    for (const DrawnBox& drawn : ui.drawn()) {
        char line[160];
        std::snprintf(line, sizeof line, "%s %d %.2f %.2f %.2f %.2f %d ",
                      kKinds[static_cast<int>(drawn.kind)], drawn.layer, drawn.box.x, drawn.box.y,
                      drawn.box.w, drawn.box.h, drawn.cut ? 1 : 0);
        std::string name = drawn.name;
        for (char& c : name) {
            if (c == '\n') c = ' ';
        }
        out += line + name + "\n";
    }
    for (const std::string& words : missing_words())
        out += "untranslated 0 0 0 0 0 0 " + words + "\n";
    return write_text_output(picture + ".boxes", out);
}

void clear_marks(PictureTools& tools) {
    tools.measurements.clear();
    tools.marks.labels.clear();
}

bool show_notice(Notices& notices, Ui& ui, const Box& bar) {
    if (notices.standing().empty()) return false;
    if (draw_notice(ui, bar.inset(0, 3), notices.standing().back()))
        notices.dismiss(notices.standing().size() - 1);
    return true;
}

bool tracker_is_live(const CaseState& loaded,
                     const TrackerInUse& tracker,
                     const TrackerHealth& health) {
    if (tracker.mouse || tracker.paced || tracker.spec == "null") return true;
    return health.phase == TrackerPhase::streaming && !loaded.frame().waiting &&
           tracker.lost_since_s < 0;
}

void begin_page() {
    ImGui::SetNextWindowPos({0, 0});
    ImGui::SetNextWindowSize(ImGui::GetIO().DisplaySize);
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
    ImGui::Begin("sonocase", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoBringToFrontOnFocus |
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoScrollWithMouse);
    ImGui::PopStyleVar(2);
}

void end_page(Ui& ui) {
    ImGui::End();
    ui.end();
}

}  // namespace sonocase::runtime::inline player_ui
