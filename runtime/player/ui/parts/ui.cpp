// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/parts/ui.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <GLFW/glfw3.h>
#include <imgui.h>

#include "runtime/player/words/words.h"

namespace sonocase::runtime::inline player_ui_parts {

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
        focus_ = order_before_[i];
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

void Ui::scroll_by_wheel(const Box& box, double& scroll, double max) {
    const ImGuiIO& io = ImGui::GetIO();
    const bool over =
        ImGui::IsMouseHoveringRect({px(box.x), px(box.y)}, {px(box.right()), px(box.bottom())}) &&
        ImGui::IsWindowHovered();
    if (over) scroll -= 60 * io.MouseWheel;
    scroll = std::clamp(scroll, 0.0, max);
    if (max <= 0) return;
    const float part = box.h / (box.h + static_cast<float>(max));
    const float y = box.y + static_cast<float>(scroll / max) * (1 - part) * box.h;
    fill({box.right() - 6, y, 4, part * box.h}, colour::kControlPressed, 2);
}

void Ui::tooltip(const std::string& words) {
    tip_ = words;
    tip_at_ = {mouse_x() + 8, mouse_y(), 1, 16};
}

namespace {

constexpr double kTipAfterS = 0.5;
constexpr double kRepeatAfterS = 0.4, kRepeatEveryS = 0.125;
constexpr float kRadius = 6;

}  // namespace

void Ui::show_tip(unsigned id, bool hovered, bool focused, const std::string& words) {
    if (hovered && hovered_ != id) {
        hovered_ = id;
        hovered_since_s_ = now_s_;
    }
    if (!hovered && hovered_ == id) hovered_ = 0;
    if (words.empty() || ImGui::IsMouseDown(0)) return;
    const bool shown = focused || (hovered && now_s_ - hovered_since_s_ > kTipAfterS);
    if (shown) tip_ = words;
}

Ui::Press Ui::press(const char* id, const Box& box, bool enabled, const char* tip) {
    Press now;
    note(DrawnBox::Kind::control, box, id);
    if (box.w <= 0 || box.h <= 0) return now;
    ImGui::SetCursorScreenPos({px(box.x), px(box.y)});
    const bool clicked =
        ImGui::InvisibleButton(id, {std::max(px(box.w), 1.0f), std::max(px(box.h), 1.0f)});
    const unsigned number = ImGui::GetID(id);
    now.hovered = ImGui::IsItemHovered();
    now.held = ImGui::IsItemActive() && enabled;
    now.focused = focus_ == number;
    if (now.focused) focus_box_ = box;
    if (enabled) order_.push_back(number);
    now.pressed = enabled && (clicked || enter_ == number);
    const std::string before = tip_;
    show_tip(number, now.hovered, now.focused, *tip ? tr(tip) : "");
    if (tip_ != before) tip_at_ = box;
    return now;
}

void Ui::draw_button(const Box& box,
                     const std::string& words,
                     const ButtonStyle& style,
                     const Press& now) {
    unsigned back = colour::kControl, ink = colour::kText;
    if (style.primary) {
        back = now.held      ? colour::rgba(0x23, 0x5A, 0x6E)
               : now.hovered ? colour::rgba(0x33, 0x78, 0x8F)
                             : colour::kPrime;
        ink = colour::rgba(255, 255, 255);
    } else if (!style.enabled) {
        back = colour::rgba(0x1C, 0x1F, 0x21);
        ink = colour::kOff;
    } else if (style.chosen) {
        back = colour::kChosen;
    } else if (now.held) {
        back = colour::kControlPressed;
    } else if (now.hovered) {
        back = colour::kControlHover;
    }
    const bool plain =
        (style.ghost || style.link) && !now.hovered && !style.chosen && !style.primary;
    if (!plain) fill(box, back, kRadius);
    if (style.link && style.enabled) ink = colour::kAccent;
    if (style.chosen) fill({box.x + 3, box.bottom() - 3, box.w - 6, 3}, colour::kAccent, 1.5f);
    Type type = style.primary || style.chosen ? Type::bold : Type::body;
    if (style.tile) {
        icon(style.icon, box.x + 0.5f * box.w - 12, box.y + 6, 24, ink);
        text({box.x + 2, box.bottom() - 24, box.w - 4, 20}, words, Type::small, ink, Align::centre);
        return;
    }
    // Letters and F3 are the same on every keyboard; Space and Enter have names.
    const std::string key_name = std::strlen(style.key) > 2 ? tr(style.key) : style.key;
    const float key_width = key_name.empty() ? 0 : width(key_name, Type::small) + 12;
    const float icon_width = style.icon != Icon::none ? (words.empty() ? 24.0f : 32.0f) : 0;
    // Words that are long in some language take the padding too, or small letters.
    if (style.may_cut && icon_width + width(words, type) > box.w - 6) type = Type::small;
    const bool tight = icon_width + width(words, type) > box.w - 20;
    const float pad = style.link || tight ? 3.0f : 10.0f;
    const float all = icon_width + width(words, type) + (key_width > 0 ? key_width + 10 : 0);
    // The key's cap gives way to the words.
    const bool cap = key_width > 0 && all <= box.w - 2 * pad;
    const float used = cap ? all : all - (key_width > 0 ? key_width + 10 : 0);
    float x = style.left ? box.x + pad : box.x + std::max(0.5f * (box.w - used), pad);
    if (words.empty()) x = box.x + 0.5f * (box.w - 24);
    const float middle = box.y + 0.5f * box.h;
    if (style.icon != Icon::none) {
        icon(style.icon, x, middle - 12, 24, ink);
        x += icon_width;
    }
    const float room = box.right() - pad - x - (cap ? key_width + 10 : 0);
    if (!words.empty()) {
        // Words that are cut in a control are a fault of its size: kept with the control.
        if (width(words, type) > room + 0.5f) {
            if (!style.may_cut && !drawn_.empty()) drawn_.back().cut = true;
            if (style.may_cut && now.hovered) tooltip(words);
        }
        text({x, box.y, std::max(room, 1.0f), box.h}, words, type, ink);
    }
    if (!cap) return;
    const Box key{style.left ? box.right() - pad - key_width : x + width(words, type) + 10,
                  middle - 10, key_width, 20};
    outline(key, ink, 1, 4);
    text(key, key_name, Type::small, ink, Align::centre);
}

bool Ui::button(const char* id,
                const Box& box,
                const std::string& words,
                const ButtonStyle& style) {
    const Press now = press(id, box, style.enabled, style.tip);
    quiet_ = true;
    draw_button(box, words, style, now);
    quiet_ = false;
    return now.pressed;
}

int Ui::stepper(const char* id,
                const Box& box,
                const std::string& name,
                const std::string& value,
                const char* tip,
                bool enabled) {
    ImGui::PushID(id);
    const float side = std::min(box.h, 44.0f);
    Box rest = box;
    const Box plus = rest.take_right(side);
    // The value is never cut: the name takes what it leaves.
    const float left = box.w - 2 * side - width(value, Type::bold) - 8;
    const Box words =
        name.empty() ? Box{}
                     : rest.take_left(std::max(std::min({72.0f, 0.28f * box.w, left}), 0.0f), 4);
    const Box minus = rest.take_left(side);
    text(words, name, Type::body, colour::kDim);
    text(rest, value, Type::bold, enabled ? colour::kText : colour::kOff, Align::centre);
    int step = 0;
    const struct {
        const char* id;
        Box box;
        Icon icon;
        int by;
    } ends[] = {{"minus", minus, Icon::minus, -1}, {"plus", plus, Icon::plus, 1}};
    for (const auto& end : ends) {
        ButtonStyle style;
        style.icon = end.icon;
        style.enabled = enabled;
        const Press now = press(end.id, end.box, enabled, tip);
        quiet_ = true;
        draw_button(end.box, "", style, now);
        quiet_ = false;
        if (now.held && ImGui::IsItemActivated()) repeat_s_ = now_s_ + kRepeatAfterS;
        if (now.held && now_s_ >= repeat_s_ && ImGui::GetIO().MouseDownDuration[0] > 0.3f) {
            repeat_s_ = now_s_ + kRepeatEveryS;
            step = end.by;
        } else if (now.pressed && ImGui::GetIO().MouseDownDurationPrev[0] < kRepeatAfterS) {
            step = end.by;
        }
    }
    ImGui::PopID();
    return step;
}

bool Ui::groove(const char* id,
                const Box& box,
                double& value,
                double low,
                double high,
                double normal,
                const char* tip,
                bool enabled) {
    const Press now = press(id, box, enabled, tip);
    const double before = value;
    const float knob = std::min(12.0f, box.h);
    const float left = box.x + 0.5f * knob, wide = std::max(box.w - knob, 1.0f);
    if (now.held) {
        const double share = std::clamp((mouse_x() - left) / wide, 0.0f, 1.0f);
        value = low + share * (high - low);
    }
    if (now.hovered && ImGui::IsMouseDoubleClicked(0)) value = normal;
    if (now.focused) {
        const double step = (high - low) / (ImGui::GetIO().KeyShift ? 10 : 100);
        if (ImGui::IsKeyPressed(GLFW_KEY_RIGHT)) value += step;
        if (ImGui::IsKeyPressed(GLFW_KEY_LEFT)) value -= step;
        if (ImGui::IsKeyPressed(GLFW_KEY_BACKSPACE)) value = normal;
    }
    value = std::clamp(value, low, high);
    const float y = box.y + 0.5f * box.h;
    const float share = high > low ? static_cast<float>((value - low) / (high - low)) : 0;
    const float x = left + share * wide;
    fill({left, y - 2, wide, 4}, colour::kControlPressed, 2);
    if (enabled) fill({left, y - 2, x - left, 4}, colour::kAccent, 2);
    const float high_knob = std::min(24.0f, box.h - 4);
    fill({x - 0.5f * knob, y - 0.5f * high_knob, knob, high_knob},
         enabled ? colour::kText : colour::kOff, 4);
    return value != before;
}

bool Ui::slider(const char* id,
                const Box& box,
                const std::string& name,
                double& value,
                double low,
                double high,
                double normal,
                const std::string& shown,
                const char* tip,
                bool enabled) {
    Box rest = box;
    const Box words = rest.take_left(std::min(72.0f, 0.28f * box.w), 4);
    const Box number = rest.take_right(72);
    text(words, name, Type::body, colour::kDim);
    const bool moved = groove(id, rest, value, low, high, normal, tip, enabled);
    text(number, shown, Type::bold, enabled ? colour::kText : colour::kOff, Align::right);
    return moved;
}

bool Ui::input(const char* id, const Box& box, char* text, std::size_t size, const char* hint) {
    note(DrawnBox::Kind::control, box, id);
    ImGui::SetCursorScreenPos({px(box.x), px(box.y)});
    ImGui::PushStyleVar(ImGuiStyleVar_FramePadding,
                        {px(12), std::max(0.5f * (px(box.h) - ImGui::GetFontSize()), 0.0f)});
    ImGui::SetNextItemWidth(px(box.w));
    // The field of a box that has just opened takes the keyboard.
    if (layer_ > 0 && ImGui::IsWindowAppearing()) ImGui::SetKeyboardFocusHere();
    const bool done =
        ImGui::InputTextWithHint(id, hint, text, size, ImGuiInputTextFlags_EnterReturnsTrue);
    ImGui::PopStyleVar();
    return done;
}

Ui::Area Ui::area(const char* id, const Box& box) {
    Area now;
    if (box.w <= 0 || box.h <= 0) return now;
    ImGui::SetCursorScreenPos({px(box.x), px(box.y)});
    now.clicked = ImGui::InvisibleButton(id, {std::max(px(box.w), 1.0f), std::max(px(box.h), 1.0f)},
                                         ImGuiButtonFlags_MouseButtonLeft |
                                             ImGuiButtonFlags_MouseButtonRight |
                                             ImGuiButtonFlags_MouseButtonMiddle);
    now.hovered = ImGui::IsItemHovered();
    now.held = ImGui::IsItemActive();
    now.double_clicked = now.hovered && ImGui::IsMouseDoubleClicked(0);
    return now;
}

bool back_button(Ui& ui, Box& bar, const char* id, const std::string& words, const char* tip) {
    ButtonStyle style;
    style.icon = Icon::back;
    style.ghost = true;
    style.tip = tip;
    return ui.button(id, bar.take_left(56 + ui.width(words, Type::body), 12).inset(0, 4), words,
                     style);
}

}  // namespace sonocase::runtime::inline player_ui_parts
