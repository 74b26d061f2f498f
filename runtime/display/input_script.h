// SPDX-License-Identifier: Apache-2.0

// Input from a file, for tests of the window: one command per line.
//
//   wait N              for N pictures
//   key NAME [mods]     press and release; mods are shift, ctrl, alt
//   hold NAME N [mods]  keep it down for N pictures
//   move X Y            the mouse, in window pixels
//   down B | up B       button 0 left, 1 right, 2 middle
//   wheel DY
//   shot FILE           save the window as PNG, and in FILE.boxes where its words and controls are
//   boxes FILE          save in FILE.boxes alone, without a picture
//   instructor FILE     save the second window as PNG
//   only-shots          from here on, the first window draws only the pictures that are saved
//   press NAME          click the control of that name (DrawnBox), wherever it is
//   loop S              again from the first line until the clock says S seconds
//   quit
// A picture lasts 1/60 s for keys that are held, however long it took to draw. One that is saved
// waits until all that came before is rendered.
// Empty lines and lines that start with # are ignored.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/result.h"
#include "runtime/display/window.h"

namespace sonocase::runtime::inline display {

class InputScript {
  public:
    // Errors: a file that cannot be read, a line that is not a command.
    static Result<InputScript> load(const std::string& path);

    // False after the last command.
    bool active() const { return next_ < lines_.size() || waiting_ > 0 || press_ > 0; }
    // Whether next() will ask for a picture or boxes.
    bool saves_next() const;
    // The input of the next picture. Sets `shot` to the file in which to save that picture, and
    // `quit` when the script ends. now_s: the clock of `loop`. ready: false repeats the input, once
    // keys are up, and leaves the script where it is.
    InjectedInput next(double now_s, bool ready, std::string& shot, bool& quit);
    // Whether the last next() asked for a picture of the second window.
    bool of_instructor() const { return of_instructor_; }
    // Whether it asked for the boxes alone.
    bool boxes_alone() const { return boxes_alone_; }
    // Whether pictures that are not saved need not be drawn.
    bool only_shots() const { return only_shots_; }
    // Finds a control by its name and gives its middle in window pixels; false: there is none.
    void set_finder(std::function<bool(const std::string& name, float& x, float& y)> find) {
        find_ = std::move(find);
    }

  private:
    struct Line {
        int number = 0;
        std::vector<std::string> words;
    };
    std::vector<Line> lines_;
    std::size_t next_ = 0;
    int waiting_ = 0;
    InjectedInput input_;
    bool release_ = false, of_instructor_ = false, boxes_alone_ = false, only_shots_ = false;
    int press_ = 0;  // steps of a press that are still to come
    std::function<bool(const std::string&, float&, float&)> find_;
};

}  // namespace sonocase::runtime::inline display
