// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/tag_fit.h"

#include <algorithm>
#include <cmath>

#include "formats/markers/marker_set.h"
#include "formats/markers/small_cholesky.h"

namespace sonocase {
namespace {

constexpr int kCorners = 8, kUnknowns = 12;     // then black, white, blur along u and along v
constexpr double kMinBlur = 0.3, kMaxBlur = 6;  // pixels
constexpr double kMargin = 0.5;                 // of white round the square, in cells
constexpr double kMinNoise = 0.6;               // grey values: rounding alone has 0.3
// Errors of neighbouring pixels go together (compression, blur of another shape, uneven light), so
// that corners are less certain than as many independent pixels would make them. The factor is
// measured on rendered video.
constexpr double kUnmodelled = 2;
constexpr double kFloor = 0.03;  // pixels: the raster, print and lens leave so much at any size

// The normal distribution's integral and density from a table, to 1e-5.
struct BellTable {
    static constexpr int kPerUnit = 128, kReach = 4, kSize = 2 * kReach * kPerUnit;
    std::array<float, kSize + 1> step, bell;
    BellTable() {
        for (int i = 0; i <= kSize; ++i) {
            const double t = static_cast<double>(i) / kPerUnit - kReach;
            step[i] = static_cast<float>(0.5 * std::erfc(-t / std::sqrt(2.0)));
            bell[i] = static_cast<float>(0.3989422804014327 * std::exp(-0.5 * t * t));
        }
    }
};
const BellTable& bells() {
    static const BellTable table;
    return table;
}

// How much of each of five cells along one axis a blurred point sees, with derivatives.
struct AxisWeights {
    int first = 0;  // cell of weight[0]
    double weight[5], by_place[5], by_blur[5];
};

// at, blur: in cells.
AxisWeights axis_weights(const BellTable& table, double at, double blur) {
    AxisWeights out;
    const int cell = static_cast<int>(std::floor(at));
    out.first = cell - 2;
    double step[6], bell[6], arm[6];
    step[0] = 0, bell[0] = 0, arm[0] = 0;
    step[5] = 1, bell[5] = 0, arm[5] = 0;
    const double inv = 1 / blur;
    for (int k = 1; k <= 4; ++k) {
        // How much lies below the border of cell `first + k`.
        const double t = (cell - 2 + k - at) * inv;
        const double place =
            std::clamp((t + BellTable::kReach) * BellTable::kPerUnit, 0.0, BellTable::kSize - 1.0);
        const int i = static_cast<int>(place);
        const double f = place - i;
        step[k] = table.step[i] + f * (table.step[i + 1] - table.step[i]);
        bell[k] = (table.bell[i] + f * (table.bell[i + 1] - table.bell[i])) * inv;
        arm[k] = -t * bell[k];  // d step / d blur
        bell[k] = -bell[k];     // d step / d at
    }
    for (int k = 0; k < 5; ++k) {
        out.weight[k] = step[k + 1] - step[k];
        out.by_place[k] = bell[k + 1] - bell[k];
        out.by_blur[k] = arm[k + 1] - arm[k];
    }
    return out;
}

// The homography that takes (u, v) = (0, 0), (8, 0), (8, 8), (0, 8), counted in cells from the lower
// left corner, to the corners (Heckbert 1989).
struct Quad {
    double a, b, c, d, e, f, g, h;
    explicit Quad(const std::array<Pixel, 4>& p) {
        const double sx = p[0].x - p[1].x + p[2].x - p[3].x, sy = p[0].y - p[1].y + p[2].y - p[3].y;
        const double dx1 = p[1].x - p[2].x, dx2 = p[3].x - p[2].x;
        const double dy1 = p[1].y - p[2].y, dy2 = p[3].y - p[2].y;
        const double det = dx1 * dy2 - dx2 * dy1;
        g = (sx * dy2 - dx2 * sy) / det;
        h = (dx1 * sy - sx * dy1) / det;
        a = p[1].x - p[0].x + g * p[1].x;
        b = p[3].x - p[0].x + h * p[3].x;
        c = p[0].x;
        d = p[1].y - p[0].y + g * p[1].y;
        e = p[3].y - p[0].y + h * p[3].y;
        f = p[0].y;
        for (double* scaled : {&a, &b, &d, &e, &g, &h}) *scaled /= kTagCells;
    }
    // (u, v) of a pixel, and the change of the pixel with u and v: 2 x 2, row by row.
    bool inside(double x, double y, double& u, double& v, double* slope) const {
        const double m00 = a - g * x, m01 = b - h * x, m10 = d - g * y, m11 = e - h * y;
        const double det = m00 * m11 - m01 * m10;
        if (!(std::abs(det) > 1e-12)) return false;
        const double rx = x - c, ry = y - f;
        u = (m11 * rx - m01 * ry) / det;
        v = (m00 * ry - m10 * rx) / det;
        const double w = 1 / (g * u + h * v + 1);
        slope[0] = m00 * w, slope[1] = m01 * w, slope[2] = m10 * w, slope[3] = m11 * w;
        return w > 0;
    }
};

bool turns_one_way(const std::array<Pixel, 4>& p) {
    for (int k = 0; k < 4; ++k) {
        const Pixel a = p[k], b = p[(k + 1) % 4], c = p[(k + 2) % 4];
        // Anticlockwise as seen is negative where y points down.
        if (!((b.x - a.x) * (c.y - b.y) - (b.y - a.y) * (c.x - b.x) < -4)) return false;
    }
    return true;
}

struct Unknowns {
    std::array<Pixel, 4> corners;
    double black = 0, white = 0, blur_u = 1, blur_v = 1;  // blur in pixels
};

struct Sums {
    SymmetricSystem<kUnknowns> system;
    double square = 0, cost = 0;  // of residuals; Huber's
    int pixels = 0;
};

struct Region {
    int x0, x1, y0, y1, stride;
};

// Grey values under the pattern against the pattern. limit: Huber's, grey values.
Sums sums_of(const GreyPicture& picture,
             const Region& region,
             const bool (&white)[kTagCells][kTagCells],
             const Unknowns& at,
             double limit) {
    const BellTable& table = bells();
    Sums out;
    const Quad quad(at.corners);
    // Pixels per cell along the two axes, in the middle.
    double u, v, slope[4];
    if (!quad.inside(0.25 * (at.corners[0].x + at.corners[1].x + at.corners[2].x + at.corners[3].x),
                     0.25 * (at.corners[0].y + at.corners[1].y + at.corners[2].y + at.corners[3].y),
                     u, v, slope))
        return out;
    // Along u the blur is that across the lines of constant u.
    const double det = std::abs(slope[0] * slope[3] - slope[1] * slope[2]);
    const double px_u = det / std::hypot(slope[1], slope[3]);
    const double px_v = det / std::hypot(slope[0], slope[2]);
    const double blur_u = at.blur_u / px_u, blur_v = at.blur_v / px_v;
    const double height = at.white - at.black;
    for (int y = region.y0; y <= region.y1; ++y) {
        const std::uint8_t* row = picture.pixels + static_cast<std::ptrdiff_t>(y) * picture.stride;
        // Pixels that are passed over are others in each row.
        for (int x = region.x0 + y * 2 % region.stride; x <= region.x1; x += region.stride) {
            if (!quad.inside(x, y, u, v, slope)) continue;
            if (!(u > -kMargin && v > -kMargin && u < kTagCells + kMargin &&
                  v < kTagCells + kMargin))
                continue;
            const AxisWeights wu = axis_weights(table, u, blur_u);
            const AxisWeights wv = axis_weights(table, v, blur_v);
            double value = 0, by_u = 0, by_v = 0, by_blur_u = 0, by_blur_v = 0;
            for (int j = 0; j < 5; ++j) {
                const int cv = wv.first + j;
                double line = 0, line_u = 0, line_blur = 0;
                for (int i = 0; i < 5; ++i) {
                    const int cu = wu.first + i;
                    const bool is_white = cu < 0 || cv < 0 || cu >= kTagCells || cv >= kTagCells ||
                                          white[kTagCells - 1 - cv][cu];
                    if (!is_white) continue;
                    line += wu.weight[i], line_u += wu.by_place[i], line_blur += wu.by_blur[i];
                }
                value += wv.weight[j] * line;
                by_u += wv.weight[j] * line_u;
                by_v += wv.by_place[j] * line;
                by_blur_u += wv.weight[j] * line_blur;
                by_blur_v += wv.by_blur[j] * line;
            }
            const double r = at.black + height * value - row[x];
            const double size = std::abs(r);
            const double weight = size <= limit ? 1 : limit / size;
            out.square += weight * r * r;
            out.cost += size <= limit ? r * r : limit * (2 * size - limit);
            ++out.pixels;
            // A corner that moves takes its share of (u, v) along; the pattern seen at this pixel
            // moves the other way.
            const double area = slope[0] * slope[3] - slope[1] * slope[2];
            const double by_x = -height * (by_u * slope[3] - by_v * slope[2]) / area;
            const double by_y = -height * (by_v * slope[0] - by_u * slope[1]) / area;
            const double su = u / kTagCells, sv = v / kTagCells;
            const double share[4] = {(1 - su) * (1 - sv), su * (1 - sv), su * sv, (1 - su) * sv};
            double j[kUnknowns];
            for (int k = 0; k < 4; ++k) {
                j[2 * k] = by_x * share[k];
                j[2 * k + 1] = by_y * share[k];
            }
            j[8] = 1 - value;
            j[9] = value;
            j[10] = height * by_blur_u / px_u;
            j[11] = height * by_blur_v / px_v;
            out.system.add(j, r, weight);
        }
    }
    // The blur is held near what it was where the picture does not tell.
    for (int k = 10; k < 12; ++k) out.system.normal[k * (kUnknowns + 1)] += 1e-3 * height * height;
    return out;
}

}  // namespace

bool fit_tag(const GreyPicture& picture, SeenTag& tag, int max_pixels) {
    if (!turns_one_way(tag.corners)) return false;
    bool white[kTagCells][kTagCells];
    for (int r = 0; r < kTagCells; ++r)
        for (int c = 0; c < kTagCells; ++c) white[r][c] = tag_cell_is_white(tag.id, r, c);
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9, twice = 0;
    for (int k = 0; k < 4; ++k) {
        const Pixel p = tag.corners[k], q = tag.corners[(k + 1) % 4];
        x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
        y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
        twice += p.x * q.y - q.x * p.y;
    }
    const double area = 0.5 * std::abs(twice);
    const int border = 2 + static_cast<int>(0.1 * std::sqrt(area));
    Region region;
    region.x0 = std::max(0, static_cast<int>(x0) - border);
    region.x1 = std::min(picture.width_px - 1, static_cast<int>(x1) + border);
    region.y0 = std::max(0, static_cast<int>(y0) - border);
    region.y1 = std::min(picture.height_px - 1, static_cast<int>(y1) + border);
    region.stride = std::max(1, static_cast<int>(std::ceil(1.27 * area / max_pixels)));
    constexpr double kMinArea = 70;  // pixels: of a tag eight cells wide
    if (area < kMinArea || region.x0 >= region.x1 || region.y0 >= region.y1) return false;

    Unknowns at;
    at.corners = tag.corners;
    // Black and white to begin with: the darkest and lightest tenth under the tag.
    std::array<int, 256> histogram{};
    int count = 0;
    for (int y = region.y0; y <= region.y1; ++y)
        for (int x = region.x0; x <= region.x1; ++x) {
            ++histogram[picture.pixels[static_cast<std::ptrdiff_t>(y) * picture.stride + x]];
            ++count;
        }
    for (int grey = 0, sum = 0; grey < 256; ++grey) {
        if (sum < 0.15 * count) at.black = grey;
        if (sum < 0.8 * count) at.white = grey;
        sum += histogram[grey];
    }
    constexpr double kMinContrast = 12;
    if (at.white - at.black < kMinContrast) return false;
    double limit = 0.5 * (at.white - at.black), damping = 1e-3;
    Sums now = sums_of(picture, region, white, at, limit);
    constexpr int kMaxIterations = 12;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
        if (now.pixels < 3 * kUnknowns) return false;
        SymmetricSystem<kUnknowns> damped = now.system;
        for (int k = 0; k < kUnknowns; ++k) damped.normal[k * (kUnknowns + 1)] *= 1 + damping;
        if (!damped.factorise()) return false;
        std::array<double, kUnknowns> step = now.system.right;
        damped.solve(step);
        Unknowns next = at;
        double moved = 0;
        for (int k = 0; k < 4; ++k) {
            next.corners[k].x += step[2 * k];
            next.corners[k].y += step[2 * k + 1];
            moved = std::max({moved, std::abs(step[2 * k]), std::abs(step[2 * k + 1])});
        }
        next.black += step[8], next.white += step[9];
        next.blur_u = std::clamp(next.blur_u + step[10], kMinBlur, kMaxBlur);
        next.blur_v = std::clamp(next.blur_v + step[11], kMinBlur, kMaxBlur);
        if (!(moved < 20) || !turns_one_way(next.corners)) return false;
        const Sums then = sums_of(picture, region, white, next, limit);
        // Pixels come and go at the rim of the pattern: means are compared.
        if (!(then.cost * now.pixels <= now.cost * then.pixels * (1 + 1e-6))) {
            damping = std::max(1e-2, damping * 10);
            if (damping > 1e4) break;
            continue;
        }
        at = next;
        damping *= 0.1;
        now = then;
        // Once the pattern lies where it belongs, what still does not fit is not the tag.
        const double spread = std::sqrt(now.square / now.pixels);
        const double tighter = std::max(3 * kMinNoise, 3 * spread);
        const bool settled = moved < 0.01;
        if (tighter < 0.8 * limit) {
            limit = tighter;
            now = sums_of(picture, region, white, at, limit);
        } else if (settled) {
            break;
        }
    }
    double farthest = 0;
    for (int k = 0; k < 4; ++k)
        farthest = std::max(farthest, std::hypot(at.corners[k].x - tag.corners[k].x,
                                                 at.corners[k].y - tag.corners[k].y));
    const double contrast = at.white - at.black;
    const double residual = std::sqrt(now.square / std::max(1, now.pixels - kUnknowns));
    // The pattern has to explain most of what is seen, and to lie where it was read.
    if (contrast < kMinContrast || residual > 0.2 * contrast ||
        farthest > std::max(2.0, 0.15 * std::sqrt(area)))
        return false;

    // What the corners are worth once black, white and blur are unknown: the Schur complement, in
    // the scale of the residuals.
    SymmetricSystem<kUnknowns> order;  // nuisances first, so that the factor's end is the corners'
    const auto place = [](int k) { return k < kCorners ? k + kUnknowns - kCorners : k - kCorners; };
    for (int r = 0; r < kUnknowns; ++r)
        for (int c = 0; c <= r; ++c) {
            const int pr = place(r), pc = place(c);
            order.normal[std::max(pr, pc) * kUnknowns + std::min(pr, pc)] =
                now.system.normal[r * kUnknowns + c];
        }
    if (!order.factorise()) return false;
    const double noise = kUnmodelled * std::max(residual, kMinNoise);
    // The factor's last part is that of the corners; its inverse, and no corner better than kFloor.
    constexpr int kFirst = kUnknowns - kCorners;
    SymmetricSystem<kCorners> corners, covariance;
    for (int r = 0; r < kCorners; ++r)
        for (int c = 0; c <= r; ++c)
            corners.normal[r * kCorners + c] =
                order.normal[(r + kFirst) * kUnknowns + c + kFirst] / noise;
    for (int c = 0; c < kCorners; ++c) {
        std::array<double, kCorners> unit{};
        unit[c] = 1;
        corners.solve(unit);
        for (int r = c; r < kCorners; ++r) covariance.normal[r * kCorners + c] = unit[r];
        covariance.normal[c * (kCorners + 1)] += kFloor * kFloor;
    }
    if (!covariance.factorise()) return false;
    SymmetricSystem<kCorners> whitening;
    for (int c = 0; c < kCorners; ++c) {
        std::array<double, kCorners> unit{};
        unit[c] = 1;
        covariance.solve(unit);
        for (int r = c; r < kCorners; ++r) whitening.normal[r * kCorners + c] = unit[r];
    }
    if (!whitening.factorise()) return false;
    for (int r = 0; r < kCorners; ++r)
        for (int c = 0; c < kCorners; ++c)
            tag.whitening[r * kCorners + c] = c >= r ? whitening.normal[c * kCorners + r] : 0;
    tag.corners = at.corners;
    tag.contrast = contrast;
    tag.residual = residual;
    tag.blur_px = std::max(at.blur_u, at.blur_v);
    return true;
}

}  // namespace sonocase
