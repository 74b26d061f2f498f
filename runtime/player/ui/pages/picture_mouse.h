// SPDX-License-Identifier: Apache-2.0

// The mouse on the ultrasound picture: it moves the tools, or measures.
#pragma once

#include "runtime/player/app/scan/measurements.h"
#include "runtime/player/app/states.h"
#include "runtime/player/ui/picture/image_view.h"
#include "runtime/tracking/mouse_tracker.h"

namespace sonocase::runtime {

// Once per picture, after the picture was drawn.
// place    as draw_image_view returned it
// tracker  whose tools move; null if the mouse is not the tracker
void handle_picture_mouse(const ImagePlace& place,
                          bool flipped,
                          bool measuring,
                          Measurements& measurements,
                          MouseTracker* tracker);

// In a Doppler mode: what the left button takes hold of, box, its corner or the gate, follows the
// mouse. True: the mouse is taken, and moves nothing else.
bool handle_doppler_mouse(App& app, const ImagePlace& place, float scale);

// Zoom, words and body mark. area: of the picture, u. True: the mouse is taken.
bool handle_marks_mouse(App& app, const ImagePlace& place, const Box& area, float scale);

// While an educator places a target: the click sets it.
void place_new_target(App& app, const ImagePlace& place);

}  // namespace sonocase::runtime
