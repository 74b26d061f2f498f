// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <utility>

#include "formats/base/base64.h"
#include "formats/bundle/case_bundle.h"
#include "formats/text/number_text.h"
#include "pipeline/base/parallel.h"
#include "pipeline/check/case_labels.h"
#include "pipeline/check/check_case.h"
#include "pipeline/export/accuracy_picture.h"
#include "pipeline/export/error_budget.h"
#include "pipeline/pictures/markup.h"
#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline check {

extern const std::string_view kCheckPageHtml;  // check_page.html, embedded by CMake

namespace {

constexpr double kAmbient = 0.25;
constexpr std::size_t kShownPlaces = 12;  // a longer list of structures is folded up

// The labels that are drawn: everything but the covers of the body.
std::vector<std::uint8_t> seen_labels(const CaseLabels& labels) {
    std::vector<std::uint8_t> seen;
    for (std::size_t l = 0; l < labels.bundle().labels.size(); ++l) {
        const int label = static_cast<int>(l);
        const TissueKind kind = labels.kind(label);
        seen.push_back(kind != TissueKind::outside && !labels.is_plain(label) &&
                       !labels.is_skin(label));
    }
    return seen;
}

// The view without the white margin around it.
BodyView cropped(const BodyView& view) {
    int left = view.width_px, right = -1, top = view.height_px, bottom = -1;
    const auto at = [&](int x, int y) {
        return view.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(y * view.width_px + x);
    };
    for (int y = 0; y < view.height_px; ++y)
        for (int x = 0; x < view.width_px; ++x) {
            if (std::all_of(at(x, y), at(x, y) + 3, [](int c) { return c == 255; })) continue;
            left = std::min(left, x);
            right = std::max(right, x);
            top = std::min(top, y);
            bottom = std::max(bottom, y);
        }
    if (right < left) return view;
    BodyView out{right - left + 1, bottom - top + 1, {}};
    for (int y = top; y <= bottom; ++y)
        out.rgb.insert(out.rgb.end(), at(left, y), at(right, y) + 3);
    return out;
}

}  // namespace

// Casts one ray per pixel in steps of a voxel. The shade follows the slope of the surface, found
// from the drawn voxels around the point.
BodyView body_view(const CaseBundle& bundle,
                   Vector3 along,
                   Vector3 up,
                   const std::vector<Point3>& marks,
                   int height_px) {
    const CaseLabels labels(bundle);
    const std::vector<std::uint8_t> seen = seen_labels(labels);
    const Vector3 right = cross(along, up);
    const Box3 box = bundle.grid.bounds();
    const Point3 middle = box.centre();
    double half_u = 0, half_v = 0, half_d = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vector3 c =
            Point3{corner & 1 ? box.upper.x : box.lower.x, corner & 2 ? box.upper.y : box.lower.y,
                   corner & 4 ? box.upper.z : box.lower.z} -
            middle;
        half_u = std::max(half_u, std::abs(dot(c, right)));
        half_v = std::max(half_v, std::abs(dot(c, up)));
        half_d = std::max(half_d, std::abs(dot(c, along)));
    }
    BodyView view;
    const double mm = 2 * half_v / height_px;  // per pixel
    view.height_px = height_px;
    view.width_px = std::max(1, static_cast<int>(2 * half_u / mm));
    view.rgb.assign(3 * view.width_px * view.height_px, 255);
    const double step = labels.voxel_mm();
    const auto solid = [&](Point3 p) { return seen[labels.label(p)] ? 1.0 : 0.0; };
    const auto draw_row = [&](int y) {
        for (int x = 0; x < view.width_px; ++x) {
            const Point3 pixel = middle + (x * mm - half_u) * right + (half_v - y * mm) * up;
            std::uint8_t* const out = &view.rgb[3 * (y * view.width_px + x)];
            bool body = false;
            for (double t = -half_d; t <= half_d; t += step) {
                const Point3 p = pixel + t * along;
                const int label = labels.label(p);
                body = body || label != 0;
                if (!seen[label]) continue;
                Vector3 inwards;
                for (const double r : {1.0, 2.0, 3.0})
                    for (int axis = 0; axis < 3; ++axis) {
                        Vector3 off;
                        off[axis] = r * step;
                        inwards[axis] += solid(p + off) - solid(p - off);
                    }
                const double facing = std::abs(dot(normalized(inwards), along));
                const double light = kAmbient + (1 - kAmbient) * facing;
                const auto& colour = bundle.labels[label].colour;
                for (int c = 0; c < 3; ++c)
                    out[c] = static_cast<std::uint8_t>(light * colour[c] + 0.5);
                break;
            }
            if (body && out[0] == 255 && out[1] == 255 && out[2] == 255)
                std::fill(out, out + 3, std::uint8_t{225});  // only covers lie here
        }
    };
    parallel_for(static_cast<std::size_t>(view.height_px), 16,
                 [&](std::size_t begin, std::size_t end) {
                     for (std::size_t y = begin; y < end; ++y) draw_row(static_cast<int>(y));
                 });
    for (const Point3 mark : marks) {
        const Vector3 off = mark - middle;
        const int u = static_cast<int>(std::lround((dot(off, right) + half_u) / mm));
        const int v = static_cast<int>(std::lround((half_v - dot(off, up)) / mm));
        for (int y = v - 4; y <= v + 4; ++y)
            for (int x = u - 4; x <= u + 4; ++x) {
                const int r2 = (x - u) * (x - u) + (y - v) * (y - v);
                if (r2 > 18 || x < 0 || y < 0 || x >= view.width_px || y >= view.height_px)
                    continue;
                std::uint8_t* const out = &view.rgb[3 * (y * view.width_px + x)];
                std::fill(out, out + 3, r2 > 8 ? std::uint8_t{0} : std::uint8_t{255});
            }
    }
    return cropped(view);
}

namespace {

const HtmlTemplate& html() {
    static const HtmlTemplate page(kCheckPageHtml);
    return page;
}

std::string figure(double value) {
    return fixed_text(value, value < 10 ? 1 : 0);
}

std::string picture(const char* alt, const std::vector<std::uint8_t>& png) {
    return html().filled("picture", {{"alt", alt}, {"png", base64(png)}});
}

// Organs and bones from the front, the right and the back, targets as white dots.
std::string views(const CaseBundle& bundle, const CheckResult& result) {
    Vector3 forwards = result.forwards, up = result.up;
    if (!(norm(up) > 0)) {  // unknown: the grid's own axes
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
        out += picture(alt, png_from_rgb(view.rgb.data(), view.width_px, view.height_px));
    }
    return out;
}

// A plane through the middle of the volume at right angles to `axis`, labels in their colours.
using Colours = std::vector<std::array<std::uint8_t, 3>>;  // # labels
enum class Borders { plain, drawn };                       // a dark line between structures
std::string plane(const CaseBundle& bundle, int axis, const Colours& colours, Borders borders) {
    const Int3 size = bundle.grid.size;
    const int u = axis == 0 ? 1 : 0, v = axis == 2 ? 1 : 2;
    const int width = size[u], height = size[v];
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3) * width * height);
    std::size_t at = 0;
    for (int y = height - 1; y >= 0; --y)
        for (int x = 0; x < width; ++x) {
            Int3 p;
            p[axis] = size[axis] / 2;
            p[u] = x;
            p[v] = y;
            const auto label = [&](Int3 q) { return bundle.label_bricks.at(q.x, q.y, q.z); };
            bool border = false;
            for (const int along : {u, v}) {
                Int3 next = p;
                if (++next[along] < size[along]) border = border || label(next) != label(p);
            }
            const bool dark = border && borders == Borders::drawn;
            for (const std::uint8_t c : colours[label(p)]) rgb[at++] = dark ? std::uint8_t{40} : c;
        }
    return picture("plane", png_from_rgb(rgb.data(), width, height));
}

std::string planes(const CaseBundle& bundle, const Colours& colours, Borders borders) {
    return plane(bundle, 0, colours, borders) + plane(bundle, 1, colours, borders) +
           plane(bundle, 2, colours, borders);
}

Colours own_colours(const CaseBundle& bundle) {
    Colours colours;
    for (const Label& label : bundle.labels)
        colours.push_back({label.colour[0], label.colour[1], label.colour[2]});
    return colours;
}

// The darker, the less is known of a structure's place.
struct Step {
    double to_mm;
    const char* words;
    std::array<std::uint8_t, 3> colour;
};
constexpr Step kSteps[] = {
    {2, "within 2 mm", {255, 250, 220}}, {5, "2 to 5 mm", {254, 227, 150}},
    {10, "5 to 10 mm", {253, 190, 90}},  {20, "10 to 20 mm", {243, 140, 60}},
    {40, "20 to 40 mm", {222, 85, 60}},  {60, "40 to 60 mm", {190, 45, 95}},
    {80, "60 to 80 mm", {140, 40, 130}}, {1e9, "more than 80 mm", {85, 45, 130}}};

const Step& step_of(double mm) {
    return *std::find_if(std::begin(kSteps), std::end(kSteps),
                         [mm](const Step& step) { return !(mm >= step.to_mm); });
}

// Planes coloured by how far from its place each structure may lie, and the figures.
std::string unknown_part(const CaseBundle& bundle) {
    const std::vector<UnknownPlace> places = unknown_places_of_case(bundle);
    if (places.empty()) return "";
    Colours colours(bundle.labels.size(), {150, 150, 150});  // a structure of later stages
    colours[0] = {255, 255, 255};
    std::string rows, legend;
    for (const UnknownPlace& place : places) {
        for (std::size_t l = 1; l < bundle.labels.size(); ++l)
            if (bundle.labels[l].name == place.label) colours[l] = step_of(place.p90_mm).colour;
        rows += html().filled(
            "unknown_row",
            {{"label", escaped_html(place.label + (place.target ? " (has a target)" : ""))},
             {"mm", figure(place.p90_mm)},
             {"held", place.with_landmarks_mm > 0 ? figure(place.with_landmarks_mm) : ""}});
    }
    for (const Step& step : kSteps)
        legend += html().filled(
            "step", {{"rgb", std::to_string(step.colour[0]) + "," + std::to_string(step.colour[1]) +
                                 "," + std::to_string(step.colour[2])},
                     {"words", step.words}});
    std::string advice = landmark_advice(places);
    if (!advice.empty()) advice[0] = static_cast<char>(std::toupper(advice[0])), advice += ".";
    return html().filled("unknown", {{"planes", planes(bundle, colours, Borders::drawn)},
                                     {"legend", legend},
                                     {"advice", escaped_html(advice)},
                                     {"open", places.size() <= kShownPlaces ? " open" : ""},
                                     {"count", std::to_string(places.size())},
                                     {"rows", rows}});
}

// Where the millimetres of the case come from.
std::string accuracy_part(const CaseBundle& bundle, const std::vector<CasePoint>& points) {
    const CaseAccuracy accuracy = case_accuracy(bundle, points);
    if (accuracy.budget.entries.empty()) return "";
    return html().filled("accuracy", {{"svg", accuracy_svg(accuracy)},
                                      {"summary", escaped_html(accuracy_summary(accuracy))}});
}

std::string faults_part(const CheckResult& result) {
    if (result.faults.empty()) return html().filled("no_fault", {});
    std::string rows;
    for (const Fault& fault : result.faults)
        rows += html().filled("fault", {{"name", escaped_html(fault.name)},
                                        {"what", escaped_html(fault.what)},
                                        {"remedy", escaped_html(fault.remedy)}});
    return html().filled("faults", {{"rows", rows}});
}

std::string target_rows(const CaseBundle& bundle, const CheckResult& result) {
    std::string rows;
    const std::vector<UnknownPlace> places = unknown_places(bundle.manifest.stages);
    const auto within = [&](const std::string& label) {
        for (const UnknownPlace& place : places)
            if (place.label == label) return figure(place.p90_mm);
        return std::string();
    };
    for (const TargetRow& t : result.targets)
        rows += html().filled("target", {{"exercise", escaped_html(t.exercise)},
                                         {"target", escaped_html(t.target)},
                                         {"windows", std::to_string(t.windows)},
                                         {"depth", figure(t.depth_mm)},
                                         {"blocked", figure(100 * t.blocked)},
                                         {"needle", t.needle ? "yes" : "no"},
                                         {"visible", figure(100 * t.visible)},
                                         {"within", within(t.inside)}});
    return rows;
}

std::string exercise_rows(const CheckResult& result) {
    std::string rows;
    for (const ExerciseRow& exercise : result.exercises) {
        std::string missed;
        for (const std::string& mark : exercise.missed)
            missed += (missed.empty() ? "" : ", ") + mark;
        const bool failed = exercise.played && !exercise.missed.empty();
        rows += html().filled("exercise", {{"exercise", escaped_html(exercise.exercise)},
                                           {"class", failed ? "bad" : ""},
                                           {"passed", !exercise.played ? "not played"
                                                      : failed         ? "no"
                                                                       : "yes"},
                                           {"missed", escaped_html(missed)}});
    }
    return rows;
}

std::string organ_rows(const CheckResult& result) {
    std::string rows;
    for (const OrganRow& organ : result.organs) {
        const bool known = organ.high_ml > 0;
        const bool odd = known && (organ.ml < organ.low_ml || organ.ml > organ.high_ml);
        rows += html().filled(
            "organ",
            {{"label", escaped_html(organ.label)},
             {"class", odd ? "bad" : ""},
             {"ml", figure(organ.ml)},
             {"normal", known ? figure(organ.low_ml) + " to " + figure(organ.high_ml) : ""}});
    }
    return rows;
}

}  // namespace

std::string check_page(const CaseBundle& bundle,
                       const CheckResult& result,
                       const std::vector<CasePoint>& points) {
    std::string remarks;
    for (const std::string& remark : result.remarks)
        remarks += html().filled("remark", {{"text", escaped_html(remark)}});
    const std::string source = attribution_of(bundle);
    return html().filled(
        "page",
        {{"case", escaped_html(bundle.manifest.case_name)},
         {"faults", faults_part(result)},
         {"planes", planes(bundle, own_colours(bundle), Borders::plain)},
         {"accuracy", accuracy_part(bundle, points)},
         {"unknown", unknown_part(bundle)},
         {"views", views(bundle, result)},
         {"ribs_right", std::to_string(result.ribs_right)},
         {"ribs_left", std::to_string(result.ribs_left)},
         {"targets", target_rows(bundle, result)},
         {"exercises", exercise_rows(result)},
         {"organs", organ_rows(result)},
         {"remarks", remarks},
         {"attribution",
          source.empty() ? "" : html().filled("attribution", {{"text", escaped_html(source)}})}});
}

}  // namespace sonocase::pipeline::inline check
