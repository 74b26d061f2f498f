// SPDX-License-Identifier: Apache-2.0

#include "pipeline/segmentation/level_set_smoothing.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>

#include "pipeline/base/parallel.h"
#include "pipeline/base/stopwatch.h"
#include "pipeline/segmentation/distance/signed_distance.h"

namespace sonocase::pipeline::inline segmentation {
namespace {

// phi of one label in its box, and the voxels that move.
struct Layer {
    VoxelBox box;
    float h = 1;
    std::vector<float> phi;
    std::vector<std::uint32_t> band;  // voxels of the box that move
    std::vector<float> start;         // phi_0 of each, # band
};

// Distances to a voxel's neighbours in memory, 0 at the border of the box: a missing neighbour
// repeats the border and must not act as a surface.
struct Stencil {
    std::size_t xm, xp, ym, yp, zm, zp;
};

Stencil stencil(const VoxelBox& box, Int3 v) {
    const std::size_t sy = static_cast<std::size_t>(box.size.x);
    const std::size_t sz = sy * static_cast<std::size_t>(box.size.y);
    Stencil s;
    s.xm = v.x > 0 ? 1 : 0;
    s.xp = v.x + 1 < box.size.x ? 1 : 0;
    s.ym = v.y > 0 ? sy : 0;
    s.yp = v.y + 1 < box.size.y ? sy : 0;
    s.zm = v.z > 0 ? sz : 0;
    s.zp = v.z + 1 < box.size.z ? sz : 0;
    return s;
}

float curvature(const float* p, const Stencil& s, float h) {
    const float c = *p;
    const float xm = *(p - s.xm), xp = *(p + s.xp), ym = *(p - s.ym), yp = *(p + s.yp),
                zm = *(p - s.zm), zp = *(p + s.zp);
    const float dx = 0.5f * (xp - xm), dy = 0.5f * (yp - ym), dz = 0.5f * (zp - zm);
    const float dxx = xp - 2 * c + xm, dyy = yp - 2 * c + ym, dzz = zp - 2 * c + zm;
    const float dxy =
        0.25f * (*(p + s.xp + s.yp) - *(p - s.xm + s.yp) - *(p + s.xp - s.ym) + *(p - s.xm - s.ym));
    const float dxz =
        0.25f * (*(p + s.xp + s.zp) - *(p - s.xm + s.zp) - *(p + s.xp - s.zm) + *(p - s.xm - s.zm));
    const float dyz =
        0.25f * (*(p + s.yp + s.zp) - *(p - s.ym + s.zp) - *(p + s.yp - s.zm) + *(p - s.ym - s.zm));
    const float g2 = dx * dx + dy * dy + dz * dz;
    // On a medial axis the gradient is zero and the quotient is 0 / 0; nothing needs smoothing
    // there.
    if (g2 < 1e-4f * h * h) return 0;
    const float top = dxx * (dy * dy + dz * dz) + dyy * (dx * dx + dz * dz) +
                      dzz * (dx * dx + dy * dy) -
                      2 * (dxy * dx * dy + dxz * dx * dz + dyz * dy * dz);
    const float kappa = top / (h * g2 * std::sqrt(g2));  // differences are over voxels, not mm
    // A stencil resolves no curvature above about 1/h in each direction.
    return std::clamp(kappa, -2.0f / h, 2.0f / h);
}

Int3 unravel(const VoxelBox& box, std::size_t at) {
    const std::size_t nx = static_cast<std::size_t>(box.size.x);
    const std::size_t ny = static_cast<std::size_t>(box.size.y);
    return {static_cast<int>(at % nx), static_cast<int>(at / nx % ny),
            static_cast<int>(at / nx / ny)};
}

// Trilinear interpolation at voxel coordinates, clamped to the box, of a field on the box.
float sample(const VoxelBox& box, const std::vector<float>& field, float x, float y, float z) {
    const auto cell = [](float v, int n, int* i, float* t) {
        v = std::clamp(v, 0.0f, static_cast<float>(n - 1));
        *i = std::min(static_cast<int>(v), std::max(0, n - 2));
        *t = v - static_cast<float>(*i);
    };
    int i = 0, j = 0, k = 0;
    float u = 0, v = 0, w = 0;
    cell(x, box.size.x, &i, &u);
    cell(y, box.size.y, &j, &v);
    cell(z, box.size.z, &k, &w);
    const std::size_t sx = box.size.x > 1 ? 1 : 0;
    const std::size_t sy = box.size.y > 1 ? static_cast<std::size_t>(box.size.x) : 0;
    const std::size_t sz = box.size.z > 1 ? static_cast<std::size_t>(box.size.x) * box.size.y : 0;
    const float* p = field.data() + box.index(i, j, k);
    const auto line = [&](const float* q) { return q[0] + u * (q[sx] - q[0]); };
    const float a = line(p), b = line(p + sy), c = line(p + sz), d = line(p + sy + sz);
    const float ab = a + v * (b - a), cd = c + v * (d - c);
    return ab + w * (cd - ab);
}

void evolve(Layer* layer, const LevelSetOptions& options, float dt) {
    const VoxelBox& box = layer->box;
    const float h = layer->h, k0 = static_cast<float>(options.k0);
    std::vector<float> curve(options.closest_point ? layer->phi.size() : 0);
    std::vector<float> next(layer->band.size());
    constexpr std::size_t kGrain = 16384;
    for (int step = 0; step < options.iterations; ++step) {
        const float* phi = layer->phi.data();
        if (options.closest_point) {
            parallel_for(layer->band.size(), kGrain, [&](std::size_t begin, std::size_t end) {
                for (std::size_t b = begin; b < end; ++b) {
                    const std::size_t at = layer->band[b];
                    curve[at] = curvature(phi + at, stencil(box, unravel(box, at)), h);
                }
            });
        }
        parallel_for(layer->band.size(), kGrain, [&](std::size_t begin, std::size_t end) {
            for (std::size_t b = begin; b < end; ++b) {
                const std::size_t at = layer->band[b];
                const Int3 v = unravel(box, at);
                const Stencil s = stencil(box, v);
                const float* p = phi + at;
                float c = 0;
                if (options.closest_point) {
                    const float dx = *(p + s.xp) - *(p - s.xm), dy = *(p + s.yp) - *(p - s.ym),
                                dz = *(p + s.zp) - *(p - s.zm);
                    const float length = std::sqrt(dx * dx + dy * dy + dz * dz);
                    const float go = length > 0.02f * h ? *p / (h * length) : 0;
                    c = sample(box, curve, static_cast<float>(v.x) - go * dx,
                               static_cast<float>(v.y) - go * dy,
                               static_cast<float>(v.z) - go * dz);
                } else {
                    c = curvature(p, s, h);
                }
                next[b] = *p + dt * (k0 * (layer->start[b] - *p) + c);
            }
        });
        for (std::size_t b = 0; b < next.size(); ++b) layer->phi[layer->band[b]] = next[b];
    }
}

std::optional<Error> check(const Grid& grid, const LevelSetOptions& options, double time_step) {
    const char* const where = "level-set smoothing";
    const Vector3 h = grid.spacing_mm;
    if (std::abs(h.x - h.y) > 1e-6 * h.x || std::abs(h.x - h.z) > 1e-6 * h.x) {
        char found[96];
        std::snprintf(found, sizeof found, "voxels of %g x %g x %g mm", h.x, h.y, h.z);
        return Error{found, where, "cubic voxels: resample first"};
    }
    const double limit = max_stable_step(options.k0, h.x);
    if (!(options.k0 > 0) || options.iterations < 1 || !(time_step <= limit)) {
        char found[128];
        std::snprintf(found, sizeof found, "time step %g with K0 %g and %d iterations", time_step,
                      options.k0, options.iterations);
        char wanted[128];
        std::snprintf(
            wanted, sizeof wanted,
            "K0 > 0, at least one iteration and a time step of at most %.4g, the limit of "
            "stability",
            limit);
        return Error{found, where, wanted};
    }
    return std::nullopt;
}

Layer make_layer(const LabelVolume& volume, std::uint8_t label, const VoxelBox& box, double band) {
    const double h = volume.grid.spacing_mm.x;
    const int pad = static_cast<int>(std::ceil(band / h)) + 2;
    Layer layer;
    layer.box = grow(box, {pad, pad, pad}, volume.grid.size);
    layer.h = static_cast<float>(h);
    signed_distance(volume, label, layer.box, band + h, {true, true, true}, &layer.phi);
    for (std::size_t at = 0; at < layer.phi.size(); ++at) {
        if (std::abs(layer.phi[at]) > static_cast<float>(band)) continue;
        layer.band.push_back(static_cast<std::uint32_t>(at));
        layer.start.push_back(layer.phi[at]);
    }
    return layer;
}

// Gives the label the voxels where its phi is the smallest so far.
void claim(const Layer& layer,
           std::uint8_t label,
           std::vector<float>* smallest,
           LabelVolume* volume) {
    for (int k = 0; k < layer.box.size.z; ++k) {
        for (int j = 0; j < layer.box.size.y; ++j) {
            const float* phi = layer.phi.data() + layer.box.index(0, j, k);
            const std::size_t to =
                volume->grid.index(layer.box.first.x, layer.box.first.y + j, layer.box.first.z + k);
            for (std::size_t i = 0; i < static_cast<std::size_t>(layer.box.size.x); ++i) {
                if (phi[i] < (*smallest)[to + i]) {
                    (*smallest)[to + i] = phi[i];
                    volume->voxels[to + i] = label;
                }
            }
        }
    }
}

}  // namespace

double max_stable_step(double k0, double voxel_mm) {
    return 2 / (k0 + 8 / (voxel_mm * voxel_mm));
}

Result<LevelSetResult> level_set_smoothing(const LabelVolume& volume,
                                           const LevelSetOptions& options,
                                           const Progress& progress) {
    const Stopwatch watch;
    const double h = volume.grid.spacing_mm.x;
    const double limit = max_stable_step(options.k0, h);
    const double dt = options.time_step > 0 ? options.time_step : 0.8 * limit;
    if (auto error = check(volume.grid, options, dt)) return *error;
    LevelSetResult result;
    result.time_step = dt;
    result.volume = volume;
    std::vector<float> smallest(volume.grid.voxel_count(), INFINITY);
    const std::vector<VoxelBox> boxes = label_boxes(volume);
    for (std::size_t l = 0; l < boxes.size(); ++l) {
        if (boxes[l].empty()) continue;
        report_progress(progress, static_cast<double>(l) / static_cast<double>(boxes.size()),
                        "level sets");
        const auto label = static_cast<std::uint8_t>(l);
        Layer layer = make_layer(volume, label, boxes[l], std::max(3.0, options.band_vx) * h);
        evolve(&layer, options, static_cast<float>(dt));
        claim(layer, label, &smallest, &result.volume);
    }
    result.changes =
        compare_volumes(volume.labels, label_volumes_ml(volume), label_volumes_ml(result.volume));
    for (LabelChange& c : result.changes) {
        if (c.change() < -0.2)
            c.note = "the curvature term removes what is thinner than 4 / sqrt(K0)";
    }
    result.report.stage = stage_names::kSmooth;
    result.report.measures = {{"k0", options.k0},
                              {"iterations", static_cast<double>(options.iterations)},
                              {"time_step", dt},
                              {"time_step_limit", limit}};
    report_changes(result.changes, kMaxExpectedChange, &result.report);
    result.report.seconds = watch.seconds();
    report_progress(progress, 1, "level sets");
    return result;
}

}  // namespace sonocase::pipeline::inline segmentation
