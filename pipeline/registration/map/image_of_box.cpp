// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/image_of_box.h"

#include <algorithm>
#include <cmath>

namespace sonocase::pipeline {
namespace {

constexpr int kMostCells = 24;  // of the CT box, per axis

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
                const Vector3 c = grid.control_mm[static_cast<std::size_t>(i) +
                                                  static_cast<std::size_t>(grid.size.x) *
                                                      (static_cast<std::size_t>(j) +
                                                       static_cast<std::size_t>(grid.size.y) *
                                                           static_cast<std::size_t>(k))];
                hull.include({c.x, c.y, c.z});
            }
        }
    }
    image->lower = image->lower + (hull.lower - Point3{});
    image->upper = image->upper + (hull.upper - Point3{});
}

}  // namespace

ImageOfBox::ImageOfBox(const Registration& registration) {
    const Box3& box = registration.ct_box;
    const Vector3 e = box.extent();
    const int cells = std::clamp(static_cast<int>(std::max({e.x, e.y, e.z}) / 16), 1, kMostCells);
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
    reached_.assign(static_cast<std::size_t>(size_.x) * static_cast<std::size_t>(size_.y) *
                        static_cast<std::size_t>(size_.z),
                    0);
    for (const Box3& image : images) {
        int first[3], last[3];
        for (int a = 0; a < 3; ++a) {
            first[a] = std::max(0, static_cast<int>((image.lower[a] - origin_[a]) / cell_mm_));
            last[a] =
                std::min(size_[a] - 1, static_cast<int>((image.upper[a] - origin_[a]) / cell_mm_));
        }
        for (int k = first[2]; k <= last[2]; ++k) {
            for (int j = first[1]; j <= last[1]; ++j) {
                std::uint8_t* row = reached_.data() + static_cast<std::size_t>(size_.x) *
                                                          (static_cast<std::size_t>(j) +
                                                           static_cast<std::size_t>(size_.y) *
                                                               static_cast<std::size_t>(k));
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
                if (reached_[static_cast<std::size_t>(i) +
                             static_cast<std::size_t>(size_.x) *
                                 (static_cast<std::size_t>(j) + static_cast<std::size_t>(size_.y) *
                                                                    static_cast<std::size_t>(k))]) {
                    return true;
                }
            }
        }
    }
    return false;
}

}  // namespace sonocase::pipeline
