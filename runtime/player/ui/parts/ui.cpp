// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/parts/ui.h"

#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

namespace sonocase::runtime {
namespace {

ImFont* font_of(Type type) {
    const Fonts& f = fonts();
    switch (type) {
        case Type::small: return f.small;
        case Type::body: return f.body;
        case Type::bold: return f.bold;
        case Type::heading: return f.heading;
        case Type::large: return f.large;
        case Type::title: return f.title;
    }
    return f.body;
}

ImDrawList* list() {
    return ImGui::GetWindowDrawList();
}

}  // namespace

void Ui::begin(float scale, double now_s) {
    scale_ = scale;
    now_s_ = now_s;
    drawn_.clear();
    layer_ = 0;
    top_layer_before_ = top_layer_;
    top_layer_ = 0;
    order_before_.swap(order_);
    order_.clear();
    tip_.clear();
    enter_ = 0;
    const ImGuiIO& io = ImGui::GetIO();
    if (io.WantTextInput) return;
    if (ImGui::IsKeyPressed(GLFW_KEY_TAB) && !io.KeyCtrl && !order_before_.empty()) {
        const auto at = std::find(order_before_.begin(), order_before_.end(), focus_);
        const auto n = static_cast<int>(order_before_.size());
        int i = at == order_before_.end() ? (io.KeyShift ? 0 : -1)
                                          : static_cast<int>(at - order_before_.begin());
        i = (i + (io.KeyShift ? n - 1 : 1)) % n;
        focus_ = order_before_[static_cast<std::size_t>(i)];
    }
    if (ImGui::IsMouseClicked(0)) focus_ = 0;
    if (std::find(order_before_.begin(), order_before_.end(), focus_) == order_before_.end())
        focus_ = 0;
    if (focus_ && (ImGui::IsKeyPressed(GLFW_KEY_ENTER, false))) enter_ = focus_;
}

void Ui::end() {
    ImDrawList* draw = ImGui::GetForegroundDrawList();
    if (focus_) {
        const Box b = focus_box_.inset(-2);
        draw->AddRect({px(b.x), px(b.y)}, {px(b.right()), px(b.bottom())}, colour::kAccent, px(8),
                      0, px(2));
    }
    if (tip_.empty()) return;
    ImFont* font = font_of(Type::small);
    const float wrap = px(320), pad = px(8);
    const ImVec2 size = font->CalcTextSizeA(font->FontSize, wrap, wrap, tip_.c_str());
    const ImVec2 all = ImGui::GetIO().DisplaySize;
    float x = px(tip_at_.x), y = px(tip_at_.bottom() + 6);
    if (y + size.y + 2 * pad > all.y) y = px(tip_at_.y - 6) - size.y - 2 * pad;
    x = std::clamp(x, pad, std::max(all.x - size.x - 3 * pad, pad));
    y = std::max(y, pad);
    const ImVec2 to{x + size.x + 2 * pad, y + size.y + 2 * pad};
    draw->AddRectFilled({x, y}, to, colour::kRaised, px(6));
    draw->AddRect({x, y}, to, colour::kEdge, px(6), 0, std::max(1.0f, px(1)));
    draw->AddText(font, font->FontSize, {x + pad, y + pad}, colour::kText, tip_.c_str(), nullptr,
                  wrap);
}

Box Ui::window() const {
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    return {0, 0, size.x / scale_, size.y / scale_};
}

float Ui::mouse_x() const {
    return ImGui::GetIO().MousePos.x / scale_;
}
float Ui::mouse_y() const {
    return ImGui::GetIO().MousePos.y / scale_;
}

void Ui::begin_layer(const char* id, const Box& box, bool dims) {
    ++layer_;
    top_layer_ = std::max(top_layer_, layer_);
    order_.clear();  // Tab stays in what is on top
    const Box all = window();
    const Box at = dims ? all : box;
    ImGui::SetNextWindowPos({px(at.x), px(at.y)});
    ImGui::SetNextWindowSize({px(at.w), px(at.h)});
    ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
    ImGui::Begin(id, nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoSavedSettings |
                     ImGuiWindowFlags_NoScrollWithMouse);
    ImGui::PopStyleVar();
    if (dims) {
        fill(all, colour::rgba(0, 0, 0, 150));
        fill(box, colour::kPanel, 8);
        outline(box, colour::kLine, 1, 8);
    }
    note(DrawnBox::Kind::card, box, id);
}

void Ui::end_layer() {
    ImGui::End();
    --layer_;
}

void Ui::note(DrawnBox::Kind kind, const Box& box, const std::string& name, bool cut) {
    if (quiet_) return;
    Box seen = box;
    if (!clips_.empty()) {
        const Box& c = clips_.back();
        const float x = std::max(box.x, c.x), y = std::max(box.y, c.y);
        seen = {x, y, std::min(box.right(), c.right()) - x, std::min(box.bottom(), c.bottom()) - y};
        if (seen.empty()) return;
    }
    drawn_.push_back({kind, seen, layer_, cut, name});
}

void Ui::fill(const Box& b, unsigned packed, float radius) {
    list()->AddRectFilled({px(b.x), px(b.y)}, {px(b.right()), px(b.bottom())}, packed, px(radius));
}

void Ui::outline(const Box& b, unsigned packed, float thick, float radius) {
    list()->AddRect({px(b.x), px(b.y)}, {px(b.right()), px(b.bottom())}, packed, px(radius), 0,
                    std::max(px(thick), 1.0f));
}

void Ui::line(float x0, float y0, float x1, float y1, unsigned packed, float thick) {
    list()->AddLine({px(x0), px(y0)}, {px(x1), px(y1)}, packed, std::max(px(thick), 1.0f));
}

void Ui::disc(float x, float y, float radius, unsigned packed) {
    list()->AddCircleFilled({px(x), px(y)}, px(radius), packed);
}

void Ui::diamond(float x, float y, float r, unsigned packed) {
    list()->AddQuadFilled({px(x), px(y - r)}, {px(x + r), px(y)}, {px(x), px(y + r)},
                          {px(x - r), px(y)}, packed);
}

void Ui::icon(Icon icon, float x, float y, float side, unsigned packed) {
    draw_icon(list(), icon, px(x), px(y), px(side), packed);
}

void Ui::curve(const std::vector<float>& xy, unsigned packed, float thick) {
    for (std::size_t i = 0; i + 1 < xy.size(); i += 2)
        list()->PathLineTo({px(xy[i]), px(xy[i + 1])});
    list()->PathStroke(packed, 0, std::max(px(thick), 1.0f));
}

void Ui::image(void* texture, const Box& b, bool upside_down, float radius) {
    const ImVec2 from{0, upside_down ? 1.0f : 0.0f}, to{1, upside_down ? 0.0f : 1.0f};
    list()->AddImageRounded(texture, {px(b.x), px(b.y)}, {px(b.right()), px(b.bottom())}, from, to,
                            0xFFFFFFFF, px(radius));
}

void Ui::card(const Box& box, const char* name, unsigned packed) {
    fill(box, packed, 8);
    note(DrawnBox::Kind::card, box, name);
}

void Ui::picture(const Box& box, const char* name) {
    note(DrawnBox::Kind::picture, box, name);
}

void Ui::clip(const Box& b) {
    list()->PushClipRect({px(b.x), px(b.y)}, {px(b.right()), px(b.bottom())}, true);
    clips_.push_back(b);
}
void Ui::unclip() {
    list()->PopClipRect();
    clips_.pop_back();
}

float Ui::width(const std::string& words, Type type) const {
    ImFont* font = font_of(type);
    return font->CalcTextSizeA(font->FontSize, 1e9f, 0, words.c_str()).x / scale_;
}

float Ui::line_height(Type type) const {
    return font_of(type)->FontSize / scale_;
}

namespace {

// The longest beginning of `words` that fits, with an ellipsis.
std::string shortened(const Ui& ui, const std::string& words, Type type, float width) {
    std::string shorter = words;
    while (!shorter.empty() && ui.width(shorter + "…", type) > width) {
        do {
            shorter.pop_back();
        } while (!shorter.empty() && (static_cast<unsigned char>(shorter.back()) & 0xC0) == 0x80);
        // A lead byte whose continuation is gone goes too.
        if (!shorter.empty() && static_cast<unsigned char>(shorter.back()) >= 0xC0)
            shorter.pop_back();
    }
    return shorter + "…";
}

}  // namespace

void Ui::text(const Box& box,
              const std::string& words,
              Type type,
              unsigned packed,
              Align align,
              bool may_cut) {
    if (words.empty() || box.w <= 0) return;
    float wide = width(words, type);
    const bool cut = wide > box.w + 0.5f;
    const std::string shown = cut ? shortened(*this, words, type, box.w) : words;
    if (cut) wide = width(shown, type);
    const float high = line_height(type);
    const float x = align == Align::left     ? box.x
                    : align == Align::centre ? box.x + 0.5f * (box.w - wide)
                                             : box.right() - wide;
    const float y = box.y + 0.5f * (box.h - high);
    ImFont* font = font_of(type);
    list()->AddText(font, font->FontSize, {std::round(px(x)), std::round(px(y))}, packed,
                    shown.c_str());
    note(DrawnBox::Kind::words, {x, y, wide, high}, words, cut && !may_cut);
    if (cut && !quiet_) {
        const Area over = {ImGui::IsMouseHoveringRect({px(box.x), px(box.y)},
                                                      {px(box.right()), px(box.bottom())}) &&
                               ImGui::IsWindowHovered(),
                           false, false, false};
        if (over.hovered) tooltip(words);
    }
}

float Ui::paragraph_height(float width, const std::string& words, Type type) const {
    ImFont* font = font_of(type);
    return font->CalcTextSizeA(font->FontSize, 1e9f, px(width), words.c_str()).y / scale_;
}

float Ui::paragraph(
    const Box& box, const std::string& words, Type type, unsigned packed, bool may_cut) {
    if (words.empty() || box.w <= 0) return 0;
    ImFont* font = font_of(type);
    const float line = line_height(type);
    const float whole = paragraph_height(box.w, words, type);
    const bool cut = whole > box.h + 0.5f;
    float y = box.y;
    const char* at = words.c_str();
    const char* end = at + words.size();
    float taken = 0;
    while (at < end) {
        const char* stop = font->CalcWordWrapPositionA(1, at, end, px(box.w));
        if (stop == at) ++stop;
        std::string one(at, stop);
        if (const auto newline = one.find('\n'); newline != std::string::npos) {
            one.resize(newline);
            stop = at + newline + 1;
        }
        const bool last = taken + 2 * line > box.h + 0.5f && stop < end;
        if (last) one = shortened(*this, std::string(at, end), type, box.w);
        list()->AddText(font, font->FontSize, {std::round(px(box.x)), std::round(px(y))}, packed,
                        one.c_str());
        y += line;
        taken += line;
        if (last) break;
        at = stop;
        while (at < end && *at == ' ') ++at;
    }
    note(DrawnBox::Kind::words, {box.x, box.y, box.w, taken}, words, cut && !may_cut);
    return taken;
}

void Ui::row(const Box& box, const std::string& name, const std::string& value, unsigned packed) {
    const float wide = width(value, Type::bold);
    text({box.x, box.y, box.w - wide - 8, box.h}, name, Type::body, colour::kDim, Align::left,
         true);
    text({box.right() - wide - 1, box.y, wide + 1, box.h}, value, Type::bold, packed, Align::right);
}

void Ui::scroll_by_wheel(const Box& box, double& scroll, double most) {
    const ImGuiIO& io = ImGui::GetIO();
    const bool over =
        ImGui::IsMouseHoveringRect({px(box.x), px(box.y)}, {px(box.right()), px(box.bottom())}) &&
        ImGui::IsWindowHovered();
    if (over) scroll -= 60 * io.MouseWheel;
    scroll = std::clamp(scroll, 0.0, most);
    if (most <= 0) return;
    const float part = box.h / (box.h + static_cast<float>(most));
    const float y = box.y + static_cast<float>(scroll / most) * (1 - part) * box.h;
    fill({box.right() - 6, y, 4, part * box.h}, colour::kControlPressed, 2);
}

void Ui::tooltip(const std::string& words) {
    tip_ = words;
    tip_at_ = {mouse_x() + 8, mouse_y(), 1, 16};
}

}  // namespace sonocase::runtime
