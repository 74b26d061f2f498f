// SPDX-License-Identifier: Apache-2.0

// The bar under a frozen picture: which of the kept frames is shown.
#include <imgui.h>

#include <algorithm>

#include "runtime/player/ui/panels.h"

namespace sonocase::runtime {

void draw_cine_bar(
    ScanControls& controls, Cine& cine, int kept, double age_s, float height, float s) {
    ImGui::BeginChild("cine", {0, height}, false);
    ImGui::SetCursorPos({8 * s, 0.5f * (height - ImGui::GetFrameHeight())});
    if (ImGui::Button(cine.playing ? "Stop" : "Play", {54 * s, 0})) cine.playing = !cine.playing;
    ImGui::SameLine();
    const int newest = std::max(kept - 1, 1);
    int at = newest - controls.cine_back;
    ImGui::SetNextItemWidth(ImGui::GetContentRegionAvail().x - 78 * s);
    if (ImGui::SliderInt("##cine", &at, 0, newest, "")) {
        controls.cine_back = newest - at;
        cine.playing = false;
    }
    ImGui::SameLine();
    ImGui::AlignTextToFramePadding();
    ImGui::TextDisabled("-%.2f s", age_s);
    ImGui::EndChild();
}

}  // namespace sonocase::runtime
