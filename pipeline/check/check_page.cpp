// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "formats/bundle/attribution.h"
#include "pipeline/aim/exercise_targets.h"
#include "pipeline/check/check_case.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline {
namespace {

constexpr const char* kHead =
    "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Check</title><style>"
    "body{font:15px/1.5 sans-serif;max-width:70em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse}td,th{padding:.15em .8em;text-align:left;"
    "border-bottom:1px solid #ddd}.bad{color:#a00;font-weight:bold}.good{color:#060}"
    "img{image-rendering:pixelated;max-width:32%;border:1px solid #888;background:#000}"
    "</style></head><body>";

std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, value < 10 ? "%.1f" : "%.0f", value);
    return text;
}

std::string picture(const char* alt, const std::vector<std::uint8_t>& png) {
    return std::string("<img alt=\"") + alt + "\" src=\"data:image/png;base64," + base64(png) +
           "\">";
}

// Organs and bones from the front, the right and the back, targets as white dots.
std::string views(const CaseBundle& bundle, const CheckResult& result) {
    Vector3 forwards = result.forwards, up = result.up;
    if (!(norm(up) > 0)) {  // nothing tells: the grid's own axes
        forwards = {0, 1, 0};
        up = {0, 0, 1};
    }
    std::vector<Point3> marks;
    for (const NamedTarget& target : exercise_targets(bundle)) marks.push_back(target.centre);
    const Vector3 right = cross(forwards, up);
    const std::pair<const char*, Vector3> from[] = {
        {"from the front", -forwards}, {"from the right", -right}, {"from the back", forwards}};
    std::string out;
    for (const auto& [alt, along] : from) {
        const BodyView view = body_view(bundle, along, up, marks);
        out += picture(alt, png_from_rgb(view.rgb.data(), view.width_px, view.height_px)) + " ";
    }
    return out;
}

// A plane through the middle of the volume, labels in their colours; axis: the one it is across.
std::string plane(const CaseBundle& bundle, int axis) {
    const Int3 size = bundle.grid.size;
    const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    const int width = size[u], height = size[v];
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3) * static_cast<std::size_t>(width) *
                                  static_cast<std::size_t>(height));
    std::size_t at = 0;
    for (int y = height - 1; y >= 0; --y)
        for (int x = 0; x < width; ++x) {
            Int3 p;
            p[axis] = size[axis] / 2;
            p[u] = x;
            p[v] = y;
            const Label& label = bundle.labels[bundle.label_bricks.at(p.x, p.y, p.z)];
            for (const std::uint8_t c : label.colour) rgb[at++] = c;
        }
    return picture("plane", png_from_rgb(rgb.data(), width, height));
}

std::string row(std::initializer_list<std::string> cells) {
    std::string out = "<tr>";
    for (const std::string& cell : cells) out += "<td>" + cell + "</td>";
    return out + "</tr>";
}

}  // namespace

std::string check_page(const CaseBundle& bundle, const CheckResult& result) {
    std::string page = kHead;
    page += "<h1>" + escaped_html(bundle.manifest.case_name) + "</h1>";
    if (result.faults.empty())
        page += "<p class=\"good\">No fault found.</p>";
    else
        page += "<h2>Faults</h2><table><tr><th>fault</th><th>found</th><th>do</th></tr>";
    for (const Fault& fault : result.faults)
        page += row({"<span class=\"bad\">" + escaped_html(fault.name) + "</span>",
                     escaped_html(fault.what), escaped_html(fault.remedy)});
    if (!result.faults.empty()) page += "</table>";
    page += "<h2>Planes through the middle</h2><p>" + plane(bundle, 0) + " " + plane(bundle, 1) +
            " " + plane(bundle, 2) + "</p>";
    page +=
        "<h2>In space</h2><p>" + views(bundle, result) +
        "</p><p>From the front, the right and the back, without skin, fat and muscle; targets are "
        "white dots. Ribs: " +
        std::to_string(result.ribs_right) + " on the right, " + std::to_string(result.ribs_left) +
        " on the left.</p>";
    page +=
        "<h2>Targets</h2><table><tr><th>exercise</th><th>target</th><th>windows</th>"
        "<th>depth, mm</th><th>blocked</th><th>needle passes</th><th>of it seen</th></tr>";
    for (const TargetRow& t : result.targets)
        page += row({escaped_html(t.exercise), escaped_html(t.target), std::to_string(t.windows),
                     number(t.depth_mm), number(100 * t.blocked) + " %", t.needle ? "yes" : "no",
                     number(100 * t.visible) + " %"});
    page +=
        "</table><h2>Exercises, played by a script through the first windows</h2>"
        "<table><tr><th>exercise</th><th>passed</th><th>missed</th></tr>";
    for (const ExerciseRow& exercise : result.exercises) {
        std::string missed;
        for (const std::string& mark : exercise.missed)
            missed += (missed.empty() ? "" : ", ") + mark;
        page += row({escaped_html(exercise.exercise),
                     !exercise.played          ? "not played"
                     : exercise.missed.empty() ? "yes"
                                               : "<span class=\"bad\">no</span>",
                     escaped_html(missed)});
    }
    page += "</table><h2>Structures</h2><table><tr><th>label</th><th>ml</th><th>normal</th></tr>";
    for (const OrganRow& organ : result.organs) {
        const bool odd = organ.high_ml > 0 && (organ.ml < organ.low_ml || organ.ml > organ.high_ml);
        page +=
            row({escaped_html(organ.label),
                 (odd ? "<span class=\"bad\">" : "<span>") + number(organ.ml) + "</span>",
                 organ.high_ml > 0 ? number(organ.low_ml) + " to " + number(organ.high_ml) : ""});
    }
    page += "</table><h2>Remarks</h2><ul>";
    for (const std::string& remark : result.remarks)
        page += "<li>" + escaped_html(remark) + "</li>";
    page += "</ul>";
    if (const std::string text = attribution_of(bundle); !text.empty())
        page += "<p><small>" + escaped_html(text) + "</small></p>";
    return page + "</body></html>\n";
}

}  // namespace sonocase::pipeline
