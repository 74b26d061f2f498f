// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "formats/base/constants.h"
#include "formats/exercise/exercise.h"
#include "pipeline/base/text.h"
#include "pipeline/check/case_labels.h"
#include "pipeline/check/check_case.h"
#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline check {

namespace {

constexpr int kHalfSheetPx = kSheetPx / 2;
constexpr int kCaptionPx = 26, kGapPx = 10, kColumns = 4;

using Colour = std::array<std::uint8_t, 3>;

// A square picture, rows from the top down, and what stands below it.
struct Panel {
    std::string caption;
    std::string left, right;  // letters at its edges: the patient's sides
    std::vector<std::uint8_t> rgb = std::vector<std::uint8_t>(3 * kSheetPx * kSheetPx, 255);

    void plot(int x, int y, Colour colour) {
        if (x < 0 || y < 0 || x >= kSheetPx || y >= kSheetPx) return;
        std::copy(colour.begin(), colour.end(),
                  rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * kSheetPx + x));
    }
};

// A plane as a picture has it: `across` to the right, `down` downwards, mm per pixel.
struct View {
    Point3 middle;  // in the middle of the picture
    Vector3 across, down;
    double mm_per_px = 1;

    Point3 at(int x, int y) const {
        return middle + (x - kHalfSheetPx) * mm_per_px * across +
               (y - kHalfSheetPx) * mm_per_px * down;
    }
};

void draw_labels(const CaseLabels& labels, const View& view, Panel& panel) {
    for (int y = 0; y < kSheetPx; ++y)
        for (int x = 0; x < kSheetPx; ++x) {
            const int label = labels.label(view.at(x, y));
            panel.plot(x, y,
                       label == 0 ? Colour{0, 0, 0}
                                  : labels.bundle().labels[static_cast<std::size_t>(label)].colour);
        }
}

void stroke(const View& view, Point3 from, Point3 to, Colour colour, Panel& panel) {
    for (int s = 0; s <= 800; ++s) {
        const Vector3 at = from + (s / 800.0) * (to - from) - view.middle;
        const int x = static_cast<int>(std::lround(dot(at, view.across) / view.mm_per_px)),
                  y = static_cast<int>(std::lround(dot(at, view.down) / view.mm_per_px));
        panel.plot(x + kHalfSheetPx, y + kHalfSheetPx, colour);
        panel.plot(x + kHalfSheetPx + 1, y + kHalfSheetPx, colour);
    }
}

struct PatientAxes {
    Vector3 right{1, 0, 0}, front{0, 1, 0}, up{0, 0, 1};
    bool known = false;
};

// The axis of the grid that a direction nearly has; else the direction itself.
Vector3 squared(Vector3 v) {
    constexpr double kNear = 0.85;  // cosine: organs tell an axis to some 25 degrees
    for (int axis = 0; axis < 3; ++axis)
        if (std::abs(v[axis]) > kNear) {
            Vector3 along;
            along[axis] = v[axis] > 0 ? 1 : -1;
            return along;
        }
    return v;
}

PatientAxes axes_of(const CheckResult& result) {
    PatientAxes axes;
    if (!(norm(result.up) > 0)) return axes;
    const Vector3 up = squared(result.up);
    const Vector3 front = squared(normalized(result.forwards - dot(result.forwards, up) * up));
    return {cross(front, up), front, up, true};
}

// Planes through the middle of the body as radiologists hang them: the patient's right on the left.
std::vector<Panel> planes(const CaseLabels& labels, const PatientAxes& axes) {
    const Grid& grid = labels.bundle().grid;
    View view;
    view.middle = grid.point_from_voxel({0.5 * grid.size.x, 0.5 * grid.size.y, 0.5 * grid.size.z});
    double longest = 0;
    for (int axis = 0; axis < 3; ++axis)
        longest = std::max(longest, grid.size[axis] * grid.spacing_mm[axis]);
    view.mm_per_px = longest / kSheetPx;
    struct CutPlane {
        const char* caption;
        Vector3 across, down;
        const char *left, *right;
    };
    const CutPlane all[] = {{"axial", -axes.right, -axes.front, "R", "L"},
                            {"coronal", -axes.right, -axes.up, "R", "L"},
                            {"sagittal", -axes.front, -axes.up, "A", "P"}};
    std::vector<Panel> panels;
    for (const CutPlane& plane : all) {
        view.across = plane.across;
        view.down = plane.down;
        Panel panel;
        panel.caption = axes.known ? plane.caption : "plane through the middle";
        if (axes.known) panel.left = plane.left, panel.right = plane.right;
        draw_labels(labels, view, panel);
        panels.push_back(std::move(panel));
    }
    return panels;
}

// A view in space, brought to the panel's size by its nearest pixels.
Panel in_space(const CaseBundle& bundle, const char* caption, Vector3 along, Vector3 up) {
    std::vector<Point3> marks;
    for (const NamedTarget& target : exercise_targets(bundle)) marks.push_back(target.centre);
    const BodyView view = body_view(bundle, along, up, marks, kSheetPx);
    Panel panel;
    panel.caption = caption;
    const double scale =
        static_cast<double>(std::max({view.width_px, view.height_px, 1})) / kSheetPx;
    for (int y = 0; y < kSheetPx; ++y)
        for (int x = 0; x < kSheetPx; ++x) {
            const int from_x = static_cast<int>((x - kHalfSheetPx) * scale + view.width_px / 2.0),
                      from_y = static_cast<int>((y - kHalfSheetPx) * scale + view.height_px / 2.0);
            if (from_x < 0 || from_y < 0 || from_x >= view.width_px || from_y >= view.height_px)
                continue;
            const std::uint8_t* pixel =
                view.rgb.data() +
                3 * (static_cast<std::ptrdiff_t>(from_y) * view.width_px + from_x);
            panel.plot(x, y, {pixel[0], pixel[1], pixel[2]});
        }
    return panel;
}

// The plane in which an exercise's first sweep begins.
Panel window(const CaseLabels& labels, const Exercise& exercise) {
    const SweepKey& start = exercise.sweeps.front().keys.front();
    View view;
    const double depth_mm = exercise.probe.depth_mm;
    view.mm_per_px = (depth_mm + 40) / kSheetPx;
    view.down = normalized(start.beam);
    view.across = normalized(start.lateral - dot(start.lateral, view.down) * view.down);
    view.middle = start.probe + (0.5 * depth_mm) * view.down;
    Panel panel;
    panel.caption = exercise.name;
    draw_labels(labels, view, panel);
    stroke(view, start.probe - 25 * view.across, start.probe + 25 * view.across, {255, 255, 255},
           panel);
    if (!exercise.targets.empty()) {
        const Target& target = exercise.targets.front();
        for (int s = 0; s < 360; ++s) {
            const double a = s * kRadPerDeg;
            const Point3 p = target.centre + target.radius_mm * std::cos(a) * view.across +
                             target.radius_mm * std::sin(a) * view.down;
            stroke(view, p, p, {255, 255, 0}, panel);
        }
        if (start.has_needle)
            stroke(view, start.needle_tip - 30 * start.needle_direction, target.centre,
                   {0, 255, 255}, panel);
    }
    return panel;
}

// The picture of the player in that window; white where there is none.
Panel ultrasound_panel(const std::string& exercise,
                       const std::map<std::string, std::vector<std::uint8_t>>& ultrasound) {
    Panel panel;
    const auto found = ultrasound.find(exercise);
    if (found == ultrasound.end()) return panel;
    const auto picture = grey_from_png(found->second);
    if (!picture || picture->width_px != kSheetPx || picture->height_px != kSheetPx) return panel;
    panel.caption = "ultrasound";
    for (std::size_t n = 0; n < picture->pixels.size(); ++n)
        std::fill_n(panel.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(n), 3, picture->pixels[n]);
    return panel;
}

void paste(const Panel& panel, int x0, int y0, int width, std::vector<std::uint8_t>& rgb) {
    for (int y = 0; y < kSheetPx; ++y)
        std::copy_n(panel.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(y) * kSheetPx, 3 * kSheetPx,
                    rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y0 + y) * width + x0));
}

}  // namespace

std::vector<std::uint8_t> case_sheet(
    const CaseBundle& bundle,
    const CheckResult& result,
    const std::map<std::string, std::vector<std::uint8_t>>& ultrasound) {
    const CaseLabels labels(bundle);
    const PatientAxes axes = axes_of(result);
    std::vector<Panel> panels = planes(labels, axes);
    panels.push_back(in_space(bundle, "from the front", -axes.front, axes.up));
    panels.push_back(in_space(bundle, "from the right", -axes.right, axes.up));
    panels.push_back(in_space(bundle, "from the back", axes.front, axes.up));
    for (const EmbeddedExercise& embedded : bundle.exercises) {
        const auto exercise = parse_exercise(embedded.toml, embedded.name);
        if (!exercise || exercise->sweeps.empty() || exercise->sweeps.front().keys.empty())
            continue;
        panels.push_back(window(labels, *exercise));
        if (!ultrasound.empty()) panels.push_back(ultrasound_panel(embedded.name, ultrasound));
    }
    const int rows = static_cast<int>((panels.size() + kColumns - 1) / kColumns);
    constexpr int kTitlePx = 44;
    const int width = kColumns * (kSheetPx + kGapPx) + kGapPx,
              height = kTitlePx + rows * (kSheetPx + kCaptionPx + kGapPx);
    Canvas canvas(width, height);
    canvas.text(bundle.manifest.case_name + text(": %zu structures, %zu exercises, %zu faults",
                                                 bundle.labels.size() - 1, bundle.exercises.size(),
                                                 result.faults.size()),
                {kGapPx, height - 30.0}, {.size_px = 18, .bold = true});
    const auto place = [&](std::size_t n) {
        return std::pair{
            kGapPx + static_cast<int>(n % kColumns) * (kSheetPx + kGapPx),
            kTitlePx + static_cast<int>(n / kColumns) * (kSheetPx + kCaptionPx + kGapPx)};
    };
    for (std::size_t n = 0; n < panels.size(); ++n) {
        const auto [x, y] = place(n);
        const double base = height - y - kSheetPx - 18.0;  // the canvas counts from below
        canvas.text(panels[n].caption, {x + kSheetPx / 2.0, base},
                    {.size_px = 13, .anchor = TextAnchor::middle});
        canvas.text(panels[n].left, {double(x), base}, {.size_px = 13, .bold = true});
        canvas.text(panels[n].right, {double(x + kSheetPx), base},
                    {.size_px = 13, .bold = true, .anchor = TextAnchor::end});
    }
    std::vector<std::uint8_t> rgb = canvas.rgb();
    for (std::size_t n = 0; n < panels.size(); ++n) {
        const auto [x, y] = place(n);
        paste(panels[n], x, y, width, rgb);
    }
    return png_from_rgb(rgb.data(), width, height);
}

}  // namespace sonocase::pipeline::inline check
