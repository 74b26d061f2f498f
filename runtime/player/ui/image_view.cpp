// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/image_view.h"

#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "runtime/display/image_texture.h"
#include "runtime/display/theme.h"

namespace sonocase::runtime {
namespace {

ImVec2 screen(const ImagePlace& place, double x_mm, double z_mm) {
    return {static_cast<float>(place.origin_x + x_mm / place.mm_per_screen_px),
            static_cast<float>(place.origin_y + z_mm / place.mm_per_screen_px)};
}

void text_at(ImDrawList* draw, float x, float y, unsigned colour, const char* text) {
    // A dark edge keeps words readable over bright tissue.
    draw->AddText({x + 1, y + 1}, colour::rgba(0, 0, 0, 200), text);
    draw->AddText({x, y}, colour, text);
}

void cross_mark(ImDrawList* draw, ImVec2 p, float r, unsigned colour, float thick) {
    draw->AddLine({p.x - r, p.y}, {p.x + r, p.y}, colour, thick);
    draw->AddLine({p.x, p.y - r}, {p.x, p.y + r}, colour, thick);
}

// On the right, in centimetres, as machines write it; finer marks where there is room.
void draw_depth_scale(const ImagePlace& place, const ImageViewInput& input) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = input.scale;
    const ScanFrame& frame = input.frame;
    const double px_per_mm = 1 / place.mm_per_screen_px;
    const float x = place.x + place.side_x - 30 * s;
    const int label_step_mm = px_per_mm * 10 >= 16 * s ? 10 : px_per_mm * 20 >= 16 * s ? 20 : 50;
    const bool fine = px_per_mm * 5 >= 7 * s;
    for (int mm = 0; mm <= static_cast<int>(frame.depth_mm + 0.5); mm += 5) {
        if (mm % 10 != 0 && !fine) continue;
        const float y = static_cast<float>(place.origin_y + mm * px_per_mm);
        const bool labelled = mm % label_step_mm == 0;
        const float length = (mm % 50 == 0 ? 11.0f : mm % 10 == 0 ? 7.0f : 4.0f) * s;
        draw->AddLine({x - length, y}, {x, y}, colour::kDim, std::max(1.0f, s));
        if (labelled && mm > 0) {
            char label[16];
            std::snprintf(label, sizeof label, "%d", mm / 10);
            draw->AddText({x + 6 * s, y - 0.5f * ImGui::GetTextLineHeight()}, colour::kImageText,
                          label);
        }
    }
    draw->AddText(
        {x + 3 * s, static_cast<float>(place.origin_y) - 0.5f * ImGui::GetTextLineHeight()},
        colour::kDim, "cm");
    // Focus mark: a triangle that points at the scale.
    const float fy = static_cast<float>(place.origin_y + frame.focus_mm * px_per_mm);
    if (frame.focus_mm > 0 && frame.focus_mm <= frame.depth_mm) {
        draw->AddTriangleFilled({x - 22 * s, fy - 5 * s}, {x - 22 * s, fy + 5 * s},
                                {x - 14 * s, fy}, colour::kAccent);
    }
}

// The orientation mark beside the face, on the side of the probe's x axis.
void draw_orientation_mark(const ImagePlace& place, const ImageViewInput& input) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = input.scale;
    const double px_per_mm = 1 / place.mm_per_screen_px;
    double half_mm = 0.5 * input.probe.width_mm;
    if (input.probe.shape == ProbeShape::curvilinear) {
        half_mm = input.probe.radius_mm * std::sin(0.5 * input.probe.field_of_view_rad);
    }
    const float side = input.flipped ? -1.0f : 1.0f;
    const ImVec2 mark{static_cast<float>(place.origin_x) +
                          side * (static_cast<float>(half_mm * px_per_mm) + 20 * s),
                      std::max(static_cast<float>(place.origin_y) - 2 * s, place.y + 14 * s)};
    draw->AddCircleFilled(mark, 6.5f * s, colour::kAccent, 20);
    const char* letter = "S";
    const ImVec2 size = ImGui::CalcTextSize(letter);
    draw->AddText({mark.x - 0.5f * size.x, mark.y - 0.5f * size.y}, colour::rgba(8, 12, 16),
                  letter);
}

// On the left.
void draw_grey_bar(const ImagePlace& place, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const ImVec2 bar{place.x + 12 * s, place.y + 0.34f * place.side_y};
    draw->AddRectFilledMultiColor(bar, {bar.x + 7 * s, bar.y + 110 * s}, 0xFFFFFFFF, 0xFFFFFFFF,
                                  0xFF000000, 0xFF000000);
    draw->AddRect(bar, {bar.x + 7 * s, bar.y + 110 * s}, colour::kFaint);
}

// A sentence on the picture where the frame is not one of tissue.
void draw_status(const ImagePlace& place, FrameStatus status, bool skin_not_fitted) {
    const bool no_contact = status == FrameStatus::no_contact;
    const bool held = status == FrameStatus::held_bad_pose;
    if (!no_contact && !held && !skin_not_fitted) return;
    const char* words = no_contact ? "No contact: press the probe onto the skin"
                        : held     ? "Pose is not usable: picture held"
                                   : "Not fitted here: the mannequin was not swept";
    const ImVec2 wide = ImGui::CalcTextSize(words);
    // Over a picture of tissue the words stand at its foot.
    const float height = no_contact || held ? 0.55f : 0.93f;
    text_at(ImGui::GetWindowDrawList(), place.x + 0.5f * (place.side_x - wide.x),
            place.y + height * place.side_y, no_contact ? colour::kDim : colour::kWarn, words);
}

void draw_measurements(const ImagePlace& place, const ImageViewInput& input) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float s = input.scale;
    std::vector<Measurement> shown = input.measurements.done();
    if (input.measurements.begun()) {
        Measurement live = *input.measurements.begun();
        const ImVec2 mouse = ImGui::GetIO().MousePos;
        live.x1_mm = (mouse.x - place.origin_x) * place.mm_per_screen_px;
        live.z1_mm = (mouse.y - place.origin_y) * place.mm_per_screen_px;
        shown.push_back(live);
    }
    float y = place.y + place.side_y - 14 * s;
    for (std::size_t i = shown.size(); i-- > 0;) {
        const Measurement& m = shown[i];
        const ImVec2 a = screen(place, m.x0_mm, m.z0_mm), b = screen(place, m.x1_mm, m.z1_mm);
        cross_mark(draw, a, 6 * s, colour::kMeasure, 1.5f * s);
        cross_mark(draw, b, 6 * s, colour::kMeasure, 1.5f * s);
        const double dx = b.x - a.x, dy = b.y - a.y, length = std::hypot(dx, dy);
        for (double t = 9 * s; t + 3 * s < length - 6 * s; t += 7 * s) {
            const auto at = [&](double u) {
                return ImVec2{static_cast<float>(a.x + dx * u / length),
                              static_cast<float>(a.y + dy * u / length)};
            };
            draw->AddLine(at(t), at(t + 3 * s), colour::kMeasure, 1.2f * s);
        }
        char number[24], words[48];
        std::snprintf(number, sizeof number, "%zu", i + 1);
        draw->AddText({a.x + 7 * s, a.y - 16 * s}, colour::kMeasure, number);
        std::snprintf(words, sizeof words, "%zu  %.1f mm", i + 1, m.length_mm());
        y -= ImGui::GetTextLineHeight() + 3 * s;
        text_at(draw, place.x + 34 * s, y, colour::kMeasure, words);
    }
    if (input.measuring && place.hovered) {
        cross_mark(draw, ImGui::GetIO().MousePos, 9 * s, colour::kMeasure, 1.0f * s);
    }
}

// Fits the frame into the area that starts at `corner`.
void fit_frame(
    ImagePlace& place, ImVec2 corner, float width, float height, const ScanFrame& frame) {
    const float fit = std::min(width / static_cast<float>(frame.width_px),
                               height / static_cast<float>(frame.height_px));
    place.side_x = std::floor(fit * static_cast<float>(frame.width_px));
    place.side_y = std::floor(fit * static_cast<float>(frame.height_px));
    place.x = std::floor(corner.x + 0.5f * (width - place.side_x));
    place.y = std::floor(corner.y + 0.5f * (height - place.side_y));
    place.mm_per_screen_px = frame.layout.mm_per_px > 0 ? frame.layout.mm_per_px / fit : 1;
    place.origin_x = place.x + fit * frame.layout.origin_x_px;
    place.origin_y = place.y + fit * frame.layout.origin_y_px;
}

// Black beside the picture alone, and the picture without blending: where the processor paints,
// every layer costs time.
void draw_pixels(const ImagePlace& place, ImVec2 corner, float width, float height, void* texture) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float right = place.x + place.side_x, bottom = place.y + place.side_y;
    const ImU32 black = colour::rgba(0, 0, 0);
    draw->AddRectFilled(corner, {place.x, corner.y + height}, black);
    draw->AddRectFilled({right, corner.y}, {corner.x + width, corner.y + height}, black);
    draw->AddRectFilled({place.x, corner.y}, {right, place.y}, black);
    draw->AddRectFilled({place.x, bottom}, {right, corner.y + height}, black);
    draw->AddCallback(paint_opaque, nullptr);
    draw->AddImage(texture, {place.x, place.y}, {right, bottom});
    draw->AddCallback(ImDrawCallback_ResetRenderState, nullptr);
}

void draw_corner_texts(ImVec2 corner, float width, const ImageViewInput& input) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    ImGui::PushFont(fonts().small);
    const float line = ImGui::GetTextLineHeight() + 2 * input.scale, pad = 10 * input.scale;
    float y = corner.y + pad;
    for (const std::string& text : input.left_lines) {
        text_at(draw, corner.x + pad, y, colour::kImageText, text.c_str());
        y += line;
    }
    y = corner.y + pad;
    for (const std::string& text : input.right_lines) {
        text_at(draw, corner.x + width - pad - ImGui::CalcTextSize(text.c_str()).x, y,
                colour::kImageText, text.c_str());
        y += line;
    }
    ImGui::PopFont();
}

// "FROZEN", or "CINE" where an older frame than the newest is shown.
void draw_frozen_sign(ImVec2 corner, float width, double cine_age_s, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    ImGui::PushFont(fonts().heading);
    const char* word = cine_age_s > 0.005 ? "CINE" : "FROZEN";
    const ImVec2 size = ImGui::CalcTextSize(word);
    const ImVec2 at{corner.x + 0.5f * (width - size.x), corner.y + 10 * s};
    draw->AddRectFilled({at.x - 9 * s, at.y - 3 * s},
                        {at.x + size.x + 9 * s, at.y + size.y + 3 * s},
                        colour::rgba(30, 90, 110, 230), 4 * s);
    draw->AddText(at, colour::kText, word);
    ImGui::PopFont();
}

}  // namespace

ImagePlace draw_image_view(float width, float height, const ImageViewInput& input) {
    ImagePlace place;
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    ImDrawList* draw = ImGui::GetWindowDrawList();
    // Takes the mouse.
    ImGui::InvisibleButton("picture", {std::max(width, 1.0f), std::max(height, 1.0f)},
                           ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight |
                               ImGuiButtonFlags_MouseButtonMiddle);
    place.hovered = ImGui::IsItemHovered() || ImGui::IsItemActive();
    const ScanFrame& frame = input.frame;
    if (frame.width_px > 0 && input.texture) {
        fit_frame(place, corner, width, height, frame);
        draw->PushClipRect(corner, {corner.x + width, corner.y + height}, true);
        draw_pixels(place, corner, width, height, input.texture);
        ImGui::PushFont(fonts().small);
        draw_depth_scale(place, input);
        draw_orientation_mark(place, input);
        draw_grey_bar(place, input.scale);
        draw_status(place, frame.status, frame.record.skin_not_fitted);
        ImGui::PopFont();
        draw_measurements(place, input);
        draw->PopClipRect();
    } else {
        draw->AddRectFilled(corner, {corner.x + width, corner.y + height}, colour::rgba(0, 0, 0));
    }
    draw_corner_texts(corner, width, input);
    if (frame.frozen) draw_frozen_sign(corner, width, frame.cine_age_s, input.scale);
    return place;
}

}  // namespace sonocase::runtime
