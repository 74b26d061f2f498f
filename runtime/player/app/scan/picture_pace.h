// SPDX-License-Identifier: Apache-2.0

// When the window is drawn again. What moves is drawn 60 times a second; what stands still is drawn
// for input, some times more afterwards because hovering and tooltips follow it, and then not at
// all.
#pragma once

namespace sonocase::runtime {

inline constexpr double kPictureTime = 1 / 60.0;  // seconds from one picture to the next
inline constexpr double kStillTime = 0.6;         // where something changes now and then
inline constexpr double kLoadingTime = 0.25;      // where cases are being read
inline constexpr double kNoPicture = 1e9;         // none before there is input
inline constexpr double kAfterInput = 1.5;        // for so long things follow an input

struct Stillness {
    bool scanning = false;   // a picture of living tissue, or a film, is shown
    bool key_held = false;   // which moves something
    bool loading = false;    // cases are being read, or meshes made
    bool notice = false;     // one stands, and will go
    bool typing = false;     // a cursor blinks
    double input_s_ago = 0;  // since the last input
};

// Longest time from the start of one picture to the start of the next, unless there is input.
double longest_wait_s(const Stillness& now);

}  // namespace sonocase::runtime
