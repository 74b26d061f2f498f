// SPDX-License-Identifier: Apache-2.0

#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/base/delimited_text.h"
#include "pipeline/import/surface/surface_readers.h"

namespace sonocase::pipeline {
namespace {

struct Columns {
    int point[3] = {0, 1, 2};
    int normal[3] = {-1, -1, -1};
    int status = -1;
};

int find_column(const TextRow& header, const char* name) {
    for (std::size_t c = 0; c < header.cells.size(); ++c) {
        std::string cell = lower_case(header.cells[c]);
        if (cell.ends_with("_mm") || cell.ends_with("[mm]"))
            cell = cell.substr(0, cell.find_first_of("_[ "));
        if (cell == name) return static_cast<int>(c);
    }
    return -1;
}

bool find_columns(const TextRow& header, Columns* columns) {
    constexpr const char* kNames[][3] = {{"x", "y", "z"}, {"tx", "ty", "tz"}, {"px", "py", "pz"}};
    for (const auto& names : kNames) {
        for (int axis = 0; axis < 3; ++axis)
            columns->point[axis] = find_column(header, names[axis]);
        if (columns->point[0] >= 0 && columns->point[1] >= 0 && columns->point[2] >= 0) {
            constexpr const char* kNormals[3] = {"nx", "ny", "nz"};
            for (int axis = 0; axis < 3; ++axis)
                columns->normal[axis] = find_column(header, kNormals[axis]);
            columns->status = find_column(header, "status");
            return true;
        }
    }
    return false;
}

}  // namespace

Result<Surface> read_point_file(const std::string& path, std::vector<std::string>* warnings) {
    auto text = read_text_file(path);
    if (!text) return text.error();
    const std::vector<TextRow> rows = split_rows(*text);
    Surface surface;
    if (rows.empty()) return surface;
    Columns columns;
    std::size_t first = 0;
    if (!number_in(rows[0].cells[0]) || !find_columns(rows[0], &columns)) {
        columns = Columns{};
        if (rows[0].cells.size() == 1 && number_in(rows[0].cells[0])) {
            first = 1;  // XYZ files may begin with the number of points
        } else if (!number_in(rows[0].cells[0])) {
            if (!find_columns(rows[0], &columns))
                return Error{
                    "no columns x, y, z", path + ":" + std::to_string(rows[0].line),
                    "expected a header with x,y,z (or tx,ty,tz), or three numbers per row"};
            first = 1;
        }
    }
    const bool has_normals =
        columns.normal[0] >= 0 && columns.normal[1] >= 0 && columns.normal[2] >= 0;
    std::size_t left_out = 0;
    for (std::size_t r = first; r < rows.size(); ++r) {
        const TextRow& row = rows[r];
        const auto cell = [&](int column) -> std::optional<double> {
            if (static_cast<std::size_t>(column) >= row.cells.size()) return std::nullopt;
            return number_in(row.cells[static_cast<std::size_t>(column)]);
        };
        if (columns.status >= 0 && static_cast<std::size_t>(columns.status) < row.cells.size() &&
            lower_case(row.cells[static_cast<std::size_t>(columns.status)]) != "ok") {
            ++left_out;
            continue;
        }
        Point3 point;
        Vector3 normal;
        for (int axis = 0; axis < 3; ++axis) {
            const auto value = cell(columns.point[axis]);
            if (!value)
                return Error{"row without three numbers", path + ":" + std::to_string(row.line),
                             "expected x, y and z; correct or delete the row"};
            point[axis] = *value;
            if (has_normals) normal[axis] = cell(columns.normal[axis]).value_or(0.0);
        }
        if (!std::isfinite(point.x) || !std::isfinite(point.y) || !std::isfinite(point.z)) {
            ++left_out;
            continue;
        }
        surface.points.push_back(point);
        if (has_normals) surface.normals.push_back(normalized(normal));
    }
    if (left_out > 0)
        warnings->push_back(
            std::to_string(left_out) +
            " readings without position or with a status other than OK were left out");
    return surface;
}

}  // namespace sonocase::pipeline
