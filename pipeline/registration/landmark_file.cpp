// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/landmark_file.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/files/atomic_file.h"
#include "pipeline/base/point_table.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline registration {
namespace {

// False: the row does not name all columns.
bool find_columns(const TextRow& header, std::array<std::size_t, 7>& column) {
    constexpr const char* kNames[] = {"name", "ct_x", "ct_y", "ct_z", "x", "y", "z"};
    std::array<std::size_t, 7> found{};
    for (std::size_t n = 0; n < 7; ++n) {
        const auto cell = std::find_if(header.cells.begin(), header.cells.end(), [&](auto& c) {
            return lower_case(c) == kNames[n] || lower_case(c) == std::string(kNames[n]) + "_mm";
        });
        if (cell == header.cells.end()) return false;
        found[n] = static_cast<std::size_t>(cell - header.cells.begin());
    }
    column = found;
    return true;
}

Result<PointTable> load_marks(const std::string& path) {
    SONOCASE_TRY(auto marks, load_point_table(path, {.names = true}));
    if (marks.names.empty() || marks.names.size() != marks.points.size())
        return Error{"the marks have no names", path, "expected rows name,x,y,z"};
    // A mark is found in the other file by its name.
    for (std::size_t n = 0; n < marks.names.size(); ++n) {
        if (marks.names[n].empty())
            return Error{"mark " + std::to_string(n + 1) + " has no name", path,
                         "give each mark a name of its own, the same in both files"};
        if (std::find(marks.names.begin(), marks.names.begin() + static_cast<std::ptrdiff_t>(n),
                      marks.names[n]) != marks.names.begin() + static_cast<std::ptrdiff_t>(n))
            return Error{"two marks are named '" + marks.names[n] + "'", path,
                         "give each mark a name of its own, the same in both files"};
    }
    place_points(marks, 1, Axes::unsaid);
    return marks;
}

}  // namespace

Result<std::vector<Landmark>> parse_landmarks(std::string_view csv, const std::string& where) {
    SONOCASE_TRY_DONE(expect_utf8(csv, where));
    std::vector<Landmark> landmarks;
    bool first = true;
    std::array<std::size_t, 7> column{0, 1, 2, 3, 4, 5, 6};
    for (const TextRow& row : split_rows(csv)) {
        const std::string at = where + ":" + std::to_string(row.line);
        const char* expected = "rows are name,ct_x,ct_y,ct_z,x,y,z in mm";
        if (row.cells.size() < 7) {
            return Error{"landmark row of " + std::to_string(row.cells.size()) + " cells", at,
                         expected};
        }
        double value[6] = {};
        std::size_t numbers = 0;
        for (std::size_t c = 0; c < 6; ++c) {
            const std::optional<double> v = column[c + 1] < row.cells.size()
                                                ? number_in(row.cells[column[c + 1]])
                                                : std::nullopt;
            if (v && std::isfinite(*v)) {
                value[c] = *v;
                ++numbers;
            }
        }
        if (numbers == 0 && first) {  // the header
            first = false;
            if (!find_columns(row, column) && row.cells.size() > 7)
                return Error{"landmarks of " + std::to_string(row.cells.size()) +
                                 " columns: which are the coordinates?",
                             at, "call them name,ct_x,ct_y,ct_z,x,y,z, in any order"};
            continue;
        }
        if (first && row.cells.size() > 7)
            return Error{"landmarks of " + std::to_string(row.cells.size()) +
                             " columns without names: which are the coordinates?",
                         at,
                         "put the line name,ct_x,ct_y,ct_z,x,y,z above, with the others' names"};
        first = false;
        if (numbers < 6) {
            return Error{
                "landmark '" + row.cells[column[0]] + "' has a coordinate that is not a number", at,
                expected};
        }
        landmarks.push_back(
            {row.cells[column[0]], {value[0], value[1], value[2]}, {value[3], value[4], value[5]}});
    }
    if (landmarks.empty()) {
        return Error{"no landmark found", where, "rows are name,ct_x,ct_y,ct_z,x,y,z in mm"};
    }
    return landmarks;
}

Result<std::vector<Landmark>> load_landmarks(const std::string& path,
                                             const std::string& surface_path) {
    const bool markups = is_markups_file(path) || lower_case(path).ends_with(".fcsv");
    if (surface_path.empty()) {
        if (markups)
            return Error{"the file holds each mark once, and a landmark has a place on either body",
                         path, "give those on the mannequin with --surface-landmarks FILE"};
        SONOCASE_TRY(const std::string text, read_text_file(path));
        return parse_landmarks(text, path);
    }
    SONOCASE_TRY(const auto patient, load_marks(path));
    SONOCASE_TRY(const auto surface, load_marks(surface_path));
    std::vector<Landmark> landmarks;
    for (std::size_t n = 0; n < patient.points.size(); ++n) {
        const std::string& name = patient.names[n];
        const auto found = std::find(surface.names.begin(), surface.names.end(), name);
        if (found == surface.names.end())
            return Error{"the mark '" + name + "' of " + path + " is missing", surface_path,
                         "give the same marks the same names in both files"};
        landmarks.push_back(
            {name, patient.points[n],
             surface.points[static_cast<std::size_t>(found - surface.names.begin())]});
    }
    return landmarks;
}

}  // namespace sonocase::pipeline::inline registration
