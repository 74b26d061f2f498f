// SPDX-License-Identifier: Apache-2.0

// Colours, spacing and fonts of the player: dark, so that the ultrasound picture is the brightest
// part of the screen.
#pragma once

struct ImFont;

namespace sonocase::runtime {

struct Fonts {
    ImFont* body = nullptr;
    ImFont* heading = nullptr;
    ImFont* small = nullptr;
    ImFont* title = nullptr;
};

// Makes style and fonts for a scale; to be called between pictures. The fonts are the system's
// (share/sonocase/fonts, DejaVu, Liberation, Noto), or ImGui's own, enlarged, if it has none of
// them.
void apply_theme(float scale);
const Fonts& fonts();

// sRGB with alpha, as ImGui packs it.
namespace colour {
inline constexpr unsigned rgba(unsigned r, unsigned g, unsigned b, unsigned a = 255) {
    return (a << 24) | (b << 16) | (g << 8) | r;
}
inline constexpr unsigned kText = rgba(222, 228, 235);
inline constexpr unsigned kDim = rgba(139, 151, 166);
inline constexpr unsigned kFaint = rgba(74, 84, 97);
inline constexpr unsigned kAccent = rgba(72, 186, 214);
inline constexpr unsigned kGood = rgba(96, 200, 130);
inline constexpr unsigned kWarn = rgba(240, 180, 70);
inline constexpr unsigned kBad = rgba(238, 96, 88);
inline constexpr unsigned kPanel = rgba(21, 25, 31);
inline constexpr unsigned kImageText = rgba(190, 200, 210);
inline constexpr unsigned kMeasure = rgba(255, 214, 80);
}  // namespace colour

}  // namespace sonocase::runtime
