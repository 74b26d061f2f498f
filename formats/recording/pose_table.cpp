// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/pose_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "formats/recording/tool_frames.h"
#include "formats/text/lower_case.h"
#include "formats/text/number_text.h"

namespace sonocase {

bool is_none(std::string_view cell) {
    static constexpr std::string_view kNone[] = {
        "",        "nan",    "-nan",    "nan(ind)", "-nan(ind)", "1.#qna",
        "-1.#qna", "1.#ind", "-1.#ind", "1.#nan",   "#n/a",      "n/a",
        "na",      "null",   "none",    "-",        "--",        "missing"};
    if (cell.size() > 10) return false;
    std::string word = lower_case(cell);
    if (word.starts_with("1.#") || word.starts_with("-1.#")) word.resize(word.find('#') + 4);
    return std::find(std::begin(kNone), std::end(kNone), word) != std::end(kNone);
}

namespace {

constexpr std::array<const char*, 3> kPlaces{"tx", "ty", "tz"};
constexpr std::array<const char*, 4> kQuaternion{"qw", "qx", "qy", "qz"};
constexpr std::array<const char*, 9> kMatrix{"r00", "r01", "r02", "r10", "r11",
                                             "r12", "r20", "r21", "r22"};
constexpr std::size_t kMaxTools = 64;
constexpr double kNdiMissing = -3e28;  // NDI writes -3.697314e28 for what it has not measured

// The same columns by other names, as other programs write them.
constexpr std::pair<std::string_view, std::string_view> kOtherNames[] = {
    {"m00", "r00"},
    {"m01", "r01"},
    {"m02", "r02"},
    {"m10", "r10"},
    {"m11", "r11"},
    {"m12", "r12"},
    {"m20", "r20"},
    {"m21", "r21"},
    {"m22", "r22"},
    {"m03", "tx"},
    {"m13", "ty"},
    {"m23", "tz"},
    {"timestamp", "timestamp_s"},
    {"time", "timestamp_s"},
    {"time_s", "timestamp_s"},
    {"t", "timestamp_s"},
    {"t_s", "timestamp_s"},
    {"stamp", "timestamp_s"},
    {"state", "status"},
    {"valid", "status"},
    {"ok", "status"},
    {"tracked", "status"},
    {"visible", "status"},
    {"frame_number", "frame"},
    {"framenumber", "frame"},
    {"frame#", "frame"},
    {"x", "tx"},
    {"y", "ty"},
    {"z", "tz"},
    {"px", "tx"},
    {"py", "ty"},
    {"pz", "tz"},
    {"pos_x", "tx"},
    {"pos_y", "ty"},
    {"pos_z", "tz"},
    {"position_x", "tx"},
    {"position_y", "ty"},
    {"position_z", "tz"},
    {"q0", "qw"},
    {"q_w", "qw"},
    {"q_x", "qx"},
    {"q_y", "qy"},
    {"q_z", "qz"},
    {"quat_w", "qw"},
    {"quat_x", "qx"},
    {"quat_y", "qy"},
    {"quat_z", "qz"},
    {"orientation_w", "qw"},
    {"orientation_x", "qx"},
    {"orientation_y", "qy"},
    {"orientation_z", "qz"},
    {"tool_name", "tool"},
    {"toolname", "tool"},
    {"tool_id", "tool"},
    {"name", "tool"},
    {"device", "tool"},
    {"devicename", "tool"},
    {"device_name", "tool"},
    {"port", "tool"},
    {"port_handle", "tool"},
    {"handle", "tool"},
    {"sensor", "tool"},
    {"rigid_body", "tool"},
    {"rigidbody", "tool"}};

void split(std::string_view line, char between, std::vector<std::string_view>& out) {
    out.clear();
    while (true) {
        if (between == ' ') line = trimmed(line);
        const std::size_t end = between == ' ' ? line.find_first_of(" \t") : line.find(between);
        std::string_view cell = trimmed(line.substr(0, end));
        if (cell.size() > 1 && cell.front() == '"' && cell.back() == '"')
            cell = trimmed(cell.substr(1, cell.size() - 2));
        out.push_back(cell);
        if (end == std::string_view::npos) return;
        line.remove_prefix(end + 1);
    }
}

char separator_of(std::string_view line) {
    for (const char sign : {';', '\t', ','}) {
        if (line.find(sign) != std::string_view::npos) return sign;
    }
    return ' ';
}

// What a cell of a column of states says.
enum class State { counts, lost, unknown };
State state_of(std::string_view cell) {
    static constexpr std::string_view kCounts[] = {
        "ok",   "valid", "tracked", "tracking", "visible", "enabled", "good",
        "true", "yes",   "1",       "1.0",      "tool_ok", "in view", "in_view"};
    static constexpr std::string_view kLost[] = {"invalid",
                                                 "missing",
                                                 "lost",
                                                 "out_of_view",
                                                 "out of view",
                                                 "out_of_volume",
                                                 "out of volume",
                                                 "partially_out_of_volume",
                                                 "partially out of volume",
                                                 "not tracked",
                                                 "not_tracked",
                                                 "untracked",
                                                 "occluded",
                                                 "hidden",
                                                 "disabled",
                                                 "bad",
                                                 "bad fit",
                                                 "false",
                                                 "no",
                                                 "0",
                                                 "0.0",
                                                 "error",
                                                 "unknown",
                                                 "tool_missing",
                                                 "tool_out_of_view",
                                                 "not_rigid",
                                                 "out_of_range"};
    if (cell == "OK") return State::counts;
    const std::string word = lower_case(cell);
    if (std::find(std::begin(kCounts), std::end(kCounts), word) != std::end(kCounts))
        return State::counts;
    if (is_none(cell) || std::find(std::begin(kLost), std::end(kLost), word) != std::end(kLost))
        return State::lost;
    return State::unknown;
}

// Where one tool's numbers stand in a row; -1: nowhere.
struct Columns {
    std::string tool;
    int frame = -1, time = -1, status = -1;
    std::array<int, 3> place{-1, -1, -1};
    std::array<int, 9> turn{-1, -1, -1, -1, -1, -1, -1, -1, -1};  // four of a quaternion, or nine
    bool quaternion = false;
    double place_unit_mm = 1;
};

// How a table is laid out, from the line that names its columns.
struct Layout {
    char between = ',';
    std::size_t cells = 0;
    std::vector<Columns> tools;
    int tool_column = -1;  // its cells say whose reading a row is
    double time_unit_s = 1;
    bool time_unit_named = false;
};

constexpr const char* kOurColumns =
    "expected frame,timestamp_s,status,tx,ty,tz and r00,...,r22 or qw,qx,qy,qz";

class LayoutReader {
  public:
    LayoutReader(std::string_view line, std::string at) : line_(line), at_(std::move(at)) {
        layout_.between = separator_of(line);
        std::vector<std::string_view> cells;
        split(line, layout_.between, cells);
        while (cells.size() > 1 && cells.back().empty()) cells.pop_back();
        layout_.cells = cells.size();
        for (std::size_t i = 0; i < cells.size(); ++i) add(cells[i], static_cast<int>(i));
    }

    // True if the line names a pose's columns, for lines that might be remarks.
    bool names_columns() const { return first("tx") >= 0 && first("tz") >= 0; }

    Result<Layout> read() {
        if (columns_.size() == 1 && line_.find(' ') == std::string_view::npos) return missing("tx");
        if (!other_unit_.empty())
            return Error{
                "places are in the unit of '" + std::string(other_unit_.substr(0, 40)) + "'", at_,
                "expected mm, cm or m: convert them and name their columns so"};
        layout_.tool_column = first("tool");
        const std::vector<int> turns = all(has_all("", kQuaternion) ? "qw" : "r00");
        const bool plain = has_all("", kPlaces) && !turns.empty();
        if (plain && turns.size() > 1) {
            SONOCASE_TRY_DONE(read_again_and_again(turns));
        } else if (!plain && read_by_prefix()) {
            if (!twice_.empty())
                return Error{"has the columns of '" + twice_.substr(0, 40) + "' twice", at_,
                             "one group of columns for each tool"};
            return layout_;
        } else {
            SONOCASE_TRY(Columns one, columns_of(""));
            layout_.tools.push_back(one);
        }
        return layout_;
    }

  private:
    struct Named {
        std::string name;
        int index = 0;
        double unit_mm = 1;
    };
    static bool is_place(std::string_view name) {
        const std::string_view before = name.substr(0, name.size() - 1);
        const bool axis = !name.empty() && name.back() >= 'x' && name.back() <= 'z';
        return axis && (before.empty() || before.ends_with("_") || before.ends_with("t"));
    }

    void add(std::string_view cell, int index) {
        std::string name;
        for (const char c : cell) {
            const bool between =
                c == ' ' || c == '[' || c == '(' || c == '-' || c == '.' || c == ':';
            if (between && !name.empty() && name.back() != '_') name += '_';
            if (c != ']' && c != ')' && c != '%' && !between)
                name += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
        }
        while (!name.empty() && name.back() == '_') name.pop_back();
        const auto cut = [&](std::string_view end) {
            const bool has = name.ends_with(end) && name.size() > end.size();
            if (has) name.resize(name.size() - end.size());
            return has;
        };
        const bool ms = cut("_ms") || cut("_milliseconds"), us = !ms && cut("_us"),
                   ns = !us && cut("_ns"), s = !ns && (cut("_seconds") || cut("_sec"));
        const bool mm = !ms && cut("_mm"), cm = !mm && cut("_cm"),
                   m = !cm &&
                       (name.ends_with("x_m") || name.ends_with("y_m") || name.ends_with("z_m")) &&
                       cut("_m");
        for (const std::string_view other : {"_in", "_inch", "_inches", "_ft", "_dm", "_um"}) {
            if (!name.ends_with(other) || !is_place(name.substr(0, name.size() - other.size())))
                continue;
            if (other_unit_.empty()) other_unit_ = cell;
        }
        name = of_matrix(name);
        for (const auto& [given, meant] : kOtherNames) {
            if (name != given) continue;
            name = meant;
            break;
        }
        if (name == "timestamp_s" && first(name) < 0) {
            layout_.time_unit_named =
                ms || us || ns || s || cell.ends_with("s]") || cell.ends_with("_s");
            layout_.time_unit_s = ms ? 1e-3 : us ? 1e-6 : ns ? 1e-9 : 1;
        }
        columns_.push_back({std::move(name), index, cm ? 10.0 : m ? 1000.0 : 1.0});
    }

    // An entry of a matrix by its row and column: t14 of t11 to t44, t03 of t00 to t33,
    // rotation[0][2].
    std::string of_matrix(const std::string& name) const {
        static constexpr std::string_view kBefore[] = {"rotation_", "rot_", "matrix_", "r_", "m_"};
        std::size_t at = std::string::npos;
        int from = 0;
        for (const std::string_view before : kBefore) {
            if (name.size() == before.size() + 3 && name.starts_with(before) &&
                name[before.size() + 1] == '_')
                at = before.size();
        }
        if (name.size() == 3 && name[0] == 't') {
            at = 1;
            from = lower_case(line_).find("t00") == std::string::npos ? 1 : 0;
        }
        if (at == std::string::npos) return name;
        const int row = name[at] - '0' - from, column = name.back() - '0' - from;
        if (row < 0 || row > 2 || column < 0 || column > 3) return name;
        return column < 3 ? kMatrix[static_cast<std::size_t>(3 * row + column)]
                          : kPlaces[static_cast<std::size_t>(row)];
    }

    int first(std::string_view name) const {
        for (const Named& column : columns_) {
            if (column.name == name) return column.index;
        }
        return -1;
    }
    std::vector<int> all(std::string_view name) const {
        std::vector<int> out;
        for (const Named& column : columns_) {
            if (column.name == name) out.push_back(column.index);
        }
        return out;
    }
    template <class Names>
    bool has_all(const std::string& prefix, const Names& names) const {
        return std::all_of(names.begin(), names.end(),
                           [&](const char* name) { return first(prefix + name) >= 0; });
    }
    double unit_mm(int index) const { return columns_[static_cast<std::size_t>(index)].unit_mm; }

    Error missing(const std::string& name) const {
        std::string found(line_.substr(0, 80));
        if (line_.size() > 80) found += "...";
        return Error{"column '" + name + "' is missing", at_,
                     "found " + found + "; " + kOurColumns};
    }

    Result<Columns> columns_of(const std::string& prefix) const {
        Columns out;
        out.frame = first("frame");
        out.time = first("timestamp_s");
        out.status = first(prefix + "status");
        for (std::size_t i = 0; i < 3; ++i) {
            out.place[i] = first(prefix + kPlaces[i]);
            if (out.place[i] < 0) return missing(prefix + kPlaces[i]);
        }
        out.place_unit_mm = unit_mm(out.place[0]);
        out.quaternion = has_all(prefix, kQuaternion);
        if (out.quaternion) {
            for (std::size_t i = 0; i < 4; ++i) out.turn[i] = first(prefix + kQuaternion[i]);
            return out;
        }
        if (first("q1") >= 0 && first("q2") >= 0 && first("q3") >= 0)
            return Error{"columns q0, q1, q2, q3 do not say which of them is the scalar", at_,
                         "name them qw, qx, qy, qz"};
        for (std::size_t i = 0; i < 9; ++i) {
            out.turn[i] = first(prefix + kMatrix[i]);
            if (out.turn[i] >= 0) continue;
            for (const char* angle : {"roll", "rx", "azimuth", "yaw", "euler_x", "rot_x", "a"}) {
                if (first(angle) >= 0)
                    return Error{"angles (column '" + std::string(angle) +
                                     "') do not say in which order they turn",
                                 at_, "export quaternions qw,qx,qy,qz or matrices r00,...,r22"};
            }
            return missing(prefix + kMatrix[i]);
        }
        return out;
    }

    // probe_tx, probe_ty, ... needle_tx: true if at least one prefix has all columns of a pose.
    bool read_by_prefix() {
        for (const Named& column : columns_) {
            for (const std::string_view end : {"_tx", "_x", "_px", "_pos_x", "_position_x"}) {
                if (!column.name.ends_with(end)) continue;
                const std::string prefix =
                    column.name.substr(0, column.name.size() - end.size() + 1);
                if (prefix.ends_with("pos_") || prefix.ends_with("position_") ||
                    prefix.ends_with("q_") || prefix.ends_with("quat_"))
                    continue;
                rename(prefix);
                if (!has_all(prefix, kPlaces)) continue;
                Result<Columns> one = columns_of(prefix);
                if (!one) continue;
                one->tool = prefix.substr(0, prefix.size() - 1);
                if (all(prefix + kPlaces[0]).size() > 1) twice_ = one->tool;
                const bool known =
                    std::any_of(layout_.tools.begin(), layout_.tools.end(),
                                [&](const Columns& tool) { return tool.tool == one->tool; });
                if (!known && layout_.tools.size() < kMaxTools) layout_.tools.push_back(*one);
            }
        }
        // The one prefix of a table may be a path that names no tool: field.pose.position.x.
        if (layout_.tools.size() == 1) {
            std::string& name = layout_.tools.front().tool;
            if (rank_as_tool(name, ToolRole::probe) + rank_as_tool(name, ToolRole::needle) == 0)
                name.clear();
        }
        return !layout_.tools.empty();
    }
    // Names behind a prefix as those without one: "probe_x" is "probe_tx".
    void rename(const std::string& prefix) {
        for (Named& column : columns_) {
            if (!column.name.starts_with(prefix)) continue;
            const std::string_view rest = std::string_view(column.name).substr(prefix.size());
            for (const auto& [given, meant] : kOtherNames) {
                if (rest != given) continue;
                column.name = prefix + std::string(meant);
                break;
            }
        }
    }

    // The same columns for each tool: a tool's place is nearest to its rotation, on the side on
    // which the first tool has it.
    Status read_again_and_again(const std::vector<int>& turns) {
        if (turns.size() > kMaxTools) return Error{"has columns of too many tools", at_, ""};
        SONOCASE_TRY(const Columns one, columns_of(""));
        const auto near = [&](std::string_view name, bool before, int from) {
            int found = -1;
            for (const int index : all(name)) {
                if (before && index < from) found = index;
                if (!before && index > from && found < 0) found = index;
            }
            return found;
        };
        const std::vector<int> frames = all("frame"), times = all("timestamp_s");
        for (std::size_t k = 0; k < turns.size(); ++k) {
            Columns tool;
            const int at = turns[k];
            for (std::size_t i = 0; i < 3; ++i)
                tool.place[i] = near(kPlaces[i], one.place[i] < turns[0], at);
            tool.quaternion = one.quaternion;
            for (std::size_t i = 0; i < (one.quaternion ? 4u : 9u); ++i) {
                const char* name = one.quaternion ? kQuaternion[i] : kMatrix[i];
                tool.turn[i] =
                    one.turn[i] == turns[0] ? at : near(name, one.turn[i] < turns[0], at);
            }
            if (one.status >= 0) tool.status = near("status", one.status < turns[0], at);
            const bool each_frame = frames.size() == turns.size();
            tool.frame = frames.empty() ? -1 : frames[each_frame ? k : 0];
            const bool each_time = times.size() == turns.size();
            tool.time = times.empty() ? -1 : times[each_time ? k : 0];
            const bool whole = tool.place[0] >= 0 && tool.place[1] >= 0 && tool.place[2] >= 0;
            if (!whole) return missing("tx of tool " + std::to_string(k + 1));
            for (std::size_t i = 0; i < (one.quaternion ? 4u : 9u); ++i) {
                if (tool.turn[i] < 0)
                    return missing(std::string(one.quaternion ? kQuaternion[i] : kMatrix[i]) +
                                   " of tool " + std::to_string(k + 1));
            }
            tool.place_unit_mm = unit_mm(tool.place[0]);
            tool.tool = name_before(at, k);
            layout_.tools.push_back(std::move(tool));
        }
        return Done{};
    }
    // "Port 1" of NDI's tables stands before the tool's columns.
    std::string name_before(int at, std::size_t k) const {
        for (int i = at; i-- > 0;) {
            const std::string& name = columns_[static_cast<std::size_t>(i)].name;
            if (name.starts_with("port_") || name.starts_with("tool_") ||
                name.starts_with("sensor_"))
                return name;
            if (k > 0 && (name == "tz" || name == "qz" || name == "r22")) break;
        }
        return "tool_" + std::to_string(k + 1);
    }

    std::string_view line_;
    std::string at_;
    std::vector<Named> columns_;
    std::string twice_;            // a tool whose columns stand in the line more than once
    std::string_view other_unit_;  // the first column of places in a unit that is not read
    Layout layout_;
};

// Reads rows; cells and their texts are kept between them.
class RowReader {
  public:
    RowReader(const Layout& layout, std::string where) : layout_(layout), where_(std::move(where)) {
        last_ = layout.tool_column;
        for (const Columns& c : layout.tools) {
            last_ = std::max({last_, c.frame, c.time, c.status});
            for (const int column : c.place) last_ = std::max(last_, column);
            for (const int column : c.turn) last_ = std::max(last_, column);
        }
    }

    Status take(std::string_view line, int number) {
        number_ = number;
        split(line, layout_.between, cells_);
        if (last_ >= static_cast<int>(cells_.size()))
            return Error{"holds " + std::to_string(cells_.size()) + " cells", here(),
                         "expected one per column"};
        std::size_t filled = cells_.size();
        while (filled > layout_.cells && cells_[filled - 1].empty()) --filled;
        if (filled > layout_.cells)
            return Error{"holds " + std::to_string(filled) + " cells for " +
                             std::to_string(layout_.cells) + " columns",
                         here(),
                         "are there decimal commas between commas? Export with decimal points, or "
                         "with semicolons between cells"};
        return Done{};
    }
    std::string_view tool() const { return cells_[static_cast<std::size_t>(layout_.tool_column)]; }

    Status read(const Columns& c, std::int64_t row, Pose& pose) {
        pose.frame = row;
        if (c.frame >= 0 && !parse_number(cell(c.frame), pose.frame))
            return not_a_number(c.frame, "frame");
        if (c.time >= 0) {
            if (!number_at(c.time, pose.timestamp_s)) {
                Error fault = not_a_number(c.time, "timestamp_s");
                fault.expected = "times must be numbers of seconds, or time_ms of milliseconds";
                return fault;
            }
            pose.timestamp_s *= layout_.time_unit_s;
        }
        const State state = c.status < 0 ? State::counts : state_of(cell(c.status));
        if (state == State::unknown && unknown_state.empty()) unknown_state = cell(c.status);
        pose.ok = state == State::counts;
        const std::size_t turns = c.quaternion ? 4 : 9;
        std::array<double, 12> values{};
        std::size_t none = 0, empty = 0;
        for (std::size_t i = 0; i < 3 + turns; ++i) {
            const int column = i < 3 ? c.place[i] : c.turn[i - 3];
            if (!number_at(column, values[i])) {
                if (!is_none(cell(column)))
                    return not_a_number(column, i < 3          ? kPlaces[i]
                                                : c.quaternion ? kQuaternion[i - 3]
                                                               : kMatrix[i - 3]);
                if (cell(column).empty()) ++empty;
                values[i] = std::numeric_limits<double>::quiet_NaN();
            }
            if (values[i] < kNdiMissing) values[i] = std::numeric_limits<double>::quiet_NaN();
            if (std::isnan(values[i])) ++none;
        }
        // A row without a pose may have no numbers for it; half a pose is a fault of the table.
        if (pose.ok && empty > 0 && none < 3 + turns) {
            for (std::size_t i = 0; i < 3 + turns; ++i) {
                const int column = i < 3 ? c.place[i] : c.turn[i - 3];
                if (cell(column).empty()) return not_a_number(column, i < 3 ? kPlaces[i] : "r00");
            }
        }
        if (none == 3 + turns) {
            pose.ok = false;
            return Done{};
        }
        Rigid& to = pose.tracker_from_tool;
        to.translation = {values[0], values[1], values[2]};
        if (c.place_unit_mm != 1) to.translation = c.place_unit_mm * to.translation;
        if (!c.quaternion) {
            for (std::size_t i = 0; i < 9; ++i) to.rotation.m[i] = values[3 + i];
            return Done{};
        }
        const double length = std::sqrt(values[3] * values[3] + values[4] * values[4] +
                                        values[5] * values[5] + values[6] * values[6]);
        // A tracker that has lost a tool may send the quaternion of zeros.
        if (length == 0) pose.ok = false;
        if (!pose.ok && !(length > 0.5)) return Done{};
        // Four printed decimals are off by less; other lengths are no rotation.
        if (pose.ok && std::isfinite(length) && !(std::abs(length - 1) < 1e-3))
            return Error{"the quaternion has length " + number_text(length, 4), here(),
                         "expected 1: name the scalar qw and the others qx, qy, qz, and write four "
                         "decimals and more"};
        to.rotation = rotation_from_quaternion(
            {values[3] / length, values[4] / length, values[5] / length, values[6] / length});
        return Done{};
    }

    std::string unknown_state;  // the first that is neither known to count nor to be lost

  private:
    std::string_view cell(int column) const { return cells_[static_cast<std::size_t>(column)]; }
    std::string here() const { return where_ + ":" + std::to_string(number_); }
    Error not_a_number(int column, const char* name) const {
        return {"'" + std::string(cell(column).substr(0, 40)) + "' is not a number", here(),
                "column '" + std::string(name) + "' must hold numbers"};
    }
    bool number_at(int column, double& value) {
        const std::string_view text = cell(column);
        const std::size_t comma = text.find(',');
        if (layout_.between == ',' || comma == std::string_view::npos)
            return parse_number(text, value);
        if (text.find('.') != std::string_view::npos) return false;  // which of them is it?
        text_ = text;
        text_[comma] = '.';
        return parse_number(text_, value);
    }

    const Layout& layout_;
    std::string where_, text_;
    std::vector<std::string_view> cells_;
    int last_ = -1, number_ = 0;
};

// A row of units below the names ("s,mm,mm,mm,..."): true if this line is one, and the units are
// taken. It holds words and no numbers, and one of them is the unit of a time or place.
Result<bool> take_units(std::string_view line, const std::string& at, Layout& layout) {
    constexpr std::pair<std::string_view, double> kTimes[] = {{"s", 1},
                                                              {"sec", 1},
                                                              {"second", 1},
                                                              {"seconds", 1},
                                                              {"ms", 1e-3},
                                                              {"msec", 1e-3},
                                                              {"milliseconds", 1e-3},
                                                              {"us", 1e-6},
                                                              {"microseconds", 1e-6},
                                                              {"ns", 1e-9},
                                                              {"nanoseconds", 1e-9}};
    constexpr std::pair<std::string_view, double> kLengths[] = {
        {"mm", 1},           {"millimeters", 1},  {"millimetres", 1}, {"cm", 10},
        {"centimeters", 10}, {"centimetres", 10}, {"m", 1000},        {"meters", 1000},
        {"metres", 1000},    {"in", 0},           {"inch", 0},        {"inches", 0},
        {"ft", 0},           {"dm", 0},           {"um", 0}};
    std::vector<std::string_view> cells;
    split(line, layout.between, cells);
    for (const std::string_view cell : cells) {
        double number = 0;
        if (parse_number(cell, number)) return false;
    }
    const auto unit_in = [&](int column, const auto& units) -> std::optional<double> {
        if (column < 0 || column >= static_cast<int>(cells.size())) return {};
        std::string word = lower_case(cells[static_cast<std::size_t>(column)]);
        std::erase_if(word, [](char c) { return std::string_view("[]() ").find(c) < 5; });
        for (const auto& [name, value] : units)
            if (word == name) return value;
        return {};
    };
    bool any = false;
    for (Columns& tool : layout.tools) {
        const auto time = unit_in(tool.time, kTimes), place = unit_in(tool.place[0], kLengths);
        any = any || time || place;
        if (time) layout.time_unit_s = *time;
        if (time) layout.time_unit_named = true;
        if (place && *place > 0) {
            tool.place_unit_mm = *place;
            continue;
        }
        const auto column = static_cast<std::size_t>(tool.place[0]);
        if (any && column < cells.size() && !is_none(cells[column]))
            return Error{"places are in '" + std::string(cells[column].substr(0, 40)) + "'", at,
                         "expected mm, cm or m"};
    }
    return any;
}

// An error for times that step like milliseconds and do not say what they are.
Status check_unit(const std::vector<Pose>& poses, const std::string& where) {
    std::vector<double> steps;
    for (std::size_t i = 1; i < std::min<std::size_t>(poses.size(), 1000); ++i) {
        const double step = poses[i].timestamp_s - poses[i - 1].timestamp_s;
        if (std::isfinite(step)) steps.push_back(step);
    }
    if (steps.size() < 10) return Done{};
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    if (!(*middle > 3)) return Done{};
    // No tracker is slower than 2 Hz or faster than 2 kHz.
    const auto [unit, name] = *middle >= 5e5   ? std::pair{"nanoseconds", "time_ns"}
                              : *middle >= 500 ? std::pair{"microseconds", "time_us"}
                                               : std::pair{"milliseconds", "time_ms"};
    return Error{"times rise by " + number_text(*middle, 4) + " from row to row", where,
                 std::string("are they ") + unit + "? Name their column " + name +
                     "; or timestamp_s for seconds"};
}

// Takes the next line off `text`.
std::string_view next_line(std::string_view& text) {
    std::size_t end = text.find('\n');
    // Line ends of old spreadsheets.
    if (end == std::string_view::npos) end = text.find('\r');
    const std::string_view line = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    return line;
}

std::string_view after(std::string_view line, std::string_view key, char between) {
    const std::size_t at = line.find(key);
    if (at == std::string_view::npos) return {};
    line.remove_prefix(at + key.size());
    if (line.empty() || line.front() != between) return {};
    line.remove_prefix(1);
    return trimmed(line.substr(0, line.find(between)));
}

// OptiTrack Motive's export: lines "Format Version", Type, Name, ID, which quantity, and
// "Frame,Time (Seconds),X,Y,Z,W,X,Y,Z,..."; quaternions are x, y, z, w. Older formats do not label
// their lines: the one below the types holds the names.
Result<Layout> motive_layout(std::string_view& text, int& number, const std::string& where) {
    std::string_view line = next_line(text);
    const std::string at = where + ":" + std::to_string(++number);
    const char between = separator_of(line);
    const std::string_view unit = after(line, "Length Units", between);
    const std::string_view turn = after(line, "Rotation Type", between);
    if (!turn.empty() && turn != "Quaternion")
        return Error{"rotations are of type " + std::string(turn.substr(0, 40)), at,
                     "export again with rotation type Quaternion"};
    Layout layout;
    layout.between = between;
    layout.time_unit_named = true;
    const double unit_mm = unit == "Meters"        ? 1000
                           : unit == "Centimeters" ? 10
                           : unit == "Millimeters" ? 1
                                                   : 0;
    if (unit_mm == 0)
        return Error{"does not say its unit of length", at,
                     "export again with Length Units Meters or Millimeters"};
    std::vector<std::string_view> types, names, quantities, cells;
    while (!text.empty()) {
        line = next_line(text);
        ++number;
        if (line.empty()) continue;
        split(line, between, cells);
        const auto holds = [&](std::string_view word) {
            return std::find(cells.begin(), cells.end(), word) != cells.end();
        };
        if (cells.front() == "Frame") break;
        if (holds("Name") || (!types.empty() && names.empty())) names = cells;
        if (types.empty() && (holds("Type") || holds("Rigid Body"))) types = cells;
        if (holds("Rotation") || holds("Position")) quantities = cells;
        if (number > 50) return Error{"has no line that begins with Frame", at, "export it again"};
    }
    layout.cells = cells.size();
    for (std::size_t i = 2; i < cells.size() && i < names.size() && i < quantities.size(); ++i) {
        const bool body = types.size() <= i || types[i] == "Rigid Body";
        if (!body || (quantities[i] != "Rotation" && quantities[i] != "Position")) continue;
        const std::string name(names[i]);
        auto tool = std::find_if(layout.tools.begin(), layout.tools.end(),
                                 [&](const Columns& c) { return c.tool == name; });
        if (tool == layout.tools.end()) {
            if (layout.tools.size() >= kMaxTools) break;
            Columns made;
            made.tool = name;
            made.frame = 0;
            made.time = 1;
            made.quaternion = true;
            made.place_unit_mm = unit_mm;
            tool = layout.tools.insert(layout.tools.end(), made);
        }
        const std::size_t axis = cells[i] == "X"   ? 0
                                 : cells[i] == "Y" ? 1
                                 : cells[i] == "Z" ? 2
                                                   : 3;
        const int column = static_cast<int>(i);
        if (quantities[i] == "Position" && axis < 3 && tool->place[axis] < 0)
            tool->place[axis] = column;
        if (quantities[i] == "Rotation" && tool->turn[(axis + 1) % 4] < 0)
            tool->turn[(axis + 1) % 4] = column;
    }
    std::erase_if(layout.tools, [](const Columns& c) {
        return std::min({c.place[0], c.place[1], c.place[2], c.turn[0], c.turn[1], c.turn[2],
                         c.turn[3]}) < 0;
    });
    if (layout.tools.empty())
        return Error{"holds no rigid body with rotation and position", at,
                     "export rigid bodies, with rotation type Quaternion"};
    return layout;
}

}  // namespace

Result<std::vector<ToolReadings>> parse_pose_table(std::string_view text,
                                                   const std::string& where) {
    std::optional<Layout> layout;
    int number = 0;
    if (text.substr(0, 2) == "\xFF\xFE" || text.substr(0, 2) == "\xFE\xFF")
        return Error{"is text in UTF-16", where, "save it as UTF-8 (CSV)"};
    if (text.substr(0, 3) == "\xEF\xBB\xBF")
        text.remove_prefix(3);  // a byte order mark, as spreadsheets write
    if (text.starts_with("Format Version")) {
        SONOCASE_TRY(Layout made, motive_layout(text, number, where));
        layout.emplace(std::move(made));
    }
    while (!layout && !text.empty()) {
        std::string_view line = next_line(text);
        ++number;
        if (line.empty() || lower_case(line.substr(0, 4)) == "sep=") continue;
        const std::string at = where + ":" + std::to_string(number);
        const bool remark = line.front() == '#' || line.front() == '%';
        if (remark) line = trimmed(line.substr(1));
        LayoutReader reader(line, at);
        if (remark && !reader.names_columns() && !LayoutReader(line, at).read()) continue;
        std::vector<std::string_view> cells;
        split(line, separator_of(line), cells);
        double first = 0;
        if (parse_number(cells.front(), first))
            return Error{"has no line that names its columns", at,
                         "the first line names the columns "
                         "frame,timestamp_s,status,tx,ty,tz,r00,...,r22"};
        SONOCASE_TRY(Layout made, reader.read());
        layout.emplace(std::move(made));
    }
    if (!layout) return Error{"is empty", where, "expected poses as CSV"};
    std::string_view below = text;
    SONOCASE_TRY(const bool units,
                 take_units(next_line(below), where + ":" + std::to_string(number + 1), *layout));
    if (units) text = below, ++number;
    RowReader reader(*layout, where);
    std::vector<ToolReadings> tools;
    for (const Columns& columns : layout->tools) {
        // Two poses of one tool at one time: which is it?
        for (const ToolReadings& other : tools)
            if (other.name == columns.tool)
                return Error{
                    "has the columns of '" + columns.tool.substr(0, 40) + "' twice", where,
                    "name the columns of each tool after it, as in probe_tx and needle_tx"};
        tools.push_back({columns.tool, {}});
    }
    std::map<std::string, std::size_t, std::less<>> by_name;
    std::int64_t row = 0;
    while (!text.empty()) {
        const std::string_view line = next_line(text);
        ++number;
        if (line.empty() || line.front() == '#') continue;
        SONOCASE_TRY_DONE(reader.take(line, number));
        for (std::size_t k = 0; k < layout->tools.size(); ++k) {
            Pose pose;
            SONOCASE_TRY_DONE(reader.read(layout->tools[k], row, pose));
            std::size_t to = k;
            if (layout->tool_column >= 0 && layout->tools.size() == 1) {
                auto found = by_name.find(reader.tool());
                if (found == by_name.end()) {
                    if (by_name.size() >= kMaxTools)
                        return Error{"has more than 64 tools", where + ":" + std::to_string(number),
                                     "the column of the tool's name must say one of a few names"};
                    const std::size_t at = by_name.size();
                    if (at > 0) tools.emplace_back();
                    tools[at].name = reader.tool();
                    found = by_name.emplace(tools[at].name, at).first;
                }
                to = found->second;
            }
            tools[to].poses.push_back(pose);
        }
        ++row;
    }
    if (!reader.unknown_state.empty()) {
        const bool any = std::any_of(tools.begin(), tools.end(), [](const ToolReadings& tool) {
            return std::any_of(tool.poses.begin(), tool.poses.end(),
                               [](const Pose& pose) { return pose.ok; });
        });
        if (!any)
            return Error{"no row has a status that counts; one is '" +
                             reader.unknown_state.substr(0, 40) + "'",
                         where, "OK, VALID, TRUE or 1 says that a pose counts"};
    }
    if (!layout->time_unit_named) {
        for (const ToolReadings& tool : tools) {
            if (layout->tools.front().time >= 0) SONOCASE_TRY_DONE(check_unit(tool.poses, where));
        }
    }
    return tools;
}

}  // namespace sonocase
