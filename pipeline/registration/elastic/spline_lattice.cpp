// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/elastic/spline_lattice.h"

#include "pipeline/base/parallel.h"

namespace sonocase::pipeline::inline registration_elastic {
namespace {

std::size_t as_size(int n) {
    return static_cast<std::size_t>(n);
}

}  // namespace

void LatticeSlopes::resize(std::size_t count) {
    x.resize(count, kNoLanes);
    y.resize(count, kNoLanes);
    z.resize(count, kNoLanes);
}

SplineLattice::SplineLattice(const DisplacementGrid& grid) {
    grid_.size = grid.size;
    grid_.origin_mm = grid.origin_mm;
    grid_.spacing_mm = grid.spacing_mm;
    for (int a = 0; a < 3; ++a) {
        Axis& axis = axis_[as_size(a)];
        const int cells = grid.size[a] - 3;
        axis.at.push_back({0, 0, true, 0});
        for (int c = 0; c < cells; ++c) {
            axis.at.push_back({c, 0, false, 0.25});
            axis.at.push_back({c, 1, false, 0.75});
        }
        axis.at.push_back({cells - 1, 1, true, 1});
        axis.taps.resize(as_size(grid.size[a]));
        for (std::size_t n = 0; n < axis.at.size(); ++n) {
            const double t = axis.at[n].fraction, s = 1 - t, rate = 1 / grid.spacing_mm;
            const double value[4] = {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
                                     (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6};
            const double slope[4] = {-s * s / 2 * rate, (3 * t * t - 4 * t) / 2 * rate,
                                     -(3 * s * s - 4 * s) / 2 * rate, t * t / 2 * rate};
            Weights w{};
            for (std::size_t m = 0; m < 4; ++m) {
                w.value[m] = static_cast<float>(value[m]);
                w.slope[m] = static_cast<float>(slope[m]);
                axis.taps[as_size(axis.at[n].cell) + m].push_back(
                    {static_cast<int>(n), w.value[m], w.slope[m]});
            }
            axis.weights.push_back(w);
        }
    }
}

std::size_t SplineLattice::control_count() const {
    return as_size(grid_.size.x) * as_size(grid_.size.y) * as_size(grid_.size.z);
}

Int3 SplineLattice::size() const {
    return {static_cast<int>(axis_[0].at.size()), static_cast<int>(axis_[1].at.size()),
            static_cast<int>(axis_[2].at.size())};
}

std::size_t SplineLattice::count() const {
    const Int3 n = size();
    return as_size(n.x) * as_size(n.y) * as_size(n.z);
}

Point3 SplineLattice::place(int i, int j, int k) const {
    const int n[3] = {i, j, k};
    Point3 p;
    for (int a = 0; a < 3; ++a) {
        const Position& at = position(a, n[a]);
        p[a] = grid_.origin_mm[a] + (at.cell + at.fraction) * grid_.spacing_mm;
    }
    return p;
}

void SplineLattice::slopes(std::span<const Lanes> control, LatticeSlopes& out) const {
    const Int3 n = grid_.size, s = size();
    const std::size_t sx = as_size(s.x), sy = as_size(s.y), nx = as_size(n.x), ny = as_size(n.y);
    const std::size_t slab = sx * sy;
    out.resize(count());
    // For each layer of control points: slope along x, slope along y, value.
    std::vector<Lanes> by_x(slab * as_size(n.z)), by_y(slab * as_size(n.z)),
        plain(slab * as_size(n.z));
    parallel_for(as_size(n.z), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<Lanes> value(sx * ny), slope(sx * ny);
        for (std::size_t k = begin; k < end; ++k) {
            for (std::size_t j = 0; j < ny; ++j) {
                const Lanes* line = control.data() + nx * (j + ny * k);
                for (std::size_t i = 0; i < sx; ++i) {
                    const Weights& w = axis_[0].weights[i];
                    const Lanes* c = line + axis_[0].at[i].cell;
                    value[i + sx * j] = (w.value[0] * c[0] + w.value[1] * c[1]) +
                                        (w.value[2] * c[2] + w.value[3] * c[3]);
                    slope[i + sx * j] = (w.slope[0] * c[0] + w.slope[1] * c[1]) +
                                        (w.slope[2] * c[2] + w.slope[3] * c[3]);
                }
            }
            for (std::size_t j = 0; j < sy; ++j) {
                const Weights& w = axis_[1].weights[j];
                const Lanes* v = value.data() + sx * as_size(axis_[1].at[j].cell);
                const Lanes* d = slope.data() + sx * as_size(axis_[1].at[j].cell);
                Lanes* to_x = by_x.data() + sx * j + slab * k;
                Lanes* to_y = by_y.data() + sx * j + slab * k;
                Lanes* to = plain.data() + sx * j + slab * k;
                for (std::size_t i = 0; i < sx; ++i) {
                    const Lanes a = v[i], b = v[i + sx], c = v[i + 2 * sx], e = v[i + 3 * sx];
                    to[i] = (w.value[0] * a + w.value[1] * b) + (w.value[2] * c + w.value[3] * e);
                    to_y[i] = (w.slope[0] * a + w.slope[1] * b) + (w.slope[2] * c + w.slope[3] * e);
                    to_x[i] = (w.value[0] * d[i] + w.value[1] * d[i + sx]) +
                              (w.value[2] * d[i + 2 * sx] + w.value[3] * d[i + 3 * sx]);
                }
            }
        }
    });
    parallel_for(as_size(s.z), 2, [&](std::size_t begin, std::size_t end) {
        for (std::size_t k = begin; k < end; ++k) {
            const Weights& w = axis_[2].weights[k];
            const std::size_t first = slab * as_size(axis_[2].at[k].cell);
            const auto along = [&](const std::vector<Lanes>& from, const std::array<float, 4>& f,
                                   std::vector<Lanes>& to) {
                const Lanes* v = from.data() + first;
                Lanes* o = to.data() + slab * k;
                for (std::size_t i = 0; i < slab; ++i)
                    o[i] = (f[0] * v[i] + f[1] * v[i + slab]) +
                           (f[2] * v[i + 2 * slab] + f[3] * v[i + 3 * slab]);
            };
            along(by_x, w.value, out.x);
            along(by_y, w.value, out.y);
            along(plain, w.slope, out.z);
        }
    });
}

void SplineLattice::transposed(const LatticeSlopes& values,
                               bool squared,
                               std::span<Lanes> out) const {
    const Int3 n = grid_.size, s = size();
    const std::size_t sx = as_size(s.x), sy = as_size(s.y), nx = as_size(n.x), ny = as_size(n.y);
    const std::size_t slab = sx * sy;
    const auto value_of = [&](const Tap& t) { return squared ? t.value * t.value : t.value; };
    const auto slope_of = [&](const Tap& t) { return squared ? t.slope * t.slope : t.slope; };
    parallel_for(as_size(n.z), 1, [&](std::size_t begin, std::size_t end) {
        std::vector<Lanes> by_x(slab), by_y(slab), plain(slab), value(sx), slope(sx);
        for (std::size_t k = begin; k < end; ++k) {
            by_x.assign(slab, kNoLanes);
            by_y.assign(slab, kNoLanes);
            plain.assign(slab, kNoLanes);
            for (const Tap& t : axis_[2].taps[k]) {
                const float v = value_of(t), d = slope_of(t);
                const std::size_t from = slab * as_size(t.sample);
                for (std::size_t i = 0; i < slab; ++i) {
                    by_x[i] += v * values.x[from + i];
                    by_y[i] += v * values.y[from + i];
                    plain[i] += d * values.z[from + i];
                }
            }
            for (std::size_t j = 0; j < ny; ++j) {
                value.assign(sx, kNoLanes);
                slope.assign(sx, kNoLanes);
                for (const Tap& t : axis_[1].taps[j]) {
                    const float v = value_of(t), d = slope_of(t);
                    const std::size_t from = sx * as_size(t.sample);
                    for (std::size_t i = 0; i < sx; ++i) {
                        slope[i] += v * by_x[from + i];
                        value[i] += d * by_y[from + i] + v * plain[from + i];
                    }
                }
                Lanes* line = out.data() + nx * (j + ny * k);
                for (std::size_t i = 0; i < nx; ++i) {
                    Lanes sum = kNoLanes;
                    for (const Tap& t : axis_[0].taps[i]) {
                        sum += value_of(t) * value[as_size(t.sample)] +
                               slope_of(t) * slope[as_size(t.sample)];
                    }
                    line[i] = sum;
                }
            }
        }
    });
}

}  // namespace sonocase::pipeline::inline registration_elastic
