// SPDX-License-Identifier: Apache-2.0

#include "pipeline/import/mesh/node_table.h"

#include <algorithm>
#include <sstream>

#include "formats/text/nearest_name.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline import_mesh {
namespace {

const std::vector<std::string>& role_names() {
    static const std::vector<std::string> names{"body", "organ", "part", "lumen", "skip", "frame"};
    return names;
}

// "y 50: 0.97 -8.2 1.07 -3.8 0.97 -48.6"
bool read_frame(const std::string& text, FrameRow& row) {
    std::istringstream in(text);
    char axis = 0, colon = 0;
    if (!(in >> axis >> row.at_mm >> colon) || colon != ':' || axis < 'x' || axis > 'z')
        return false;
    row.axis = axis - 'x';
    for (double& value : row.change)
        if (!(in >> value)) return false;
    std::string rest;
    return !(in >> rest) && row.change[0] > 0 && row.change[2] > 0 && row.change[4] > 0;
}

std::string cell(const TextRow& row, std::size_t n) {
    return n < row.cells.size() ? row.cells[n] : std::string();
}

Status add_row(const TextRow& row, const std::string& where, NodeTable& table) {
    const std::string place = where + ":" + std::to_string(row.line);
    const std::string role = cell(row, 2);
    const auto found = std::find(role_names().begin(), role_names().end(), role);
    if (found == role_names().end())
        return Error{"unknown role '" + role + "'", place, suggest_name(role, role_names())};
    if (role == "frame") {
        FrameRow frame;
        frame.pattern = cell(row, 0);
        if (!read_frame(cell(row, 1), frame))
            return Error{"'" + cell(row, 1) + "' is not a change of frame", place,
                         "expected AXIS HEIGHT: and scale and shift of x, y and z, as in y 50: "
                         "0.97 -8 1.07 -4 0.97 -49"};
        table.frames.push_back(frame);
        return Done{};
    }
    NodeRow node{cell(row, 0),
                 cell(row, 1),
                 cell(row, 3),
                 static_cast<NodeRole>(found - role_names().begin()),
                 number_in(cell(row, 4)).value_or(0),
                 row.line};
    const bool nameless = node.role == NodeRole::skip || node.role == NodeRole::body;
    if (node.pattern.empty() || (node.label.empty() && !nameless))
        return Error{"a row without a node or a label", place, "expected node,label,role"};
    table.rows.push_back(std::move(node));
    return Done{};
}

}  // namespace

bool matches_pattern(std::string_view pattern, std::string_view name) {
    std::size_t p = 0, n = 0, star = std::string_view::npos, mark = 0;
    while (n < name.size()) {
        if (p < pattern.size() && pattern[p] == '*') {
            star = p++;
            mark = n;
        } else if (p < pattern.size() && pattern[p] == name[n]) {
            ++p;
            ++n;
        } else if (star != std::string_view::npos) {
            p = star + 1;
            n = ++mark;
        } else {
            return false;
        }
    }
    while (p < pattern.size() && pattern[p] == '*') ++p;
    return p == pattern.size();
}

const NodeRow* NodeTable::find(std::string_view node) const {
    for (const NodeRow& row : rows)
        if (matches_pattern(row.pattern, node)) return &row;
    return nullptr;
}

Point3 NodeTable::placed(const std::string& file, Point3 p) const {
    const FrameRow *below = nullptr, *above = nullptr;
    for (const FrameRow& row : frames) {
        if (!matches_pattern(row.pattern, file)) continue;
        const double height = p[row.axis];
        if (row.at_mm <= height && (below == nullptr || row.at_mm > below->at_mm)) below = &row;
        if (row.at_mm > height && (above == nullptr || row.at_mm < above->at_mm)) above = &row;
    }
    if (below == nullptr && above == nullptr) return p;
    if (below == nullptr) below = above;
    if (above == nullptr) above = below;
    const double span = above->at_mm - below->at_mm;
    const double t = span > 0 ? (p[below->axis] - below->at_mm) / span : 0;
    Point3 out;
    for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(2 * axis);
        const double scale = (1 - t) * below->change[a] + t * above->change[a];
        const double shift = (1 - t) * below->change[a + 1] + t * above->change[a + 1];
        out[axis] = scale * p[axis] + shift;
    }
    return out;
}

Result<NodeTable> parse_node_table(std::string_view csv, const std::string& where) {
    SONOCASE_TRY_DONE(expect_utf8(csv, where));
    if (csv.starts_with("\xEF\xBB\xBF")) csv.remove_prefix(3);
    NodeTable table;
    // Comment lines stay as empty lines, so that the numbers of lines are right.
    std::string rows;
    std::istringstream in{std::string(csv)};
    constexpr std::string_view kKey = "# attribution:";
    for (std::string line; std::getline(in, line);) {
        if (line.starts_with(kKey)) {
            const std::size_t first = line.find_first_not_of(" \t", kKey.size());
            std::string text = first == std::string::npos ? "" : line.substr(first);
            while (!text.empty() && (text.back() == '\r' || text.back() == ' ')) text.pop_back();
            table.attribution += (table.attribution.empty() ? "" : " ") + text;
        }
        rows += (line.starts_with("#") ? "" : line) + "\n";
    }
    for (const TextRow& row : split_rows(rows)) {
        if (row.cells.empty() || (row.cells.size() == 1 && row.cells[0].empty())) continue;
        if (lower_case(row.cells[0]) == "node") continue;
        SONOCASE_TRY_DONE(add_row(row, where, table));
    }
    if (table.rows.empty())
        return Error{"the table has no rows", where, "expected node,label,role"};
    return table;
}

}  // namespace sonocase::pipeline::inline import_mesh
