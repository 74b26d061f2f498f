// SPDX-License-Identifier: Apache-2.0

#include "pipeline/calibration/touched_points.h"

#include <algorithm>

#include "formats/base/digest.h"
#include "formats/files/atomic_file.h"
#include "pipeline/base/point_table.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline calibration {

namespace {

Result<NamedPoints> named_points(PointTable table, const std::string& where) {
    place_points(table, 1, Axes::unsaid);
    if (table.points.empty()) return Error{"no points", where, "expected rows name,x,y,z in mm"};
    return NamedPoints{std::move(table.names), std::move(table.points)};
}

}  // namespace

Result<NamedPoints> parse_named_points(std::string_view csv, const std::string& where) {
    SONOCASE_TRY(auto table, parse_point_table(csv, where, {.names = true, .keep_holes = true}));
    return named_points(std::move(table), where);
}

Result<NamedPoints> load_named_points(const std::string& path) {
    SONOCASE_TRY(auto table, load_point_table(path, {.names = true, .keep_holes = true}));
    return named_points(std::move(table), path);
}

Result<std::pair<NamedPoints, NamedPoints>> pair_points(const NamedPoints& known,
                                                        const NamedPoints& touched) {
    if (known.names.empty() || touched.names.empty()) {
        if (known.points.size() != touched.points.size()) {
            return Error{std::to_string(touched.points.size()) + " touched points for " +
                             std::to_string(known.points.size()) + " landmarks",
                         "", "touch each once, in the order of the list, or name the rows"};
        }
        return std::pair{known, touched};
    }
    NamedPoints a, b;
    for (std::size_t i = 0; i < touched.points.size(); ++i) {
        const auto found = std::find(known.names.begin(), known.names.end(), touched.names[i]);
        if (found == known.names.end()) {
            std::string names;
            for (const std::string& n : known.names) names += (names.empty() ? "" : ", ") + n;
            return Error{"no landmark is called \"" + touched.names[i] + "\"", "",
                         "the list has " + names};
        }
        a.names.push_back(touched.names[i]);
        b.names.push_back(touched.names[i]);
        a.points.push_back(known.points[found - known.names.begin()]);
        b.points.push_back(touched.points[i]);
    }
    return std::pair{a, b};
}

Result<Signal> parse_signal(std::string_view csv, const std::string& where) {
    Signal out;
    bool first = true;
    for (const TextRow& row : split_rows(csv)) {
        const auto time = row.cells.size() >= 2 ? number_in(row.cells[0]) : std::nullopt;
        const auto value = row.cells.size() >= 2 ? number_in(row.cells[1]) : std::nullopt;
        if (!time || !value) {
            if (first) {
                first = false;
                continue;
            }
            return Error{"the row is not two numbers", where + ": line " + std::to_string(row.line),
                         "expected time_s,value"};
        }
        first = false;
        out.time_s.push_back(*time);
        out.value.push_back(*value);
    }
    if (out.time_s.empty()) return Error{"no rows", where, "expected time_s,value"};
    return out;
}

Result<Signal> load_signal(const std::string& path) {
    SONOCASE_TRY(const auto text, read_text_file(path));
    return parse_signal(text, path);
}

std::string digest_of_points(const std::vector<Point3>& points) {
    Digest digest;
    for (const Point3& p : points) digest.add(p.x).add(p.y).add(p.z);
    return digest.hex();
}

}  // namespace sonocase::pipeline::inline calibration
