// SPDX-License-Identifier: Apache-2.0

// What the user puts on the picture: distances, words, a body mark, and how far it is enlarged.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "runtime/imaging/doppler/box_hands.h"

namespace sonocase::runtime::inline player_app {

// What the mouse drags in a Doppler mode.
using DopplerDrag = doppler::Held;

struct Measurement {
    double x0_mm = 0, z0_mm = 0, x1_mm = 0, z1_mm = 0;  // scan plane, `probe` frame
    double length_mm() const { return std::hypot(x1_mm - x0_mm, z1_mm - z0_mm); }
};

// The distance tool: the first click sets a point, the second ends a measurement; the last two
// measurements are kept.
class Measurements {
  public:
    void click(double x_mm, double z_mm) {
        if (!begun_) {
            begun_ = Measurement{x_mm, z_mm, x_mm, z_mm};
            return;
        }
        done_.push_back({begun_->x0_mm, begun_->z0_mm, x_mm, z_mm});
        begun_.reset();
        if (done_.size() > 2) done_.erase(done_.begin());
    }
    void clear() { *this = {}; }

    const std::vector<Measurement>& done() const { return done_; }  // oldest first
    const std::optional<Measurement>& begun() const { return begun_; }

  private:
    std::vector<Measurement> done_;
    std::optional<Measurement> begun_;
};

struct PictureLabel {
    double x_mm = 0, z_mm = 0;  // scan plane, as on the screen: flipped pictures are not turned
    std::string words;
};

// What the next click or drag in the picture does.
enum class MarkTool { none, zoom, label };

struct PictureZoom {
    double factor = 1;          // 1: the whole picture
    double x_mm = 0, z_mm = 0;  // in the middle of the area
    bool on() const { return factor > 1; }
};

struct PictureMarks {
    MarkTool tool = MarkTool::none;
    std::vector<PictureLabel> labels;  // at most kMaxLabels, oldest first
    PictureLabel placing;              // whose words are being typed
    char words[48] = "";
    bool body = false;                   // the body mark is shown ...
    float body_x = 0.5f, body_y = 0.4f;  // ... with the probe there, parts of its box
    PictureZoom zoom;
    float from_x = -1, from_y = -1;  // of the zoom's drag, screen pixels; negative: none
};

inline constexpr std::size_t kMaxLabels = 8;

// Zoom, or back from it.
inline void toggle_zoom(PictureMarks& marks) {
    const bool begins = !marks.zoom.on() && marks.tool != MarkTool::zoom;
    marks.zoom = {};
    marks.tool = begins ? MarkTool::zoom : MarkTool::none;
    marks.from_x = -1;
}

inline void add_label(PictureMarks& marks) {
    marks.placing.words = marks.words;
    if (!marks.placing.words.empty()) marks.labels.push_back(marks.placing);
    if (marks.labels.size() > kMaxLabels) marks.labels.erase(marks.labels.begin());
    marks.words[0] = 0;
    marks.tool = MarkTool::none;
}

// The box of a drag, mm in the scan plane, fills the area; a drag of less than 5 mm does nothing.
// The picture is enlarged at most eight times.
inline void zoom_to(
    PictureZoom& zoom, double x0, double z0, double x1, double z1, double wide_mm, double high_mm) {
    const double wide = std::abs(x1 - x0), high = std::abs(z1 - z0);
    if (wide < 5 && high < 5) return;
    zoom.factor = std::clamp(std::min(wide_mm / std::max(wide, 1.0), high_mm / std::max(high, 1.0)),
                             1.0, 8.0);
    zoom.x_mm = 0.5 * (x0 + x1);
    zoom.z_mm = 0.5 * (z0 + z1);
}

}  // namespace sonocase::runtime::inline player_app
