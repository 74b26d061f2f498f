// SPDX-License-Identifier: Apache-2.0

// The fitted map from the patient (`ct` frame) to the mannequin, as stored in one file.
//
//     y = q(x) + d(x)
//
// q  quadratic, eq. (3), of centred and scaled coordinates u = (x - centre) / scale:
//        q_r = sum_c coefficients[r][c] * b_c(u),  b = (1, u, v, w, uu, vv, ww, uv, uw, vw)
//    It contains the rigid alignment; mannequin_from_ct is kept for the report only.
// d  residual displacement, a uniform cubic B-spline over `ct`, added and not composed: the sum
//    stays in one spline space, which makes the proof of det J > 0 exact. Absent: d = 0.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "formats/base/geometry.h"
#include "formats/base/result.h"
#include "formats/base/stage_report.h"

namespace sonocase {

struct QuadraticMap {
    Point3 centre_mm;
    double scale_mm = 1;
    std::array<std::array<double, 10>, 3> coefficients{};  // mm

    static QuadraticMap from_rigid(const Rigid& to_from, Point3 centre_mm, double scale_mm);
};

Point3 map_point(const QuadraticMap& map, Point3 p);
Matrix3 jacobian(const QuadraticMap& map, Point3 p);  // d(to)/d(from), dimensionless

// Uniform tensor cubic B-spline. Knot cell (0,0,0) starts at origin; control point (i,j,k) is the
// one whose basis function is centred on origin + (i - 1, j - 1, k - 1) * spacing. # size product.
// Outside the cells the displacement is that of the nearest point of the box.
struct DisplacementGrid {
    Int3 size{0, 0, 0};  // control points, cells + 3; all zero: no displacement
    Point3 origin_mm;
    double spacing_mm = 1;
    std::vector<Vector3> control_mm;
    bool empty() const { return control_mm.empty(); }
};

Vector3 displacement(const DisplacementGrid& grid, Point3 p);
Matrix3 displacement_jacobian(const DisplacementGrid& grid, Point3 p);

struct Registration {
    Rigid mannequin_from_ct;  // the rigid stage's answer
    QuadraticMap quadratic;
    DisplacementGrid residual;
    Box3 ct_box;                  // where the map is proven; a preimage outside it does not count
    double min_det_jacobian = 0;  // proven lower bound over ct_box; <= 0: not proven
    std::vector<StageReport> reports;
};

// Forward map, ct to mannequin. Constant time.
Point3 mannequin_from_ct(const Registration& registration, Point3 ct);
Matrix3 jacobian(const Registration& registration, Point3 ct);

// A registration as JSON: what `sonocase register` writes and `map` and `resample` read
// (docs/format.md, part 4).

Result<Registration> parse_registration(std::string_view json, const std::string& where);
std::string format_registration(const Registration& registration);

// The same as a file.

Result<Registration> load_registration(const std::string& path);
Status save_registration(const Registration& registration, const std::string& path);

}  // namespace sonocase
