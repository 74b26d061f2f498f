// SPDX-License-Identifier: Apache-2.0

// A drawing per step of the guided set-up: what is held where, and how it moves.
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "runtime/display/theme.h"
#include "runtime/player/ui/panels/panels.h"

namespace sonocase::runtime {
namespace {

constexpr float kWide = 300, kHigh = 110;  // u

struct Pen {
    ImDrawList* draw;
    ImVec2 at;
    float s;

    ImVec2 point(float x, float y) const { return {at.x + x * s, at.y + y * s}; }
    void line(float x0, float y0, float x1, float y1, unsigned packed, float thick = 2) const {
        draw->AddLine(point(x0, y0), point(x1, y1), packed, thick * s);
    }
    void arrow(float x0, float y0, float x1, float y1) const {
        line(x0, y0, x1, y1, colour::kAccent);
        const float dx = x1 - x0, dy = y1 - y0, n = std::max(std::hypot(dx, dy), 1.0f);
        const float ux = dx / n, uy = dy / n;
        line(x1, y1, x1 - 8 * ux - 5 * uy, y1 - 8 * uy + 5 * ux, colour::kAccent);
        line(x1, y1, x1 - 8 * ux + 5 * uy, y1 - 8 * uy - 5 * ux, colour::kAccent);
    }
    // A probe whose face's middle is at x, y, leaning by so much per unit of height.
    void probe(float x, float y, float lean, unsigned packed) const {
        const ImVec2 shape[] = {point(x - 18, y - 4),
                                point(x + 18, y - 4),
                                point(x + 12 + 34 * lean, y - 40),
                                point(x + 9 + 58 * lean, y - 64),
                                point(x - 9 + 58 * lean, y - 64),
                                point(x - 12 + 34 * lean, y - 40)};
        draw->AddPolyline(shape, 6, packed, ImDrawFlags_Closed, 2 * s);
        line(x - 18, y - 4, x, y, packed);
        line(x, y, x + 18, y - 4, packed);
    }
    void ruler(float x, float y, float length, bool upright) const {
        for (int i = 0; i <= 12; ++i) {
            const float t = length * static_cast<float>(i) / 12, tick = i % 4 == 0 ? 10.0f : 5.0f;
            if (upright) {
                line(x, y + t, x + tick, y + t, colour::kDim, 1);
            } else {
                line(x + t, y, x + t, y + tick, colour::kDim, 1);
            }
        }
        line(x, y, upright ? x : x + length, upright ? y + length : y, colour::kDim, 1);
    }
};

void draw_needle_step(const Pen& pen) {
    pen.line(40, 84, 140, 84, colour::kDim);
    pen.line(160, 84, 260, 84, colour::kDim);  // a plate with a pinhole
    for (const float lean : {-36.0f, 0.0f, 36.0f})
        pen.line(150 - 0.3f * lean, 104, 150 + lean, 10,
                 lean == 0 ? colour::kText : colour::kFaint);
    pen.arrow(176, 30, 196, 42);
    pen.arrow(226, 60, 226, 100);
}

void draw_sweep_step(const Pen& pen) {
    pen.draw->PathLineTo(pen.point(20, 104));
    pen.draw->PathBezierCubicCurveTo(pen.point(60, 40), pen.point(240, 40), pen.point(280, 104),
                                     24);
    pen.draw->PathStroke(colour::kDim, 0, 2 * pen.s);
    pen.probe(150, 58, 0, colour::kText);
    pen.arrow(120, 76, 64, 92);
    pen.arrow(180, 76, 236, 92);
}

}  // namespace

void draw_setup_drawing(SetupStep step, float s) {
    const Pen pen{ImGui::GetWindowDrawList(), ImGui::GetCursorScreenPos(), s};
    pen.draw->AddRectFilled(pen.at, pen.point(kWide, kHigh), colour::kRaised, 6 * s);
    switch (step) {
        case SetupStep::trackers:
            pen.probe(90, 92, 0, colour::kText);
            pen.line(200, 96, 236, 26, colour::kText);
            pen.draw->AddCircle(pen.point(90, 20), 8 * s, colour::kAccent, 20, 2 * s);
            pen.draw->AddCircle(pen.point(236, 22), 8 * s, colour::kAccent, 20, 2 * s);
            break;
        case SetupStep::probe_tip:
            pen.probe(150, 86, -0.7f, colour::kFaint);
            pen.probe(150, 86, 0.7f, colour::kFaint);
            pen.probe(150, 86, 0, colour::kText);
            pen.line(150, 87, 150, 106, colour::kDim);  // the pin
            pen.arrow(176, 18, 204, 34);
            pen.arrow(124, 18, 96, 34);
            break;
        case SetupStep::probe_depth:
            pen.probe(130, 78, 0, colour::kText);
            pen.ruler(176, 6, 96, true);
            pen.arrow(130, 82, 130, 106);
            break;
        case SetupStep::probe_lateral:
            pen.probe(120, 82, 0, colour::kText);
            pen.draw->AddCircleFilled(pen.point(136, 60), 3 * s, colour::kAccent);  // its mark
            pen.ruler(30, 92, 240, false);
            pen.arrow(150, 52, 214, 52);
            break;
        case SetupStep::needle: draw_needle_step(pen); break;
        case SetupStep::mannequin: draw_sweep_step(pen); break;
        case SetupStep::done:
            pen.probe(90, 92, 0, colour::kText);
            pen.draw->AddTriangle(pen.point(220, 20), pen.point(180, 96), pen.point(260, 96),
                                  colour::kDim, 2 * s);
            pen.arrow(118, 60, 176, 60);
            break;
    }
    ImGui::Dummy({kWide * s, kHigh * s});
}

}  // namespace sonocase::runtime
