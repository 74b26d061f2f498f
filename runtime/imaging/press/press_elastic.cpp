// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_elastic.h"

#include <algorithm>
#include <array>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "press_elastic.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>
// This comes after Highway's: it is included again for each instruction set.
#include "runtime/imaging/press/press_law-inl.h"

HWY_BEFORE_NAMESPACE();
namespace sonocase::runtime::press::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// At most 16 lanes, so that the columns are a whole number of groups.
using Lanes = hn::CappedTag<float, 16>;

// Adds up one number per column by halves, in the same order for any number of lanes.
float sum_columns(std::array<float, kColumns>& each) {
    for (std::size_t half = kColumns / 2; half >= 3; half /= 2)
        for (std::size_t i = 0; i < half; ++i) each[i] += each[i + half];
    return (each[0] + each[1]) + each[2];
}

// 1 / (E B) of every part of a row.
void set_compliance(const PressSamples& s, const PressFace& face, PressElastic& w) {
    const Lanes d;
    const auto one = hn::Set(d, 1.0f);
    const auto inverse_a2 =
        hn::Set(d, static_cast<float>(1 / (face.half_height_mm * face.half_height_mm)));
    for (int j = 0; j < kFineRows; ++j) {
        const double t = row_middle(j / kParts);
        const auto inverse_t2 = hn::Set(d, static_cast<float>(1 / (t * t)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto b2 = hn::Div(one, hn::Add(inverse_a2, hn::LoadU(d, s.edge.data() + i)));
            const auto tissue = hn::Sub(one, hn::LoadU(d, s.drains.row(j) + i));
            const auto bracket = hn::Add(one, hn::Mul(tissue, hn::Mul(b2, inverse_t2)));
            hn::StoreU(hn::Div(one, hn::Mul(hn::LoadU(d, s.stiffness_kpa.row(j) + i), bracket)), d,
                       w.compliance.row(j) + i);
        });
    }
}

// Couplings between columns and to the foundation, which are the same in every increment.
void set_couplings(const PressSamples& s, const PressFace& face, PressElastic& w) {
    const Lanes d;
    const double h = column_width_mm(face);
    std::array<float, kRows> beside{}, below{};
    for (int k = 0; k < kRows; ++k) {
        const double t = row_middle(k), width = field_width_mm(face.half_height_mm, t);
        const double spread = face.radius_mm > 0 ? 1 + t / face.radius_mm : 1;
        // Half of a cell's share for the node above it and half for the one below; half of the sum
        // of two columns.
        beside[k] = static_cast<float>(0.25 * width * kShear * row_height(k) / (h * spread));
        below[k] = static_cast<float>(0.5 * kFoundation / width * row_height(k) * h * spread);
    }
    for (int k = 0; k < kRows; ++k) {
        const int above = std::max(k - 1, 0);
        const float share = k == 0 ? 0.0f : 1.0f;
        const auto beside_here = hn::Set(d, beside[k]);
        const auto beside_above = hn::Set(d, share * beside[above]);
        const auto below_here = hn::Set(d, below[k]);
        const auto below_above = hn::Set(d, share * below[above]);
        for_columns(d, [&](int i) HWY_ATTR {
            const auto here = hn::LoadU(d, s.lateral_kpa.row(k) + i);
            const auto up = hn::LoadU(d, s.lateral_kpa.row(above) + i);
            const auto pair = hn::Add(here, hn::LoadU(d, s.lateral_kpa.row(k) + i + 1));
            const auto up_pair = hn::Add(up, hn::LoadU(d, s.lateral_kpa.row(above) + i + 1));
            hn::StoreU(hn::Add(hn::Mul(beside_here, pair), hn::Mul(beside_above, up_pair)), d,
                       w.right.row(k) + i);
            hn::StoreU(hn::Add(hn::Mul(below_here, here), hn::Mul(below_above, up)), d,
                       w.ground.row(k) + i);
        });
        w.right.row(k)[kColumns - 1] = 0;
    }
    for (int i = 0; i < kColumns; ++i) {
        for (int k = 0; k < kRows; ++k)
            w.free.row(k)[i] = k < s.fixed_row[i] && !(k == 0 && s.touching[i]) ? 1.0f : 0.0f;
    }
}

// Modulus of every row at the stress reached (the parts of a row are in series), then the pivots of
// each column by itself.
void set_moduli(const PressSamples& s, const PressFace& face, PressElastic& w) {
    const Lanes d;
    const auto quarter = hn::Set(d, 1.0f / kParts);
    for (int k = 0; k < kRows; ++k) {
        const double t = row_middle(k), spread = face.radius_mm > 0 ? 1 + t / face.radius_mm : 1;
        const auto scale =
            hn::Set(d, static_cast<float>(field_width_mm(face.half_height_mm, t) *
                                          column_width_mm(face) * spread / row_height(k)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto stress = hn::LoadU(d, w.stress_kpa.row(k) + i);
            auto yielding = hn::Zero(d);
            for (int j = k * kParts; j < (k + 1) * kParts; ++j) {
                const auto compliance = hn::LoadU(d, w.compliance.row(j) + i);
                const auto strain = hn::Mul(stress, compliance);
                auto slope = tissue_stretch(d, strain).slope;
                if (s.lumen[j])
                    slope = mix(d, slope, lumen_stretch(d, strain).slope,
                                hn::LoadU(d, s.drains.row(j) + i));
                yielding = hn::Add(yielding, hn::Mul(slope, compliance));
            }
            hn::StoreU(hn::Div(scale, hn::Mul(yielding, quarter)), d, w.down.row(k) + i);
        });
    }
    for (int k = 0; k < kRows; ++k)
        for_columns(d, [&](int i) HWY_ATTR {
            const auto right = hn::LoadU(d, w.right.row(k) + i);
            const auto left = hn::LoadU(d, w.right.row(k) + i - 1);
            auto pivot = hn::Add(hn::Add(hn::LoadU(d, w.down.row(k) + i), hn::Add(left, right)),
                                 hn::LoadU(d, w.ground.row(k) + i));
            if (k > 0) {
                const auto up = hn::LoadU(d, w.down.row(k - 1) + i);
                pivot = hn::Sub(hn::Add(pivot, up),
                                hn::Mul(hn::Mul(up, up), hn::LoadU(d, w.pivot.row(k - 1) + i)));
            }
            // Zero where a node does not move, whatever the force on it.
            hn::StoreU(hn::Div(hn::LoadU(d, w.free.row(k) + i), pivot), d, w.pivot.row(k) + i);
        });
}

// Row k of A v, and v . A v of each column.
template <class D>
HWY_INLINE void apply_row(
    D d, const PressElastic& w, const Plane<kRows + 1>& v, int k, Plane<kRows>& out, float* each) {
    for_columns(d, [&](int i) HWY_ATTR {
        const float* row = v.row(k) + i;
        const auto here = hn::LoadU(d, row);
        const auto right =
            hn::Mul(hn::LoadU(d, w.right.row(k) + i), hn::Sub(here, hn::LoadU(d, row + 1)));
        const auto left =
            hn::Mul(hn::LoadU(d, w.right.row(k) + i - 1), hn::Sub(here, hn::LoadU(d, row - 1)));
        const auto down =
            hn::Mul(hn::LoadU(d, w.down.row(k) + i), hn::Sub(here, hn::LoadU(d, v.row(k + 1) + i)));
        auto force = hn::Add(hn::Add(right, left),
                             hn::Add(down, hn::Mul(hn::LoadU(d, w.ground.row(k) + i), here)));
        if (k > 0)
            force = hn::Add(force, hn::Mul(hn::LoadU(d, w.down.row(k - 1) + i),
                                           hn::Sub(here, hn::LoadU(d, v.row(k - 1) + i))));
        hn::StoreU(force, d, out.row(k) + i);
        hn::StoreU(hn::Add(hn::LoadU(d, each + i), hn::Mul(force, here)), d, each + i);
    });
}

// Subtracts `step` times the product from the residual, then sets `relaxed` to the solution of
// every column by itself for that residual; returns residual . relaxed.
float relax(float step, PressElastic& w) {
    const Lanes d;
    const auto off = hn::Set(d, step);
    for (int k = 0; k < kRows; ++k)
        for_columns(d, [&](int i) HWY_ATTR {
            const auto residual = hn::Sub(hn::LoadU(d, w.residual.row(k) + i),
                                          hn::Mul(off, hn::LoadU(d, w.product.row(k) + i)));
            hn::StoreU(residual, d, w.residual.row(k) + i);
            auto force = residual;
            if (k > 0)
                force = hn::Add(force, hn::Mul(hn::LoadU(d, w.down.row(k - 1) + i),
                                               hn::LoadU(d, w.relaxed.row(k - 1) + i)));
            hn::StoreU(hn::Mul(force, hn::LoadU(d, w.pivot.row(k) + i)), d, w.relaxed.row(k) + i);
        });
    std::array<float, kColumns> each{};
    for (int k = kRows - 1; k >= 0; --k)
        for_columns(d, [&](int i) HWY_ATTR {
            auto value = hn::LoadU(d, w.relaxed.row(k) + i);
            if (k + 1 < kRows) {
                const auto pull = hn::Mul(hn::LoadU(d, w.down.row(k) + i),
                                          hn::LoadU(d, w.relaxed.row(k + 1) + i));
                value = hn::Add(value, hn::Mul(pull, hn::LoadU(d, w.pivot.row(k) + i)));
                hn::StoreU(value, d, w.relaxed.row(k) + i);
            }
            const auto sum = hn::LoadU(d, each.data() + i);
            hn::StoreU(hn::Add(sum, hn::Mul(value, hn::LoadU(d, w.residual.row(k) + i))), d,
                       each.data() + i);
        });
    return sum_columns(each);
}

// Row k: shift += step * search, then search = relaxed + keep * search.
template <class D, class V>
HWY_INLINE void turn_row(D d, V step, V keep, int k, PressElastic& w) {
    for_columns(d, [&](int i) HWY_ATTR {
        const auto search = hn::LoadU(d, w.search.row(k) + i);
        hn::StoreU(hn::Add(hn::LoadU(d, w.shift.row(k) + i), hn::Mul(step, search)), d,
                   w.shift.row(k) + i);
        hn::StoreU(hn::Add(hn::LoadU(d, w.relaxed.row(k) + i), hn::Mul(keep, search)), d,
                   w.search.row(k) + i);
    });
}

// Turns every row, and applies A to the new search one row behind: the planes are larger than the
// nearest cache and are gone through only once. Returns search . A search.
float turn_and_apply(float step, float keep, PressElastic& w) {
    const Lanes d;
    const auto s = hn::Set(d, step), kept = hn::Set(d, keep);
    std::array<float, kColumns> each{};
    for (int k = 0; k < kRows; ++k) {
        turn_row(d, s, kept, k, w);
        if (k > 0) apply_row(d, w, w.search, k - 1, w.product, each.data());
    }
    apply_row(d, w, w.search, kRows - 1, w.product, each.data());
    return sum_columns(each);
}

void solve_increment(int iterations, PressElastic& w) {
    const Lanes d;
    std::array<float, kColumns> each{};
    for (int k = 0; k < kRows; ++k) apply_row(d, w, w.shift, k, w.product, each.data());
    w.residual.values.fill(0);
    w.search.values.fill(0);
    float before = 1, step = 1;  // the first residual is 0 - A shift
    for (int n = 0; n < iterations; ++n) {
        const float now = relax(step, w);
        if (n == 0) step = 0;
        if (!(now > 1e-12f)) break;
        const float curvature = turn_and_apply(step, n == 0 ? 0.0f : now / before, w);
        before = now;
        step = 0;
        if (!(curvature > 0)) return;
        step = now / curvature;
        ++w.iterations_done;
    }
    const auto s = hn::Set(d, step);
    for (int k = 0; k < kRows; ++k) turn_row(d, s, hn::Zero(d), k, w);
}

// The stress that the increment's strain adds at the moduli it was solved with.
void add_stress(const PressFace& face, PressElastic& w) {
    const Lanes d;
    for (int k = 0; k < kRows; ++k) {
        const double t = row_middle(k), spread = face.radius_mm > 0 ? 1 + t / face.radius_mm : 1;
        const auto scale =
            hn::Set(d, static_cast<float>(1 / (field_width_mm(face.half_height_mm, t) *
                                               column_width_mm(face) * spread)));
        for_columns(d, [&](int i) HWY_ATTR {
            const auto squeeze =
                hn::Sub(hn::LoadU(d, w.shift.row(k) + i), hn::LoadU(d, w.shift.row(k + 1) + i));
            const auto added = hn::Mul(hn::Mul(hn::LoadU(d, w.down.row(k) + i), scale), squeeze);
            hn::StoreU(hn::Add(hn::LoadU(d, w.stress_kpa.row(k) + i), added), d,
                       w.stress_kpa.row(k) + i);
        });
    }
}

void solve(const PressSamples& s,
           const PressFace& face,
           const PressSolveOptions& options,
           PressElastic& w) {
    set_compliance(s, face, w);
    set_couplings(s, face, w);
    w.stress_kpa.values.fill(0);
    w.shift.values.fill(0);
    w.iterations_done = 0;
    for (int i = 0; i < kColumns; ++i) {
        if (s.touching[i])
            w.shift.row(0)[i] = s.pressed_mm[i] / static_cast<float>(options.increments);
    }
    for (int n = 0; n < options.increments; ++n) {
        set_moduli(s, face, w);
        solve_increment(n == 0 ? options.first_iterations : options.iterations, w);
        add_stress(face, w);
    }
}

}  // namespace sonocase::runtime::press::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace sonocase::runtime::press {

HWY_EXPORT(solve);

void solve_press(SimdTarget simd,
                 const PressSamples& samples,
                 const PressFace& face,
                 const PressSolveOptions& options,
                 PressElastic& work) {
    HWY_DISPATCH_TABLE(solve)[simd.index](samples, face, options, work);
}

}  // namespace sonocase::runtime::press
#endif
