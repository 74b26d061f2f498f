// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/map/registration.h"

#include <algorithm>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "formats/text/json_reader.h"
#include "formats/text/stage_report_json.h"

namespace sonocase {

namespace {

// Values and derivatives of the four cubic B-splines that are not zero at fraction t of a cell.
struct SplineWeights {
    std::array<double, 4> value;
    std::array<double, 4> slope;
};

SplineWeights spline_weights(double t) {
    const double s = 1 - t;
    return {{s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6,
             (3 * s * s * s - 6 * s * s + 4) / 6, t * t * t / 6},
            {-s * s / 2, (3 * t * t - 4 * t) / 2, -(3 * s * s - 4 * s) / 2, t * t / 2}};
}

struct SplineCell {
    std::array<int, 3> first;
    std::array<SplineWeights, 3> weights;
    std::array<bool, 3> clamped;
};

SplineCell locate(const DisplacementGrid& grid, Point3 p) {
    SplineCell cell;
    for (int a = 0; a < 3; ++a) {
        const int cells = grid.size[a] - 3;
        const double u = (p[a] - grid.origin_mm[a]) / grid.spacing_mm;
        const double inside = std::clamp(u, 0.0, static_cast<double>(cells));
        const auto i = static_cast<std::size_t>(a);
        cell.clamped[i] = inside != u;
        cell.first[i] = std::min(static_cast<int>(inside), cells - 1);
        cell.weights[i] = spline_weights(inside - cell.first[i]);
    }
    return cell;
}

Vector3 combine(const DisplacementGrid& grid,
                const SplineCell& cell,
                const std::array<double, 4>& wx,
                const std::array<double, 4>& wy,
                const std::array<double, 4>& wz) {
    Vector3 sum;
    for (std::size_t c = 0; c < 4; ++c) {
        for (std::size_t b = 0; b < 4; ++b) {
            const std::size_t row = static_cast<std::size_t>(cell.first[0]) +
                                    static_cast<std::size_t>(grid.size.x) *
                                        ((static_cast<std::size_t>(cell.first[1]) + b) +
                                         static_cast<std::size_t>(grid.size.y) *
                                             (static_cast<std::size_t>(cell.first[2]) + c));
            Vector3 line;
            for (std::size_t a = 0; a < 4; ++a) line = line + wx[a] * grid.control_mm[row + a];
            sum = sum + (wy[b] * wz[c]) * line;
        }
    }
    return sum;
}

// Offset from the map's centre in its scale.
Vector3 scaled(const QuadraticMap& map, Point3 p) {
    return {(p.x - map.centre_mm.x) / map.scale_mm, (p.y - map.centre_mm.y) / map.scale_mm,
            (p.z - map.centre_mm.z) / map.scale_mm};
}

}  // namespace

QuadraticMap QuadraticMap::from_rigid(const Rigid& to_from, Point3 centre_mm, double scale_mm) {
    QuadraticMap map;
    map.centre_mm = centre_mm;
    map.scale_mm = scale_mm;
    const Point3 centre_to = to_from * centre_mm;
    for (int r = 0; r < 3; ++r) {
        auto& row = map.coefficients[r];
        row[0] = centre_to[r];
        for (int c = 0; c < 3; ++c) row[1 + c] = scale_mm * to_from.rotation(r, c);
    }
    return map;
}

Point3 map_point(const QuadraticMap& map, Point3 p) {
    const auto [u, v, w] = scaled(map, p);
    Point3 out;
    for (int r = 0; r < 3; ++r) {
        const auto& k = map.coefficients[r];
        out[r] = k[0] + k[1] * u + k[2] * v + k[3] * w + k[4] * u * u + k[5] * v * v +
                 k[6] * w * w + k[7] * u * v + k[8] * u * w + k[9] * v * w;
    }
    return out;
}

Matrix3 jacobian(const QuadraticMap& map, Point3 p) {
    const auto [u, v, w] = scaled(map, p);
    Matrix3 j;
    for (int r = 0; r < 3; ++r) {
        const auto& k = map.coefficients[r];
        j(r, 0) = (k[1] + 2 * k[4] * u + k[7] * v + k[8] * w) / map.scale_mm;
        j(r, 1) = (k[2] + 2 * k[5] * v + k[7] * u + k[9] * w) / map.scale_mm;
        j(r, 2) = (k[3] + 2 * k[6] * w + k[8] * u + k[9] * v) / map.scale_mm;
    }
    return j;
}

Vector3 displacement(const DisplacementGrid& grid, Point3 p) {
    if (grid.empty()) return {};
    const SplineCell cell = locate(grid, p);
    return combine(grid, cell, cell.weights[0].value, cell.weights[1].value, cell.weights[2].value);
}

Matrix3 displacement_jacobian(const DisplacementGrid& grid, Point3 p) {
    if (grid.empty()) return Matrix3::diagonal({0, 0, 0});
    const SplineCell cell = locate(grid, p);
    std::array<Vector3, 3> column;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        if (cell.clamped[axis]) continue;  // constant beyond the box
        const auto& x = axis == 0 ? cell.weights[0].slope : cell.weights[0].value;
        const auto& y = axis == 1 ? cell.weights[1].slope : cell.weights[1].value;
        const auto& z = axis == 2 ? cell.weights[2].slope : cell.weights[2].value;
        column[axis] = combine(grid, cell, x, y, z) / grid.spacing_mm;
    }
    return Matrix3::from_columns(column[0], column[1], column[2]);
}

Point3 mannequin_from_ct(const Registration& registration, Point3 ct) {
    return map_point(registration.quadratic, ct) + displacement(registration.residual, ct);
}

Matrix3 jacobian(const Registration& registration, Point3 ct) {
    Matrix3 j = jacobian(registration.quadratic, ct);
    const Matrix3 d = displacement_jacobian(registration.residual, ct);
    for (std::size_t i = 0; i < 9; ++i) j.m[i] += d.m[i];
    return j;
}

namespace {

using detail::Json;
using detail::JsonFault;
using detail::JsonObject;

constexpr const char* kFormat = "sonocase registration";
constexpr std::int64_t kVersion = 1;
constexpr double kMaxControls = 1e7;

DisplacementGrid residual_from(JsonObject object) {
    DisplacementGrid grid;
    const std::vector<double> size = object.numbers("size", 3);
    double count = 1;
    for (int a = 0; a < 3; ++a) {
        const double n = size[a];
        // Fewer than four control points hold no cell.
        if (n != std::floor(n) || n < 4 || n > 4096) {
            object.add_fault("size", "is out of range", "expected whole numbers from 4 to 4096");
            return grid;
        }
        grid.size[a] = static_cast<std::int32_t>(n);
        count *= n;
    }
    if (count > kMaxControls)
        object.add_fault("size", "is too large", "expected at most 1e7 control points");
    grid.origin_mm = object.point("origin_mm");
    grid.spacing_mm = object.number("spacing_mm");
    if (!(grid.spacing_mm > 0)) object.add_fault("spacing_mm", "is not above zero");
    if (!object.ok()) return grid;
    const std::vector<double> values =
        object.numbers("control_mm", static_cast<std::size_t>(3 * count));
    if (!object.ok()) return grid;
    grid.control_mm.resize(static_cast<std::size_t>(count));
    for (std::size_t i = 0; i < grid.control_mm.size(); ++i) {
        grid.control_mm[i] = {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
    }
    return grid;
}

}  // namespace

std::string format_registration(const Registration& registration) {
    Json out = Json::object();
    out["format"] = kFormat;
    out["version"] = kVersion;
    out["mannequin_from_ct"] = detail::json_of(registration.mannequin_from_ct);
    Json quadratic = Json::object();
    quadratic["centre_mm"] = detail::json_of(registration.quadratic.centre_mm);
    quadratic["scale_mm"] = registration.quadratic.scale_mm;
    quadratic["coefficients_mm"] = registration.quadratic.coefficients;
    out["quadratic"] = std::move(quadratic);
    if (registration.residual.empty()) {
        out["residual"] = nullptr;
    } else {
        const DisplacementGrid& grid = registration.residual;
        Json residual = Json::object();
        residual["size"] = Json::array({grid.size.x, grid.size.y, grid.size.z});
        residual["origin_mm"] = detail::json_of(grid.origin_mm);
        residual["spacing_mm"] = grid.spacing_mm;
        Json control = Json::array();
        for (const Vector3& v : grid.control_mm) {
            for (int a = 0; a < 3; ++a) control.push_back(v[a]);
        }
        residual["control_mm"] = std::move(control);
        out["residual"] = std::move(residual);
    }
    if (registration.ct_box.empty()) {
        out["ct_box"] = nullptr;
    } else {
        Json box = Json::object();
        box["lower_mm"] = detail::json_of(registration.ct_box.lower);
        box["upper_mm"] = detail::json_of(registration.ct_box.upper);
        out["ct_box"] = std::move(box);
    }
    out["min_det_jacobian"] = detail::json_number(registration.min_det_jacobian);
    out["stages"] = detail::json_of(registration.reports);
    return detail::json_text(out, true) + "\n";
}

Result<Registration> parse_registration(std::string_view json, const std::string& where) {
    Json value;
    JsonFault fault{where, {}};
    if (!detail::parse_json(json, value, fault)) return *fault.error;
    JsonObject object(value, "", fault);
    detail::expect_format(object, kFormat, kVersion, "register");
    Registration registration;
    registration.mannequin_from_ct = detail::rigid_from(object.object("mannequin_from_ct"));
    JsonObject quadratic = object.object("quadratic");
    registration.quadratic.centre_mm = quadratic.point("centre_mm");
    registration.quadratic.scale_mm = quadratic.number("scale_mm");
    if (registration.quadratic.scale_mm == 0) quadratic.add_fault("scale_mm", "is zero");
    if (object.ok()) {
        const Json& rows = value["quadratic"].contains("coefficients_mm")
                               ? value["quadratic"]["coefficients_mm"]
                               : Json();
        bool good = rows.is_array() && rows.size() == 3;
        for (std::size_t r = 0; good && r < 3; ++r) {
            good = rows[r].is_array() && rows[r].size() == 10;
            for (std::size_t c = 0; good && c < 10; ++c) {
                good = rows[r][c].is_number();
                if (good) registration.quadratic.coefficients[r][c] = rows[r][c].get<double>();
            }
        }
        if (!good)
            quadratic.add_fault("coefficients_mm", "has the wrong shape",
                                "expected 3 lists of 10 numbers");
    }
    if (object.has("residual")) registration.residual = residual_from(object.object("residual"));
    if (object.has("ct_box")) {
        JsonObject box = object.object("ct_box");
        registration.ct_box.lower = box.point("lower_mm");
        registration.ct_box.upper = box.point("upper_mm");
    }
    registration.min_det_jacobian = object.number_or("min_det_jacobian", 0);
    registration.reports = detail::reports_from(object, "stages");
    if (fault.error) return *fault.error;
    return registration;
}

Result<Registration> load_registration(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    return parse_registration(text, path);
}

Status save_registration(const Registration& registration, const std::string& path) {
    return write_file(path, format_registration(registration));
}

}  // namespace sonocase
