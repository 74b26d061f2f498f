// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/doppler_marks.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/base/constants.h"
#include "runtime/display/theme.h"
#include "runtime/imaging/doppler/box_hands.h"
#include "runtime/imaging/doppler/doppler_picture.h"
#include "runtime/imaging/doppler/m_mode.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
namespace {

using doppler::kColourLines;
using doppler::kColourRows;

constexpr float kReach = 14;  // u, from the mouse to what it takes hold of

ImVec2 screen(const ImagePlace& place, PlanePoint p, bool flipped) {
    return {static_cast<float>(place.origin_x + (flipped ? -p.x : p.x) / place.mm_per_screen_px),
            static_cast<float>(place.origin_y + p.z / place.mm_per_screen_px)};
}

PlanePoint in_plane(const ImagePlace& place, bool flipped, float x, float y) {
    PlanePoint p{(x - place.origin_x) * place.mm_per_screen_px,
                 (y - place.origin_y) * place.mm_per_screen_px};
    if (flipped) p.x = -p.x;
    return p;
}

void outline(const std::vector<ImVec2>& points, bool closed, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const int count = static_cast<int>(points.size());
    const ImDrawFlags flags = closed ? ImDrawFlags_Closed : ImDrawFlags_None;
    draw->AddPolyline(points.data(), count, colour::rgba(0, 0, 0, 160), flags, 3 * s);
    draw->AddPolyline(points.data(), count, colour::kMeasure, flags, 1.3f * s);
}

void draw_box(const ImagePlace& place,
              const ScanGeometry& geometry,
              const DopplerSettings& d,
              bool flipped,
              float s) {
    std::vector<ImVec2> points;
    for (const PlanePoint p : doppler::box_outline(geometry, d))
        points.push_back(screen(place, p, flipped));
    outline(points, true, s);
}

void draw_gate(const ImagePlace& place,
               const ScanGeometry& geometry,
               const DopplerSettings& d,
               bool flipped,
               float s) {
    const doppler::GateMarks gate = doppler::gate_marks(geometry, d);
    const ImVec2 face = screen(place, gate.face, flipped), end = screen(place, gate.end, flipped);
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float dx = end.x - face.x, dy = end.y - face.y;
    const float length = std::max(std::hypot(dx, dy), 1.0f);
    for (float t = 0; t < length; t += 9 * s) {
        const float u = t / length, v = std::min((t + 3 * s) / length, 1.0f);
        draw->AddLine({face.x + u * dx, face.y + u * dy}, {face.x + v * dx, face.y + v * dy},
                      colour::kMeasure, 1.2f * s);
    }
    if (d.mode != DopplerMode::spectral) return;
    // The gate: two strokes across the line, and the cursor along the vessel.
    const ImVec2 unit{dx / length, dy / length}, across{-unit.y, unit.x};
    for (const PlanePoint limit : {gate.upper, gate.lower}) {
        const ImVec2 p = screen(place, limit, flipped);
        outline({{p.x - 11 * s * across.x, p.y - 11 * s * across.y},
                 {p.x + 11 * s * across.x, p.y + 11 * s * across.y}},
                false, s);
    }
    const ImVec2 middle = screen(place, gate.middle, flipped);
    const double angle = (flipped ? -1 : 1) * d.angle_deg * kPi / 180;
    const auto c = static_cast<float>(std::cos(angle)), n = static_cast<float>(std::sin(angle));
    const ImVec2 along{c * unit.x - n * unit.y, n * unit.x + c * unit.y};
    for (const float side : {-1.0f, 1.0f})
        outline({{middle.x + side * 8 * s * along.x, middle.y + side * 8 * s * along.y},
                 {middle.x + side * 34 * s * along.x, middle.y + side * 34 * s * along.y}},
                false, s);
}

// Velocities beside the strip, corrected by the angle cursor as the measures are: the ends of the
// scale and 0.
void draw_velocities(Ui& ui, const Box& box, const DopplerSettings& d) {
    const double cosine = std::cos(std::clamp(d.angle_deg, -80.0, 80.0) * kPi / 180);
    const double zero = 0.5 + 0.5 * std::clamp(d.baseline, -0.9, 0.9);  // from the top
    const double upper = d.spectral_scale_cm_s * (1 + d.baseline) / cosine,
                 lower = -d.spectral_scale_cm_s * (1 - d.baseline) / cosine;
    const float x = box.right() - 52;
    const auto label = [&](double share, double cm_s) {
        const float y = box.y + static_cast<float>(share) * box.h;
        ui.line(box.right() - 58, y, box.right() - 54, y, colour::kDim);
        const Box words{x, std::clamp(y - 9, box.y, box.bottom() - 18), 50, 18};
        ui.text(words, std::to_string(static_cast<int>(std::lround(d.invert ? -cm_s : cm_s))),
                Type::small, colour::kImageText, Align::left, true);
    };
    label(0, upper);
    label(zero, 0);
    label(1, lower);
}

void draw_measures(Ui& ui, const Box& box, const ScanFrame& frame) {
    const doppler::SpectralMeasures& m = frame.doppler.measures;
    std::string words = tr("PSV, EDV and RI after one beat");
    if (m.beats > 0 && m.psv_cm_s < 0.05) {
        words = std::string("PSV –  EDV –  RI –   ") + tr("no flow in the gate");
    } else if (m.beats > 0) {
        words = filled(tr("PSV %.1f  EDV %.1f cm/s  RI %.2f  flow %.0f ml/min"), m.psv_cm_s,
                       m.edv_cm_s, m.resistive_index, m.flow_ml_min);
    }
    ui.text(box, words, Type::small, colour::kImageText, Align::left, true);
}

}  // namespace

ScanGeometry picture_geometry(const ScanFrame& frame, const Probe& probe) {
    Probe shown = probe;
    shown.depth_mm = frame.depth_mm;
    return make_scan_geometry(shown, kColourLines, kColourRows, std::max(frame.width_px, 1),
                              std::max(frame.height_px, 1));
}

void draw_doppler_marks(Ui& ui,
                        const ImagePlace& place,
                        const ScanGeometry& geometry,
                        const DopplerSettings& settings,
                        bool flipped) {
    if (settings.mode == DopplerMode::off) return;
    if (has_strip(settings.mode)) {
        draw_gate(place, geometry, settings, flipped, ui.scale());
    } else {
        draw_box(place, geometry, settings, flipped, ui.scale());
    }
}

void draw_colour_bar(Ui& ui, const Box& area, const DopplerSettings& settings) {
    const float high = std::min(110.0f, 0.25f * area.h);
    const Box bar{area.x + 12, area.bottom() - 16 - high, 9, high};
    const auto& palette = doppler::palette(settings.mode);
    constexpr int kSteps = 48;
    for (int i = 0; i < kSteps; ++i) {
        int index = 1 + (kSteps - 1 - i) * 254 / (kSteps - 1);
        if (settings.invert && settings.mode == DopplerMode::colour) index = 256 - index;
        const doppler::Rgb& c = palette[std::clamp(index, 1, 255)];
        ui.fill(
            {bar.x, bar.y + bar.h * static_cast<float>(i) / kSteps, bar.w, bar.h / kSteps + 0.6f},
            colour::rgba(c[0], c[1], c[2]));
    }
    ui.outline(bar, colour::kFaint, 1);
    if (settings.mode != DopplerMode::colour) return;
    const int scale = static_cast<int>(std::lround(settings.scale_cm_s));
    const std::string ends[] = {(settings.invert ? "-" : "+") + std::to_string(scale) + " cm/s",
                                (settings.invert ? "+" : "-") + std::to_string(scale)};
    ui.text({bar.right() + 5, bar.y - 3, 80, 18}, ends[0], Type::small, colour::kImageText,
            Align::left, true);
    ui.text({bar.right() + 5, bar.bottom() - 15, 60, 18}, ends[1], Type::small, colour::kImageText,
            Align::left, true);
}

bool has_strip(DopplerMode mode) {
    return mode == DopplerMode::spectral || mode == DopplerMode::m_mode;
}

Box strip_box(const Box& area) {
    Box rest = area;
    return rest.take_bottom(std::round(0.34f * area.h));
}

void draw_strip(Ui& ui,
                const Box& box,
                const ScanFrame& frame,
                const DopplerSettings& settings,
                void* texture) {
    ui.fill(box, colour::kPicture);
    ui.line(box.x, box.y, box.right(), box.y, colour::kLine);
    Box rest = box;
    rest.take_top(4);
    const Box words = rest.take_top(18, 2);
    rest.take_left(8);
    Box strip = rest;
    strip.take_right(60);
    if (texture && !frame.doppler.strip.empty()) ui.image(texture, strip);
    ui.outline(strip, colour::kFaint, 1);
    const bool spectral = settings.mode == DopplerMode::spectral;
    const double shown_s =
        spectral ? kStripSeconds : double(doppler::MMode::kColumns) / doppler::MMode::kPerSecond;
    for (int second = 1; second < shown_s; ++second) {
        const float x = strip.right() - strip.w * static_cast<float>(second / shown_s);
        ui.line(x, strip.bottom() - 5, x, strip.bottom(), colour::kImageText);
    }
    const Box above{words.x + 12, words.y, words.w - 24, words.h};
    if (spectral) {
        draw_velocities(ui, rest, settings);
        draw_measures(ui, above, frame);
        return;
    }
    ui.text(above, tr("Depth over time; a tick per second"), Type::small, colour::kImageText,
            Align::left, true);
    constexpr float kLine = 20;
    int step_cm = 1;
    while (strip.h * static_cast<float>(step_cm * 10 / std::max(frame.depth_mm, 1.0)) < kLine)
        step_cm += step_cm == 1 ? 1 : step_cm == 2 ? 3 : 5;
    for (int cm = step_cm; cm * 10 < frame.depth_mm; cm += step_cm) {
        const float y = strip.y + strip.h * static_cast<float>(cm * 10 / frame.depth_mm);
        ui.line(strip.right(), y, strip.right() + 4, y, colour::kDim);
        if (y + 9 > strip.bottom()) break;
        ui.text({strip.right() + 8, std::max(y - 9, strip.y), 40, 18}, std::to_string(cm),
                Type::small, colour::kImageText, Align::left, true);
    }
}

DopplerDrag doppler_hold(const ImagePlace& place,
                         const ScanGeometry& geometry,
                         const DopplerSettings& d,
                         bool flipped,
                         float x,
                         float y,
                         float scale) {
    return doppler::hold_at(geometry, d, in_plane(place, flipped, x, y),
                            kReach * scale * place.mm_per_screen_px);
}

void drag_doppler(const ImagePlace& place,
                  const ScanGeometry& geometry,
                  DopplerDrag held,
                  bool flipped,
                  float from_x,
                  float from_y,
                  float to_x,
                  float to_y,
                  DopplerSettings& d) {
    doppler::drag_held(geometry, held, in_plane(place, flipped, from_x, from_y),
                       in_plane(place, flipped, to_x, to_y), d);
}

}  // namespace sonocase::runtime::inline player_ui
