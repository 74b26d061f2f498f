// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/theme.h"

#include <imgui.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace sonocase::runtime::inline display {
namespace {

Fonts g_fonts;  // global, as ImGui's current context is

std::string first_file(const std::vector<std::string>& files) {
    for (const std::string& file : files) {
        std::error_code ignored;
        if (!file.empty() && std::filesystem::is_regular_file(file, ignored)) return file;
    }
    return {};
}

std::vector<std::string> candidates(bool bold) {
    const std::string dejavu = bold ? "DejaVuSans-Bold.ttf" : "DejaVuSans.ttf";
    std::vector<std::string> files;
    if (const char* chosen = std::getenv("SONOCASE_FONT")) files.push_back(chosen);
    for (const char* root : {"/usr/local/share", "/usr/share"}) {
        const std::string fonts = std::string(root) + "/fonts/";
        files.push_back(std::string(root) + "/sonocase/fonts/" + dejavu);
        files.push_back(fonts + "truetype/dejavu/" + dejavu);
        files.push_back(fonts + "dejavu/" + dejavu);
        files.push_back(fonts + "TTF/" + dejavu);
        files.push_back(fonts + "dejavu-sans-fonts/" + dejavu);
        files.push_back(fonts + "truetype/liberation/LiberationSans-" +
                        (bold ? "Bold.ttf" : "Regular.ttf"));
        files.push_back(fonts + "truetype/noto/NotoSans-" + (bold ? "Bold.ttf" : "Regular.ttf"));
    }
    return files;
}

ImVec4 colour_of(unsigned packed, float alpha = 1) {
    ImVec4 c = ImGui::ColorConvertU32ToFloat4(packed);
    c.w *= alpha;
    return c;
}

}  // namespace

const Fonts& fonts() {
    return g_fonts;
}

void use_fonts(const Fonts& fonts) {
    g_fonts = fonts;
}

void apply_theme(float scale) {
    ImGuiIO& io = ImGui::GetIO();
    io.Fonts->Clear();
    // Latin, Greek, Cyrillic, punctuation, arrows, a few signs, and the mark of a missing letter.
    // DejaVu has all of these and figures of equal width.
    static const ImWchar kRanges[] = {0x20,   0x24F,  0x370,  0x3FF,  0x400,  0x4FF,
                                      0x2010, 0x2027, 0x2190, 0x2193, 0x2212, 0x2212,
                                      0x2264, 0x2265, 0xFFFD, 0xFFFD, 0};
    // Large letters are few: Latin, and the same signs. Keeps the atlas of a 4K window small.
    static const ImWchar kFewRanges[] = {0x20,   0x17F,  0x2010, 0x2027, 0x2264,
                                         0x2265, 0xFFFD, 0xFFFD, 0};
    const std::string body = first_file(candidates(false)), bold = first_file(candidates(true));
    const auto load = [&](const std::string& file, float size, const ImWchar* ranges) {
        ImFontConfig config;
        config.SizePixels = std::round(size * scale);
        if (file.empty()) return io.Fonts->AddFontDefault(&config);
        config.OversampleH = scale < 1.9f ? 2 : 1;
        return io.Fonts->AddFontFromFileTTF(file.c_str(), config.SizePixels, &config, ranges);
    };
    const std::string& strong = bold.empty() ? body : bold;
    // DejaVu Sans is an eighth wider than most fonts, so a smaller size reads as well.
    g_fonts.body = load(body, 16, kRanges);  // the first one is ImGui's default
    g_fonts.small = load(body, 14, kRanges);
    g_fonts.bold = load(strong, 16, kRanges);
    g_fonts.heading = load(strong, 19, kRanges);
    g_fonts.large = load(strong, 26, kFewRanges);
    g_fonts.title = load(strong, 30, kFewRanges);

    ImGuiStyle style;
    ImGui::StyleColorsDark(&style);
    style.WindowRounding = 8;
    style.ChildRounding = 8;
    style.FrameRounding = 6;
    style.GrabRounding = 4;
    style.PopupRounding = 6;
    style.ScrollbarRounding = 4;
    style.ScrollbarSize = 16;
    style.WindowBorderSize = 0;
    style.ChildBorderSize = 0;
    style.PopupBorderSize = 1;
    style.FramePadding = {10, 7};
    style.ItemSpacing = {8, 6};
    style.ItemInnerSpacing = {8, 4};
    style.WindowPadding = {12, 12};
    style.CellPadding = {5, 3};
    style.GrabMinSize = 12;
    style.ScaleAllSizes(scale);
    ImVec4* c = style.Colors;
    c[ImGuiCol_Text] = colour_of(colour::kText);
    c[ImGuiCol_TextDisabled] = colour_of(colour::kDim);
    c[ImGuiCol_WindowBg] = colour_of(colour::kPanel);
    c[ImGuiCol_ChildBg] = colour_of(colour::kPanel);
    c[ImGuiCol_PopupBg] = colour_of(colour::kRaised);
    c[ImGuiCol_Border] = colour_of(colour::kLine);
    c[ImGuiCol_FrameBg] = colour_of(colour::kControl);
    c[ImGuiCol_FrameBgHovered] = colour_of(colour::kControlHover);
    c[ImGuiCol_FrameBgActive] = colour_of(colour::kControlPressed);
    c[ImGuiCol_TitleBg] = colour_of(colour::kRaised);
    c[ImGuiCol_TitleBgActive] = colour_of(colour::kRaised);
    c[ImGuiCol_Button] = colour_of(colour::kControl);
    c[ImGuiCol_ButtonHovered] = colour_of(colour::kControlHover);
    c[ImGuiCol_ButtonActive] = colour_of(colour::kControlPressed);
    c[ImGuiCol_Header] = colour_of(colour::kChosen);
    c[ImGuiCol_HeaderHovered] = colour_of(colour::kControlHover);
    c[ImGuiCol_HeaderActive] = colour_of(colour::kControlPressed);
    c[ImGuiCol_SliderGrab] = colour_of(colour::kText);
    c[ImGuiCol_SliderGrabActive] = colour_of(colour::kAccent);
    c[ImGuiCol_CheckMark] = colour_of(colour::kAccent);
    c[ImGuiCol_Separator] = colour_of(colour::kLine);
    c[ImGuiCol_NavHighlight] = colour_of(colour::kAccent);
    c[ImGuiCol_PlotHistogram] = colour_of(colour::kAccent);
    c[ImGuiCol_PlotLines] = colour_of(colour::kAccent);
    c[ImGuiCol_ModalWindowDimBg] = colour_of(colour::kPicture, 0.6f);
    c[ImGuiCol_TableHeaderBg] = colour_of(colour::kRaised);
    c[ImGuiCol_ScrollbarBg] = colour_of(colour::kPanel);
    ImGui::GetStyle() = style;
}

}  // namespace sonocase::runtime::inline display
