// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/inverse_map.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Dense>

#include "pipeline/registration/map/map_evaluator.h"

namespace sonocase::pipeline::inline registration_map {

namespace {

// Which places of the mannequin the CT box can be mapped to: a coarse grid of yes and no, in which
// "no" is proven. The box is divided into cells; the image of each lies in the bounding box of the
// Bernstein coefficients of the quadratic plus the control points of the residual that act there.
class ImageOfBox {
  public:
    // registration.ct_box must not be empty.
    explicit ImageOfBox(const Registration& registration);

    // False: no point of the CT box maps onto p, or into the box.
    bool may_contain(Point3 p) const;
    bool may_touch(const Box3& box) const;

  private:
    double cell_mm_ = 16;
    Point3 origin_;
    Int3 size_{0, 0, 0};
    std::vector<std::uint8_t> reached_;
};

constexpr int kMaxCells = 24;  // of the CT box, per axis

// Box around q over a cell, by the 27 Bernstein coefficients of degree 2 in each axis. The
// coefficients follow from the values at the ends and the middle of each axis:
// b1 = 2 m - (a + c) / 2.
Box3 image_of_cell(const QuadraticMap& q, const Box3& cell) {
    Point3 value[3][3][3];
    const Vector3 e = cell.extent();
    for (int k = 0; k < 3; ++k) {
        for (int j = 0; j < 3; ++j) {
            for (int i = 0; i < 3; ++i) {
                value[k][j][i] =
                    map_point(q, cell.lower + Vector3{0.5 * i * e.x, 0.5 * j * e.y, 0.5 * k * e.z});
            }
        }
    }
    const auto middle = [](Point3 a, Point3 m, Point3 c) { return m + 0.5 * ((m - a) + (m - c)); };
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
            value[a][b][1] = middle(value[a][b][0], value[a][b][1], value[a][b][2]);
        }
    }
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
            value[a][1][b] = middle(value[a][0][b], value[a][1][b], value[a][2][b]);
        }
    }
    for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
            value[1][a][b] = middle(value[0][a][b], value[1][a][b], value[2][a][b]);
        }
    }
    Box3 box;
    for (auto& plane : value) {
        for (auto& row : plane) {
            for (Point3 p : row) box.include(p);
        }
    }
    return box;
}

// Box around d over a cell: the hull of the control points that act there.
void widen_by_displacement(const DisplacementGrid& grid, const Box3& cell, Box3* image) {
    if (grid.empty()) return;
    int first[3], last[3];
    for (int a = 0; a < 3; ++a) {
        const int cells = grid.size[a] - 3;
        const double lower = (cell.lower[a] - grid.origin_mm[a]) / grid.spacing_mm;
        const double upper = (cell.upper[a] - grid.origin_mm[a]) / grid.spacing_mm;
        first[a] = std::clamp(static_cast<int>(std::floor(lower - 1e-9)), 0, cells - 1);
        last[a] = std::clamp(static_cast<int>(std::floor(upper + 1e-9)), 0, cells - 1) + 3;
    }
    Box3 hull;
    for (int k = first[2]; k <= last[2]; ++k) {
        for (int j = first[1]; j <= last[1]; ++j) {
            for (int i = first[0]; i <= last[0]; ++i) {
                const Vector3 c =
                    grid.control_mm[i + static_cast<std::size_t>(grid.size.x) *
                                            (j + static_cast<std::size_t>(grid.size.y) * k)];
                hull.include({c.x, c.y, c.z});
            }
        }
    }
    image->lower = image->lower + (hull.lower - Point3{});
    image->upper = image->upper + (hull.upper - Point3{});
}

ImageOfBox::ImageOfBox(const Registration& registration) {
    const Box3& box = registration.ct_box;
    const Vector3 e = box.extent();
    const int cells = std::clamp(static_cast<int>(std::max({e.x, e.y, e.z}) / 16), 1, kMaxCells);
    std::vector<Box3> images;
    Box3 all;
    for (int k = 0; k < cells; ++k) {
        for (int j = 0; j < cells; ++j) {
            for (int i = 0; i < cells; ++i) {
                Box3 cell;
                cell.include(box.lower +
                             Vector3{e.x * i / cells, e.y * j / cells, e.z * k / cells});
                cell.include(box.lower + Vector3{e.x * (i + 1) / cells, e.y * (j + 1) / cells,
                                                 e.z * (k + 1) / cells});
                Box3 image = image_of_cell(registration.quadratic, cell);
                widen_by_displacement(registration.residual, cell, &image);
                // Rounding, and the tolerance with which a point counts as inside the box.
                const double slack = 0.01;
                image.lower = image.lower - slack * Vector3{1, 1, 1};
                image.upper = image.upper + slack * Vector3{1, 1, 1};
                all.include(image.lower);
                all.include(image.upper);
                images.push_back(image);
            }
        }
    }
    const Vector3 size = all.extent();
    cell_mm_ = std::max(8.0, std::max({size.x, size.y, size.z}) / 64);
    origin_ = all.lower;
    for (int a = 0; a < 3; ++a) size_[a] = static_cast<std::int32_t>(size[a] / cell_mm_) + 1;
    reached_.assign(static_cast<std::size_t>(size_.x) * size_.y * size_.z, 0);
    for (const Box3& image : images) {
        int first[3], last[3];
        for (int a = 0; a < 3; ++a) {
            first[a] = std::max(0, static_cast<int>((image.lower[a] - origin_[a]) / cell_mm_));
            last[a] =
                std::min(size_[a] - 1, static_cast<int>((image.upper[a] - origin_[a]) / cell_mm_));
        }
        for (int k = first[2]; k <= last[2]; ++k) {
            for (int j = first[1]; j <= last[1]; ++j) {
                std::uint8_t* row =
                    reached_.data() +
                    static_cast<std::size_t>(size_.x) * (j + static_cast<std::size_t>(size_.y) * k);
                std::fill(row + first[0], row + last[0] + 1, std::uint8_t{1});
            }
        }
    }
}

bool ImageOfBox::may_contain(Point3 p) const {
    Box3 box;
    box.include(p);
    return may_touch(box);
}

bool ImageOfBox::may_touch(const Box3& box) const {
    int first[3], last[3];
    for (int a = 0; a < 3; ++a) {
        const double lower = (box.lower[a] - origin_[a]) / cell_mm_;
        const double upper = (box.upper[a] - origin_[a]) / cell_mm_;
        if (!(upper >= 0 && lower < size_[a])) return false;
        first[a] = static_cast<int>(std::max(lower, 0.0));
        last[a] = static_cast<int>(std::min(upper, size_[a] - 1.0));
    }
    for (int k = first[2]; k <= last[2]; ++k) {
        for (int j = first[1]; j <= last[1]; ++j) {
            for (int i = first[0]; i <= last[0]; ++i) {
                if (reached_[i + static_cast<std::size_t>(size_.x) *
                                     (j + static_cast<std::size_t>(size_.y) * k)]) {
                    return true;
                }
            }
        }
    }
    return false;
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// Rounding of a point that was on the face of the box.
constexpr double kBoxSlackMm = 1e-6;

// A solved point of a row: its preimage relative to the CT centre, and how that moves along the
// row.
struct Knot {
    int index = 0;
    bool solved = false;
    Vector3 ct;
    Vector3 rate;  // per point of the row
};

// The inverse of the fitted map at single points and at the knots of a row.
struct PointInverse {
    explicit PointInverse(const Registration& r);

    // Damped Newton from `start`; true if it converged.
    bool newton(Point3 y, Point3 start, Point3* ct) const;
    // See InverseMap::invert.
    MapStatus invert(Point3 y, Point3* ct) const;

    // Point start + index * step of a row. solve_knot: a few Newton steps from a near guess
    // (relative to the CT centre); search_knot: without a guess, slow and certain.
    Knot solve_knot(Point3 start, Vector3 step, int index, Vector3 guess) const;
    Knot search_knot(Point3 start, Vector3 step, int index) const;

    Registration registration;
    MapEvaluator evaluate;
    std::vector<ImageOfBox> image;  // none if the box is empty
    QuadraticMap approximate;       // the map fitted with its sides exchanged
    // Points of the box and their images, the starts for points that defeat the approximate
    // inverse.
    std::vector<Point3> lattice_ct, lattice_mannequin;
    double longest_step_mm = 100;
    double magnitude = 0;
};

constexpr double kNewtonSwitchMm = 0.02;  // below this, one more step leaves its square: < 1e-5 mm
constexpr int kRowNewtonSteps = 6;
constexpr int kLattice = 7;  // starts per axis

bool inside(const Box3& box, Point3 p) {
    if (box.empty()) return true;
    for (int a = 0; a < 3; ++a) {
        if (!(p[a] >= box.lower[a] - kBoxSlackMm && p[a] <= box.upper[a] + kBoxSlackMm))
            return false;
    }
    return true;
}

// The map fitted with its sides exchanged: x ~ p(y), by QR in centred and scaled coordinates.
QuadraticMap swapped_fit(const std::vector<Point3>& ct, const std::vector<Point3>& mannequin) {
    Box3 box;
    for (Point3 y : mannequin) box.include(y);
    QuadraticMap map;
    map.centre_mm = box.centre();
    map.scale_mm = std::max(1.0, 0.5 * norm(box.extent()));
    const auto rows = static_cast<Eigen::Index>(ct.size());
    Eigen::MatrixXd a(rows, 10);
    Eigen::MatrixXd b(rows, 3);
    for (Eigen::Index i = 0; i < rows; ++i) {
        const Vector3 u = (mannequin[i] - map.centre_mm) / map.scale_mm;
        a.row(i) << 1, u.x, u.y, u.z, u.x * u.x, u.y * u.y, u.z * u.z, u.x * u.y, u.x * u.z,
            u.y * u.z;
        const Point3 x = ct[i];
        b.row(i) << x.x, x.y, x.z;
    }
    const Eigen::MatrixXd k = a.colPivHouseholderQr().solve(b);
    for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 10; ++c) {
            map.coefficients[r][c] = k(c, r);
        }
    }
    return map;
}

PointInverse::PointInverse(const Registration& r) : registration(r), evaluate(r) {
    Box3 box = r.ct_box;
    if (box.empty()) {
        box.include(r.quadratic.centre_mm - r.quadratic.scale_mm * Vector3{1, 1, 1});
        box.include(r.quadratic.centre_mm + r.quadratic.scale_mm * Vector3{1, 1, 1});
    } else {
        image.emplace_back(registration);
    }
    Box3 images;
    for (int k = 0; k < kLattice; ++k) {
        for (int j = 0; j < kLattice; ++j) {
            for (int i = 0; i < kLattice; ++i) {
                const double n = kLattice - 1;
                const Vector3 e = box.extent();
                lattice_ct.push_back(box.lower + Vector3{e.x * i / n, e.y * j / n, e.z * k / n});
                lattice_mannequin.push_back(mannequin_from_ct(r, lattice_ct.back()));
                images.include(lattice_mannequin.back());
            }
        }
    }
    approximate = swapped_fit(lattice_ct, lattice_mannequin);
    longest_step_mm = 0.25 * norm(box.extent());
    for (int a = 0; a < 3; ++a) {
        magnitude = std::max({magnitude, std::abs(images.lower[a]), std::abs(images.upper[a])});
    }
}

bool PointInverse::newton(Point3 y, Point3 start, Point3* ct) const {
    const double reach = std::max({magnitude, std::abs(y.x), std::abs(y.y), std::abs(y.z)});
    const double tolerance = std::max(1e-9, 32 * std::numeric_limits<double>::epsilon() * reach);
    Point3 x = start;
    Vector3 r = mannequin_from_ct(registration, x) - y;
    double error = norm(r);
    for (int step = 0; step < 50 && std::isfinite(error); ++step) {
        if (error <= tolerance) {
            *ct = x;
            return true;
        }
        const Matrix3 j = jacobian(registration, x);
        const double det = determinant(j);
        Vector3 dx;
        if (std::abs(det) > 1e-9) {
            dx = -(inverse(j) * r);
        } else {  // on a fold: the damped normal equations still give a descent direction
            Matrix3 n = transpose(j) * j;
            for (int a = 0; a < 3; ++a) n(a, a) += 1e-6;
            dx = -(inverse(n) * (transpose(j) * r));
        }
        const double length = norm(dx);
        if (length > longest_step_mm) dx = (longest_step_mm / length) * dx;
        bool better = false;
        for (double t = 1; t > 1e-4; t *= 0.5) {
            const Point3 trial = x + t * dx;
            const Vector3 trial_r = mannequin_from_ct(registration, trial) - y;
            const double trial_error = norm(trial_r);
            if (trial_error < (1 - 0.1 * t) * error || trial_error <= tolerance) {
                x = trial;
                r = trial_r;
                error = trial_error;
                better = true;
                break;
            }
        }
        if (!better) break;
    }
    if (error <= tolerance) {
        *ct = x;
        return true;
    }
    return false;
}

MapStatus PointInverse::invert(Point3 y, Point3* ct) const {
    if (!std::isfinite(y.x) || !std::isfinite(y.y) || !std::isfinite(y.z)) {
        *ct = {kNan, kNan, kNan};
        return MapStatus::no_preimage;
    }
    Point3 x;
    bool beyond = false;
    Point3 beyond_ct{kNan, kNan, kNan};
    if (newton(y, map_point(approximate, y), &x)) {
        if (inside(registration.ct_box, x)) {
            *ct = x;
            return MapStatus::ok;
        }
        beyond = true;
        beyond_ct = x;
    }
    if (!image.empty() && !image[0].may_contain(y) && beyond) {
        *ct = beyond_ct;
        return MapStatus::outside;
    }
    // The first start failed, or led to a preimage beyond the box while another one may lie inside:
    // try the lattice points whose images are nearest.
    constexpr int kTries = 4;
    int nearest[kTries];
    double gap[kTries];
    std::fill(gap, gap + kTries, std::numeric_limits<double>::infinity());
    for (std::size_t i = 0; i < lattice_mannequin.size(); ++i) {
        double d = distance(lattice_mannequin[i], y);
        int n = static_cast<int>(i);
        for (int t = 0; t < kTries; ++t) {
            if (d < gap[t]) {
                std::swap(d, gap[t]);
                std::swap(n, nearest[t]);
            }
        }
    }
    for (int t = 0; t < kTries; ++t) {
        if (!std::isfinite(gap[t])) break;
        if (!newton(y, lattice_ct[nearest[t]], &x)) continue;
        if (inside(registration.ct_box, x)) {
            *ct = x;
            return MapStatus::ok;
        }
        if (!beyond) {
            beyond = true;
            beyond_ct = x;
        }
    }
    *ct = beyond_ct;
    return beyond ? MapStatus::outside : MapStatus::no_preimage;
}

Knot PointInverse::solve_knot(Point3 start, Vector3 step, int index, Vector3 guess) const {
    Knot knot;
    knot.index = index;
    const Vector3 y = (start + static_cast<double>(index) * step) - evaluate.mannequin_centre();
    Vector3 x = guess;
    for (int n = 0; n < kRowNewtonSteps; ++n) {
        const MapSample s = evaluate(x);
        const double det = determinant(s.jacobian);
        if (!(std::abs(det) > 1e-6)) return knot;
        const Matrix3 back = inverse(s.jacobian);
        const Vector3 dx = back * (y - s.value);
        const double length = norm(dx);
        if (!(length < longest_step_mm)) return knot;
        x = x + dx;
        if (length < kNewtonSwitchMm) {
            knot.ct = x;
            knot.rate = back * step;
            knot.solved = true;
            return knot;
        }
    }
    return knot;
}

Knot PointInverse::search_knot(Point3 start, Vector3 step, int index) const {
    Knot knot;
    knot.index = index;
    Point3 ct;
    if (invert(start + static_cast<double>(index) * step, &ct) == MapStatus::no_preimage)
        return knot;
    const Vector3 x = ct - evaluate.ct_centre();
    const Matrix3 j = evaluate(x).jacobian;
    if (!(std::abs(determinant(j)) > 1e-6)) return knot;
    knot.ct = x;
    knot.rate = inverse(j) * step;
    knot.solved = true;
    return knot;
}

}  // namespace

struct InverseMap::Impl : PointInverse {
    using PointInverse::PointInverse;
};

namespace {

constexpr double kRowToleranceMm = 2.5e-4;  // largest expected error of the cubic between two knots
constexpr int kBaseInterval = 16;           // points between the first knots of a row

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
            const double slack = kBoxSlackMm + 6e-8 * std::abs(v);
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
        if (norm(k.ct - guess) <= 8 * kRowToleranceMm && !write.crosses_box(a, k) &&
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

}  // namespace sonocase::pipeline::inline registration_map
