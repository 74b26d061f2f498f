// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/picture/target_marks.h"

#include <imgui.h>

#include <cmath>
#include <numbers>

#include "runtime/display/theme.h"
#include "runtime/player/ui/parts/panel_parts.h"

namespace sonocase::runtime {
namespace {

void dotted_ring(ImDrawList* draw, ImVec2 centre, float radius, float s) {
    const int dots = std::max(12, static_cast<int>(radius / (3 * s)));
    for (int i = 0; i < dots; ++i) {
        const double turn = 2 * std::numbers::pi * i / dots;
        draw->AddCircleFilled({centre.x + radius * static_cast<float>(std::cos(turn)),
                               centre.y + radius * static_cast<float>(std::sin(turn))},
                              1.4f * s, colour::kMeasure, 6);
    }
}

void words_beside(ImDrawList* draw, ImVec2 centre, float radius, const std::string& words) {
    const ImVec2 wide = ImGui::CalcTextSize(words.c_str());
    const float x = centre.x - 0.5f * wide.x, y = centre.y - radius - wide.y - 2;
    draw->AddText({x + 1, y + 1}, colour::rgba(0, 0, 0, 200), words.c_str());
    draw->AddText({x, y}, colour::kMeasure, words.c_str());
}

}  // namespace

void draw_target_marks(Ui& ui,
                       const ImagePlace& place,
                       const std::vector<TargetMark>& targets,
                       bool flipped) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = ui.scale();
    ImGui::PushFont(fonts().small);
    for (const TargetMark& target : targets) {
        if (!(target.centre.z > 0)) continue;  // behind the face
        const double per_px = place.mm_per_screen_px, x = (flipped ? -1 : 1) * target.centre.x;
        const ImVec2 at{static_cast<float>(place.origin_x + x / per_px),
                        static_cast<float>(place.origin_y + target.centre.z / per_px)};
        const double off = std::abs(target.centre.y), r = target.radius_mm;
        if (off < r) {
            const auto ring = static_cast<float>(std::sqrt(r * r - off * off) / per_px);
            draw->AddCircle(at, ring, colour::rgba(0, 0, 0, 200), 0, 4 * s);
            draw->AddCircle(at, ring, colour::kMeasure, 0, 2 * s);
            words_beside(draw, at, ring, target.name);
        } else {
            const auto ring = static_cast<float>(r / per_px);
            dotted_ring(draw, at, ring, s);
            words_beside(draw, at, ring, target.name + text("  %.0f mm", off));
        }
    }
    ImGui::PopFont();
}

}  // namespace sonocase::runtime
