// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/poses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "formats/text/number_text.h"

namespace sonocase {
namespace {

constexpr std::array<const char*, 15> kColumns{"frame", "timestamp_s", "status", "tx",  "ty",
                                               "tz",    "r00",         "r01",    "r02", "r10",
                                               "r11",   "r12",         "r20",    "r21", "r22"};
constexpr std::array<const char*, 3> kPlaces{"tx", "ty", "tz"};
constexpr std::array<const char*, 4> kQuaternion{"qw", "qx", "qy", "qz"};

// The same columns by other names, as other programs write them.
constexpr std::pair<const char*, const char*> kOtherNames[] = {{"timestamp", "timestamp_s"},
                                                               {"time", "timestamp_s"},
                                                               {"time_s", "timestamp_s"},
                                                               {"t", "timestamp_s"},
                                                               {"t_s", "timestamp_s"},
                                                               {"state", "status"},
                                                               {"frame_number", "frame"},
                                                               {"framenumber", "frame"},
                                                               {"x", "tx"},
                                                               {"y", "ty"},
                                                               {"z", "tz"},
                                                               {"q0", "qw"}};

void split(std::string_view line, char between, std::vector<std::string_view>& out) {
    out.clear();
    while (true) {
        const std::size_t end = line.find(between);
        std::string_view cell = trimmed(line.substr(0, end));
        if (cell.size() > 1 && cell.front() == '"' && cell.back() == '"')
            cell = trimmed(cell.substr(1, cell.size() - 2));
        out.push_back(cell);
        if (end == std::string_view::npos) return;
        line.remove_prefix(end + 1);
    }
}

// How a table is laid out, from its first line.
class Layout {
  public:
    static Result<Layout> of(std::string_view line, const std::string& at) {
        Layout layout;
        layout.between_ = line.find(';') != std::string_view::npos    ? ';'
                          : line.find('\t') != std::string_view::npos ? '\t'
                                                                      : ',';
        std::vector<std::string_view> cells;
        split(line, layout.between_, cells);
        double number = 0;
        if (parse_number(cells.front(), number))
            return Error{"has no line that names its columns", at,
                         "the first line names the columns "
                         "frame,timestamp_s,status,tx,ty,tz,r00,...,r22"};
        for (std::size_t i = 0; i < cells.size(); ++i) layout.name_column(cells[i], i);
        std::string missing;
        const auto need = [&](const auto& names) {
            for (const char* name : names) {
                if (missing.empty() && layout.at(name) < 0) missing = name;
            }
        };
        need(kPlaces);
        if (layout.has_quaternion())
            return missing.empty() ? Result<Layout>(layout) : layout.without(missing, at, line);
        if (layout.at("q1") >= 0 && layout.at("q2") >= 0 && layout.at("q3") >= 0)
            return Error{"columns q0, q1, q2, q3 do not say which of them is the scalar", at,
                         "name them qw, qx, qy, qz"};
        need(std::span(kColumns).subspan(6));
        if (!missing.empty()) return layout.without(missing, at, line);
        return layout;
    }

    char between() const { return between_; }
    bool has_quaternion() const {
        return std::all_of(kQuaternion.begin(), kQuaternion.end(),
                           [&](const char* name) { return at(name) >= 0; });
    }
    int at(std::string_view name) const {
        const auto found = columns_.find(name);
        return found == columns_.end() ? -1 : found->second;
    }
    double time_unit_s() const { return time_unit_s_; }
    bool time_unit_named() const { return time_unit_named_; }
    double place_unit_mm() const { return place_unit_mm_; }

  private:
    void name_column(std::string_view cell, std::size_t i) {
        std::string name;
        for (const char c : cell) {
            const bool between = c == ' ' || c == '[' || c == '(' || c == '-';
            if (between && !name.empty() && name.back() != '_') name += '_';
            if (c != ']' && c != ')' && !between)
                name += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
        }
        const auto cut = [&](const char* end) {
            const bool has = name.ends_with(end) && name.size() > std::string_view(end).size();
            if (has) name.resize(name.size() - std::string_view(end).size());
            return has;
        };
        const auto other = [&] {
            for (const auto& [given, meant] : kOtherNames) {
                if (name == given) name = meant;
            }
        };
        const bool ms = cut("_ms"), mm = !ms && cut("_mm"), cm = !mm && cut("_cm"),
                   m = !cm && name.size() <= 4 && cut("_m");
        other();
        if (name == "timestamp_s" && at(name) < 0) {
            time_unit_named_ = ms || cell.ends_with("s]") || cell.ends_with("_s");
            if (ms) time_unit_s_ = 1e-3;
        }
        if (name == "tx") place_unit_mm_ = cm ? 10 : m ? 1000 : 1;
        columns_.emplace(name, static_cast<int>(i));  // the first of two of one name
    }
    Error without(const std::string& missing, const std::string& at, std::string_view line) const {
        std::string found(line.substr(0, 80));
        if (line.size() > 80) found += "...";
        return Error{"column '" + missing + "' is missing", at,
                     "found " + found +
                         "; expected frame,timestamp_s,status,tx,ty,tz and r00,...,r22 or "
                         "qw,qx,qy,qz"};
    }

    char between_ = ',';
    std::map<std::string, int, std::less<>> columns_;
    double time_unit_s_ = 1, place_unit_mm_ = 1;
    bool time_unit_named_ = false;
};

// Reads one row; its cells and their texts are kept between rows.
class RowReader {
  public:
    RowReader(const Layout& layout, std::string where) : layout_(layout), where_(std::move(where)) {
        frame_ = layout.at("frame");
        time_ = layout.at("timestamp_s");
        status_ = layout.at("status");
        for (const char* name : kPlaces) numbers_.push_back({layout.at(name), name});
        quaternion_ = layout.has_quaternion();
        if (quaternion_) {
            for (const char* name : kQuaternion) numbers_.push_back({layout.at(name), name});
        } else {
            for (const char* name : std::span(kColumns).subspan(6))
                numbers_.push_back({layout.at(name), name});
        }
        last_ = std::max({frame_, time_, status_});
        for (const auto& [column, name] : numbers_) last_ = std::max(last_, column);
    }

    Status read(std::string_view line, int number, std::int64_t row, Pose& pose) {
        number_ = number;
        split(line, layout_.between(), cells_);
        if (last_ >= static_cast<int>(cells_.size()))
            return Error{"holds " + std::to_string(cells_.size()) + " cells", here(),
                         "expected one per column"};
        pose.frame = row;
        if (frame_ >= 0 && !parse_number(cells_[static_cast<std::size_t>(frame_)], pose.frame))
            return not_a_number(frame_, "frame");
        if (time_ >= 0) {
            if (!number_at(time_, pose.timestamp_s)) return not_a_number(time_, "timestamp_s");
            pose.timestamp_s *= layout_.time_unit_s();
        }
        pose.ok = status_ < 0 || is_ok(cells_[static_cast<std::size_t>(status_)]);
        std::array<double, 12> values{};
        for (std::size_t i = 0; i < numbers_.size(); ++i) {
            if (number_at(numbers_[i].first, values[i])) continue;
            // A row without a pose may have no numbers for it.
            if (pose.ok || !cells_[static_cast<std::size_t>(numbers_[i].first)].empty())
                return not_a_number(numbers_[i].first, numbers_[i].second);
        }
        const double unit = layout_.place_unit_mm();
        Rigid& to = pose.tracker_from_tool;
        to.translation = {values[0], values[1], values[2]};
        if (unit != 1) to.translation = unit * to.translation;
        if (!quaternion_) {
            for (std::size_t i = 0; i < 9; ++i) to.rotation.m[i] = values[3 + i];
        } else if (pose.ok || values[3] != 0) {
            const double length = std::sqrt(values[3] * values[3] + values[4] * values[4] +
                                            values[5] * values[5] + values[6] * values[6]);
            // Four printed decimals are off by less; other lengths are no rotation.
            if (pose.ok && std::isfinite(length) && !(std::abs(length - 1) < 1e-3))
                return Error{"the quaternion has length " + number_text(length, 4), here(),
                             "expected 1: name the scalar qw and the others qx, qy, qz"};
            to.rotation = rotation_from_quaternion(
                {values[3] / length, values[4] / length, values[5] / length, values[6] / length});
        }
        return Done{};
    }

  private:
    static bool is_ok(std::string_view cell) {
        return cell == "OK" || cell == "ok" || cell == "Ok" || cell == "VALID" || cell == "valid";
    }
    std::string here() const { return where_ + ":" + std::to_string(number_); }
    Error not_a_number(int column, const char* name) const {
        const std::string_view cell = cells_[static_cast<std::size_t>(column)];
        return {"'" + std::string(cell.substr(0, 40)) + "' is not a number", here(),
                "column '" + std::string(name) + "' must hold numbers"};
    }
    bool number_at(int column, double& value) {
        const std::string_view cell = cells_[static_cast<std::size_t>(column)];
        const std::size_t comma = cell.find(',');
        if (layout_.between() == ',' || comma == std::string_view::npos)
            return parse_number(cell, value);
        if (cell.find('.') != std::string_view::npos) return false;  // which of them is it?
        text_ = cell;
        text_[comma] = '.';
        return parse_number(text_, value);
    }

    const Layout& layout_;
    std::string where_, text_;
    std::vector<std::string_view> cells_;
    std::vector<std::pair<int, const char*>> numbers_;
    int frame_ = -1, time_ = -1, status_ = -1, last_ = -1, number_ = 0;
    bool quaternion_ = false;
};

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
    return Error{"times rise by " + number_text(*middle, 4) + " from row to row", where,
                 "are they milliseconds? Name their column time_ms; or timestamp_s for seconds"};
}

}  // namespace

Result<std::vector<Pose>> parse_poses(std::string_view csv, const std::string& where) {
    std::vector<Pose> poses;
    std::optional<Layout> layout;
    std::optional<RowReader> reader;
    int number = 0;
    if (csv.substr(0, 2) == "\xFF\xFE" || csv.substr(0, 2) == "\xFE\xFF")
        return Error{"is text in UTF-16", where, "save it as UTF-8 (CSV)"};
    if (csv.substr(0, 3) == "\xEF\xBB\xBF")
        csv.remove_prefix(3);  // a byte order mark, as spreadsheets write
    while (!csv.empty()) {
        const std::size_t end = csv.find('\n');
        const std::string_view line = trimmed(csv.substr(0, end));
        csv.remove_prefix(end == std::string_view::npos ? csv.size() : end + 1);
        ++number;
        if (line.empty() || line.front() == '#') continue;
        if (!layout) {
            SONOCASE_TRY(Layout made, Layout::of(line, where + ":" + std::to_string(number)));
            layout.emplace(std::move(made));
            reader.emplace(*layout, where);
            continue;
        }
        Pose pose;
        SONOCASE_TRY_DONE(
            reader->read(line, number, static_cast<std::int64_t>(poses.size()), pose));
        poses.push_back(pose);
    }
    if (!layout) return Error{"is empty", where, "expected poses as CSV"};
    if (layout->at("timestamp_s") >= 0 && !layout->time_unit_named())
        SONOCASE_TRY_DONE(check_unit(poses, where));
    return poses;
}

bool has_times(std::span<const Pose> poses) {
    if (poses.size() < 2) return true;
    return std::any_of(poses.begin(), poses.end(), [&](const Pose& pose) {
        return pose.timestamp_s != poses.front().timestamp_s;
    });
}

std::vector<Pose> poses_of(const Sequence& sequence, int transform) {
    std::vector<Pose> out;
    for (const SequenceFrame& frame : sequence.frames) {
        const SequencePose& given = frame.poses[static_cast<std::size_t>(transform)];
        if (given.absent) continue;
        Pose pose;
        pose.frame = frame.number;
        pose.timestamp_s = frame.timestamp_s;
        // A last row of other numbers is a transposed matrix: its place would be lost.
        const auto& m = given.to_from;
        pose.ok = given.ok && m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1;
        for (std::size_t r = 0; r < 3; ++r) {
            for (std::size_t c = 0; c < 3; ++c)
                pose.tracker_from_tool.rotation.m[3 * r + c] = given.to_from[4 * r + c];
            pose.tracker_from_tool.translation[static_cast<int>(r)] = given.to_from[4 * r + 3];
        }
        out.push_back(pose);
    }
    return out;
}

Sequence sequence_of(const std::vector<std::pair<std::string, std::vector<Pose>>>& tools) {
    Sequence sequence;
    for (std::size_t tool = 0; tool < tools.size(); ++tool) {
        sequence.transforms.push_back(tools[tool].first);
        for (const Pose& pose : tools[tool].second) {
            SequenceFrame frame;
            frame.number = pose.frame;
            frame.timestamp_s = frame.unfiltered_timestamp_s = pose.timestamp_s;
            frame.poses.resize(tools.size(), {.absent = true});
            frame.poses[tool] = {pose.ok, matrix_from_rigid(pose.tracker_from_tool)};
            sequence.frames.push_back(std::move(frame));
        }
    }
    if (tools.size() > 1) join_frames(sequence);
    return sequence;
}

std::string format_poses(const std::vector<Pose>& poses) {
    std::string out;
    for (std::size_t c = 0; c < kColumns.size(); ++c)
        out += (c ? "," : "") + std::string(kColumns[c]);
    out += '\n';
    for (const Pose& pose : poses) {
        out += std::to_string(pose.frame) + ',';
        append_number(out, pose.timestamp_s);
        out += pose.ok ? ",OK" : ",INVALID";
        for (int a = 0; a < 3; ++a) {
            out += ',';
            append_number(out, pose.tracker_from_tool.translation[a]);
        }
        for (const double r : pose.tracker_from_tool.rotation.m) {
            out += ',';
            append_number(out, r);
        }
        out += '\n';
    }
    return out;
}

}  // namespace sonocase
