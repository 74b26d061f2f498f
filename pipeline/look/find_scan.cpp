// SPDX-License-Identifier: Apache-2.0

#include "pipeline/look/find_scan.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/base/constants.h"
#include "formats/image_scores/smooth.h"
#include "formats/text/json_reader.h"

namespace sonocase::pipeline::inline look {

namespace {

constexpr double kInlierPx = 1.5;

struct EdgePoint {
    double x, y;
};
// x = at + slope y; support: how many points lie on it.
struct EdgeLine {
    double at = 0, slope = 0;
    int support = 0;
};

// The grey of the picture's surroundings: the most common one along its border.
int background_of(const FramePile& pile) {
    std::array<int, 256> count{};
    for (int x = 0; x < pile.width_px; ++x) {
        ++count[pile.highest[pile.index(x, 0)]];
        ++count[pile.highest[pile.index(x, pile.height_px - 1)]];
    }
    for (int y = 0; y < pile.height_px; ++y) {
        ++count[pile.highest[pile.index(0, y)]];
        ++count[pile.highest[pile.index(pile.width_px - 1, y)]];
    }
    const auto most = std::max_element(count.begin(), count.end());
    // A scan that fills its picture has no surroundings; they are taken as black.
    return *most * 4 > 2 * (pile.width_px + pile.height_px) ? static_cast<int>(most - count.begin())
                                                            : 0;
}

// The large connected places of the mask; smaller ones (text, bars) are cleared. 8 neighbours, and
// gaps of one pixel are bridged.
void keep_large_places(std::vector<std::uint8_t>& mask, const FramePile& pile) {
    std::vector<int> place(mask.size(), -1);
    std::vector<std::size_t> sizes, stack;
    for (std::size_t start = 0; start < mask.size(); ++start) {
        if (!mask[start] || place[start] >= 0) continue;
        const int number = static_cast<int>(sizes.size());
        sizes.push_back(0);
        stack.push_back(start);
        place[start] = number;
        while (!stack.empty()) {
            const auto i = static_cast<int>(stack.back());
            stack.pop_back();
            ++sizes.back();
            const int x = i % pile.width_px, y = i / pile.width_px;
            for (int v = std::max(y - 2, 0); v <= std::min(y + 2, pile.height_px - 1); ++v) {
                for (int u = std::max(x - 2, 0); u <= std::min(x + 2, pile.width_px - 1); ++u) {
                    const std::size_t j = pile.index(u, v);
                    if (!mask[j] || place[j] >= 0) continue;
                    place[j] = number;
                    stack.push_back(j);
                }
            }
        }
    }
    if (sizes.empty()) return;
    const std::size_t largest = *std::max_element(sizes.begin(), sizes.end());
    for (std::size_t i = 0; i < mask.size(); ++i) {
        if (mask[i] && sizes[place[i]] * 8 < largest) mask[i] = 0;
    }
}

// The line on which most points lie with none beyond it. `outward` -1: nothing may lie at smaller x
// (left side); +1: at greater x. Every pair of some 120 points is tried.
EdgeLine supporting_line(const std::vector<EdgePoint>& points, int outward) {
    EdgeLine best;
    const std::size_t step = std::max<std::size_t>(points.size() / 120, 1);
    for (std::size_t i = 0; i < points.size(); i += step) {
        for (std::size_t j = i + 8; j < points.size(); j += step) {
            const double slope = (points[j].x - points[i].x) / (points[j].y - points[i].y);
            if (std::abs(slope) > 30) continue;
            const double at = points[i].x - slope * points[i].y;
            const double scale = 1 / std::sqrt(1 + slope * slope);
            int support = 0, beyond = 0;
            for (const EdgePoint& p : points) {
                const double distance = (p.x - at - slope * p.y) * scale * outward;
                support += std::abs(distance) <= kInlierPx;
                beyond += distance > 2 * kInlierPx;
            }
            support -= 2 * beyond;
            if (support > best.support) best = {at, slope, support};
        }
    }
    // Least squares over the points that lie on it.
    double n = 0, sx = 0, sy = 0, sxy = 0, syy = 0;
    for (const EdgePoint& p : points) {
        const double scale = 1 / std::sqrt(1 + best.slope * best.slope);
        if (std::abs(p.x - best.at - best.slope * p.y) * scale > kInlierPx) continue;
        n += 1;
        sx += p.x;
        sy += p.y;
        sxy += p.x * p.y;
        syy += p.y * p.y;
    }
    const double spread = n * syy - sy * sy;
    if (n >= 2 && spread > 0) {
        best.slope = (n * sxy - sx * sy) / spread;
        best.at = (sx - best.slope * sy) / n;
    }
    return best;
}

struct Sides {
    std::vector<EdgePoint> left, right;  // first and last echo of each row
    int rows = 0;
};

Sides sides_of(const std::vector<std::uint8_t>& mask, const FramePile& pile) {
    Sides sides;
    for (int y = 0; y < pile.height_px; ++y) {
        int first = 0, last = pile.width_px - 1;
        while (first <= last && !mask[pile.index(first, y)]) ++first;
        while (last > first && !mask[pile.index(last, y)]) --last;
        if (first > last) continue;
        ++sides.rows;
        if (first > 1) sides.left.push_back({first - 0.5, static_cast<double>(y)});
        if (last < pile.width_px - 2) sides.right.push_back({last + 0.5, static_cast<double>(y)});
    }
    return sides;
}

Error no_sides() {
    return {"no fan or rectangle of echoes is found in the pictures", "",
            "give its place with --geometry FILE.json"};
}

// A side is a line over a quarter of the picture's height; round outlines have shorter ones.
bool is_long(const EdgeLine& line, const FramePile& pile) {
    return line.support * std::sqrt(1 + line.slope * line.slope) > 0.25 * pile.height_px;
}

Result<FoundScan> linear_scan(const std::vector<std::uint8_t>& mask,
                              const FramePile& pile,
                              double left,
                              double right) {
    std::vector<double> tops, bottoms;
    for (int x = std::max(static_cast<int>(left) + 2, 0);
         x < std::min(static_cast<int>(right) - 1, pile.width_px); ++x) {
        int first = 0, last = pile.height_px - 1;
        while (first <= last && !mask[pile.index(x, first)]) ++first;
        while (last > first && !mask[pile.index(x, last)]) --last;
        if (first > last) continue;
        tops.push_back(first);
        bottoms.push_back(last + 1);
    }
    if (tops.size() < 32) return no_sides();
    FoundScan scan;
    scan.fan = false;
    scan.apex_x_px = 0.5 * (left + right);
    scan.apex_y_px = quantile_of(tops, 0.25) - 0.5;
    scan.width_px = right - left;
    scan.depth_px = quantile_of(bottoms, 0.75) - 0.5 - scan.apex_y_px;
    return scan;
}

// First and last echo along rays from the apex.
void measure_radii(const std::vector<std::uint8_t>& mask, const FramePile& pile, FoundScan& scan) {
    std::vector<double> inner, outer, cut;
    const double reach = std::hypot(pile.width_px, pile.height_px) + std::abs(scan.apex_y_px);
    for (int i = -45; i <= 45; ++i) {
        const double angle = scan.half_angle_rad * i / 50;
        double first = -1, last = -1;
        bool at_border = false;
        for (double r = 0; r < reach; r += 0.5) {
            const int x = static_cast<int>(std::lround(scan.apex_x_px + std::sin(angle) * r)),
                      y = static_cast<int>(std::lround(scan.apex_y_px + std::cos(angle) * r));
            if (x < 0 || y < 0 || x >= pile.width_px || y >= pile.height_px) continue;
            if (!mask[pile.index(x, y)]) continue;
            if (first < 0) first = r;
            last = r;
            at_border = x <= 1 || x >= pile.width_px - 2 || y >= pile.height_px - 2;
        }
        if (first < 0) continue;
        inner.push_back(first);
        (at_border ? cut : outer).push_back(last);
    }
    scan.radius_px = inner.empty() ? 0 : quantile_of(inner, 0.25);
    double end = outer.size() >= 5 ? quantile_of(outer, 0.75) : 0;
    if (!cut.empty()) end = std::max(end, *std::max_element(cut.begin(), cut.end()));
    scan.depth_px = end - scan.radius_px;
    if (outer.size() < 5) {
        scan.warnings.push_back(
            "The picture cuts the fan at every depth: its end is taken where the picture ends. "
            "Give the geometry if it is known.");
    }
}

}  // namespace

Result<FoundScan> find_scan(const FramePile& pile, const std::vector<std::uint8_t>& burnt) {
    // The mean is used because compression artefacts ring beyond the edges of a single bright
    // frame. Pixels that move are echoes even where they are dark on average.
    constexpr int kOverBackground = 3, kMoves = 40;
    const int background = background_of(pile);
    std::vector<std::uint8_t> mask(pile.highest.size());
    std::size_t echoes = 0;
    for (std::size_t i = 0; i < mask.size(); ++i) {
        mask[i] = !burnt[i] && (pile.mean[i] > static_cast<float>(background + kOverBackground) ||
                                pile.highest[i] - pile.lowest[i] > kMoves);
        echoes += mask[i];
    }
    if (echoes * 100 < mask.size()) {
        if (background > 40)
            return Error{"the pictures are one even grey of " + std::to_string(background), "",
                         "expected frames that show a scan on black"};
        return Error{"the pictures are black", "", "expected frames that show a scan"};
    }
    keep_large_places(mask, pile);
    const Sides sides = sides_of(mask, pile);
    // A picture without surroundings at its sides is a linear scan that fills it.
    const bool open_left = static_cast<int>(sides.left.size()) * 10 < sides.rows,
               open_right = static_cast<int>(sides.right.size()) * 10 < sides.rows;
    if (open_left && open_right) {
        auto scan = linear_scan(mask, pile, -0.5, pile.width_px - 0.5);
        if (scan) scan->edge_share = 1;
        return scan;
    }
    const EdgeLine left = supporting_line(sides.left, -1), right = supporting_line(sides.right, 1);
    if ((!open_left && !is_long(left, pile)) || (!open_right && !is_long(right, pile)))
        return no_sides();
    const double upright = 0.03;  // 2 degrees
    const bool left_upright = open_left || std::abs(left.slope) < upright,
               right_upright = open_right || std::abs(right.slope) < upright;
    const double middle_y = pile.height_px / 2.0;
    const double share =
        static_cast<double>(left.support + right.support) /
        static_cast<double>(std::max<std::size_t>(sides.left.size() + sides.right.size(), 1));
    if (left_upright && right_upright) {
        auto scan =
            linear_scan(mask, pile, open_left ? -0.5 : left.at + left.slope * middle_y,
                        open_right ? pile.width_px - 0.5 : right.at + right.slope * middle_y);
        if (scan) scan->edge_share = share;
        return scan;
    }
    const double closing = right.slope - left.slope;  // per row; a fan opens downwards
    if (open_left || open_right || closing < 2 * upright) return no_sides();
    FoundScan scan;
    scan.apex_y_px = (left.at - right.at) / closing;
    scan.apex_x_px = left.at + left.slope * scan.apex_y_px;
    scan.half_angle_rad = 0.5 * (std::atan(right.slope) - std::atan(left.slope));
    scan.edge_share = share;
    if (std::abs(std::atan(right.slope) + std::atan(left.slope)) > 0.1) {
        scan.warnings.push_back(
            "The fan's sides are not equally steep: a steered or turned picture is measured as if "
            "it were upright.");
    }
    measure_radii(mask, pile, scan);
    if (!(scan.depth_px > 32)) return no_sides();
    return scan;
}

ScanPlace scan_place(const FoundScan& scan, double mm_per_px) {
    ScanPlace place;
    place.mm_per_px = mm_per_px;
    place.apex_x_px = scan.apex_x_px;
    place.apex_y_px = scan.apex_y_px;
    place.depth_mm = scan.depth_px * mm_per_px;
    if (scan.fan) {
        place.radius_mm = scan.radius_px * mm_per_px;
        place.half_angle_rad = scan.half_angle_rad;
    } else {
        place.width_mm = scan.width_px * mm_per_px;
    }
    return place;
}

namespace {

void expect_between(
    detail::JsonObject& json, const char* key, double value, double low, double high) {
    if (value >= low && value <= high) return;
    json.add_fault(key, "is out of range",
                   "expected " + std::to_string(low) + " to " + std::to_string(high));
}

void read_fan(detail::JsonObject& json, ScanPlace& place) {
    const auto apex = json.numbers("apex_px", 2);
    const double inner = json.number("r_in_mm"), outer = json.number("r_out_mm");
    const double degrees = json.number("half_angle_deg");
    if (!json.ok()) return;
    expect_between(json, "half_angle_deg", degrees, 1, 89);
    expect_between(json, "r_in_mm", inner, 0, 1000);
    expect_between(json, "r_out_mm", outer, inner + 5, inner + 500);
    place.apex_x_px = apex[0];
    place.apex_y_px = apex[1];
    place.radius_mm = inner;
    place.depth_mm = outer - inner;
    place.half_angle_rad = degrees * kRadPerDeg;
}

void read_linear(detail::JsonObject& json, ScanPlace& place) {
    const double left = json.number("left_px"), right = json.number("right_px"),
                 top = json.number("top_px"), bottom = json.number("bottom_px");
    if (!json.ok()) return;
    expect_between(json, "right_px", right, left + 16, left + 16384);
    expect_between(json, "bottom_px", bottom, top + 16, top + 16384);
    place.apex_x_px = 0.5 * (left + right - 1);
    place.apex_y_px = top - 0.5;
    place.width_mm = (right - left) * place.mm_per_px;
    place.depth_mm = (bottom - top) * place.mm_per_px;
}

}  // namespace

Result<GivenScan> parse_scan(const std::string& text, const std::string& where) {
    detail::JsonFault fault{where, {}};
    detail::Json value;
    if (!detail::parse_json(text, value, fault)) return *fault.error;
    detail::JsonObject json(value, "", fault);
    GivenScan scan;
    const std::string kind = json.text("kind");
    scan.place.mm_per_px = json.number("mm_per_px");
    if (json.ok()) {
        expect_between(json, "mm_per_px", scan.place.mm_per_px, 0.001, 10);
        if (kind == "fan") {
            read_fan(json, scan.place);
        } else if (kind == "linear") {
            read_linear(json, scan.place);
        } else {
            json.add_fault("kind", "is '" + kind + "'", "expected \"fan\" or \"linear\"");
        }
    }
    if (json.ok() && json.has("use")) {
        for (const double index : json.numbers("use", 0)) {
            if (index >= 0 && index < 1e9) scan.use.push_back(static_cast<std::size_t>(index));
        }
    }
    if (fault.error) return *fault.error;
    return scan;
}

}  // namespace sonocase::pipeline::inline look
