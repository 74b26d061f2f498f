// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/image_view.h"

#include <imgui.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "runtime/display/image_texture.h"
#include "runtime/display/theme.h"
#include "runtime/player/ui/doppler_marks.h"
#include "runtime/player/ui/parts/panel_parts.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui {
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

// The area less what is kept for the depth scale on the right, and above and below.
constexpr float kScaleRoom = 44, kEndRoom = 12;

void cross_mark(ImDrawList* draw, ImVec2 p, float r, unsigned colour, float thick) {
    draw->AddLine({p.x - r, p.y}, {p.x + r, p.y}, colour, thick);
    draw->AddLine({p.x, p.y - r}, {p.x, p.y + r}, colour, thick);
}

// The depth scale on the right, in centimetres as on machines; finer marks where there is room.
void draw_depth_scale(const ImagePlace& place, const ImageViewInput& input, float right, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const ScanFrame& frame = input.frame;
    const double px_per_mm = 1 / place.mm_per_screen_px;
    const float x = right - 30 * s;
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
                                {x - 14 * s, fy}, colour::kMeasure);
    }
}

// The orientation mark beside the face, on the side of the probe's x axis.
void draw_orientation_mark(const ImagePlace& place, const ImageViewInput& input, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const double px_per_mm = 1 / place.mm_per_screen_px;
    const double half_mm = half_face_mm(input.probe);
    const float side = input.flipped ? -1.0f : 1.0f;
    const ImVec2 mark{static_cast<float>(place.origin_x) +
                          side * (static_cast<float>(half_mm * px_per_mm) + 20 * s),
                      std::max(static_cast<float>(place.origin_y) - 2 * s, place.y + 14 * s)};
    draw->AddCircle(mark, 9 * s, colour::kMeasure, 24, 1.5f * s);
    const char* letter = "S";
    const ImVec2 size = ImGui::CalcTextSize(letter);
    draw->AddText({mark.x - 0.5f * size.x, mark.y - 0.5f * size.y}, colour::kMeasure, letter);
}

// The grey bar on the left, in the lower half, where a sector leaves room.
void draw_grey_bar(const Box& area, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const float high = std::min(110.0f, 0.25f * area.h);
    const ImVec2 bar{(area.x + 12) * s, (area.bottom() - 16 - high) * s};
    const ImVec2 end{bar.x + 7 * s, bar.y + high * s};
    draw->AddRectFilledMultiColor(bar, end, 0xFFFFFFFF, 0xFFFFFFFF, 0xFF000000, 0xFF000000);
    draw->AddRect(bar, end, colour::kFaint);
}

// A sentence on the picture where the frame does not show tissue.
void draw_status(const ImagePlace& place, const ScanFrame& frame) {
    const bool no_contact = frame.status == FrameStatus::no_contact;
    const bool held = frame.status == FrameStatus::held_bad_pose;
    const auto out_of_view = [](SensorVerdict verdict) {
        return verdict == SensorVerdict::lost || verdict == SensorVerdict::stale;
    };
    const bool no_probe = !frame.frozen && out_of_view(frame.probe_verdict);
    const bool no_needle = !frame.frozen && out_of_view(frame.needle_verdict);
    const bool no_reference = !frame.frozen && out_of_view(frame.reference_verdict);
    const bool nothing = frame.waiting || no_probe || no_reference || no_contact || held;
    if (!nothing && !no_needle && !frame.record.skin_not_fitted) return;
    const char* words = frame.waiting  ? tr("No reading from the tracker yet")
                        : no_probe     ? tr("Probe out of view: picture held")
                        : no_reference ? tr("Reference out of view: picture held")
                        : no_contact   ? tr("No contact: press the probe onto the skin")
                        : held         ? tr("Pose is not usable: picture held")
                        : no_needle    ? tr("Needle out of view")
                                       : tr("Not fitted here: the mannequin was not swept");
    const ImVec2 wide = ImGui::CalcTextSize(words);
    // Over a picture of tissue the words are at its bottom.
    const float height = nothing ? 0.55f : 0.93f;
    text_at(ImGui::GetWindowDrawList(), place.x + 0.5f * (place.side_x - wide.x),
            place.y + height * place.side_y, colour::kImageText, words);
}

void draw_measurements(const ImagePlace& place, const ImageViewInput& input, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
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
    if ((input.measuring || input.placing) && place.hovered) {
        cross_mark(draw, ImGui::GetIO().MousePos, 9 * s, colour::kMeasure, 1.0f * s);
    }
}

// The planned way of a replay.
void draw_way(const ImagePlace& place, const ImageViewInput& input, float s) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    const double flip = input.flipped ? -1 : 1;
    for (const Point3& p : input.way) {
        if (std::abs(p.y) > 4) continue;  // out of the plane
        draw->AddCircleFilled(screen(place, flip * p.x, p.z), 1.6f * s, colour::kMeasure, 8);
    }
}

// Fits the frame into the area, in pixels.
void fit_frame(
    ImagePlace& place, ImVec2 corner, float width, float height, const ScanFrame& frame) {
    const float fit = std::min(width / static_cast<float>(frame.width_px),
                               height / static_cast<float>(frame.height_px));
    place.side_x = std::floor(fit * static_cast<float>(frame.width_px));
    place.side_y = std::floor(fit * static_cast<float>(frame.height_px));
    place.x = std::floor(corner.x + 0.5f * (width - place.side_x));
    place.y = std::floor(corner.y + 0.5f * (height - place.side_y));
    place.px_per_image_px = fit;
    place.mm_per_screen_px = frame.layout.mm_per_px > 0 ? frame.layout.mm_per_px / fit : 1;
    place.origin_x = place.x + fit * frame.layout.origin_x_px;
    place.origin_y = place.y + fit * frame.layout.origin_y_px;
}

// Enlarges the frame about a place that comes into the middle.
void zoom_frame(ImagePlace& place,
                const PictureZoom& zoom,
                ImVec2 corner,
                float width,
                float height,
                const ScanFrame& frame) {
    const auto factor = static_cast<float>(zoom.factor);
    place.px_per_image_px *= factor;
    place.side_x *= factor;
    place.side_y *= factor;
    place.mm_per_screen_px /= zoom.factor;
    place.origin_x = corner.x + 0.5f * width - zoom.x_mm / place.mm_per_screen_px;
    place.origin_y = corner.y + 0.5f * height - zoom.z_mm / place.mm_per_screen_px;
    place.x = static_cast<float>(place.origin_x) -
              place.px_per_image_px * static_cast<float>(frame.layout.origin_x_px);
    place.y = static_cast<float>(place.origin_y) -
              place.px_per_image_px * static_cast<float>(frame.layout.origin_y_px);
}

// A trunk with the probe on it: shoulders, waist, hips.
void draw_body_mark(Ui& ui, const Box& box, const PictureMarks& marks) {
    const auto at = [&](float x, float y) {
        return std::array{box.x + x * box.w, box.y + y * box.h};
    };
    constexpr float kOutline[][2] = {{0.38f, 0.0f}, {0.36f, 0.1f},  {0.04f, 0.18f}, {0.14f, 0.3f},
                                     {0.22f, 0.6f}, {0.12f, 1.0f},  {0.88f, 1.0f},  {0.78f, 0.6f},
                                     {0.86f, 0.3f}, {0.96f, 0.18f}, {0.64f, 0.1f},  {0.62f, 0.0f}};
    std::vector<float> xy;
    for (const auto& p : kOutline) {
        const auto q = at(p[0], p[1]);
        xy.insert(xy.end(), q.begin(), q.end());
    }
    ui.curve(xy, colour::kImageText, 1.5f);
    const auto probe = at(marks.body_x, marks.body_y);
    ui.line(probe[0] - 7, probe[1], probe[0] + 7, probe[1], colour::kMeasure, 4);
}

// Words that were put on the picture, and the box of a zoom that is being dragged.
void draw_marks_on_picture(Ui& ui, const ImagePlace& place, const PictureMarks& marks) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    for (const PictureLabel& label : marks.labels) {
        const ImVec2 p = screen(place, label.x_mm, label.z_mm);
        text_at(draw, p.x, p.y - 0.5f * ImGui::GetTextLineHeight(), colour::kMeasure,
                label.words.c_str());
    }
    if (marks.tool == MarkTool::zoom && marks.from_x >= 0)
        draw->AddRect({marks.from_x, marks.from_y}, ImGui::GetIO().MousePos, colour::kMeasure, 0, 0,
                      1.5f * ui.scale());
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

void draw_corner_words(Ui& ui, const Box& area, const ImageViewInput& input) {
    const float line = 18;
    float y = area.y + 8;
    const float half = 0.5f * area.w - 60;
    for (const std::string& words : input.left_lines) {
        ui.text({area.x + 12, y, half, line}, words, Type::small, colour::kImageText, Align::left,
                true);
        y += line;
    }
    y = area.y + 8;
    for (const std::string& words : input.right_lines) {
        ui.text({area.right() - kScaleRoom - 10 - half, y, half, line}, words, Type::small,
                colour::kImageText, Align::right, true);
        y += line;
    }
}

// "FROZEN", in white; no colour on the picture.
void draw_frozen_sign(Ui& ui, const Box& area, double cine_age_s) {
    const std::string words =
        cine_age_s > 0.005 ? filled("%s  -%.1f s", tr("FROZEN"), cine_age_s) : tr("FROZEN");
    const float wide = ui.width(words, Type::bold) + 20;
    const Box sign{area.x + 0.5f * (area.w - wide), area.y + 8, wide, 28};
    ui.fill(sign, colour::rgba(0, 0, 0, 190), 4);
    ui.outline(sign, colour::kImageText, 1, 4);
    ui.text(sign, words, Type::bold, colour::kMeasure, Align::centre);
}

// Names of tissue on the picture, and beside the pointer.
void draw_names(Ui& ui, const Box& area, const ImagePlace& place, const ImageViewInput& input) {
    ImDrawList* draw = ImGui::GetWindowDrawList();
    ImGui::PushFont(fonts().small);
    for (const ImageViewInput::Name& name : input.names) {
        const ImVec2 wide = ImGui::CalcTextSize(name.words.c_str());
        const float x = place.x + place.px_per_image_px * static_cast<float>(name.column),
                    y = place.y + place.px_per_image_px * static_cast<float>(name.row);
        text_at(draw, x - 0.5f * wide.x, y - 0.5f * wide.y, colour::kMeasure, name.words.c_str());
    }
    ImGui::PopFont();
    if (input.picked_name.empty()) return;
    const float wide = ui.width(input.picked_name, Type::small) + 16;
    const float x = std::min(ui.mouse_x() + 16, area.right() - wide - 4),
                y = std::clamp(ui.mouse_y() + 14, area.y, area.bottom() - 28);
    ui.fill({x, y, wide, 24}, colour::rgba(0, 0, 0, 200), 4);
    ui.text({x + 8, y, wide - 16, 24}, input.picked_name, Type::small, colour::kImageText,
            Align::left, true);
}

// The buttons of the box, whose place the picture's own area must not take.
void draw_stopped_buttons(Ui& ui, Box row, ImagePlace& place) {
    ButtonStyle style;
    style.primary = true;
    style.key = "F3";
    style.tip = "Sensors, calibration and what the tracker says";
    const bool narrow = row.w < 360;
    const float wide = narrow ? 0.5f * row.w - 4 : 70 + ui.width(tr("Open set-up"), Type::bold);
    place.open_setup = ui.button("open_setup", row.take_left(wide, 8),
                                 tr(narrow ? "Set-up" : "Open set-up"), style);
    style = {};
    style.tip = "Ends an attempt that runs; the mouse then moves the probe";
    place.use_mouse = ui.button(
        "use_mouse",
        row.take_left(narrow ? row.w : 28 + ui.width(tr("Go on with the mouse"), Type::body)),
        tr(narrow ? "Mouse" : "Go on with the mouse"), style);
}

Box stopped_box(const Box& area) {
    const float wide = std::min(480.0f, area.w - 24), high = std::min(256.0f, area.h - 16);
    return {area.x + 0.5f * (area.w - wide), area.y + 0.5f * (area.h - high), wide, high};
}

void draw_stopped(Ui& ui, const Box& area, const ImageViewInput& input, ImagePlace& place) {
    ui.fill(area, colour::rgba(0, 0, 0, 168));
    const Box box = stopped_box(area);
    ui.fill(box, colour::kPanel, 8);
    ui.outline(box, colour::kWarn, 2, 8);
    Box room = box.inset(16, 12);
    if (input.stopped_buttons) draw_stopped_buttons(ui, room.take_bottom(48, 8), place);
    Box head = room.take_top(40, 4);
    ui.icon(Icon::warn, head.x, head.y + 8, 24, colour::kWarn);
    const std::string words = filled(tr("for %d:%02d"), static_cast<int>(input.stopped_s) / 60,
                                     static_cast<int>(input.stopped_s) % 60);
    if (input.stopped_s >= 1)
        ui.text(head.take_right(ui.width(words, Type::small) + 4), words, Type::small, colour::kDim,
                Align::right);
    const bool large = ui.width(tr("NO TRACKER"), Type::title) < head.w - 34 && room.h > 120;
    ui.text({head.x + 34, head.y, head.w - 34, head.h}, tr("NO TRACKER"),
            large ? Type::title : Type::heading, colour::kWarn);
    const char* goes_on = tr("Scanning goes on by itself when it answers.");
    const Type type = room.h > 100 ? Type::body : Type::small;
    const float last = ui.paragraph_height(room.w, goes_on, Type::small);
    const bool both = ui.paragraph_height(room.w, input.stopped, type) + last < room.h;
    room.take_top(ui.paragraph(room, input.stopped, type, colour::kText, true), 6);
    if (both) ui.paragraph(room, goes_on, Type::small, colour::kDim, true);
}

void dotted_ring(ImDrawList* draw, ImVec2 centre, float radius, float s) {
    const int dots = std::max(12, static_cast<int>(radius / (3 * s)));
    for (int i = 0; i < dots; ++i) {
        const double angle_rad = 2 * std::numbers::pi * i / dots;
        draw->AddCircleFilled({centre.x + radius * static_cast<float>(std::cos(angle_rad)),
                               centre.y + radius * static_cast<float>(std::sin(angle_rad))},
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

PictureSize picture_size(const Box& area, float scale) {
    float w = (area.w - kScaleRoom) * scale, h = (area.h - 2 * kEndRoom) * scale;
    const float fits = 1024 / std::max({w, h, 1024.0f});
    const auto side = [](float px) {
        return std::clamp(static_cast<int>(px / 32) * 32, 256, 1024);
    };
    return {side(w * fits), side(h * fits)};
}

Box body_mark_box(const Box& area) {
    return {area.right() - kScaleRoom - 70, area.bottom() - 100, 60, 84};
}

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

ImagePlace draw_image_view(Ui& ui, const Box& area, const ImageViewInput& input) {
    ImagePlace place;
    const float s = ui.scale();
    ui.picture(area, "picture");
    // A picture that is not live takes no mouse: the box over it has buttons.
    const Ui::Area mouse = input.stopped.empty() ? ui.area("picture", area) : Ui::Area{};
    const ScanFrame& frame = input.frame;
    const bool strip = input.doppler && has_strip(input.doppler->mode);
    // Across a strip lie seconds: nothing is measured there in millimetres.
    const bool over_strip = strip && ImGui::GetIO().MousePos.y >= strip_box(area).y * s;
    place.hovered =
        (mouse.hovered || mouse.held) && !(over_strip && (input.measuring || input.placing));
    ui.clip(area);
    const ImVec2 corner{area.x * s, area.y * s};
    const float width = area.w * s, height = area.h * s;
    if (frame.width_px > 0 && input.texture) {
        Box shown = area;
        if (strip) shown.h -= strip_box(area).h;
        const Box sector{area.x, area.y + kEndRoom, area.w - kScaleRoom, shown.h - 2 * kEndRoom};
        fit_frame(place, {sector.x * s, sector.y * s}, sector.w * s, sector.h * s, frame);
        if (input.marks && input.marks->zoom.on())
            zoom_frame(place, input.marks->zoom, {sector.x * s, sector.y * s}, sector.w * s,
                       sector.h * s, frame);
        draw_pixels(place, corner, width, height, input.texture);
        ImGui::PushFont(fonts().small);
        draw_depth_scale(place, input, area.right() * s, s);
        draw_orientation_mark(place, input, s);
        if (area.h > 300 && !input.doppler) draw_grey_bar(area, s);
        if (input.stopped.empty()) draw_status(place, frame);
        ImGui::PopFont();
        if (input.doppler) {
            draw_doppler_marks(ui, place, picture_geometry(frame, input.probe), *input.doppler,
                               input.flipped);
            if (!strip && area.h > 300) draw_colour_bar(ui, area, *input.doppler);
        }
        draw_way(place, input, s);
        draw_measurements(place, input, s);
        if (input.marks) draw_marks_on_picture(ui, place, *input.marks);
    } else {
        ui.fill(area, colour::kPicture);
    }
    if (strip) draw_strip(ui, strip_box(area), frame, *input.doppler, input.strip);
    draw_corner_words(ui, area, input);
    draw_names(ui, area, place, input);
    if (input.marks && input.marks->body) draw_body_mark(ui, body_mark_box(area), *input.marks);
    if (frame.frozen) draw_frozen_sign(ui, area, frame.cine_age_s);
    if (!input.stopped.empty()) draw_stopped(ui, area, input, place);
    ui.unclip();
    return place;
}

}  // namespace sonocase::runtime::inline player_ui
