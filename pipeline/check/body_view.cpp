// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/aim/case_labels.h"
#include "pipeline/check/check_case.h"

namespace sonocase::pipeline {
namespace {

constexpr int kHighestPx = 600;
constexpr double kAmbient = 0.25;

// What is seen: everything but the covers of the body.
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

// Without the white round it.
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

// One ray per pixel in steps of a voxel; shaded by how the surface leans, which the share of seen
// voxels about the point tells.
BodyView body_view(const CaseBundle& bundle,
                   Vector3 along,
                   Vector3 up,
                   const std::vector<Point3>& marks) {
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
    const double mm = 2 * half_v / kHighestPx;  // per pixel
    view.height_px = kHighestPx;
    view.width_px = std::max(1, static_cast<int>(2 * half_u / mm));
    view.rgb.assign(static_cast<std::size_t>(3 * view.width_px * view.height_px), 255);
    const double step = labels.voxel_mm();
    const auto solid = [&](Point3 p) {
        return seen[static_cast<std::size_t>(labels.label(p))] ? 1.0 : 0.0;
    };
    for (int y = 0; y < view.height_px; ++y)
        for (int x = 0; x < view.width_px; ++x) {
            const Point3 pixel = middle + (x * mm - half_u) * right + (half_v - y * mm) * up;
            std::uint8_t* const out =
                &view.rgb[static_cast<std::size_t>(3 * (y * view.width_px + x))];
            bool body = false;
            for (double t = -half_d; t <= half_d; t += step) {
                const Point3 p = pixel + t * along;
                const int label = labels.label(p);
                body = body || label != 0;
                if (!seen[static_cast<std::size_t>(label)]) continue;
                Vector3 inwards;
                for (const double r : {1.0, 2.0, 3.0})
                    for (int axis = 0; axis < 3; ++axis) {
                        Vector3 off;
                        off[axis] = r * step;
                        inwards[axis] += solid(p + off) - solid(p - off);
                    }
                const double facing = std::abs(dot(normalized(inwards), along));
                const double light = kAmbient + (1 - kAmbient) * facing;
                const auto& colour = bundle.labels[static_cast<std::size_t>(label)].colour;
                for (int c = 0; c < 3; ++c)
                    out[c] = static_cast<std::uint8_t>(light * colour[static_cast<std::size_t>(c)] +
                                                       0.5);
                break;
            }
            if (body && out[0] == 255 && out[1] == 255 && out[2] == 255)
                std::fill(out, out + 3, std::uint8_t{225});  // only covers lie here
        }
    for (const Point3 mark : marks) {
        const Vector3 off = mark - middle;
        const int u = static_cast<int>(std::lround((dot(off, right) + half_u) / mm));
        const int v = static_cast<int>(std::lround((half_v - dot(off, up)) / mm));
        for (int y = v - 4; y <= v + 4; ++y)
            for (int x = u - 4; x <= u + 4; ++x) {
                const int r2 = (x - u) * (x - u) + (y - v) * (y - v);
                if (r2 > 18 || x < 0 || y < 0 || x >= view.width_px || y >= view.height_px)
                    continue;
                std::uint8_t* const out =
                    &view.rgb[static_cast<std::size_t>(3 * (y * view.width_px + x))];
                std::fill(out, out + 3, r2 > 8 ? std::uint8_t{0} : std::uint8_t{255});
            }
    }
    return cropped(view);
}

}  // namespace sonocase::pipeline
