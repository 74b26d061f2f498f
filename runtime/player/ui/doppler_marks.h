// SPDX-License-Identifier: Apache-2.0

// What a machine draws on its picture in the Doppler modes: the colour box with its scale, the
// gate with the angle cursor or the line of M-mode, and the strip below the picture with its axes
// and measures.
#pragma once

#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/core/scan_geometry.h"
#include "runtime/player/session/scan_frame.h"
#include "runtime/player/ui/image_view.h"

namespace sonocase::runtime::inline player_ui {

// Where the lines of the shown frame run; probe: of the exercise, whose depth the console changes.
ScanGeometry picture_geometry(const ScanFrame& frame, const Probe& probe);

// Box or gate on the picture. flipped: left and right are exchanged.
void draw_doppler_marks(Ui& ui,
                        const ImagePlace& place,
                        const ScanGeometry& geometry,
                        const DopplerSettings& settings,
                        bool flipped);

// The scale of the colours, in the place of the grey bar; cm/s at its ends.
void draw_colour_bar(Ui& ui, const Box& area, const DopplerSettings& settings);

// Whether the mode has a strip, and the part of the picture's area that it takes.
bool has_strip(DopplerMode mode);
Box strip_box(const Box& area);
// texture: of the frame's strip; null: none yet.
void draw_strip(
    Ui& ui, const Box& box, const ScanFrame& frame, const DopplerSettings& settings, void* texture);

// What the mouse at a place of the screen, in pixels, would drag: the box, its nearest corner, the
// gate.
DopplerDrag doppler_hold(const ImagePlace& place,
                         const ScanGeometry& geometry,
                         const DopplerSettings& settings,
                         bool flipped,
                         float x,
                         float y,
                         float scale);
// Moves what is held from one place of the screen to another. Everything stays inside the picture.
void drag_doppler(const ImagePlace& place,
                  const ScanGeometry& geometry,
                  DopplerDrag held,
                  bool flipped,
                  float from_x,
                  float from_y,
                  float to_x,
                  float to_y,
                  DopplerSettings& settings);

}  // namespace sonocase::runtime::inline player_ui
