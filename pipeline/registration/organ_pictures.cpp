// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/organ_pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "formats/files/atomic_file.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/text.h"
#include "pipeline/pictures/canvas.h"
#include "pipeline/pictures/png.h"
#include "pipeline/registration/elastic/tissue_lattice.h"
#include "pipeline/registration/fit/fit_measure.h"
#include "pipeline/registration/fit/point_index.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/warp_fit.h"

namespace sonocase::pipeline::inline registration {
namespace {

constexpr int kPanelWidth = 440, kPanelHeight = 330, kTitle = 26, kTable = 470, kRow = 18;
constexpr int kCuts = 3;
constexpr double kNearMm = 5;
constexpr CanvasColour kInk{30, 30, 30, 255}, kAlarm{190, 20, 20, 255};
constexpr std::array<std::uint8_t, 3> kReading{0, 190, 220}, kFitted{250, 250, 250},
    kUnfitted{255, 90, 40};

struct TissueColour {
    std::string_view tissue;
    std::array<std::uint8_t, 3> colour;
};
// Colours as in an anatomical atlas; structures of other tissues keep the colour of their label.
constexpr TissueColour kColours[] = {
    {"fat", {228, 204, 120}},     {"skin", {214, 170, 130}},  {"soft_tissue", {214, 180, 130}},
    {"muscle", {150, 62, 74}},    {"bone", {240, 236, 220}},  {"cartilage", {206, 214, 216}},
    {"liver", {156, 84, 52}},     {"spleen", {112, 58, 104}}, {"kidney_cortex", {196, 92, 60}},
    {"pancreas", {232, 160, 96}}, {"bowel", {200, 160, 96}},  {"gas", {70, 70, 78}},
    {"lung", {96, 112, 128}},     {"blood", {214, 44, 44}},   {"urine", {82, 126, 220}},
    {"bile", {76, 148, 84}},      {"nerve", {236, 220, 90}}};

std::vector<std::array<std::uint8_t, 3>> colours_of(const LabelVolume& labels) {
    std::vector<std::array<std::uint8_t, 3>> colours;
    for (const Label& label : labels.labels) {
        const auto known =
            std::find_if(std::begin(kColours), std::end(kColours),
                         [&](const TissueColour& c) { return c.tissue == label.tissue; });
        colours.push_back(known != std::end(kColours) ? known->colour : label.colour);
    }
    return colours;
}

using Pixels = std::vector<std::uint8_t>;  // RGB, rows from the top down

// An axial plane of the mannequin, turned so that the patient's axes are those of the page: right
// to the left, front up.
struct Plane {
    Point3 middle;
    Vector3 across, up, normal;  // unit, mannequin
    double mm_per_px = 1;
    Point3 place(double x, double y) const {
        return middle + ((x - 0.5 * kPanelWidth) * mm_per_px * across +
                         (0.5 * kPanelHeight - y) * mm_per_px * up);
    }
};

std::uint8_t label_at(const LabelVolume& labels, Point3 ct) {
    const Point3 v = labels.grid.voxel_from_point(ct);
    const int i = static_cast<int>(std::lround(v.x)), j = static_cast<int>(std::lround(v.y)),
              k = static_cast<int>(std::lround(v.z));
    return labels.grid.contains(i, j, k) ? labels.voxels[labels.grid.index(i, j, k)] : 0;
}

void put(Pixels& page, int width, int x, int y, std::array<std::uint8_t, 3> colour) {
    std::copy(colour.begin(), colour.end(),
              page.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * width + x));
}

// Draws a cut through the labels. ct_of(p, &ct): the point of the CT that lies at the place p of
// the mannequin; false if there is none.
template <class CtOf>
void draw_cut(const LabelVolume& labels,
              const Plane& plane,
              const std::vector<Point3>& readings,
              const PointIndex& index,
              const CtOf& ct_of,
              int left,
              int top,
              int width,
              Pixels& page) {
    std::vector<std::uint8_t> cut(kPanelWidth * kPanelHeight, 0);
    parallel_for(kPanelHeight, 8, [&](std::size_t begin, std::size_t end) {
        for (std::size_t y = begin; y < end; ++y) {
            for (std::size_t x = 0; x < kPanelWidth; ++x) {
                Point3 ct;
                if (ct_of(plane.place(static_cast<double>(x), static_cast<double>(y)), &ct))
                    cut[x + kPanelWidth * y] = label_at(labels, ct);
            }
        }
    });
    const auto colours = colours_of(labels);
    const auto at = [&](int x, int y) {
        return x < 0 || y < 0 || x >= kPanelWidth || y >= kPanelHeight
                   ? 0
                   : static_cast<int>(cut[x + kPanelWidth * y]);
    };
    for (int y = 0; y < kPanelHeight; ++y) {
        for (int x = 0; x < kPanelWidth; ++x) {
            const int label = at(x, y);
            std::array<std::uint8_t, 3> colour{20, 20, 24};
            if (label > 0) colour = colours[label];
            const bool border = at(x + 1, y) != label || at(x, y + 1) != label;
            if (border && label > 0) {
                for (std::uint8_t& c : colour) c = static_cast<std::uint8_t>(c * 0.45);
            }
            const bool skin = (label == 0) != (at(x + 1, y) == 0 && at(x, y + 1) == 0) &&
                              (label == 0 || at(x + 1, y) == 0 || at(x, y + 1) == 0);
            if (skin) {
                double d2 = 0;
                index.nearest(plane.place(x, y), &d2);
                colour = d2 > kNotFittedMm * kNotFittedMm ? kUnfitted : kFitted;
            }
            put(page, width, left + x, top + y, colour);
        }
    }
    for (const Point3 p : readings) {
        const Vector3 d = p - plane.middle;
        if (std::abs(dot(d, plane.normal)) > kNearMm) continue;
        const int x = static_cast<int>(
            std::lround(0.5 * kPanelWidth + dot(d, plane.across) / plane.mm_per_px));
        const int y =
            static_cast<int>(std::lround(0.5 * kPanelHeight - dot(d, plane.up) / plane.mm_per_px));
        for (int v = y - 1; v <= y + 1; ++v) {
            for (int u = x - 1; u <= x + 1; ++u) {
                if (u >= 0 && v >= 0 && u < kPanelWidth && v < kPanelHeight)
                    put(page, width, left + u, top + v, kReading);
            }
        }
    }
}

void write(Canvas& canvas, const std::string& words, double x, double y, bool alarm, bool right) {
    canvas.text(
        words, {x, y + 2},
        {.colour = alarm ? kAlarm : kInk, .anchor = right ? TextAnchor::end : TextAnchor::start});
}

// The rows of the table: all bones together, solid organs, then the others from the largest.
std::vector<OrganChange> rows_of(const std::vector<OrganChange>& changes) {
    std::vector<OrganChange> rows, others;
    const OrganChange bones = joint_change(changes, "all bones", is_bone);
    if (bones.before_ml > 0) rows.push_back(bones);
    for (const OrganChange& c : changes) {
        if (c.before_ml > 0) (is_solid_organ(c.tissue) ? rows : others).push_back(c);
    }
    std::stable_sort(others.begin(), others.end(), [](const OrganChange& a, const OrganChange& b) {
        return a.before_ml > b.before_ml;
    });
    rows.insert(rows.end(), others.begin(), others.end());
    return rows;
}

void draw_table(const std::vector<OrganChange>& changes, Canvas& canvas) {
    const double left = 2 * kPanelWidth + 16;
    double y = canvas.height() - 20;
    const auto row = [&](const std::string& name, const std::string& before,
                         const std::string& after, const std::string& change,
                         const std::string& shape, bool alarm) {
        write(canvas, name, left, y, alarm, false);
        write(canvas, before, left + 260, y, alarm, true);
        write(canvas, after, left + 320, y, alarm, true);
        write(canvas, change, left + 385, y, alarm, true);
        write(canvas, shape, left + 440, y, alarm, true);
        y -= kRow;
    };
    row("structure", "ml before", "after", "volume", "shape", false);
    for (const OrganChange& c : rows_of(changes)) {
        if (y < kRow) break;
        const bool watched = is_bone(c.tissue) || is_solid_organ(c.tissue) || c.tissue.empty();
        const bool alarm =
            watched && c.before_ml >= kMinOrganMl &&
            (std::abs(c.volume_ratio - 1) > kVolumeTolerance || c.shape_change > kShapeTolerance);
        row(c.label, text("%.0f", c.before_ml), text("%.0f", c.before_ml * c.volume_ratio),
            text("%+.0f %%", 100 * (c.volume_ratio - 1)), text("%.2f", c.shape_change), alarm);
    }
}

}  // namespace

Status write_organ_pictures(const LabelVolume& labels,
                            const Surface& mannequin,
                            const Registration& registration,
                            const std::vector<OrganChange>& changes,
                            const std::string& folder) {
    const int width = 2 * kPanelWidth + kTable, height = kCuts * (kPanelHeight + kTitle);
    Canvas canvas(width, height);
    const CanvasPoint corners[] = {
        {0, 0}, {1.0 * width, 0}, {1.0 * width, 1.0 * height}, {0, 1.0 * height}};
    canvas.fill(corners, {248, 248, 248, 255});
    draw_table(changes, canvas);
    const Matrix3& turn = registration.mannequin_from_ct.rotation;
    const Rigid back = inverse(registration.mannequin_from_ct);
    const InverseMap map(registration);
    const PointIndex index(mannequin.points);
    const Vector3 e = registration.ct_box.extent();
    const double share[kCuts] = {0.75, 0.5, 0.25};
    std::vector<Plane> planes;
    for (int n = 0; n < kCuts; ++n) {
        Point3 ct = registration.ct_box.centre();
        ct.z = registration.ct_box.lower.z + share[n] * e.z;
        Plane plane;
        plane.middle = mannequin_from_ct(registration, ct);
        plane.across = turn.column(0);
        plane.up = turn.column(1);
        plane.normal = turn.column(2);
        plane.mm_per_px = std::max(1.15 * e.x / kPanelWidth, 1.15 * e.y / kPanelHeight);
        planes.push_back(plane);
        const double y = height - n * (kPanelHeight + kTitle) - kTitle + 7;
        write(canvas, text("before, %.0f %% of the height: laid on rigidly", 100 * share[n]), 8, y,
              false, false);
        write(canvas, n == 0 ? "after; cyan: readings; orange: skin that was not fitted" : "after",
              kPanelWidth + 8, y, false, false);
    }
    Pixels page = canvas.rgb();
    for (int n = 0; n < kCuts; ++n) {
        const int top = n * (kPanelHeight + kTitle) + kTitle;
        const Plane& plane = planes[n];
        const auto rigid = [&](Point3 p, Point3* ct) {
            *ct = back * p;
            return true;
        };
        const auto fitted = [&](Point3 p, Point3* ct) {
            return map.invert(p, ct) == MapStatus::ok;
        };
        draw_cut(labels, plane, mannequin.points, index, rigid, 0, top, width, page);
        draw_cut(labels, plane, mannequin.points, index, fitted, kPanelWidth, top, width, page);
    }
    const std::vector<std::uint8_t> png = png_from_rgb(page.data(), width, height);
    return write_file(folder + "/fit_organs.png", png);
}

}  // namespace sonocase::pipeline::inline registration
