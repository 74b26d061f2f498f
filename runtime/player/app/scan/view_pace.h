// SPDX-License-Identifier: Apache-2.0

// When the small 3-D view is drawn again. Where the processor paints, one drawing can take longer
// than everything else on the screen; it is then drawn so rarely that it takes a seventh of the
// time, and the ultrasound picture keeps its rate. Where drawing takes no time, every second
// picture has one.
#pragma once

namespace sonocase::runtime {

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

}  // namespace sonocase::runtime
