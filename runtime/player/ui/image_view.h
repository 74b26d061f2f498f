// SPDX-License-Identifier: Apache-2.0

// The ultrasound picture as on a machine: depth scale, focus mark, orientation mark, grey bar,
// distance measurements, and the words in its corners. On the picture only white and grey, but for
// the map of colour Doppler. A mode with a strip has it in the lower third of the same area.
#pragma once

#include <string>
#include <vector>

#include "runtime/player/app/picture_marks.h"
#include "runtime/player/session/scan_frame.h"
#include "runtime/player/ui/parts/ui.h"

namespace sonocase::runtime::inline player_ui {

struct ImageViewInput {
    const ScanFrame& frame;
    void* texture;  // of the frame's pixels; null: none yet
    const Probe& probe;
    const Measurements& measurements;
    std::vector<std::string> left_lines{}, right_lines{};  // words in the corners
    bool flipped = false;
    bool measuring = false;
    bool placing = false;                      // a click sets a target
    const DopplerSettings* doppler = nullptr;  // a mode is on; null: the grey picture alone
    void* strip = nullptr;                     // texture of the frame's strip; null: none
    const PictureMarks* marks = nullptr;       // words, body mark and zoom; null: none
    // What lies under the pointer; empty: nothing is said.
    std::string picked_name{};
    // Names on the picture, each at its place in pixels of the frame.
    struct Name {
        double column = 0, row = 0;
        std::string words;
    };
    std::vector<Name> names{};
    // Marks in the scan plane, mm in the `probe` frame: the planned way of a replay, dotted.
    std::vector<Point3> way{};
    // What is wrong with the tracker, a sentence; the picture is then not live and is drawn dark.
    // Empty: nothing.
    std::string stopped{};
    double stopped_s = 0;         // for so long
    bool stopped_buttons = true;  // with ways out of it
};

// Where the picture is on the screen, to turn a place on one into a place on the other.
struct ImagePlace {
    float x = 0, y = 0, side_x = 0, side_y = 0;  // screen pixels
    double mm_per_screen_px = 1;
    double origin_x = 0, origin_y = 0;  // screen pixel of the middle of the probe's face
    float px_per_image_px = 1;          // screen pixels per pixel of the frame
    bool hovered = false;               // the mouse is over the picture, or dragging from it
    // Asked for while the tracker does not answer.
    bool open_setup = false, use_mouse = false;
};

// Size in pixels in which to render the picture, so that the sector fills the area less the room
// for its depth scale: multiples of 32, at most 1024.
struct PictureSize {
    int width_px = 512, height_px = 512;
};
PictureSize picture_size(const Box& area, float scale);

// The box of the body mark in the picture's area, u.
Box body_mark_box(const Box& area);

struct TargetMark {
    Point3 centre;  // `probe` frame
    double radius_mm = 0;
    std::string name;
};
// A ring where the scan plane cuts a target; beside the plane a dotted ring of the target's size,
// with the distance to the plane. flipped: left and right are exchanged.
void draw_target_marks(Ui& ui,
                       const ImagePlace& place,
                       const std::vector<TargetMark>& targets,
                       bool flipped);

ImagePlace draw_image_view(Ui& ui, const Box& area, const ImageViewInput& input);

}  // namespace sonocase::runtime::inline player_ui
