// SPDX-License-Identifier: Apache-2.0

// When the small 3-D view and the window are drawn again. The 3-D view: where the processor paints,
// one drawing can take longer than everything else on the screen; it is then drawn so rarely that
// it takes a seventh of the time, and the ultrasound picture keeps its rate. Where drawing takes no
// time, every second picture has one.
#pragma once

namespace sonocase::runtime::inline player_app {

class ViewPace {
  public:
    // Once per picture, at its start, with its time. True: draw the view in this picture.
    bool due(double now_s);

  private:
    double last_s_ = -1;   // start of the previous picture; negative: none
    double plain_s_ = -1;  // time of a picture without a drawing, smoothed; negative: unknown
    double drawn_s_ = -1;  // start of the last picture with one
    double wait_s_ = 0;    // from one drawing to the next
    bool drew_ = false;
};

// The window: what moves is drawn 60 times a second; what stands still is drawn for input, some
// times more afterwards because hovering and tooltips follow it, and then not at all.

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

}  // namespace sonocase::runtime::inline player_app
