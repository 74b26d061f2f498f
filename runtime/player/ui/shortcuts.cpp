// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/shortcuts.h"

namespace sonocase::runtime {

std::span<const Shortcut> shortcuts() {
    static constexpr Shortcut kAll[] = {
        {nullptr, "Probe (mouse tracker)"},
        {"Arrows", "slide on the skin; with Alt everything is slow"},
        {"Shift + arrows", "rock and fan"},
        {"Q  E", "rotate"},
        {"Page Down  Page Up", "press and lift"},
        {"Home", "back to the start"},
        {"Left drag, right drag, wheel",
         "on the picture: slide, tilt, rotate; Ctrl + wheel presses"},
        {"Right drag in 3-D", "put the probe there; with Shift the needle"},
        {nullptr, "Needle (mouse tracker)"},
        {"N  Shift + N", "take or withdraw, in plane or across"},
        {"W  S  Shift + wheel", "advance and pull back"},
        {"A  D  Z  X  Shift + drag", "aim in the plane and out of it"},
        {"Shift + I J K L", "move its entry while it is outside"},
        {nullptr, "Picture"},
        {"Space", "freeze"},
        {",  .  P", "cine back, forward, play"},
        {"[  ]  ;  '", "depth and focus"},
        {"-  =", "gain"},
        {"1 ... 8 held with , .", "TGC; 0 levels it"},
        {"M  C  F", "measure, clear, flip"},
        {nullptr, "Program"},
        {"B  H", "start and finish an attempt; next hint in practice"},
        {"F1  Escape", "this help; close what is on top"},
        {"F2  F3", "cases (Up, Down, Enter), set-up"},
        {"F5  F6  F7", "next exercise, image model, tracker; Shift goes back"},
        {"F8  F9  F10  V", "show exercise, tracker, effects, 3-D view"},
        {"O", "3-D view from outside, from the probe, from the needle"},
        {"Shift + ,  Shift + .", "a recording or script slower, faster"},
        {"Ctrl + ,  Ctrl + .", "a recording or script 5 s back, forward"},
        {"F11  Ctrl + / -  Ctrl + Q", "full screen, text size, quit"},
    };
    return kAll;
}

}  // namespace sonocase::runtime
