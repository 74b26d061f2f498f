// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/pages/shortcuts.h"

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
        {"Shift + 1 2 3 4", "grey picture, colour Doppler, PW, M-mode"},
        {"Ctrl + 1 2 3 4", "presets: liver, kidney, vessel, deep"},
        {"U", "held: outlines and names of what the picture shows"},
        {"M  C  F", "measure, clear, flip"},
        {"T  Y  G", "words on the picture, zoom, auto gain"},
        {nullptr, "Program"},
        {"B  H", "start and finish an attempt; next hint in practice"},
        {"Enter  P  R", "on the start page practise; after an attempt again, replay, review"},
        {"F1  Escape", "this help; close what is on top"},
        {"Tab  Enter", "walk through the controls; press the one in its frame"},
        {"F2  F3", "cases (Up, Down, Enter), set-up"},
        {"F4", "sound on and off"},
        {"F5  F6  F7", "next exercise, image model, tracker; Shift goes back"},
        {"F8  F9  F10", "exercises, tracker, effects"},
        {"V  Shift + V", "3-D view shown or not; in the place of the picture"},
        {"O", "3-D view from outside, from the probe, from the needle"},
        {"Shift + ,  Shift + .", "a recording or script slower, faster"},
        {"Ctrl + ,  Ctrl + .", "a recording or script 5 s back, forward"},
        {"F12  Shift + F12", "save the picture; save the last 20 s as a film"},
        {"F11  Ctrl + / - / 0  Ctrl + Q", "full screen, text size, quit"},
    };
    return kAll;
}

}  // namespace sonocase::runtime
