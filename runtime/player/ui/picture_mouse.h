// SPDX-License-Identifier: Apache-2.0

// The mouse on the ultrasound picture: it moves the tools, or measures.
#pragma once

#include "runtime/player/app/measurements.h"
#include "runtime/player/ui/image_view.h"
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

}  // namespace sonocase::runtime
