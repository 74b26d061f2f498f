// SPDX-License-Identifier: Apache-2.0

// Rectangles of the window, in u: pixels divided by the scale. x to the right, y down.
#pragma once

#include <algorithm>

namespace sonocase::runtime {

struct Box {
    float x = 0, y = 0, w = 0, h = 0;

    float right() const { return x + w; }
    float bottom() const { return y + h; }
    bool empty() const { return w <= 0 || h <= 0; }
    Box inset(float by) const { return inset(by, by); }
    Box inset(float across, float down) const {
        return {x + across, y + down, std::max(w - 2 * across, 0.0f), std::max(h - 2 * down, 0.0f)};
    }
    bool holds(const Box& b, float slack = 0.01f) const {
        return b.x >= x - slack && b.y >= y - slack && b.right() <= right() + slack &&
               b.bottom() <= bottom() + slack;
    }
    bool overlaps(const Box& b, float slack = 0.01f) const {
        return x < b.right() - slack && b.x < right() - slack && y < b.bottom() - slack &&
               b.y < bottom() - slack;
    }

    // Cut a part off; what is left, less the gap, stays.
    Box take_top(float height, float gap = 0) {
        const Box part{x, y, w, std::min(height, h)};
        y += part.h + gap;
        h = std::max(h - part.h - gap, 0.0f);
        return part;
    }
    Box take_bottom(float height, float gap = 0) {
        const float taken = std::min(height, h);
        const Box part{x, bottom() - taken, w, taken};
        h = std::max(h - taken - gap, 0.0f);
        return part;
    }
    Box take_left(float width, float gap = 0) {
        const Box part{x, y, std::min(width, w), h};
        x += part.w + gap;
        w = std::max(w - part.w - gap, 0.0f);
        return part;
    }
    Box take_right(float width, float gap = 0) {
        const float taken = std::min(width, w);
        const Box part{right() - taken, y, taken, h};
        w = std::max(w - taken - gap, 0.0f);
        return part;
    }
    // Column i of n equal ones with a gap between them.
    Box column(int i, int n, float gap) const {
        const float width = (w - gap * static_cast<float>(n - 1)) / static_cast<float>(n);
        return {x + static_cast<float>(i) * (width + gap), y, width, h};
    }
};

}  // namespace sonocase::runtime
