// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/tag_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "formats/markers/marker_set.h"

namespace sonocase {
namespace {

// The corners, then black, white, blur along u and along v, then Unknowns::beyond.
constexpr int kCorners = 8, kBeyond = 12, kUnknowns = 16;
constexpr double kMinBlur = 0.3, kMaxBlur = 6, kStartBlur = 0.8;  // pixels
// Half a cell of white surrounds the square. There a side of a body ends, and through the blur what
// lies beyond it, another side's white or the ground, reaches the square's edge. Taken for the
// tag's own white it would move all four edges.
constexpr double kMargin = 0.5;
constexpr double kMinNoise = 0.6;  // grey values: rounding alone has 0.3
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
    void look_up(float t, float& step_of_t, float& bell_of_t) const {
        const float place = std::clamp((t + kReach) * kPerUnit, 0.0f, kSize - 1.0f);
        const int i = static_cast<int>(place);
        const float f = place - static_cast<float>(i);
        step_of_t = step[i] + f * (step[i + 1] - step[i]);
        bell_of_t = bell[i] + f * (bell[i + 1] - bell[i]);
    }
};
const BellTable& bells() {
    static const BellTable table;
    return table;
}

// How much of each of five cells along one axis a blurred point sees, with derivatives.
struct AxisWeights {
    int first = 0;  // cell of weight[0]
    int count = 5;
    float weight[5], by_place[5], by_blur[5];
};

// at, blur: in cells. Of a blur below a quarter of a cell three cells are all that is seen.
inline void axis_weights(
    const BellTable& table, float at, float inv_blur, int reach, AxisWeights& out) {
    const int cell = static_cast<int>(at + 8) - 8;
    out.first = cell - reach;
    out.count = 2 * reach + 1;
    float step = 0, bell = 0, arm = 0;
    for (int k = 0; k < 2 * reach; ++k) {
        // How much lies below the border of cell `first + k + 1`.
        const float t = (static_cast<float>(out.first + k + 1) - at) * inv_blur;
        float next_step, density;
        table.look_up(t, next_step, density);
        density *= inv_blur;
        const float next_arm = -t * density;  // d step / d blur
        out.weight[k] = next_step - step;
        out.by_place[k] = -density - bell;
        out.by_blur[k] = next_arm - arm;
        step = next_step, bell = -density, arm = next_arm;
    }
    out.weight[2 * reach] = 1 - step;
    out.by_place[2 * reach] = -bell;
    out.by_blur[2 * reach] = -arm;
}

// How much a blurred point sees of what lies beyond the low and the high end of one axis, with
// derivatives.
struct BeyondWeights {
    float weight[2], by_place[2], by_blur[2];
};

// at, blur: in cells. False: too far away to see anything of it.
inline bool beyond_weights(const BellTable& table, float at, float inv_blur, BeyondWeights& out) {
    constexpr float kLow = -static_cast<float>(kMargin), kHigh = kTagCells - kLow;
    const float past[2] = {(kLow - at) * inv_blur, (at - kHigh) * inv_blur};
    constexpr float kUnseen = -3.5f;  // standard deviations
    if (std::max(past[0], past[1]) < kUnseen) return false;
    for (int end = 0; end < 2; ++end) {
        float density;
        table.look_up(past[end], out.weight[end], density);
        density *= inv_blur;
        out.by_place[end] = end == 0 ? -density : density;
        out.by_blur[end] = -past[end] * density;
    }
    return true;
}

// The homography that takes (u, v) = (0, 0), (1, 0), (1, 1), (0, 1) to four points (Heckbert 1989).
struct UnitSquare {
    Pixel p0;
    double ax, ay, bx, by, g, h;  // columns by u and by v from p0, and the lower row
    explicit UnitSquare(const std::array<Pixel, 4>& p) : p0(p[0]) {
        const double sx = p[0].x - p[1].x + p[2].x - p[3].x, sy = p[0].y - p[1].y + p[2].y - p[3].y;
        const double dx1 = p[1].x - p[2].x, dx2 = p[3].x - p[2].x;
        const double dy1 = p[1].y - p[2].y, dy2 = p[3].y - p[2].y;
        const double det = dx1 * dy2 - dx2 * dy1;
        g = (sx * dy2 - dx2 * sy) / det, h = (dx1 * sy - sx * dy1) / det;
        ax = p[1].x - p[0].x + g * (p[1].x - p[0].x), ay = p[1].y - p[0].y + g * (p[1].y - p[0].y);
        bx = p[3].x - p[0].x + h * (p[3].x - p[0].x), by = p[3].y - p[0].y + h * (p[3].y - p[0].y);
    }
    Pixel at(double u, double v) const {
        const double w = 1 / (g * u + h * v + 1);
        return {p0.x + (ax * u + bx * v) * w, p0.y + (ay * u + by * v) * w};
    }
};

// The same with u and v counted in cells from the lower left corner, backwards.
class Quad {
  public:
    explicit Quad(const std::array<Pixel, 4>& p) {
        const UnitSquare square(p);
        x0_ = p[0].x, y0_ = p[0].y;
        const double scale = 1.0 / kTagCells;
        ax_ = static_cast<float>(square.ax * scale), bx_ = static_cast<float>(square.bx * scale);
        ay_ = static_cast<float>(square.ay * scale), by_ = static_cast<float>(square.by * scale);
        g_ = static_cast<float>(square.g * scale), h_ = static_cast<float>(square.h * scale);
    }
    // (u, v) of a pixel, and the change of the pixel with u and v: 2 x 2, row by row.
    bool inside(double x, double y, float& u, float& v, float* slope) const {
        const auto rx = static_cast<float>(x - x0_), ry = static_cast<float>(y - y0_);
        const float m00 = ax_ - g_ * rx, m01 = bx_ - h_ * rx;
        const float m10 = ay_ - g_ * ry, m11 = by_ - h_ * ry;
        const float det = m00 * m11 - m01 * m10;
        if (!(std::abs(det) > 1e-9f)) return false;
        const float inv = 1 / det;
        u = (m11 * rx - m01 * ry) * inv;
        v = (m00 * ry - m10 * rx) * inv;
        const float w = 1 / (g_ * u + h_ * v + 1);
        slope[0] = m00 * w, slope[1] = m01 * w, slope[2] = m10 * w, slope[3] = m11 * w;
        return w > 0;
    }

  private:
    double x0_, y0_;
    float ax_, bx_, ay_, by_, g_, h_;
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
    // Grey less white beyond the left, right, lower and upper end.
    std::array<double, 4> beyond{};
};

struct Region {
    int x0, x1, y0, y1;
};

struct Sums {
    Eigen::Matrix<double, kUnknowns, kUnknowns> normal;  // its lower triangle
    Eigen::Matrix<double, kUnknowns, 1> right;
    double square = 0, cost = 0;  // of residuals; Huber's
};

// The pixels under a tag and its margin, each with its grey value.
struct Pixels {
    static constexpr int kMax = 700;
    std::array<float, kMax> x, y, grey;
    int count = 0;
};

// The pattern with a margin of three white cells, so that no look-up has to ask where it is.
struct Pattern {
    static constexpr int kRim = 3, kSide = kTagCells + 2 * kRim;
    float white[kSide][kSide];  // by v, by u, from the lower left corner
    explicit Pattern(int id) {
        for (int v = 0; v < kSide; ++v)
            for (int u = 0; u < kSide; ++u) {
                const int column = u - kRim, row = kTagCells - 1 - (v - kRim);
                const bool within =
                    column >= 0 && row >= 0 && column < kTagCells && row < kTagCells;
                white[v][u] = !within || tag_cell_is_white(id, row, column) ? 1 : 0;
            }
    }
};

// Grey values under the pattern against the pattern. limit: Huber's, grey values. False: the
// corners are no quad any more.
bool sums_of(
    const Pixels& pixels, const Pattern& pattern, const Unknowns& at, double limit, Sums& out) {
    const BellTable& table = bells();
    out.square = out.cost = 0;
    const Quad quad(at.corners);
    // Pixels per cell along the two axes, in the middle.
    float u, v, slope[4];
    if (!quad.inside(0.25 * (at.corners[0].x + at.corners[1].x + at.corners[2].x + at.corners[3].x),
                     0.25 * (at.corners[0].y + at.corners[1].y + at.corners[2].y + at.corners[3].y),
                     u, v, slope))
        return false;
    // Along u the blur is that across the lines of constant u.
    const float det = std::abs(slope[0] * slope[3] - slope[1] * slope[2]);
    // By roots, which are the same everywhere; hypot() is not, and its last digit would come out in
    // the corners.
    const float px_u = det / std::sqrt(slope[1] * slope[1] + slope[3] * slope[3]);
    const float px_v = det / std::sqrt(slope[0] * slope[0] + slope[2] * slope[2]);
    const float inv_blur_u = px_u / static_cast<float>(at.blur_u);
    const float inv_blur_v = px_v / static_cast<float>(at.blur_v);
    constexpr float kNarrow = 4;  // standard deviations to a cell
    const int reach_u = inv_blur_u >= kNarrow ? 1 : 2, reach_v = inv_blur_v >= kNarrow ? 1 : 2;
    const auto height = static_cast<float>(at.white - at.black);
    const auto black = static_cast<float>(at.black);
    const auto bound = static_cast<float>(limit);
    // Rows of the normal matrix up to their diagonal, in groups of four.
    using Four = Eigen::Array4f;
    constexpr int kGroups = kUnknowns / 4;
    Four normal[kUnknowns][kGroups], right[kGroups];
    for (int a = 0; a < kUnknowns; ++a)
        for (int g = 0; g < kGroups; ++g) normal[a][g].setZero();
    for (int g = 0; g < kGroups; ++g) right[g].setZero();
    AxisWeights wu, wv;
    BeyondWeights bu{}, bv{};
    float beyond[4];
    for (int k = 0; k < 4; ++k) beyond[k] = static_cast<float>(at.beyond[k]);
    for (int n = 0; n < pixels.count; ++n) {
        if (!quad.inside(pixels.x[n], pixels.y[n], u, v, slope)) return false;
        constexpr float kRim = 1;  // the pattern moves while it is fitted
        u = std::clamp(u, -kRim, kTagCells + kRim - 0.01f);
        v = std::clamp(v, -kRim, kTagCells + kRim - 0.01f);
        axis_weights(table, u, inv_blur_u, reach_u, wu);
        axis_weights(table, v, inv_blur_v, reach_v, wv);
        float value = 0, by_u = 0, by_v = 0, by_blur_u = 0, by_blur_v = 0;
        for (int j = 0; j < wv.count; ++j) {
            const float* cells =
                &pattern.white[wv.first + j + Pattern::kRim][wu.first + Pattern::kRim];
            float line = 0, line_u = 0, line_blur = 0;
            for (int i = 0; i < wu.count; ++i) {
                line += wu.weight[i] * cells[i];
                line_u += wu.by_place[i] * cells[i];
                line_blur += wu.by_blur[i] * cells[i];
            }
            value += wv.weight[j] * line;
            by_u += wv.weight[j] * line_u;
            by_v += wv.by_place[j] * line;
            by_blur_u += wv.weight[j] * line_blur;
            by_blur_v += wv.by_blur[j] * line;
        }
        by_u *= height, by_v *= height, by_blur_u *= height, by_blur_v *= height;
        float r = black + height * value - pixels.grey[n];
        Four ends = Four::Zero();  // how much of what lies beyond each is seen
        const bool end_u = beyond_weights(table, u, inv_blur_u, bu);
        const bool end_v = beyond_weights(table, v, inv_blur_v, bv);
        for (int end = 0; end_u && end < 2; ++end) {
            ends[end] = bu.weight[end];
            r += beyond[end] * bu.weight[end];
            by_u += beyond[end] * bu.by_place[end];
            by_blur_u += beyond[end] * bu.by_blur[end];
        }
        for (int end = 0; end_v && end < 2; ++end) {
            ends[2 + end] = bv.weight[end];
            r += beyond[2 + end] * bv.weight[end];
            by_v += beyond[2 + end] * bv.by_place[end];
            by_blur_v += beyond[2 + end] * bv.by_blur[end];
        }
        const float size = std::abs(r);
        const float weight = size <= bound ? 1 : bound / size;
        out.square += weight * r * r;
        out.cost += size <= bound ? r * r : bound * (2 * size - bound);
        // A corner that moves takes its share of (u, v) along; the pattern seen at this pixel
        // moves the other way.
        const float scale = -1 / (slope[0] * slope[3] - slope[1] * slope[2]);
        const float by_x = scale * (by_u * slope[3] - by_v * slope[2]);
        const float by_y = scale * (by_v * slope[0] - by_u * slope[1]);
        const float su = u / kTagCells, sv = v / kTagCells;
        const float share[4] = {(1 - su) * (1 - sv), su * (1 - sv), su * sv, (1 - su) * sv};
        Four j[kGroups];
        for (int k = 0; k < 2; ++k)
            j[k] = Four(by_x * share[2 * k], by_y * share[2 * k], by_x * share[2 * k + 1],
                        by_y * share[2 * k + 1]);
        j[2] = Four(1 - value, value, by_blur_u / px_u, by_blur_v / px_v);
        j[3] = ends;
        const int groups = end_u || end_v ? kGroups : kGroups - 1;
        for (int g = 0; g < groups; ++g) {
            const Four scaled = weight * j[g];
            right[g] -= r * scaled;
            for (int k = 0; k < 4; ++k)
                for (int h = 0; h <= g; ++h) normal[4 * g + k][h] += scaled[k] * j[h];
        }
    }
    for (int a = 0; a < kUnknowns; ++a) {
        for (int b = 0; b <= a; ++b) out.normal(a, b) = normal[a][b / 4][b % 4];
        out.right[a] = right[a / 4][a % 4];
    }
    // The blur is held near what it was where the picture does not tell, and what lies beyond near
    // white.
    for (int k = 10; k < kBeyond; ++k)
        out.normal(k, k) += 1e-3 * static_cast<double>(height) * height;
    constexpr double kBeyondHeld = 0.02;
    for (int k = 0; k < 4; ++k) {
        out.normal(kBeyond + k, kBeyond + k) += kBeyondHeld;
        out.right[kBeyond + k] -= kBeyondHeld * at.beyond[k];
        out.cost += kBeyondHeld * at.beyond[k] * at.beyond[k];
    }
    return true;
}

// Pixels of a tag and its margin, evenly spread, about as many as asked for. near_px: those alone
// that lie so near to the border of a cell; elsewhere the pattern does not tell where it lies, and
// of a large tag most pixels are elsewhere.
void choose_pixels(const GreyPicture& picture,
                   const Region& region,
                   const Unknowns& at,
                   double area,
                   double near_px,
                   int wanted,
                   Pixels& out) {
    out.count = 0;
    const Quad quad(at.corners);
    const double cell_px = std::sqrt(area) / kTagCells;
    const double empty = std::max(0.0, 1 - 2 * near_px / cell_px);
    // The margin of white counts as well: half a cell on all sides.
    constexpr double kWithMargin = 1.27;
    const int stride =
        std::max(1, static_cast<int>(std::ceil(kWithMargin * area * (1 - empty * empty) / wanted)));
    const auto near = static_cast<float>(std::min(0.5, near_px / cell_px));
    int next = 0;
    for (int y = region.y0; y <= region.y1; ++y) {
        const std::uint8_t* row = picture.pixels + static_cast<std::ptrdiff_t>(y) * picture.stride;
        // Every stride-th of those that count; passed over are others in each row.
        const int step = empty > 0 ? 1 : stride;
        for (int x = region.x0 + (step > 1 ? 2 * y % stride : 0); x <= region.x1; x += step) {
            float u, v, slope[4];
            if (!quad.inside(x, y, u, v, slope)) continue;
            if (!(u > -kMargin && v > -kMargin && u < kTagCells + kMargin &&
                  v < kTagCells + kMargin))
                continue;
            if (step == 1 && stride > 1) {
                const float off_u = std::abs(u - std::floor(u + 0.5f));
                const float off_v = std::abs(v - std::floor(v + 0.5f));
                if (std::min(off_u, off_v) > near || ++next % stride != 0) continue;
            }
            if (out.count == Pixels::kMax) return;
            out.x[out.count] = static_cast<float>(x);
            out.y[out.count] = static_cast<float>(y);
            out.grey[out.count++] = row[x];
        }
    }
}

}  // namespace

bool fit_tag(const GreyPicture& picture, SeenTag& tag, int max_pixels) {
    if (!turns_one_way(tag.corners)) return false;
    double x0 = 1e9, x1 = -1e9, y0 = 1e9, y1 = -1e9, twice = 0;
    for (int k = 0; k < 4; ++k) {
        const Pixel p = tag.corners[k], q = tag.corners[(k + 1) % 4];
        x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
        y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
        twice += p.x * q.y - q.x * p.y;
    }
    const double area = 0.5 * std::abs(twice);
    const int border = 2 + static_cast<int>(0.1 * std::sqrt(area));
    const Region region{std::max(0, static_cast<int>(x0) - border),
                        std::min(picture.width_px - 1, static_cast<int>(x1) + border),
                        std::max(0, static_cast<int>(y0) - border),
                        std::min(picture.height_px - 1, static_cast<int>(y1) + border)};
    constexpr double kMinArea = 70;  // pixels: of a tag eight cells wide
    if (area < kMinArea || region.x0 >= region.x1 || region.y0 >= region.y1) return false;
    const int wanted = std::min(max_pixels, 550);
    // Near the borders of cells, first as widely as corners may be off.
    constexpr double kStartPx = 4, kEdgePx = 2.5;

    const Pattern pattern(tag.id);
    Unknowns at;
    at.corners = tag.corners;
    Pixels pixels;
    choose_pixels(picture, region, at, area, kStartPx, wanted, pixels);
    if (pixels.count < 5 * kUnknowns) return false;
    // Black and white to begin with.
    std::array<int, 256> histogram{};
    for (int n = 0; n < pixels.count; ++n) ++histogram[static_cast<int>(pixels.grey[n])];
    for (int grey = 0, sum = 0; grey < 256; ++grey) {
        if (sum < 0.15 * pixels.count) at.black = grey;
        if (sum < 0.8 * pixels.count) at.white = grey;
        sum += histogram[grey];
    }
    constexpr double kMinContrast = 12;
    if (at.white - at.black < kMinContrast) return false;
    double limit = 0.5 * (at.white - at.black), damping = 1e-3;
    // A third of the pixels brings the pattern to where it belongs.
    Pixels few;
    for (int n = 0; n < pixels.count; n += 3) {
        few.x[few.count] = pixels.x[n], few.y[few.count] = pixels.y[n];
        few.grey[few.count++] = pixels.grey[n];
    }
    const Pixels* used = few.count >= 5 * kUnknowns ? &few : &pixels;
    Sums now;
    if (!sums_of(*used, pattern, at, limit, now)) return false;
    constexpr int kMaxIterations = 14;
    for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
        Eigen::Matrix<double, kUnknowns, kUnknowns> damped = now.normal;
        damped.diagonal() *= 1 + damping;
        const Eigen::LLT<Eigen::Matrix<double, kUnknowns, kUnknowns>> factor(damped);
        if (factor.info() != Eigen::Success) return false;
        const Eigen::Matrix<double, kUnknowns, 1> step = factor.solve(now.right);
        Unknowns next = at;
        double moved = 0;
        for (int k = 0; k < 4; ++k) {
            next.corners[k].x += step[2 * k];
            next.corners[k].y += step[2 * k + 1];
            moved = std::max({moved, std::abs(step[2 * k]), std::abs(step[2 * k + 1])});
        }
        next.black += step[8], next.white += step[9];
        // A sharp pattern would not feel its neighbours before it lies where it belongs.
        const double min_blur = used == &few ? kStartBlur : kMinBlur;
        next.blur_u = std::clamp(next.blur_u + step[10], min_blur, kMaxBlur);
        next.blur_v = std::clamp(next.blur_v + step[11], min_blur, kMaxBlur);
        for (int k = 0; k < 4; ++k)
            next.beyond[k] =
                std::clamp(next.beyond[k] + step[kBeyond + k], -next.white, 255 - next.white);
        if (!(moved < 20) || !turns_one_way(next.corners)) return false;
        Sums then;
        if (!sums_of(*used, pattern, next, limit, then)) return false;
        if (!(then.cost <= now.cost * (1 + 1e-5))) {
            damping = std::max(1e-2, damping * 10);
            if (damping > 1e4) break;
            if (used != &few || damping < 10) continue;
            moved = 0;  // as near as these pixels bring it
            next = at;
            then = now;
        }
        at = next;
        damping *= 0.1;
        now = then;
        // Once the pattern lies where it belongs, what still does not fit is not the tag.
        // A tenth of the contrast is what a fifth of a pixel makes at an edge: below it would lie
        // what is still to be fitted.
        constexpr double kEdgePart = 0.1;
        const double spread = std::sqrt(now.square / used->count);
        const double tighter =
            std::max({3 * kMinNoise, 3 * spread, kEdgePart * (at.white - at.black)});
        const bool tightens = tighter < 0.8 * limit;
        constexpr double kNear = 0.3, kSettled = 0.015;
        if (used == &few && moved < kNear) {
            choose_pixels(picture, region, at, area, kEdgePx, wanted, pixels);
            used = &pixels;
            limit = std::min(limit, tighter);
            if (!sums_of(*used, pattern, at, limit, now)) return false;
        } else if (tightens) {
            limit = tighter;
            if (!sums_of(*used, pattern, at, limit, now)) return false;
        } else if (moved < kSettled) {
            break;
        }
    }
    if (used == &few && !sums_of(pixels, pattern, at, limit, now)) return false;
    double farthest = 0;
    for (int k = 0; k < 4; ++k)
        farthest = std::max(farthest, std::hypot(at.corners[k].x - tag.corners[k].x,
                                                 at.corners[k].y - tag.corners[k].y));
    const double contrast = at.white - at.black;
    const double residual = std::sqrt(now.square / (pixels.count - kUnknowns));
    // The pattern has to explain most of what is seen, and to lie where it was read.
    if (contrast < kMinContrast || residual > 0.2 * contrast ||
        farthest > std::max(2.0, 0.15 * std::sqrt(area)))
        return false;

    // What the corners are worth once black, white and blur are unknown: the Schur complement, in
    // the scale of the residuals, and no corner better than kFloor.
    using Eigen::Lower;
    using Eigen::Upper;
    const Eigen::Matrix<double, kUnknowns, kUnknowns> whole = now.normal.selfadjointView<Lower>();
    const Eigen::LLT<Eigen::Matrix<double, kUnknowns, kUnknowns>> factor(whole);
    if (factor.info() != Eigen::Success) return false;
    const double noise = kUnmodelled * std::max(residual, kMinNoise);
    Eigen::Matrix<double, kUnknowns, kCorners> units =
        Eigen::Matrix<double, kUnknowns, kCorners>::Identity();
    factor.solveInPlace(units);
    Eigen::Matrix<double, kCorners, kCorners> covariance =
        noise * noise * units.topRows<kCorners>();
    covariance.diagonal().array() += kFloor * kFloor;
    const Eigen::Matrix<double, kCorners, kCorners> weight =
        covariance.llt().solve(Eigen::Matrix<double, kCorners, kCorners>::Identity());
    const Eigen::LLT<Eigen::Matrix<double, kCorners, kCorners>> whitening(weight);
    if (whitening.info() != Eigen::Success) return false;
    Eigen::Map<Eigen::Matrix<double, kCorners, kCorners, Eigen::RowMajor>>(tag.whitening.data()) =
        whitening.matrixU();
    tag.corners = at.corners;
    tag.contrast = contrast;
    tag.residual = residual;
    tag.blur_px = std::max(at.blur_u, at.blur_v);
    return true;
}

std::array<Pixel, 4> bend_of_tag(const CameraModel& camera, const std::array<Pixel, 4>& corners) {
    std::array<Pixel, 4> bend{};
    if (camera.k1 == 0 && camera.k2 == 0 && camera.k3 == 0 && camera.p1 == 0 && camera.p2 == 0)
        return bend;
    // Without the lens edges are straight: a homography takes (u, v) in [0, 1] to directions.
    std::array<Pixel, 4> straight;
    for (int k = 0; k < 4; ++k) {
        const Vector3 ray = direction_at(camera, corners[k]);
        straight[k] = {ray.x / ray.z, ray.y / ray.z};
    }
    const UnitSquare seen(corners), without(straight);
    // The straight pattern goes to where the points of the bent one are nearest, by least squares;
    // a corner that moves takes its share of each along.
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Matrix<double, 4, 2> right = Eigen::Matrix<double, 4, 2>::Zero();
    for (int i = 0; i <= kTagCells; ++i)
        for (int j = 0; j <= kTagCells; ++j) {
            const double u = static_cast<double>(i) / kTagCells,
                         v = static_cast<double>(j) / kTagCells;
            const Pixel ray = without.at(u, v), laid = seen.at(u, v);
            Pixel shown;
            if (!project(camera, {1e3 * ray.x, 1e3 * ray.y, 1e3}, shown, nullptr)) return {};
            const Eigen::Vector4d share((1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v);
            normal += share * share.transpose();
            right += share * Eigen::RowVector2d(shown.x - laid.x, shown.y - laid.y);
        }
    const Eigen::Matrix<double, 4, 2> moved = normal.llt().solve(right);
    for (int k = 0; k < 4; ++k) bend[k] = {moved(k, 0), moved(k, 1)};
    return bend;
}

void unbend_tag(const CameraModel& camera, SeenTag& tag) {
    const std::array<Pixel, 4> bend = bend_of_tag(camera, tag.corners);
    for (int k = 0; k < 4; ++k) tag.corners[k].x -= bend[k].x, tag.corners[k].y -= bend[k].y;
}

}  // namespace sonocase
