// SPDX-License-Identifier: Apache-2.0

#include <GLFW/glfw3.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>

#include "runtime/player/ui/parts/ui.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
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

void Ui::draw_button(const Box& box, const std::string& words, const Look& look, const Press& now) {
    unsigned back = colour::kControl, ink = colour::kText;
    if (look.primary) {
        back = now.held      ? colour::rgba(0x23, 0x5A, 0x6E)
               : now.hovered ? colour::rgba(0x33, 0x78, 0x8F)
                             : colour::kPrime;
        ink = colour::rgba(255, 255, 255);
    } else if (!look.enabled) {
        back = colour::rgba(0x1C, 0x1F, 0x21);
        ink = colour::kOff;
    } else if (look.chosen) {
        back = colour::kChosen;
    } else if (now.held) {
        back = colour::kControlPressed;
    } else if (now.hovered) {
        back = colour::kControlHover;
    }
    const bool plain = (look.ghost || look.link) && !now.hovered && !look.chosen && !look.primary;
    if (!plain) fill(box, back, kRadius);
    if (look.link && look.enabled) ink = colour::kAccent;
    if (look.chosen) fill({box.x + 3, box.bottom() - 3, box.w - 6, 3}, colour::kAccent, 1.5f);
    const Type type = look.primary || look.chosen ? Type::bold : Type::body;
    if (look.tile) {
        icon(look.icon, box.x + 0.5f * box.w - 12, box.y + 6, 24, ink);
        text({box.x + 2, box.bottom() - 24, box.w - 4, 20}, words, Type::small, ink, Align::centre);
        return;
    }
    const float key_width = *look.key ? width(look.key, Type::small) + 12 : 0;
    const float icon_width = look.icon != Icon::none ? (words.empty() ? 24.0f : 32.0f) : 0;
    // Words that are long in some language take the padding too.
    const bool tight = icon_width + width(words, type) > box.w - 20;
    const float pad = look.link || tight ? 3.0f : 10.0f;
    const float all = icon_width + width(words, type) + (key_width > 0 ? key_width + 10 : 0);
    // The key's cap gives way to the words.
    const bool cap = key_width > 0 && all <= box.w - 2 * pad;
    const float used = cap ? all : all - (key_width > 0 ? key_width + 10 : 0);
    float x = look.left ? box.x + pad : box.x + std::max(0.5f * (box.w - used), pad);
    if (words.empty()) x = box.x + 0.5f * (box.w - 24);
    const float middle = box.y + 0.5f * box.h;
    if (look.icon != Icon::none) {
        icon(look.icon, x, middle - 12, 24, ink);
        x += icon_width;
    }
    const float room = box.right() - pad - x - (cap ? key_width + 10 : 0);
    if (!words.empty()) {
        // Words that are cut in a control are a fault of its size: kept with the control.
        if (width(words, type) > room + 0.5f) {
            if (!look.may_cut && !drawn_.empty()) drawn_.back().cut = true;
            if (look.may_cut && now.hovered) tooltip(words);
        }
        text({x, box.y, std::max(room, 1.0f), box.h}, words, type, ink);
    }
    if (!cap) return;
    const Box key{look.left ? box.right() - pad - key_width : x + width(words, type) + 10,
                  middle - 10, key_width, 20};
    outline(key, ink, 1, 4);
    text(key, look.key, Type::small, ink, Align::centre);
}

bool Ui::button(const char* id, const Box& box, const std::string& words, const Look& look) {
    const Press now = press(id, box, look.enabled, look.tip);
    quiet_ = true;
    draw_button(box, words, look, now);
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
    const Box words = name.empty() ? Box{} : rest.take_left(std::min(72.0f, 0.28f * box.w), 4);
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
        Look look;
        look.icon = end.icon;
        look.enabled = enabled;
        const Press now = press(end.id, end.box, enabled, tip);
        quiet_ = true;
        draw_button(end.box, "", look, now);
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
    Look look;
    look.icon = Icon::back;
    look.ghost = true;
    look.tip = tip;
    return ui.button(id, bar.take_left(56 + ui.width(words, Type::body), 12).inset(0, 4), words,
                     look);
}

}  // namespace sonocase::runtime
