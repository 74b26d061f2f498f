// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/press/press_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "formats/base/portable_math.h"
#include "runtime/imaging/press/press_law.h"

namespace sonocase::runtime::press {

void mark_closed(std::span<const PressTissue> tissues,
                 const PressFace& face,
                 const PressSamples& samples,
                 const PressColumns& columns,
                 PressClosed& out) {
    constexpr int kMarks = PressClosed::kMarks, kAcross = PressClosed::kAcross;
    if (out.any) {
        out.mark.fill(0);
        out.row.fill(false);
        out.part.fill(false);
    }
    out.any = false;
    out.open = -1;
    if (std::find(samples.lumen.begin(), samples.lumen.end(), true) == samples.lumen.end()) return;
    const auto at = [](const float* row, int i) {
        const float *left = row + i / kMarks, part = static_cast<float>(i % kMarks) / kMarks;
        return i % kMarks == 0 ? *left : *left + part * (left[1] - *left);
    };
    // Rows with a lumen, which are few; 0 beyond them.
    std::array<float, kFineRows * kAcross> drains_at{};
    for (int j = 0; j < kFineRows; ++j)
        for (int i = 0; samples.lumen[j] && i < kAcross; ++i)
            drains_at[j * kAcross + i] = at(samples.drains.row(j), i);
    const auto in_lumen = [&](int j, int i) {
        return j < kFineRows && drains_at[j * kAcross + i] >= 0.5f;
    };
    std::array<bool, kFineRows * kAcross> shut{};
    std::array<bool, kFineRows> any_shut{};  // of a row
    for (int first = 0; first < kFineRows; ++first) {
        if (!samples.lumen[first]) continue;
        for (int i = 0; i < kAcross; ++i) {
            if (!in_lumen(first, i) || (first > 0 && in_lumen(first - 1, i))) continue;
            double height = 0, touching = 0;  // and the height at which walls touch
            int end = first;
            for (; in_lumen(end, i); ++end) {
                const float share = drains_at[end * kAcross + i];
                height += fine_height(end) * double{at(columns.stretch.row(end), i)};
                touching += fine_height(end) * (share * kShut + (1 - share));
            }
            for (int n = first; height < touching && n < end; ++n)
                shut[n * kAcross + i] = any_shut[n] = true;
        }
    }
    // A round lumen reaches less far up and down beside its middle, and further across than the
    // parts that it fills to half: half a row around is searched, and half a column beside.
    constexpr int kAround = kParts / 2, kBeside = kMarks / 2;
    const auto near = [&](int j, int i) {
        for (int n = std::max(j - kAround, 0); n <= std::min(j + kAround, kFineRows - 1); ++n)
            if (shut[n * kAcross + i]) return true;
        if (in_lumen(j, i)) return false;
        for (int n = std::max(i - kBeside, 0); n <= std::min(i + kBeside, kAcross - 1); ++n)
            if (shut[j * kAcross + n]) return true;
        return false;
    };
    const auto nearest = [](float mm) {
        return std::clamp(static_cast<int>(double{mm} / kTableStepMm + 0.5), 0, kTableRows - 1);
    };
    // Only the scan plane counts here: two places of each part were looked up in it.
    const auto drains = [&](int j, int i) {
        int both = 0;
        for (int s = 0; s < 2; ++s) both += tissues[samples.tissue[s][j * kColumns + i]].drains;
        return 0.5 * both;
    };
    double rest = 0, open = 0;  // heights
    for (int j = 0; j < kFineRows; ++j) {
        bool around = false;
        for (int n = std::max(j - kAround, 0); n <= std::min(j + kAround, kFineRows - 1); ++n)
            around = around || any_shut[n];
        for (int i = 0; around && i < kAcross; ++i) {
            if (!near(j, i)) continue;
            out.part[j * kAcross + i] = true;
            out.any = true;
            // One of these marks is the nearest to each place of the part.
            const int first = nearest(at(columns.pressed_mm.row(j), i)),
                      last = nearest(at(columns.pressed_mm.row(j + 1), i));
            for (int m = first; m <= last; ++m) {
                out.row_of(m)[i] = 1;
                out.row[m] = true;
            }
        }
        for (int i = kSideColumns; samples.lumen[j] && i < kSideColumns + kFaceColumns; ++i) {
            const double height = drains(j, i) * fine_height(j);
            int marks = 0;  // of this column
            for (int n = -kMarks / 2; n < kMarks / 2; ++n)
                marks += out.part[j * kAcross + i * kMarks + n];
            rest += height;
            open += height * double{columns.lumen.row(j)[i]} * (kMarks - marks) / kMarks;
        }
    }
    constexpr double kMinMm2 = 4;
    if (rest * column_width_mm(face) >= kMinMm2) out.open = open / rest;
}

namespace {

// Interpolates a plane of numbers between columns and rows.
template <int kHeight>
double between(const Plane<kHeight>& plane, double column, double row) {
    const double x = std::clamp(column, 0.0, kColumns - 1.0);
    const double r = std::clamp(row, 0.0, kHeight - 1.0);
    const int i = std::min(static_cast<int>(x), kColumns - 2);
    const int m = std::min(static_cast<int>(r), kHeight - 2);
    const float *upper = plane.row(m) + i, *lower = plane.row(m + 1) + i;
    const double across = x - i;
    const double above = upper[0] + across * (double{upper[1]} - upper[0]);
    const double below = lower[0] + across * (double{lower[1]} - lower[0]);
    return above + (r - m) * (below - above);
}

double column_of(const PressFace& face, double lateral_mm) {
    return lateral_mm / column_width_mm(face) + (kColumns - 1) / 2.0;
}

// From a pressed place in the plane to where it lies at rest.
struct Shift {
    double lateral_mm = 0, depth_mm = 0;
    double tilt = 0;  // change of depth_mm per mm along the face
};

// Share of the shift that is left beside the columns and below the table.
double fade_at(const PressFace& face, double column, double row) {
    const double past =
        std::max(std::abs(column - (kColumns - 1) / 2.0) - (kColumns - 1) / 2.0, 0.0);
    const double beyond = std::max(0.0, row - (kTableRows - 1)) * kTableStepMm;
    return std::max(0.0, 1 - past * column_width_mm(face) / kTableFadeMm) *
           std::max(0.0, 1 - beyond / kTableFadeMm);
}

// The sideways shift alone, from where tissue lies at rest to where it shows.
double bulge_at(const PressFace& face, const PressTable& table, BeamPoint p) {
    const double row = p.depth_mm / kTableStepMm, column = column_of(face, p.lateral_mm);
    return fade_at(face, column, row) * between(table.bulge_mm, column, row / kBulgeEvery);
}

Shift shift_at(const PressFace& face, const PressTable& table, BeamPoint p) {
    const double row = p.depth_mm / kTableStepMm;
    const double column = column_of(face, p.lateral_mm);
    const double share = fade_at(face, column, row);
    const double lateral = -share * between(table.bulge_mm, column, row / kBulgeEvery);
    const double target = column_of(face, p.lateral_mm + lateral);
    const double depth = std::clamp(row, 0.0, kTableRows - 1.0) * kTableStepMm;
    // Interpolates between the two columns beside it at this depth: their difference is the slope.
    const double left = std::floor(std::clamp(target, 0.0, kColumns - 2.0));
    const double before = between(table.rest_mm, left, row),
                 after = between(table.rest_mm, left + 1, row);
    const double part = std::clamp(target - left, 0.0, 1.0);
    const double rest = before + part * (after - before);
    return {lateral, share * (rest - depth), share * (after - before) / column_width_mm(face)};
}

// Depth of the resting skin from the face.
double skin_mm(const PressFace& face, const PressSamples& samples, double lateral_mm) {
    const double x =
        std::clamp(lateral_mm / column_width_mm(face) + (kColumns - 1) / 2.0, 0.0, kColumns - 1.0);
    const int i = std::min(static_cast<int>(x), kColumns - 2);
    const double left = samples.pressed_mm[i], right = samples.pressed_mm[i + 1];
    return -(left + (x - i) * (right - left));
}

}  // namespace

PressField::PressField(const PressFace& face)
    : face_(face), beams_(face), work_(std::make_unique<Work>()) {
    assert(face.half_width_mm > 0 && face.half_height_mm > 0 && face.radius_mm >= 0);
}

void PressField::lift() {
    state_ = {};
    ++version_;
}

void PressField::set_pools(std::span<const SceneChange::Pool> pools) {
    assert(pools.size() <= pools_.size());
    pool_count_ = static_cast<int>(pools.size());
    std::copy(pools.begin(), pools.end(), pools_.begin());
}

double PressField::farthest_mm() const {
    double mm = state_.farthest_mm + std::abs(dent_.tent_mm) + std::abs(dent_.drag_mm);
    for (const SceneChange::Pool& pool : pools()) mm += (1 - kPoolCore) * pool.radius_mm;
    return mm;
}

bool PressField::press(SimdTarget simd, const PressScene& scene, const PressOptions& options) {
    assert(options.solve.increments >= 1 && options.stiffness_scale > 0);
    state_ = {};
    ++version_;
    sample_tissue(simd, scene, face_, beams_, options.stiffness_scale, work_->samples);
    const PressSamples& samples = work_->samples;
    state_.excess_mm = std::max(0.0, samples.excess_mm);
    state_.out_of_reach = samples.out_of_reach;
    if (!samples.any_touch) return false;
    solve_press(simd, samples, face_, options.solve, work_->elastic);
    stretch_columns(simd, samples, face_, work_->elastic, work_->columns);
    build_table(simd, samples, face_, work_->columns, work_->table);
    mark_closed(scene.tissues, face_, samples, work_->columns, work_->closed);
    int touching = 0;
    for (std::size_t i = 0; i < kColumns; ++i) {
        if (!samples.touching[i]) continue;
        ++touching;
        state_.deepest_mm = std::max(state_.deepest_mm, double{samples.pressed_mm[i]});
    }
    state_.pressed = true;
    state_.force_n = work_->columns.force_n;
    const double area_mm2 = touching * column_width_mm(face_) * 2 * face_.half_height_mm;
    state_.pressure_kpa = 1e3 * state_.force_n / area_mm2;
    state_.min_determinant = work_->table.min_determinant;
    state_.vein_open = work_->closed.open;
    float sideways = 0;
    for (const float v : work_->table.bulge_mm.values) sideways = std::max(sideways, std::abs(v));
    state_.farthest_mm = state_.deepest_mm + double{sideways};
    return true;
}

// Where the tissue was before the needle moved it.
BeamPoint PressField::before_dent(BeamPoint shown) const {
    const Point3 p = probe_point(face_, shown, 0);
    const Vector3 u = dent_shift(dent_, p);
    if (u.x == 0 && u.z == 0) return shown;
    return beam_point(face_, {p.x - u.x, 0, p.z - u.z});
}

RestPlace PressField::pressed_in_plane(BeamPoint shown) const {
    if (!state_.pressed) return {shown.lateral_mm, shown.depth_mm, 0};
    const Shift shift = shift_at(face_, work_->table, shown);
    return {shown.lateral_mm + shift.lateral_mm, shown.depth_mm + shift.depth_mm, shift.tilt};
}

RestPlace PressField::rest_in_plane(BeamPoint shown) const {
    return pressed_in_plane(dent_.moves() ? before_dent(shown) : shown);
}

BeamPoint PressField::shown_before_dent(BeamPoint rest) const {
    if (!state_.pressed) return rest;
    // The rest depth rises down the column of `rest`: the row is found by halving, then the
    // sideways shift of that row.
    const PressTable& table = work_->table;
    const double column = column_of(face_, rest.lateral_mm);
    const double x = std::clamp(column, 0.0, kColumns - 1.0);
    const int i = std::min(static_cast<int>(x), kColumns - 2);
    const auto depth_at = [&](int row) {
        const float* at = table.rest_mm.row(row) + i;
        return at[0] + (x - i) * (double{at[1]} - at[0]);
    };
    double shown = rest.depth_mm;
    int low = 0, high = kTableRows - 1;
    if (rest.depth_mm < depth_at(low)) {
        shown = rest.depth_mm - depth_at(low);
    } else if (rest.depth_mm < depth_at(high)) {
        while (high - low > 1) {
            const int middle = (low + high) / 2;
            (depth_at(middle) <= rest.depth_mm ? low : high) = middle;
        }
        const double above = depth_at(low), below = depth_at(high);
        shown = (low + (rest.depth_mm - above) / (below - above)) * kTableStepMm;
    }
    double lateral = rest.lateral_mm;
    for (int step = 0; step < 8; ++step) {
        const double next = rest.lateral_mm + bulge_at(face_, table, {lateral, shown});
        const bool converged = std::abs(next - lateral) < 1e-4;
        lateral = next;
        if (converged) break;
    }
    return {lateral, shown};
}

void shift_by_pools(std::span<const SceneChange::Pool> pools,
                    const ScanGeometry::Beam& beam,
                    double r_mm,
                    PlaneShift& s) {
    const PlanePoint d = beam.direction, n = beside(d);
    PlanePoint p{beam.origin.x + (r_mm + s.along_mm) * d.x + s.side_mm * n.x,
                 beam.origin.z + (r_mm + s.along_mm) * d.z + s.side_mm * n.z};
    for (const SceneChange::Pool& pool : pools) {
        const Vector3 away{p.x - pool.centre.x, -pool.centre.y, p.z - pool.centre.z};
        const double square = dot(away, away), reach = kPoolReaches * pool.radius_mm;
        if (square >= reach * reach) continue;
        const double back = pool_share(std::sqrt(square), pool.radius_mm) - 1;
        const double x = back * away.x, z = back * away.z;
        p = {p.x + x, p.z + z};
        s.along_mm += x * d.x + z * d.z;
        s.side_mm += x * n.x + z * n.z;
    }
}

namespace {

// Where pools have pushed, in the plane, what lay at p.
PlanePoint after_pools(std::span<const SceneChange::Pool> pools, PlanePoint p) {
    for (std::size_t i = pools.size(); i-- > 0;) {
        const SceneChange::Pool& pool = pools[i];
        const double x = p.x - pool.centre.x, z = p.z - pool.centre.z;
        const double across2 = pool.centre.y * pool.centre.y;
        const double reach = kPoolReaches * pool.radius_mm;
        if (x * x + z * z + across2 >= reach * reach) continue;
        // The factor of x and z, by the rule of false position (Illinois), to 1e-4.
        const auto over = [&](double factor) {
            const double r = std::sqrt(factor * factor * (x * x + z * z) + across2);
            return factor * pool_share(r, pool.radius_mm) - 1;
        };
        double low = 1, high = 1 / kPoolCore, below = over(low), above = over(high), factor = low;
        for (int step = 0, side = 0; step < 12; ++step) {
            factor = (low * above - high * below) / std::max(above - below, 1e-12);
            const double here = over(factor);
            if (std::abs(here) < 1e-4) break;
            if (here > 0) {
                high = factor, above = here;
                if (side > 0) below *= 0.5;
                side = 1;
            } else {
                low = factor, below = here;
                if (side < 0) above *= 0.5;
                side = -1;
            }
        }
        p = {pool.centre.x + factor * x, pool.centre.z + factor * z};
    }
    return p;
}

}  // namespace

BeamPoint PressField::shown_in_plane(BeamPoint rest) const {
    if (pool_count_ > 0) {
        const Point3 at = probe_point(face_, rest, 0);
        const PlanePoint pushed = after_pools(pools(), {at.x, at.z});
        rest = beam_point(face_, {pushed.x, 0, pushed.z});
    }
    const BeamPoint before = shown_before_dent(rest);
    if (!dent_.moves()) return before;
    // The needle's shift changes by less than a millimetre per millimetre, so each step comes
    // nearer.
    const Point3 p = probe_point(face_, before, 0);
    Point3 at = p;
    for (int step = 0; step < 12; ++step) {
        const Vector3 u = dent_shift(dent_, at);
        at = {p.x + u.x, 0, p.z + u.z};
    }
    return beam_point(face_, at);
}

double PressField::skin_now_mm(double lateral_mm) const {
    assert(state_.pressed);
    const double column = std::clamp(column_of(face_, lateral_mm), 0.0, kColumns - 1.0);
    return std::max(0.0, between(work_->columns.pressed_mm, column, 0));
}

bool PressField::closed_in_plane(BeamPoint shown) const {
    const PressClosed& marks = work_->closed;
    if (!state_.pressed || !marks.any) return false;
    if (dent_.moves()) shown = before_dent(shown);
    const RestPlace rest = pressed_in_plane(shown);
    const double column = std::clamp(column_of(face_, rest.lateral_mm), 0.0, kColumns - 1.0);
    const double row = std::clamp(shown.depth_mm / kTableStepMm, 0.0, kTableRows - 1.0);
    return marks.row_of(static_cast<int>(
               row + 0.5))[static_cast<int>(column * PressClosed::kMarks + 0.5)] != 0;
}

Point3 PressField::pull_back(Point3 pressed) const {
    if (!state_.pressed) return pressed;
    // Relative to the face where bone holds it.
    Point3 held = pressed;
    held.z += state_.excess_mm;
    const BeamPoint p = beam_point(face_, held);
    // Off the plane the shift of the tissue is the plane's, faded. Rest depth rises with pressed
    // depth, so the depth in the plane whose faded shift ends here is found by halving.
    const double y2 = pressed.y * pressed.y;
    Shift shift = shift_at(face_, work_->table, p);
    double share = 1, sideways = 1;
    if (y2 > 0) {
        const auto faded = [&](double depth_mm, double& end_mm) {
            shift = shift_at(face_, work_->table, {p.lateral_mm, depth_mm});
            const double skin = skin_mm(face_, work_->samples, p.lateral_mm + shift.lateral_mm);
            const double below = std::max(0.0, depth_mm + shift.depth_mm - skin);
            const double w = fade_width_mm(face_.half_height_mm, below);
            share = falling_exponential(y2 / (2 * w * w));
            sideways = falling_exponential(y2 / (2 * w * w * kLateralFade * kLateralFade));
            end_mm = depth_mm + (1 - share) * shift.depth_mm;
        };
        double low = p.depth_mm - kReachMm, high = p.depth_mm + 2 * kReachMm, end = 0;
        for (int n = 0; n < 40; ++n) {
            const double middle = 0.5 * (low + high);
            faded(middle, end);
            (end < p.depth_mm ? low : high) = middle;
        }
    }
    const BeamPoint rest{p.lateral_mm + sideways * shift.lateral_mm,
                         p.depth_mm + share * shift.depth_mm};
    Point3 out = probe_point(face_, rest, pressed.y);
    out.z -= state_.excess_mm;
    return out;
}

bool PressField::closed(Point3 rest) const {
    if (!state_.pressed) return false;
    rest.z += state_.excess_mm;
    const BeamPoint p = beam_point(face_, rest);
    const double column = std::clamp(column_of(face_, p.lateral_mm), 0.0, kColumns - 1.0);
    const double below = p.depth_mm - skin_mm(face_, work_->samples, p.lateral_mm);
    const auto part = std::upper_bound(kFineEdge.begin(), kFineEdge.end(), below);
    const int j = std::clamp(static_cast<int>(part - kFineEdge.begin()) - 1, 0, kFineRows - 1);
    return work_->closed
        .part[j * PressClosed::kAcross + static_cast<int>(column * PressClosed::kMarks + 0.5)];
}

Point3 PressField::push_forward(Point3 rest) const {
    if (!state_.pressed) return rest;
    // A damped Newton iteration on the pull-back, whose Jacobian is taken by differences in the
    // plane: the map is one to one and piecewise smooth.
    Point3 at = rest;
    constexpr double kStepMm = 1e-3;
    double error = 1e9;
    for (int n = 0; n < 40 && error > 1e-5; ++n) {
        const Point3 here = pull_back(at);
        const double ex = rest.x - here.x, ez = rest.z - here.z;
        error = std::sqrt(ex * ex + ez * ez);
        const Point3 px = pull_back({at.x + kStepMm, at.y, at.z});
        const Point3 pz = pull_back({at.x, at.y, at.z + kStepMm});
        const double a = (px.x - here.x) / kStepMm, b = (pz.x - here.x) / kStepMm;
        const double c = (px.z - here.z) / kStepMm, d = (pz.z - here.z) / kStepMm;
        const double det = std::max(a * d - b * c, 1e-3);
        double dx = (d * ex - b * ez) / det, dz = (a * ez - c * ex) / det;
        double length = std::sqrt(dx * dx + dz * dz);
        const double limit = std::max(2 * error, 1e-4);
        const double scale = length > limit ? limit / length : 1;
        double best = error;
        for (double t = scale; t > scale / 64; t /= 2) {
            const Point3 tried{at.x + t * dx, at.y, at.z + t * dz};
            const Point3 back = pull_back(tried);
            const double fx = rest.x - back.x, fz = rest.z - back.z;
            const double e = std::sqrt(fx * fx + fz * fz);
            if (e < best) {
                best = e;
                at = tried;
                break;
            }
        }
        if (best >= error) break;
        error = best;
    }
    return at;
}

PressFace press_face(const Probe& probe) {
    switch (probe.shape) {
        case ProbeShape::linear: return {0.5 * probe.width_mm, 4, 0};
        case ProbeShape::curvilinear:
            return {0.5 * probe.radius_mm * probe.field_of_view_rad, 6.5, probe.radius_mm};
        case ProbeShape::phased: return {0.5 * probe.width_mm, 5, 0};
    }
    assert(false);
    return {};
}

}  // namespace sonocase::runtime::press
