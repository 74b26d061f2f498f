// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/parts/icons.h"

#include <imgui.h>

#include <cmath>
#include <cstdlib>
#include <vector>

namespace sonocase::runtime::inline player_ui_parts {
namespace {

struct Drawing {
    Icon icon;
    const char* strokes;
};

// L line x y x y ..., P closed line, C circle x y radius, D disc x y radius, A arc x y radius from
// to (degrees, clockwise from x); strokes are separated by semicolons.
constexpr Drawing kDrawings[] = {
    {Icon::cases,
     "P 3 4 10 4 10 11 3 11;P 14 4 21 4 21 11 14 11;P 3 14 10 14 10 20 3 20;"
     "P 14 14 21 14 21 20 14 20"},
    {Icon::back, "L 14 5 7 12 14 19"},
    {Icon::next, "L 9 5 16 12 9 19"},
    {Icon::up, "L 5 15 12 8 19 15"},
    {Icon::down, "L 5 9 12 16 19 9"},
    {Icon::plus, "L 12 5 12 19;L 5 12 19 12"},
    {Icon::minus, "L 5 12 19 12"},
    {Icon::close, "L 6 6 18 18;L 18 6 6 18"},
    {Icon::check, "L 4 13 9 18 20 6"},
    {Icon::help, "C 12 12 9;A 12 9.5 2.6 180 390;L 13.6 11.6 12 13.2 12 14.4;D 12 17.2 1"},
    {Icon::settings, "L 3 7 13 7;L 19 7 21 7;C 16 7 2.6;L 3 17 5 17;L 11 17 21 17;C 8 17 2.6"},
    {Icon::user, "C 12 8 4;A 12 21 8 200 340"},
    {Icon::group, "C 8 8 3;C 16.5 9 2.5;A 8 20 6 195 345;A 17 20 5 220 340"},
    {Icon::freeze, "L 12 2 12 22;L 3.4 7 20.6 17;L 3.4 17 20.6 7"},
    {Icon::live, "P 7 4 20 12 7 20"},
    {Icon::pause, "L 8 5 8 19;L 16 5 16 19"},
    {Icon::measure, "L 5 19 19 5;L 2 16 8 22;L 16 2 22 8"},
    {Icon::zoom, "C 10 10 6.5;L 15 15 21 21;L 7 10 13 10;L 10 7 10 13"},
    {Icon::text, "L 5 5 19 5;L 12 5 12 20"},
    {Icon::body, "C 12 5 2.6;P 7 9 17 9 15.5 15 16 21 8 21 8.5 15;D 9.5 13 1.3"},
    {Icon::camera, "P 3 7 8 7 9.5 4 14.5 4 16 7 21 7 21 20 3 20;C 12 13 4"},
    {Icon::clip, "P 3 6 15 6 15 18 3 18;L 15 10 21 7 21 17 15 14"},
    {Icon::flip, "L 12 3 12 21;P 9 7 9 17 3 17;L 15 7 21 17 15 17 15 7"},
    {Icon::automatic,
     "L 4 20 15 9;L 17 3 17 7;L 15 5 19 5;L 20 11 20 14;"
     "L 18.5 12.5 21.5 12.5"},
    {Icon::probe, "P 8 3 16 3 16 11 18 15 18 18 6 18 6 15 8 11;A 12 14 8 50 130"},
    {Icon::needle, "L 20 4 6 18;L 4 20 6 18;L 17 3 21 7;L 15 5 19 9"},
    {Icon::target, "C 12 12 8;C 12 12 3.5;D 12 12 1.2"},
    {Icon::hint, "A 12 10 6 -220 40;L 8.5 15 9 18 15 18 15.5 15;L 10 21 14 21"},
    {Icon::eye, "A 12 17 10 215 325;A 12 7 10 35 145;C 12 12 3"},
    {Icon::eyeoff, "A 12 17 10 215 325;A 12 7 10 35 145;L 4 21 20 3"},
    {Icon::warn, "P 12 3 22 20 2 20;L 12 9 12 14;D 12 17 1.1"},
    {Icon::fail, "C 12 12 9;L 8.5 8.5 15.5 15.5;L 15.5 8.5 8.5 15.5"},
    {Icon::pass, "C 12 12 9;L 7.5 12.5 11 16 16.5 9"},
    {Icon::cube, "P 12 2 21 7 21 17 12 22 3 17 3 7;L 3 7 12 12 21 7;L 12 12 12 22"},
    {Icon::swap, "L 4 8 20 8 16 4;L 20 16 4 16 8 20"},
    {Icon::home, "L 3 12 12 4 21 12;L 6 10 6 20 18 20 18 10"},
    {Icon::again, "A 12 12.5 8 -45 235;L 18.2 2.2 17.8 6.8 13.2 6.4"},
    {Icon::replay, "C 12 12 9;P 10 8 16.5 12 10 16"},
    {Icon::review, "P 5 3 19 3 19 21 5 21;L 8 8 16 8;L 8 12 16 12;L 8 16 13 16"},
    {Icon::folder, "P 3 5 9 5 11 8 21 8 21 19 3 19"},
    {Icon::drop, "L 12 3 12 15;L 7 10 12 15 17 10;L 3 16 3 21 21 21 21 16"},
    {Icon::timer, "C 12 13 8;L 12 13 12 8;L 9 2 15 2"},
    {Icon::link,
     "A 7 12 4 90 270;L 7 8 11 8;L 7 16 11 16;A 17 12 4 -90 90;L 17 8 13 8;"
     "L 17 16 13 16;L 9 12 15 12"},
    {Icon::lost, "A 12 20 13 232 308;A 12 20 8 232 308;D 12 19 1.4;L 4 3 20 21"},
    {Icon::rec, "C 12 12 8;D 12 12 4.5"},
    {Icon::lungs,
     "L 12 2 12 9;P 9.5 8 9.5 17 4 20.5 3 15 5.5 8.5 7.5 6;"
     "P 14.5 8 14.5 17 20 20.5 21 15 18.5 8.5 16.5 6"},
    {Icon::liver, "P 3 9 8 5 16 6 21 8 20 11 14 13 10 19 5 18 3 14"},
    {Icon::kidney,
     ""
     "P 11 2.5 15.5 3.5 18 7 17.5 10 15 11.2 15 13 17.3 14.5 17 18.5 13 21.5 9 20 6.3 15 6 9 8 "
     "4.5"},
    {Icon::vessel, "A 12 -4 14 50 130;A 12 6 14 50 130;D 12 13.6 1;D 8 12.4 1;D 16 12.4 1"},
    {Icon::deep, "L 4 4 20 4;L 12 7 12 18;L 8 14 12 19 16 14;L 7 21 17 21"},
    {Icon::lock, "P 5 11 19 11 19 21 5 21;L 8 11 8 7;A 12 7 4 180 360;L 16 7 16 11"},
    {Icon::sound, "P 3 9 7 9 12 5 12 19 7 15 3 15;A 12 12 4.5 -45 45;A 12 12 8 -45 45"},
    {Icon::menu, "L 4 6 20 6;L 4 12 20 12;L 4 18 20 18"},
    {Icon::save, "L 12 3 12 15;L 7 10 12 15 17 10;L 4 20 20 20"},
    {Icon::edit, "P 4 20 5 15 16 4 20 8 9 19"},
};

struct Stroke {
    char kind = 'L';
    std::vector<float> numbers;
};

std::vector<Stroke> strokes_of(const char* text) {
    std::vector<Stroke> strokes;
    while (*text) {
        if (*text == ';' || *text == ' ') {
            ++text;
            continue;
        }
        Stroke stroke;
        stroke.kind = *text++;
        while (*text && *text != ';') {
            char* end = nullptr;
            stroke.numbers.push_back(std::strtof(text, &end));
            if (end == text) break;
            text = end;
        }
        strokes.push_back(stroke);
    }
    return strokes;
}

const std::vector<std::vector<Stroke>>& all_strokes() {
    static const std::vector<std::vector<Stroke>> all = [] {
        std::vector<std::vector<Stroke>> made(std::size(kDrawings) + 1);
        for (const Drawing& d : kDrawings)
            made[static_cast<std::size_t>(d.icon)] = strokes_of(d.strokes);
        return made;
    }();
    return all;
}

}  // namespace

void draw_icon(ImDrawList* draw, Icon icon, float x, float y, float side, unsigned packed) {
    const float unit = side / 24, thick = std::fmax(1.75f * unit, 1.0f);
    const auto place = [&](float u, float v) { return ImVec2{x + u * unit, y + v * unit}; };
    for (const Stroke& stroke : all_strokes()[static_cast<std::size_t>(icon)]) {
        const std::vector<float>& n = stroke.numbers;
        switch (stroke.kind) {
            case 'C': draw->AddCircle(place(n[0], n[1]), n[2] * unit, packed, 0, thick); break;
            case 'D': draw->AddCircleFilled(place(n[0], n[1]), n[2] * unit, packed); break;
            case 'A': {
                constexpr float kRad = 3.14159265f / 180;
                draw->PathArcTo(place(n[0], n[1]), n[2] * unit, n[3] * kRad, n[4] * kRad);
                draw->PathStroke(packed, 0, thick);
                break;
            }
            default:
                for (std::size_t i = 0; i + 1 < n.size(); i += 2)
                    draw->PathLineTo(place(n[i], n[i + 1]));
                draw->PathStroke(packed, stroke.kind == 'P' ? ImDrawFlags_Closed : 0, thick);
        }
    }
}

}  // namespace sonocase::runtime::inline player_ui_parts
