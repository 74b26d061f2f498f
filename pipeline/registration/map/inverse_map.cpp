// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/inverse_map.h"

#include <algorithm>
#include <cmath>

#include "pipeline/registration/map/point_inverse.h"

namespace sonocase::pipeline {

struct InverseMap::Impl : PointInverse {
    using PointInverse::PointInverse;
};

namespace {

constexpr double kRowTolerance_mm =
    2.5e-4;                        // largest expected error of the cubic between two knots
constexpr int kBaseInterval = 16;  // points between the first knots of a row

typedef float Lanes __attribute__((vector_size(16)));

// Writes points of a row from the cubic between two knots. The arrays are those of the whole row.
class RowWriter {
  public:
    RowWriter(const Registration& registration,
              Point3 ct_centre,
              float* x,
              float* y,
              float* z,
              MapStatus* status)
        : box_(registration.ct_box), centre_(ct_centre), out_{x, y, z}, status_(status) {}

    // Whether the cubic between the knots may cross a face of the box, by its Bezier hull. The
    // residual has a kink at the faces, and the status changes there.
    bool crosses_box(const Knot& a, const Knot& b) const {
        if (box_.empty()) return false;
        const double third = (b.index - a.index) / 3.0;
        bool inside_all = true;
        for (int axis = 0; axis < 3; ++axis) {
            const double p0 = a.ct[axis] + centre_[axis], p1 = b.ct[axis] + centre_[axis];
            const double hull[4] = {p0, p0 + third * a.rate[axis], p1 - third * b.rate[axis], p1};
            const double low = *std::min_element(hull, hull + 4);
            const double high = *std::max_element(hull, hull + 4);
            if (high < box_.lower[axis] || low > box_.upper[axis]) return false;
            inside_all = inside_all && low >= box_.lower[axis] && high <= box_.upper[axis];
        }
        return !inside_all;
    }

    // The knots must not lie on two sides of the box.
    void cubic(const Knot& a, const Knot& b) const {
        const int count = b.index - a.index;
        const double h = count;
        for (int axis = 0; axis < 3; ++axis) {
            const double p0 = a.ct[axis] + centre_[axis], p1 = b.ct[axis] + centre_[axis];
            const double m0 = h * a.rate[axis], m1 = h * b.rate[axis];
            // In powers of the index from a.
            const double d = p1 - p0;
            const float c1 = static_cast<float>(a.rate[axis]);
            const float c2 = static_cast<float>((3 * d - 2 * m0 - m1) / (h * h));
            const float c3 = static_cast<float>((m0 + m1 - 2 * d) / (h * h * h));
            const float c0 = static_cast<float>(p0);
            float* out = out_[axis] + a.index;
            int i = 0;
            Lanes t = {0, 1, 2, 3};
            for (; i + 4 <= count; i += 4, t += 4.0f) {
                const Lanes v = c0 + t * (c1 + t * (c2 + t * c3));
                __builtin_memcpy(out + i, &v, sizeof v);
            }
            for (; i < count; ++i) {
                const float s = static_cast<float>(i);
                out[i] = c0 + s * (c1 + s * (c2 + s * c3));
            }
        }
        const Point3 first = centre_ + a.ct;
        if (box_.empty() || box_.contains(first)) {
            std::fill(status_ + a.index, status_ + b.index, MapStatus::ok);
        } else {
            for (int i = a.index; i < b.index; ++i) none(i, MapStatus::outside);
        }
    }

    void point(const Knot& knot) const {
        if (!knot.solved) {
            none(knot.index, MapStatus::no_preimage);
            return;
        }
        for (int axis = 0; axis < 3; ++axis) {
            out_[axis][knot.index] = static_cast<float>(knot.ct[axis] + centre_[axis]);
        }
        check(knot.index);
    }

    void none(int i, MapStatus status) const {
        for (float* out : out_) out[i] = static_cast<float>(kNan);
        status_[i] = status;
    }

  private:
    void check(int i) const {
        // Half a unit in the last place of single precision: the rounding of a point on the face.
        for (int axis = 0; axis < 3 && !box_.empty(); ++axis) {
            const double v = static_cast<double>(out_[axis][i]);
            const double slack = kBoxSlack_mm + 6e-8 * std::abs(v);
            if (!(v >= box_.lower[axis] - slack && v <= box_.upper[axis] + slack)) {
                none(i, MapStatus::outside);
                return;
            }
        }
        status_[i] = MapStatus::ok;
    }

    const Box3& box_;
    Point3 centre_;
    float* out_[3];
    MapStatus* status_;
};

}  // namespace

void InverseMap::invert_row(Point3 start,
                            Vector3 step,
                            int count,
                            float* ct_x,
                            float* ct_y,
                            float* ct_z,
                            MapStatus* status) const {
    const Impl& m = *impl_;
    const RowWriter write(m.registration, m.evaluate.ct_centre(), ct_x, ct_y, ct_z, status);
    if (count <= 0) return;

    // Writes the cubic between two solved knots, or splits the interval.
    const auto lay = [&](const auto& self, const Knot& a, const Knot& b) -> void {
        const int gap = b.index - a.index;
        if (gap <= 1) {
            write.point(a);
            return;
        }
        const int middle = a.index + gap / 2;
        const double h = gap, s = (middle - a.index) / h;
        const Vector3 guess = (1 + 2 * s) * (1 - s) * (1 - s) * a.ct +
                              s * (1 - s) * (1 - s) * h * a.rate + s * s * (3 - 2 * s) * b.ct +
                              s * s * (s - 1) * h * b.rate;
        Knot k = m.solve_knot(start, step, middle, guess);
        if (!k.solved) k = m.search_knot(start, step, middle);
        if (!k.solved) {
            for (int i = a.index; i < b.index; ++i) write.point(m.search_knot(start, step, i));
            return;
        }
        // Halving the interval divides the error by 8 where a third derivative jumps, else by 16.
        if (norm(k.ct - guess) <= 8 * kRowTolerance_mm && !write.crosses_box(a, k) &&
            !write.crosses_box(k, b)) {
            write.cubic(a, k);
            write.cubic(k, b);
        } else {
            self(self, a, k);
            self(self, k, b);
        }
    };

    const int last = count - 1;
    Knot previous;
    for (int from = 0; from < last || from == 0; from += kBaseInterval) {
        const int to = std::min(from + kBaseInterval, last);
        if (!m.image.empty()) {
            Box3 reach;
            reach.include(start + static_cast<double>(from) * step);
            reach.include(start + static_cast<double>(to) * step);
            if (!m.image[0].may_touch(reach)) {
                for (int i = from; i < to; ++i) write.none(i, MapStatus::outside);
                if (to == last) write.none(last, MapStatus::outside);
                previous.solved = false;
                if (to == last) break;
                continue;
            }
        }
        if (!previous.solved || previous.index != from) previous = m.search_knot(start, step, from);
        Knot next;
        next.index = to;
        if (to > from) {
            if (previous.solved) {
                next = m.solve_knot(start, step, to,
                                    previous.ct + static_cast<double>(to - from) * previous.rate);
            }
            if (!next.solved) next = m.search_knot(start, step, to);
            if (previous.solved && next.solved) {
                lay(lay, previous, next);
            } else {
                for (int i = from; i < to; ++i) write.point(m.search_knot(start, step, i));
            }
        } else {
            next = previous;
        }
        if (to == last) {
            write.point(next);
            break;
        }
        previous = next;
    }
}

MapStatus InverseMap::invert(Point3 mannequin, Point3* ct) const {
    return impl_->invert(mannequin, ct);
}

InverseMap::InverseMap(const Registration& registration)
    : impl_(std::make_unique<Impl>(registration)) {}
InverseMap::~InverseMap() = default;
InverseMap::InverseMap(InverseMap&&) noexcept = default;
InverseMap& InverseMap::operator=(InverseMap&&) noexcept = default;

}  // namespace sonocase::pipeline
