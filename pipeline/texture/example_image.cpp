// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/example_image.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sonocase::pipeline::inline texture {

std::vector<float> used_grey(const ExampleImage& image) {
    std::vector<float> out;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) out.push_back(image.grey[i]);
    }
    return out;
}

double GreyMoments::sd() const {
    return count > 0 ? std::sqrt(squares / static_cast<double>(count)) : 0;
}

GreyMoments grey_moments(const ExampleImage& image) {
    GreyMoments m;
    double sum = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (!image.used(i)) continue;
        ++m.count;
        sum += image.grey[i];
    }
    if (m.count == 0) return m;
    m.mean = sum / static_cast<double>(m.count);
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.used(i)) m.squares += (image.grey[i] - m.mean) * (image.grey[i] - m.mean);
    }
    return m;
}

namespace {

constexpr int kMinPixels = 64;

std::size_t drop_not_finite(ExampleImage& image) {
    std::size_t dropped = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (image.use[i] && !std::isfinite(image.grey[i])) {
            image.use[i] = 0;
            ++dropped;
        }
        if (!image.use[i]) image.grey[i] = 0;
    }
    return dropped;
}

// Rows and columns at the rim that have a single value: the border of a window, black or drawn.
std::size_t drop_flat_rim(ExampleImage& image) {
    const auto flat = [&](int x0, int y0, int dx, int dy, int n) {
        for (int i = 1; i < n; ++i) {
            if (image.grey[image.index(x0 + i * dx, y0 + i * dy)] !=
                image.grey[image.index(x0, y0)])
                return false;
        }
        return true;
    };
    int left = 0, right = image.width - 1, top = 0, bottom = image.height - 1;
    const auto w = [&] { return right - left + 1; };
    const auto h = [&] { return bottom - top + 1; };
    for (bool again = true; again && w() > 2 && h() > 2;) {
        again = false;
        if (flat(left, top, 1, 0, w())) ++top, again = true;
        if (flat(left, bottom, 1, 0, w())) --bottom, again = true;
        if (flat(left, top, 0, 1, h())) ++left, again = true;
        if (flat(right, top, 0, 1, h())) --right, again = true;
    }
    if (w() <= 2 || h() <= 2) return 0;  // all lines are flat: not a rim
    std::size_t dropped = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            if (x >= left && x <= right && y >= top && y <= bottom) continue;
            dropped += image.use[image.index(x, y)];
            image.use[image.index(x, y)] = 0;
        }
    }
    return dropped;
}

// Marks straight runs of one exact value well above the mean, longer than any in speckle.
void mark_runs(const ExampleImage& image, double limit, std::vector<std::uint8_t>& mark) {
    const auto scan = [&](bool rows) {
        const int lines = rows ? image.height : image.width;
        const int n = rows ? image.width : image.height;
        const int min_run = std::max(12, n / 3);
        for (int line = 0; line < lines; ++line) {
            const auto at = [&](int i) {
                return rows ? image.index(i, line) : image.index(line, i);
            };
            for (int begin = 0; begin < n;) {
                int end = begin + 1;
                while (end < n && image.grey[at(end)] == image.grey[at(begin)]) ++end;
                if (end - begin >= min_run && image.grey[at(begin)] > limit) {
                    for (int i = begin; i < end; ++i) mark[at(i)] = 1;
                }
                begin = end;
            }
        }
    };
    scan(true);
    scan(false);
}

// Marks text: pixels of one exact bright value that is far more frequent than its neighbours in the
// histogram, and that contrasts sharply with the pixels beside it.
void mark_strokes(const ExampleImage& image, double limit, std::vector<std::uint8_t>& mark) {
    std::array<std::size_t, 256> histogram{};
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (!image.use[i]) continue;
        ++histogram[std::clamp(std::lround(image.grey[i]), 0l, 255l)];
    }
    for (int v = std::max(8, static_cast<int>(limit)); v < 256; ++v) {
        double beside = 0;
        for (int d = 2; d <= 8; ++d) beside += static_cast<double>(histogram[v - d]);
        beside /= 7;
        const auto here = static_cast<double>(histogram[v]);
        if (here < 12 || here < 8 * (beside + 0.5)) continue;
        std::size_t edges = 0, bright = 0;
        std::vector<std::size_t> found;
        for (int y = 0; y < image.height; ++y) {
            for (int x = 0; x < image.width; ++x) {
                const std::size_t i = image.index(x, y);
                if (!image.use[i] || std::lround(image.grey[i]) != v) continue;
                found.push_back(i);
                ++bright;
                float steepest = 0;
                constexpr int kBeside[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
                for (const auto& d : kBeside) {
                    const int xx = x + d[0], yy = y + d[1];
                    if (xx < 0 || yy < 0 || xx >= image.width || yy >= image.height) continue;
                    steepest = std::max(steepest, image.grey[i] - image.grey[image.index(xx, yy)]);
                }
                if (steepest > 60) ++edges;
            }
        }
        if (2 * edges < bright) continue;  // saturated tissue has gradual edges
        for (const std::size_t i : found) mark[i] = 1;
    }
}

std::size_t drop_marked(ExampleImage& image, const std::vector<std::uint8_t>& mark) {
    std::size_t dropped = 0;
    for (int y = 0; y < image.height; ++y) {
        for (int x = 0; x < image.width; ++x) {
            if (!mark[image.index(x, y)]) continue;
            for (int dy = -1; dy <= 1; ++dy) {  // with the soft rim around it
                for (int dx = -1; dx <= 1; ++dx) {
                    const int xx = x + dx, yy = y + dy;
                    if (xx < 0 || yy < 0 || xx >= image.width || yy >= image.height) continue;
                    dropped += image.use[image.index(xx, yy)];
                    image.use[image.index(xx, yy)] = 0;
                }
            }
        }
    }
    return dropped;
}

struct Row {
    double t = 0;  // depth, -1 at the top to 1 at the bottom
    double weight = 0, mean = 0, deviation = 0;
};

std::vector<Row> row_statistics(const ExampleImage& image) {
    std::vector<Row> rows;
    for (int y = 0; y < image.height; ++y) {
        Row row;
        row.t = image.height > 1 ? 2.0 * y / (image.height - 1) - 1 : 0;
        for (int x = 0; x < image.width; ++x) {
            if (!image.used(image.index(x, y))) continue;
            row.weight += 1;
            row.mean += image.grey[image.index(x, y)];
        }
        if (row.weight < 2) continue;
        row.mean /= row.weight;
        for (int x = 0; x < image.width; ++x) {
            if (!image.used(image.index(x, y))) continue;
            row.deviation += std::abs(image.grey[image.index(x, y)] - row.mean);
        }
        row.deviation /= row.weight;
        rows.push_back(row);
    }
    return rows;
}

// Weighted line through (t, value).
std::pair<double, double> fit_line(const std::vector<Row>& rows, double Row::*value) {
    double w = 0, st = 0, sv = 0;
    for (const Row& r : rows) w += r.weight, st += r.weight * r.t, sv += r.weight * r.*value;
    const double mt = st / w, mv = sv / w;
    double tt = 0, tv = 0;
    for (const Row& r : rows) {
        tt += r.weight * (r.t - mt) * (r.t - mt);
        tv += r.weight * (r.t - mt) * (r.*value - mv);
    }
    const double slope = tt > 0 ? tv / tt : 0;
    return {mv - slope * mt, slope};
}

void remove_trend(PreparedExample& prepared) {
    ExampleImage& image = prepared.image;
    std::vector<Row> rows = row_statistics(image);
    if (rows.size() < 4) return;
    const GreyMoments before = grey_moments(image);
    const auto [offset, slope] = fit_line(rows, &Row::mean);
    // Whether a parabola explains more than noise would. Rows of one grain are correlated, and
    // therefore grains are counted.
    double curve = 0, shared = 0, step = 0, power = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
        rows[i].mean -= offset + slope * rows[i].t;
        power += rows[i].mean * rows[i].mean;
        if (i > 0) step += (rows[i].mean - rows[i - 1].mean) * (rows[i].mean - rows[i - 1].mean);
        const double p = 1.5 * rows[i].t * rows[i].t - 0.5;
        curve += p * rows[i].mean;
        shared += p * p;
    }
    const double grain_rows = step > 0 ? std::max(1.0, std::sqrt(2 * power / step) * 2) : 1e9;
    curve /= shared;
    const double share = power > 0 ? curve * curve * shared / power : 0;
    const double grains = static_cast<double>(rows.size()) / grain_rows;
    if (grains < 16 || share < 0.35) curve = 0;
    for (int y = 0; y < image.height; ++y) {
        const double t = image.height > 1 ? 2.0 * y / (image.height - 1) - 1 : 0;
        const double trend = offset + slope * t + curve * (1.5 * t * t - 0.5) - before.mean;
        for (int x = 0; x < image.width; ++x)
            image.grey[image.index(x, y)] -= static_cast<float>(trend);
    }
    prepared.trend_grey = 2 * slope;

    // Gain on a linear display multiplies: mean and spread then increase together.
    const double mean_top = offset - slope, mean_bottom = offset + slope;
    const double rise = std::max(mean_bottom, 1.0) / std::max(mean_top, 1.0);
    const auto [level, change] = fit_line(row_statistics(image), &Row::deviation);
    const double spread =
        std::max(level + change, 0.05 * level) / std::max(level - change, 0.05 * level);
    const bool together =
        std::abs(std::log(rise)) > std::log(1.5) && std::log(spread) / std::log(rise) > 0.5;
    if (!together) return;
    for (int y = 0; y < image.height; ++y) {
        const double t = image.height > 1 ? 2.0 * y / (image.height - 1) - 1 : 0;
        const double factor = offset / std::max(offset + slope * t, 0.2 * offset);
        for (int x = 0; x < image.width; ++x) {
            float& grey = image.grey[image.index(x, y)];
            grey = static_cast<float>(before.mean + (grey - before.mean) * factor);
        }
    }
    prepared.spread_ratio = rise;
}

std::string percent(double share) {
    const auto tenths = static_cast<int>(std::lround(share * 1000));
    return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " %";
}

}  // namespace

Result<PreparedExample> prepare_example(const ExampleImage& example) {
    PreparedExample out;
    out.image = example;
    ExampleImage& image = out.image;
    if (image.use.empty()) image.use.assign(image.count(), 1);
    const auto share = [&](std::size_t n) {
        return percent(static_cast<double>(n) / static_cast<double>(image.count()));
    };
    const auto too_few = [&](std::size_t used) {
        return Error{std::to_string(used) + " usable pixels", example.name,
                     "an example needs at least " + std::to_string(kMinPixels) +
                         "; choose a larger rectangle or mask"};
    };
    const std::size_t not_finite = drop_not_finite(image);
    if (not_finite > 0) {
        out.warnings.push_back(example.name + ": " + share(not_finite) +
                               " of the pixels are not finite and were left out.");
    }
    GreyMoments m = grey_moments(image);
    if (m.count < kMinPixels) return too_few(m.count);
    if (m.sd() < 1e-6) {
        return Error{"every pixel has grey " + std::to_string(std::lround(m.mean)), example.name,
                     "a texture cannot be learned from a constant image; choose a patch of tissue"};
    }
    std::vector<std::uint8_t> mark(image.count(), 0);
    const std::size_t rim = drop_flat_rim(image);
    m = grey_moments(image);
    mark_runs(image, m.mean + 1.5 * m.sd(), mark);
    mark_strokes(image, m.mean + 2.5 * m.sd(), mark);
    std::size_t burnt = 0;
    for (const std::uint8_t b : mark) burnt += b;
    // An image with more than a fifth in strokes has two levels; it is not text on tissue.
    if (burnt > 0 && 5 * burnt < image.count()) {
        burnt = drop_marked(image, mark);
    } else {
        burnt = 0;
    }
    if (rim + burnt > 0) {
        out.warnings.push_back(example.name + ": " + share(rim + burnt) +
                               " of the pixels look burnt in (frame or text) and were left out.");
    }
    m = grey_moments(image);
    if (m.count < kMinPixels) return too_few(m.count);
    std::size_t clipped = 0;
    bool levels[256] = {};
    int distinct = 0;
    for (std::size_t i = 0; i < image.count(); ++i) {
        if (!image.used(i)) continue;
        if (image.grey[i] <= 0 || image.grey[i] >= 255) ++clipped;
        bool& seen = levels[std::clamp(std::lround(image.grey[i]), 0l, 255l)];
        if (!seen) ++distinct;
        seen = true;
    }
    out.saturated = static_cast<double>(clipped) / static_cast<double>(m.count);
    if (out.saturated > 0.05) {
        out.warnings.push_back(example.name + ": " + percent(out.saturated) +
                               " of the pixels are clipped to black or white; a patch with less "
                               "gain shows more of the tissue.");
    }
    if (distinct < 8) {
        out.warnings.push_back(example.name + ": only " + std::to_string(distinct) +
                               " grey levels; the texture will have no more.");
    }
    // Subtracting a ramp would turn a few levels into many, and separate values that were clipped
    // to the same one.
    if (distinct >= 8 && out.saturated <= 0.05) {
        remove_trend(out);
        for (float& grey : image.grey) grey = std::clamp(grey, 0.f, 255.f);
    }
    m = grey_moments(image);
    if (m.sd() < 1e-6) {
        return Error{"nothing but a depth trend", example.name,
                     "the patch holds no texture; choose a patch of tissue"};
    }
    out.mean = m.mean;
    out.sd = m.sd();
    return out;
}

}  // namespace sonocase::pipeline::inline texture
