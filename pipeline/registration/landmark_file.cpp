// SPDX-License-Identifier: Apache-2.0

#include "pipeline/registration/landmark_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <optional>
#include <utility>

#include "formats/files/atomic_file.h"
#include "pipeline/base/point_table.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline registration {
namespace {

// Where a row holds a mark's name and its places, by body.
struct LandmarkColumns {
    struct Place {
        std::array<std::size_t, 3> column{};
        double unit_mm = 1;
        Axes axes = Axes::unsaid;
    };
    std::size_t name = 0;
    Place ct{{1, 2, 3}}, mannequin{{4, 5, 6}};
};

// "ct_x", "CT L (cm)", "mannequin_y", "z_mm". False: the cell names no coordinate.
bool read_coordinate(std::string_view cell, bool* of_ct, int* axis, double* unit_mm, Axes* axes) {
    std::vector<std::string> words(1);
    for (const char c : lower_case(cell)) {
        if (std::isalnum(static_cast<unsigned char>(c)))
            words.back() += c;
        else if (!words.back().empty())
            words.emplace_back();
    }
    if (words.back().empty()) words.pop_back();
    *unit_mm = 1;
    if (words.size() > 1 && length_unit_mm(words.back()) > 0) {
        *unit_mm = length_unit_mm(words.back());
        words.pop_back();
    }
    if (words.empty() || words.size() > 2 || words.back().size() != 1) return false;
    const char letter = words.back()[0];
    for (const auto& [letters, meant] : {std::pair<std::string_view, Axes>{"xyz", Axes::unsaid},
                                         {"ras", Axes::ras},
                                         {"lps", Axes::lps}}) {
        const std::size_t at = letters.find(letter);
        if (at == letters.npos) continue;
        *axis = static_cast<int>(at);
        *axes = letter == 's' ? Axes::unsaid : meant;  // the third of both
        const std::string body = words.size() == 2 ? words[0] : "mannequin";
        *of_ct = body == "ct" || body == "patient" || body == "scan" || body == "image";
        return *of_ct || body == "mannequin" || body == "surface" || body == "phantom";
    }
    return false;
}

// Empty: the row does not name each column once.
std::optional<LandmarkColumns> find_columns(const TextRow& header) {
    LandmarkColumns found;
    int names = 0;
    std::array<int, 6> seen{};
    for (std::size_t c = 0; c < header.cells.size(); ++c) {
        const std::string cell = lower_case(header.cells[c]);
        if (cell == "name" || cell == "label" || cell == "landmark") {
            found.name = c;
            ++names;
        }
        bool of_ct = false;
        int axis = 0;
        double unit_mm = 1;
        Axes axes = Axes::unsaid;
        if (!read_coordinate(cell, &of_ct, &axis, &unit_mm, &axes)) continue;
        LandmarkColumns::Place& place = of_ct ? found.ct : found.mannequin;
        int& first = seen[of_ct ? 0 : 3];
        if (first + seen[of_ct ? 1 : 4] + seen[of_ct ? 2 : 5] > 0 && place.unit_mm != unit_mm)
            return std::nullopt;
        if (axes != Axes::unsaid && place.axes != Axes::unsaid && axes != place.axes)
            return std::nullopt;
        place.column[static_cast<std::size_t>(axis)] = c;
        place.unit_mm = unit_mm;
        if (axes != Axes::unsaid) place.axes = axes;
        ++seen[static_cast<std::size_t>(axis + (of_ct ? 0 : 3))];
    }
    if (names != 1 || std::any_of(seen.begin(), seen.end(), [](int n) { return n != 1; }))
        return std::nullopt;
    return found;
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
    LandmarkColumns columns;
    const char* expected = "rows are name,ct_x,ct_y,ct_z,x,y,z in mm";
    for (const TextRow& row : split_rows(csv)) {
        const std::string at = where + ":" + std::to_string(row.line);
        if (row.cells.size() < 7) {
            return Error{"landmark row of " + std::to_string(row.cells.size()) + " cells", at,
                         expected};
        }
        std::size_t numbers = 0;
        const auto read = [&](const LandmarkColumns::Place& place) {
            Point3 point;
            for (int axis = 0; axis < 3; ++axis) {
                const std::size_t column = place.column[static_cast<std::size_t>(axis)];
                const std::optional<double> v =
                    column < row.cells.size() ? number_in(row.cells[column]) : std::nullopt;
                if (!v || !std::isfinite(*v)) continue;
                point[axis] = place.unit_mm * *v;
                ++numbers;
            }
            return to_ras(point, place.axes);
        };
        const Point3 ct = read(columns.ct), mannequin = read(columns.mannequin);
        if (numbers == 0 && first) {  // the header
            first = false;
            const auto named = find_columns(row);
            if (!named)
                return Error{"landmarks of " + std::to_string(row.cells.size()) +
                                 " columns: which are the coordinates?",
                             at,
                             "call them name,ct_x,ct_y,ct_z,x,y,z, in any order; l, p, s or r, a, "
                             "s in place of x, y, z, and cm or m where they are not mm (ct_l_cm)"};
            columns = *named;
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
                "landmark '" + row.cells[columns.name] + "' has a coordinate that is not a number",
                at, expected};
        }
        landmarks.push_back({row.cells[columns.name], ct, mannequin});
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
