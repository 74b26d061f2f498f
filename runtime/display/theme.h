// SPDX-License-Identifier: Apache-2.0

// Colours, spacing and fonts of the player: dark, so that the ultrasound picture is the brightest
// part of the screen. Around the picture there are only greys and one accent colour. Words have a
// contrast of at least 4.5 on every surface that they stand on (WCAG 2; a test computes it). No
// information is given by colour alone: an icon or a word repeats it.
#pragma once

struct ImFont;

namespace sonocase::runtime::inline display {

struct Fonts {
    ImFont* small = nullptr;  // second lines, words on the picture
    ImFont* body = nullptr;
    ImFont* bold = nullptr;     // values, and what is chosen
    ImFont* heading = nullptr;  // headings of cards
    ImFont* large = nullptr;    // results
    ImFont* title = nullptr;    // titles of pages
};

// Makes style and fonts for a scale; call it between pictures. The fonts are those of the system
// (share/sonocase/fonts, DejaVu, Liberation, Noto), or ImGui's own, enlarged, where it has none.
void apply_theme(float scale);
const Fonts& fonts();
// Takes the fonts of another ImGui context, which is the current one from now on.
void use_fonts(const Fonts& fonts);

// sRGB with alpha, as ImGui packs it.
namespace colour {
inline constexpr unsigned rgba(unsigned r, unsigned g, unsigned b, unsigned a = 255) {
    return (a << 24) | (b << 16) | (g << 8) | r;
}
inline constexpr unsigned kPage = rgba(0x0B, 0x0C, 0x0D);
inline constexpr unsigned kPanel = rgba(0x16, 0x18, 0x1A);   // cards
inline constexpr unsigned kRaised = rgba(0x1F, 0x22, 0x25);  // a card in a card, input
inline constexpr unsigned kControl = rgba(0x2A, 0x2E, 0x32);
inline constexpr unsigned kControlHover = rgba(0x36, 0x3B, 0x40);
inline constexpr unsigned kControlPressed = rgba(0x45, 0x4B, 0x51);  // and a slider's groove
inline constexpr unsigned kLine = rgba(0x3A, 0x3F, 0x44);            // decoration
inline constexpr unsigned kEdge = rgba(0x76, 0x7D, 0x84);  // a border that means something
inline constexpr unsigned kText = rgba(0xED, 0xEF, 0xF1);
inline constexpr unsigned kDim = rgba(0xA9, 0xB0, 0xB6);  // names, units, second lines
inline constexpr unsigned kOff = rgba(0x86, 0x8D, 0x94);  // what cannot be used now
inline constexpr unsigned kFaint = rgba(0x76, 0x7D, 0x84);
inline constexpr unsigned kAccent = rgba(0x82, 0xC8, 0xE0);
inline constexpr unsigned kChosen = rgba(0x1E, 0x42, 0x52);
inline constexpr unsigned kPrime = rgba(0x2A, 0x6B, 0x82);  // the one primary button
inline constexpr unsigned kGood = rgba(0x86, 0xC9, 0x95);
inline constexpr unsigned kWarn = rgba(0xE8, 0xC0, 0x63);
inline constexpr unsigned kBad = rgba(0xF2, 0x93, 0x8A);
inline constexpr unsigned kPicture = rgba(0, 0, 0);
inline constexpr unsigned kImageText = rgba(0xC9, 0xCD, 0xD1);  // words on the picture
inline constexpr unsigned kMeasure = rgba(0xE6, 0xE8, 0xEA);    // marks on the picture
}  // namespace colour

}  // namespace sonocase::runtime::inline display
