// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/theme.h"

#include <imgui.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

namespace sonocase::runtime {
namespace {

Fonts g_fonts;  // ImGui itself is one per process

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

void apply_theme(float scale) {
    ImGuiIO& io = ImGui::GetIO();
    io.Fonts->Clear();
    static const ImWchar kRanges[] = {0x20,   0x17F,  0x370,  0x3FF,  0x400,  0x45F, 0x2013,
                                      0x2014, 0x2018, 0x2026, 0x2190, 0x2193, 0};
    const std::string body = first_file(candidates(false)), bold = first_file(candidates(true));
    const auto load = [&](const std::string& file, float size) {
        if (file.empty()) {
            ImFontConfig config;
            config.SizePixels = std::round(size * scale);
            return io.Fonts->AddFontDefault(&config);
        }
        ImFontConfig config;
        config.OversampleH = 2;
        return io.Fonts->AddFontFromFileTTF(file.c_str(), std::round(size * scale), &config,
                                            kRanges);
    };
    g_fonts.body = load(body, 14);
    g_fonts.heading = load(bold.empty() ? body : bold, 15);
    g_fonts.small = load(body, 12);
    g_fonts.title = load(bold.empty() ? body : bold, 27);

    ImGuiStyle style;
    ImGui::StyleColorsDark(&style);
    style.WindowRounding = 0;
    style.ChildRounding = 5;
    style.FrameRounding = 4;
    style.GrabRounding = 4;
    style.PopupRounding = 5;
    style.ScrollbarRounding = 4;
    style.ScrollbarSize = 11;
    style.WindowBorderSize = 0;
    style.ChildBorderSize = 0;
    style.PopupBorderSize = 1;
    style.FramePadding = {7, 3.5f};
    style.ItemSpacing = {7, 5};
    style.ItemInnerSpacing = {6, 4};
    style.WindowPadding = {10, 9};
    style.CellPadding = {5, 2};
    style.GrabMinSize = 9;
    style.ScaleAllSizes(scale);
    ImVec4* c = style.Colors;
    c[ImGuiCol_Text] = colour_of(colour::kText);
    c[ImGuiCol_TextDisabled] = colour_of(colour::kDim);
    c[ImGuiCol_WindowBg] = colour_of(colour::rgba(12, 15, 19));
    c[ImGuiCol_ChildBg] = colour_of(colour::kPanel);
    c[ImGuiCol_PopupBg] = colour_of(colour::rgba(26, 31, 38), 0.98f);
    c[ImGuiCol_Border] = colour_of(colour::rgba(52, 61, 72));
    c[ImGuiCol_FrameBg] = colour_of(colour::rgba(36, 43, 52));
    c[ImGuiCol_FrameBgHovered] = colour_of(colour::rgba(46, 55, 66));
    c[ImGuiCol_FrameBgActive] = colour_of(colour::rgba(52, 64, 78));
    c[ImGuiCol_Button] = colour_of(colour::rgba(40, 49, 60));
    c[ImGuiCol_ButtonHovered] = colour_of(colour::rgba(52, 66, 80));
    c[ImGuiCol_ButtonActive] = colour_of(colour::rgba(38, 104, 124));
    c[ImGuiCol_Header] = colour_of(colour::rgba(34, 42, 51));
    c[ImGuiCol_HeaderHovered] = colour_of(colour::rgba(42, 54, 66));
    c[ImGuiCol_HeaderActive] = colour_of(colour::rgba(44, 62, 76));
    c[ImGuiCol_SliderGrab] = colour_of(colour::kAccent, 0.85f);
    c[ImGuiCol_SliderGrabActive] = colour_of(colour::kAccent);
    c[ImGuiCol_CheckMark] = colour_of(colour::kAccent);
    c[ImGuiCol_Separator] = colour_of(colour::rgba(44, 52, 62));
    c[ImGuiCol_NavHighlight] = colour_of(colour::kAccent);
    c[ImGuiCol_PlotHistogram] = colour_of(colour::kAccent);
    c[ImGuiCol_PlotLines] = colour_of(colour::kAccent);
    c[ImGuiCol_ModalWindowDimBg] = colour_of(colour::rgba(0, 0, 0), 0.6f);
    c[ImGuiCol_TableHeaderBg] = colour_of(colour::rgba(30, 36, 44));
    c[ImGuiCol_ScrollbarBg] = colour_of(colour::kPanel, 0.4f);
    ImGui::GetStyle() = style;
}

}  // namespace sonocase::runtime
