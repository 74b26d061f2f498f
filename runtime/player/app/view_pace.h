// SPDX-License-Identifier: Apache-2.0

// When the small 3-D view is drawn anew. Where the processor paints, one drawing can cost more than
// everything else on the screen; it is then drawn seldom enough to take a seventh of the time, so
// that the ultrasound picture keeps its rate. Where a drawing costs nothing, every second picture
// has one.
#pragma once

namespace sonocase {

class ViewPace {
  public:
    // Once a picture, at its start, with its time. True: draw the view in this picture.
    bool due(double now_s);

  private:
    double last_s_ = -1;   // start of the picture before; negative: none
    double plain_s_ = -1;  // what a picture without a drawing takes, smoothed; negative: unknown
    double drawn_s_ = -1;  // start of the last picture with one
    double wait_s_ = 0;    // from one drawing to the next
    bool drew_ = false;
};

}  // namespace sonocase
