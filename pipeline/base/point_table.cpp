// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/point_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "formats/files/atomic_file.h"
#include "formats/text/json_reader.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline base {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kFewRows = 8;  // fewer may rise by chance

struct Line {
    int number = 0;
    bool comment = false;
    std::string_view text;  // trimmed, without the marks of a comment
};

std::vector<Line> lines_of(std::string_view text) {
    std::vector<Line> lines;
    lines.reserve(text.size() / 24);
    for (int number = 1; !text.empty(); ++number) {
        const std::size_t end = text.find_first_of("\n\r");
        std::string_view line = text.substr(0, end);
        if (end == std::string_view::npos) {
            text = {};
        } else {
            const bool pair = text[end] == '\r' && end + 1 < text.size() && text[end + 1] == '\n';
            text.remove_prefix(end + (pair ? 2 : 1));
        }
        // A tab at either end of a line is an empty cell.
        while (!line.empty() && (line.front() == ' ' || line.front() == '\f'))
            line.remove_prefix(1);
        while (!line.empty() && line.back() == ' ') line.remove_suffix(1);
        if (trimmed(line).empty()) continue;
        // "[1, 2, 3]," and "(1, 2, 3)" as programs print them.
        if (line.front() == '[' || line.front() == '(') {
            const std::size_t close = line.find_last_not_of(",; ");
            const char last = line[close];
            if ((last == ']' || last == ')') && line.find_first_of("[(", 1) == line.npos)
                line = trimmed(line.substr(1, close - 1));
            if (line.empty()) continue;
        }
        const bool comment = line.front() == '#' || line.front() == '%' || line.starts_with("//");
        if (comment)
            line = trimmed(line.substr(std::min(line.find_first_not_of("#%/"), line.size())));
        lines.push_back({number, comment, line});
    }
    return lines;
}

// The cells of a line, in memory that is used again from line to line.
class Cells {
  public:
    void split(std::string_view line, char separator) {
        views_.clear();
        if (line.find('"') != std::string_view::npos) {
            owned_ = split_line(line, separator);
            for (const std::string& cell : owned_) views_.push_back(cell);
        } else if (separator == ' ') {
            for (std::size_t at = 0; (at = line.find_first_not_of(" \t", at)) != line.npos;) {
                const std::size_t end = std::min(line.find_first_of(" \t", at), line.size());
                views_.push_back(line.substr(at, end - at));
                at = end;
            }
        } else {
            for (std::size_t at = 0;;) {
                const std::size_t end = line.find(separator, at);
                views_.push_back(trimmed(line.substr(at, end - at)));
                if (end == line.npos) break;
                at = end + 1;
            }
        }
        given_ = views_.size();
        while (!views_.empty() && views_.back().empty()) views_.pop_back();
        comma_is_point_ = separator != ',';
    }

    std::size_t size() const { return views_.size(); }  // without empty ones at the end
    std::size_t given() const { return given_; }        // with them
    std::string_view operator[](std::size_t n) const {
        return n < views_.size() ? views_[n] : std::string_view();
    }
    std::optional<double> number(std::size_t n) const {
        const std::string_view cell = (*this)[n];
        if (cell.empty()) return std::nullopt;
        if (const auto value = number_in(cell)) return value;
        const std::size_t comma = cell.find(',');
        if (!comma_is_point_ || comma == cell.npos || cell.find(',', comma + 1) != cell.npos)
            return std::nullopt;
        std::string dotted(cell);
        dotted[comma] = '.';
        return number_in(dotted);
    }
    std::size_t numbers() const {
        std::size_t count = 0;
        for (std::size_t n = 0; n < size(); ++n) count += number(n).has_value();
        return count;
    }

  private:
    std::vector<std::string_view> views_;
    std::vector<std::string> owned_;
    std::size_t given_ = 0;
    bool comma_is_point_ = false;
};

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
    return std::find(words.begin(), words.end(), word) != words.end();
}

// What a column is called: a kind of name, the axis, and the unit that stands in it.
struct ColumnName {
    enum Kind { none, plain, t, p, position, ras, lps, normal, status, flag, source, name };
    Kind kind = none;
    int axis = 0;
    double unit_mm = 0;
};

bool is_position_word(std::string_view word) {
    return is_one_of(word, {"position", "positions", "pos", "translation", "trans", "coord",
                            "coordinate", "coords", "location", "loc", "point", "points", "tip"});
}

ColumnName column_name(std::string_view cell) {
    const std::string text = lower_case(cell);
    std::vector<std::string> words;
    for (std::size_t at = 0; at < text.size();) {
        std::size_t end = at;
        while (end < text.size() && std::isalnum(static_cast<unsigned char>(text[end]))) ++end;
        if (end > at) words.push_back(text.substr(at, end - at));
        at = end + 1;
    }
    ColumnName name;
    if (words.size() > 1) {
        name.unit_mm = length_unit_mm(words.back());
        if (name.unit_mm > 0) words.pop_back();
    }
    if (words.empty()) return name;
    const auto axis_of = [](const std::string& word, std::string_view letters) {
        return word.size() == 1 ? static_cast<int>(letters.find(word[0])) : -1;
    };
    const std::string& last = words.back();
    if (words.size() == 1) {
        if (is_one_of(last, {"status", "state"})) return {ColumnName::status, 0, 0};
        if (is_one_of(last, {"valid", "isvalid", "visible", "tracked", "detected", "defined"}))
            return {ColumnName::flag, 0, 0};
        if (is_one_of(last, {"sensor", "station", "tool", "marker", "device", "probe"}))
            return {ColumnName::source, 0, 0};
        if (is_one_of(last, {"name", "label", "landmark"})) return {ColumnName::name, 0, 0};
        for (const auto& [letters, kind] :
             {std::pair<const char*, ColumnName::Kind>{"xyz", ColumnName::plain},
              {"ras", ColumnName::ras},
              {"lps", ColumnName::lps}}) {
            const int axis = axis_of(last, letters);
            // "s" is the third letter of both RAS and LPS: found as ras, and counted for both.
            if (axis >= 0) return {kind, axis, name.unit_mm};
        }
        if (last.size() < 2 || last.back() < 'x' || last.back() > 'z') {
            for (const char* word : {"pos", "position", "coord", "trans", "translation"})
                if (last.starts_with(word) && last.size() > std::string_view(word).size()) {
                    const std::string rest = last.substr(std::string_view(word).size());
                    if (const int axis = axis_of(rest, "xyz"); axis >= 0)
                        return {ColumnName::position, axis, name.unit_mm};
                }
            if (last.size() > 3 && last[0] >= 'x' && last[0] <= 'z' &&
                is_position_word(last.substr(1)))
                return {ColumnName::position, last[0] - 'x', name.unit_mm};
            return name;
        }
        name.axis = last.back() - 'x';
        const std::string before = last.substr(0, last.size() - 1);
        name.kind = before == "t"              ? ColumnName::t
                    : before == "p"            ? ColumnName::p
                    : before == "n"            ? ColumnName::normal
                    : is_position_word(before) ? ColumnName::position
                                               : ColumnName::none;
        return name;
    }
    const std::string& before = words[words.size() - 2];
    if (words.size() == 2 && before == "is" && is_one_of(last, {"valid", "visible", "tracked"}))
        return {ColumnName::flag, 0, 0};
    if (words.size() == 2 && is_one_of(before, {"sensor", "station", "tool", "marker", "device"}) &&
        is_one_of(last, {"id", "name", "number", "no", "nr", "index", "handle"}))
        return {ColumnName::source, 0, 0};
    if (const int axis = axis_of(last, "xyz"); axis >= 0) {
        name.axis = axis;
        name.kind = is_position_word(before)             ? ColumnName::position
                    : words.size() > 2                   ? ColumnName::none
                    : before == "t"                      ? ColumnName::t
                    : before == "p"                      ? ColumnName::p
                    : is_one_of(before, {"n", "normal"}) ? ColumnName::normal
                                                         : ColumnName::none;
        return name;
    }
    // ParaView: Points:0, Points:1, Points:2.
    if (const int axis = axis_of(last, "012"); axis >= 0 && before == "points")
        return {ColumnName::position, axis, name.unit_mm};
    const int first = axis_of(words[0], "xyz");
    if (first >= 0 && words.size() == 2 && is_position_word(last))
        return {ColumnName::position, first, name.unit_mm};
    return name;
}

struct Columns {
    bool named = false;
    std::array<std::size_t, 3> point{0, 1, 2};
    std::array<int, 3> normal{-1, -1, -1};
    int status = -1, flag = -1, source = -1, name = -1;
    std::size_t count = 0;   // of the line of names
    bool fiducials = false;  // of 3D Slicer: version 5 writes more cells than names
    double unit_mm = 0;
    Axes axes = Axes::unsaid;
    bool has_normals() const { return normal[0] >= 0 && normal[1] >= 0 && normal[2] >= 0; }
};

struct Heading {
    std::array<std::vector<std::size_t>, 3> of[ColumnName::name + 1];
    std::vector<ColumnName> columns;

    explicit Heading(const Cells& cells) {
        for (std::size_t c = 0; c < cells.size(); ++c) {
            columns.push_back(column_name(cells[c]));
            const ColumnName& name = columns.back();
            if (name.kind == ColumnName::none) continue;
            of[name.kind][static_cast<std::size_t>(name.axis)].push_back(c);
            if (name.kind == ColumnName::ras && name.axis == 2) of[ColumnName::lps][2].push_back(c);
        }
        // The table of markups that 3D Slicer saves: what is not visible there is hidden in a view.
        const auto has = [&](std::string_view word) {
            for (std::size_t c = 0; c < cells.size(); ++c)
                if (lower_case(cells[c]) == word) return true;
            return false;
        };
        if (has("defined") || has("selected") || has("locked"))
            std::erase_if(of[ColumnName::flag][0],
                          [&](std::size_t c) { return lower_case(cells[c]) == "visible"; });
    }
    bool complete(ColumnName::Kind kind) const {
        return !of[kind][0].empty() && !of[kind][1].empty() && !of[kind][2].empty();
    }
    std::vector<ColumnName::Kind> kinds() const {
        std::vector<ColumnName::Kind> out;
        for (const auto kind : {ColumnName::plain, ColumnName::t, ColumnName::p,
                                ColumnName::position, ColumnName::ras, ColumnName::lps})
            if (complete(kind)) out.push_back(kind);
        return out;
    }
};

std::string cell_list(const Cells& cells) {
    std::string out;
    for (std::size_t n = 0; n < std::min<std::size_t>(cells.size(), 8); ++n)
        out += (n > 0 ? " " : "") + std::string(cells[n].substr(0, 20));
    return out + (cells.size() > 8 ? " ..." : "");
}

// The columns that a line above calls Position, one for each axis; if there are several, those of
// the one thing that another line above calls a rigid body. False: they are not certain.
bool narrow_by_groups(const std::vector<Line>& lines,
                      std::size_t heading,
                      char separator,
                      std::array<std::vector<std::size_t>, 3>& columns) {
    const auto keep = [&](auto&& wanted) {
        Cells cells;
        for (std::size_t up = heading; up-- > 0 && heading - up <= 8;) {
            cells.split(lines[up].text, separator);
            std::array<std::vector<std::size_t>, 3> kept;
            for (std::size_t axis = 0; axis < 3; ++axis)
                for (const std::size_t c : columns[axis])
                    if (wanted(lower_case(cells[c]))) kept[axis].push_back(c);
            if (kept[0].empty() || kept[1].empty() || kept[2].empty()) continue;
            columns = kept;
            return;
        }
    };
    const auto certain = [&] {
        return columns[0].size() == 1 && columns[1].size() == 1 && columns[2].size() == 1;
    };
    keep([](const std::string& group) { return group == "position" || group == "translation"; });
    if (!certain()) keep([](const std::string& type) { return type == "rigid body"; });
    return certain();
}

// Empty: the line does not name the columns of a point.
Result<std::optional<Columns>> columns_named(const std::vector<Line>& lines,
                                             std::size_t at,
                                             char separator,
                                             const std::string& where) {
    const Line& line = lines[at];
    std::string_view text = line.text;
    bool fiducials = false;
    if (line.comment)
        if (const std::size_t key = text.find("columns"); key != text.npos)
            if (const std::size_t equals = text.find('=', key); equals != text.npos) {
                text = text.substr(equals + 1);
                fiducials = text.find("associatedNodeID") != text.npos;
            }
    Cells cells;
    cells.split(text, separator);
    std::vector<ColumnName::Kind> kinds = Heading(cells).kinds();
    if (kinds.empty()) {
        cells.split(text, separator_of(text));
        kinds = Heading(cells).kinds();
    }
    if (kinds.empty()) return std::optional<Columns>();
    const Heading heading(cells);
    const std::string place = where + ":" + std::to_string(line.number);
    if (kinds.size() > 1)
        return Error{"which columns are x, y and z? Several could be: " + cell_list(cells), place,
                     "call those of the position x, y and z and the others something else"};
    Columns columns;
    columns.named = true;
    columns.fiducials = fiducials;
    columns.count = cells.given();  // OptiTrack leaves the last name empty
    auto of = heading.of[kinds[0]];
    if ((of[0].size() > 1 || of[1].size() > 1 || of[2].size() > 1) &&
        !narrow_by_groups(lines, at, separator, of))
        return Error{"which columns are x, y and z? Two have the same name: " + cell_list(cells),
                     place,
                     "call those of the position x, y and z and the others something else, such as "
                     "qx, qy, qz"};
    for (std::size_t axis = 0; axis < 3; ++axis) {
        columns.point[axis] = of[axis][0];
        const auto& normal = heading.of[ColumnName::normal][axis];
        if (normal.size() == 1) columns.normal[axis] = static_cast<int>(normal[0]);
        const double unit = heading.columns[of[axis][0]].unit_mm;
        if (axis > 0 && unit != columns.unit_mm)
            return Error{"x, y and z have different units: " + cell_list(cells), place,
                         "give them one unit"};
        columns.unit_mm = unit;
    }
    const auto& status = heading.of[ColumnName::status][0];
    if (status.size() == 1) columns.status = static_cast<int>(status[0]);
    const auto& flag = heading.of[ColumnName::flag][0];
    if (flag.size() == 1) columns.flag = static_cast<int>(flag[0]);
    const auto& source = heading.of[ColumnName::source][0];
    if (source.size() == 1) columns.source = static_cast<int>(source[0]);
    const auto& name = heading.of[ColumnName::name][0];
    if (!name.empty()) columns.name = static_cast<int>(name[0]);
    if (kinds[0] == ColumnName::ras) columns.axes = Axes::ras;
    if (kinds[0] == ColumnName::lps) columns.axes = Axes::lps;
    return std::optional<Columns>(columns);
}

// Names for `count` columns whose first ones are `first`.
std::string reading(std::initializer_list<const char*> first, std::size_t count) {
    std::string out;
    std::size_t n = 0;
    for (const char* name : first) {
        if (n == count) break;
        out += (n++ > 0 ? "," : "") + std::string(name);
    }
    for (; n < count; ++n) out += ",c" + std::to_string(n + 1);
    return "'" + out + "'";
}

Error which_columns(std::size_t count, const std::string& why, const std::string& place) {
    constexpr std::size_t kMany = 40;  // of one row: a list of numbers, or poses as matrices
    if (count > kMany)
        return Error{"which columns are x, y and z? " + why, place,
                     "write one point in each row, with x,y,z above the first"};
    std::string readings = reading({"x", "y", "z"}, count);
    if (count == 4) {
        readings += " or " + reading({"n", "x", "y", "z"}, count) + " or " +
                    reading({"time", "x", "y", "z"}, count);
    } else if (count == 7) {
        readings = reading({"x", "y", "z", "qx", "qy", "qz", "qw"}, count) + " or " +
                   reading({"qw", "qx", "qy", "qz", "x", "y", "z"}, count) + " or " +
                   reading({"n", "x", "y", "z"}, count);
    } else if (count == 8) {
        readings = reading({"time", "x", "y", "z", "qx", "qy", "qz", "qw"}, count) + " or " +
                   reading({"n", "qw", "qx", "qy", "qz", "x", "y", "z"}, count) + " or " + readings;
    } else if (count > 4) {
        readings += " or " + reading({"n", "x", "y", "z"}, count) + " or " +
                    reading({"n", "time", "x", "y", "z"}, count);
    } else {
        readings += "; if one of the three lacks, export it as well";
    }
    return Error{"which columns are x, y and z? " + why, place,
                 "put the line of names that is true above the first row: " + readings};
}

bool is_hole(std::string_view cell) {
    const std::string word = lower_case(cell);
    return is_one_of(word, {"", "-", "--", "na", "n/a", "#n/a", "nan", "null", "none", "missing",
                            "no data", "nodata"});
}

bool is_digits(std::string_view cell) {
    return cell.find_first_not_of("+-0123456789") == cell.npos;
}

bool is_ok(std::string_view status) {
    return is_one_of(lower_case(status), {"ok", "valid", "tracked", "good", "visible", "enabled"});
}

// NDI writes -3.7e28 for what it does not see.
constexpr double kNowhere = 1e12;

constexpr std::size_t kSensors = 8;  // of one tracker; more are names of rows

// Everything about the lines before the first point.
struct Layout {
    Columns columns;
    char separator = ',';
    std::size_t first = 0;   // line of the first row
    std::size_t stated = 0;  // points that the file says it holds; 0: it does not say
    Axes axes = Axes::unsaid;
    double unit_mm = 0;
};

class Parser {
  public:
    Parser(std::string_view text, const std::string& where, const PointTableOptions& options)
        : lines_(lines_of(text)), where_(where), options_(options) {}

    Result<PointTable> parse() {
        SONOCASE_TRY_DONE(find_layout());
        PointTable table;
        table.axes = layout_.axes != Axes::unsaid ? layout_.axes : layout_.columns.axes;
        table.unit_mm = layout_.columns.unit_mm > 0 ? layout_.columns.unit_mm : layout_.unit_mm;
        SONOCASE_TRY_DONE(layout_.columns.named ? read_named(table) : read_nameless(table));
        if (layout_.stated > rows_)
            return Error{"the file says that it holds " + std::to_string(layout_.stated) +
                             " points and holds " + std::to_string(rows_),
                         where_, "it is cut off: export it again"};
        if (sources_.size() > 1 && sources_.size() <= kSensors && rows_ > 8 * sources_.size() &&
            !options_.names)
            return Error{
                "rows of several sensors in one table: " + sources_[0] + " and " + sources_[1],
                where_, "keep the rows of the one that touched the surface"};
        leave_out_zeros(table);
        if (table.points.empty() && table.left_out > 0)
            return Error{
                "no row has a position" +
                    (bad_status_.empty() ? std::string()
                                         : "; the status of the first is '" + bad_status_ + "'"),
                where_,
                "expected a status of OK, valid or tracked; take away the column if it is "
                "something else"};
        return table;
    }

  private:
    // Trackers write 0, 0, 0 for what they do not see; one such row may be a place.
    void leave_out_zeros(PointTable& table) const {
        if (at_zero_ < 2) return;
        std::size_t kept = 0;
        for (std::size_t n = 0; n < table.points.size(); ++n) {
            const bool zero = table.points[n] == Point3{0, 0, 0};
            if (zero && options_.keep_holes) table.points[n] = {kNan, kNan, kNan};
            if (zero && !options_.keep_holes) continue;
            table.points[kept] = table.points[n];
            if (!table.normals.empty()) table.normals[kept] = table.normals[n];
            if (!table.names.empty()) std::swap(table.names[kept], table.names[n]);
            ++kept;
        }
        table.left_out += table.points.size() - kept;
        table.points.resize(kept);
        if (!table.normals.empty()) table.normals.resize(kept);
        if (!table.names.empty()) table.names.resize(kept);
    }

    std::string place(const Line& line) const { return where_ + ":" + std::to_string(line.number); }

    // The separator under which a line has three numbers or more; 0: none.
    char numbers_under(std::string_view text) {
        char tried[3] = {stated_separator_ ? stated_separator_ : separator_of(text), ' ', 0};
        if (stated_separator_) tried[1] = 0;
        for (const char separator : tried) {
            if (separator == 0) break;
            cells_.split(text, separator);
            if (cells_.numbers() >= 3) return separator;
        }
        return 0;
    }

    Status read_preamble(const Line& line) {
        if (line.comment) {
            SONOCASE_TRY(const Axes axes, axes_said(line.text, place(line)));
            if (axes != Axes::unsaid) layout_.axes = axes;
            return Done{};
        }
        cells_.split(line.text, separator_of(line.text));
        for (std::size_t n = 0; n + 1 < cells_.size(); ++n)
            if (is_one_of(lower_case(cells_[n]), {"length units", "units", "unit"}) &&
                length_unit_mm(cells_[n + 1]) > 0)
                layout_.unit_mm = length_unit_mm(cells_[n + 1]);
        return Done{};
    }

    Status find_layout() {
        std::size_t begin = 0;
        if (!lines_.empty()) {
            std::string first = lower_case(lines_[0].text);
            std::erase(first, '"');
            if (first.starts_with("sep=") && first.size() <= 5) {
                stated_separator_ = first.size() == 5 ? first[4] : '\t';
                begin = 1;
            }
        }
        // A line of names may stand above lines that hold no three numbers, such as rows of units
        // and of readings that were missed; metadata above it may hold some.
        std::size_t data = begin;
        for (; data < lines_.size(); ++data)
            if (!lines_[data].comment && numbers_under(lines_[data].text) != 0 &&
                !is_metadata(data))
                break;
        layout_.separator = data < lines_.size() ? numbers_under(lines_[data].text)
                            : stated_separator_  ? stated_separator_
                                                 : ',';
        for (std::size_t n = begin; n < std::min(data, lines_.size()); ++n)
            SONOCASE_TRY_DONE(read_preamble(lines_[n]));
        for (std::size_t n = std::min(data, lines_.size()); n-- > begin;) {
            SONOCASE_TRY(auto named, columns_named(lines_, n, layout_.separator, where_));
            if (!named) continue;
            layout_.columns = *named;
            layout_.first = n + 1;
            read_count();
            read_units();
            return Done{};
        }
        return expect_nameless(begin, data);
    }

    // Numbers among words: a line of "key,value,key,value" above the names.
    bool is_metadata(std::size_t at) {
        if (cells_.numbers() == cells_.size()) return false;
        for (std::size_t n = at + 1; n < std::min(at + 12, lines_.size()); ++n) {
            Cells cells;
            cells.split(lines_[n].text,
                        stated_separator_ ? stated_separator_ : separator_of(lines_[n].text));
            if (cells.numbers() == 0 && !Heading(cells).kinds().empty()) return true;
        }
        return false;
    }

    // Points of a scanner (PTS) have their number above; the names may have been put above that.
    void read_count() {
        std::size_t n = layout_.first;
        while (n < lines_.size() && lines_[n].comment) ++n;
        if (n == lines_.size()) return;
        const auto count = number_in(lines_[n].text);
        if (!count || *count < 1 || *count > 1e12 || *count != std::floor(*count)) return;
        layout_.stated = static_cast<std::size_t>(*count);
        layout_.first = n + 1;
    }

    // A row of units below the names.
    void read_units() {
        std::size_t n = layout_.first;
        while (n < lines_.size() && lines_[n].comment) ++n;
        if (n == lines_.size()) return;
        cells_.split(lines_[n].text, layout_.separator);
        double unit[3];
        for (std::size_t axis = 0; axis < 3; ++axis) {
            std::string word(cells_[layout_.columns.point[axis]]);
            std::erase_if(word,
                          [](char c) { return c == '[' || c == ']' || c == '(' || c == ')'; });
            unit[axis] = length_unit_mm(word);
        }
        if (unit[0] <= 0 || unit[0] != unit[1] || unit[0] != unit[2]) return;
        layout_.columns.unit_mm = unit[0];
        layout_.first = n + 1;
    }

    Status expect_nameless(std::size_t begin, std::size_t data) {
        std::size_t first = begin;
        while (first < lines_.size() && lines_[first].comment) ++first;
        if (first < lines_.size()) {
            // XYZ files may begin with the number of points.
            const auto count = number_in(lines_[first].text);
            if (count && *count >= 1 && *count < 1e12 && *count == std::floor(*count) &&
                first + 1 < lines_.size()) {
                layout_.stated = static_cast<std::size_t>(*count);
                ++first;
            }
        }
        layout_.first = first;
        while (first < lines_.size() && lines_[first].comment) ++first;
        if (first >= lines_.size() || first == data) return Done{};
        cells_.split(lines_[first].text, separator_of(lines_[first].text));
        if (cells_.numbers() > 0)
            return Error{"row without three numbers", place(lines_[first]),
                         "expected x, y and z; correct or delete the row"};
        return Error{"no columns x, y, z", place(lines_[first]),
                     "expected a line of names with x,y,z (or tx,ty,tz), or three numbers per row; "
                     "call the columns of the position x, y and z"};
    }

    // False: a reading that was missed. Errors: a row that is none.
    Result<bool> read_point(const Line& line, Point3& point) {
        const Columns& columns = layout_.columns;
        if (columns.status >= 0 && !is_ok(cells_[static_cast<std::size_t>(columns.status)])) {
            if (bad_status_.empty())
                bad_status_ = cells_[static_cast<std::size_t>(columns.status)].substr(0, 40);
            return false;
        }
        if (columns.flag >= 0 &&
            is_one_of(lower_case(cells_[static_cast<std::size_t>(columns.flag)]),
                      {"0", "0.0", "false", "no", "n", "f"}))
            return false;
        int holes = 0;
        bool finite = true;
        for (std::size_t axis = 0; axis < 3; ++axis) {
            const std::string_view cell = cells_[columns.point[axis]];
            const auto value = cells_.number(columns.point[axis]);
            point[static_cast<int>(axis)] = value.value_or(kNan);
            finite = finite && value && std::isfinite(*value) && std::abs(*value) < kNowhere;
            holes += !value && is_hole(cell);
            if (!value && !is_hole(cell)) {
                for (std::size_t n = 0; n < cells_.size(); ++n)
                    if (lower_case(cells_[n]) == "missing") return false;
                return no_point(line);
            }
        }
        if (holes > 0 && holes < 3 && !options_.keep_holes) return no_point(line);
        return finite;
    }

    Error no_point(const Line& line) const {
        return Error{"row without three numbers", place(line),
                     "expected x, y and z; correct or delete the row"};
    }

    void keep(PointTable& table, bool ok, Point3 point) {
        ++rows_;
        if (ok && point == Point3{0, 0, 0}) ++at_zero_;
        const int source = layout_.columns.source;
        if (ok && source >= 0) {
            const std::string from(cells_[static_cast<std::size_t>(source)]);
            if (std::find(sources_.begin(), sources_.end(), from) == sources_.end() &&
                sources_.size() <= kSensors)
                sources_.push_back(from);
        }
        if (!ok && !options_.keep_holes) {
            ++table.left_out;
            return;
        }
        table.points.push_back(ok ? point : Point3{kNan, kNan, kNan});
        const Columns& columns = layout_.columns;
        if (columns.name >= 0)
            table.names.emplace_back(cells_[static_cast<std::size_t>(columns.name)]);
        if (!columns.has_normals()) return;
        Vector3 normal;
        for (std::size_t axis = 0; axis < 3; ++axis)
            normal[static_cast<int>(axis)] =
                cells_.number(static_cast<std::size_t>(columns.normal[axis])).value_or(0);
        table.normals.push_back(normalized(normal));
    }

    Status read_named(PointTable& table) {
        const Columns& columns = layout_.columns;
        for (std::size_t n = layout_.first; n < lines_.size(); ++n) {
            if (lines_[n].comment) continue;
            cells_.split(lines_[n].text, layout_.separator);
            const bool blanks_shift = layout_.separator == ' ' && cells_.size() != columns.count;
            if ((cells_.size() > columns.count && !columns.fiducials) || blanks_shift) {
                bool missing = false;
                for (std::size_t c = 0; c < cells_.size(); ++c)
                    missing = missing || lower_case(cells_[c]) == "missing";
                if (!missing || cells_.size() > columns.count)
                    return Error{"row of " + std::to_string(cells_.size()) + " cells under " +
                                     std::to_string(columns.count) + " names",
                                 place(lines_[n]),
                                 "name every column; numbers with a decimal comma need ';' or tabs "
                                 "between them"};
            }
            Point3 point;
            SONOCASE_TRY(const bool ok, read_point(lines_[n], point));
            keep(table, ok, point);
        }
        return Done{};
    }

    // The first column steps evenly from row to row, as numbers and times do.
    static bool counts_up(const std::vector<double>& column) {
        if (column.size() < kFewRows) return false;
        const double step =
            (column.back() - column.front()) / static_cast<double>(column.size() - 1);
        if (!(step > 0)) return false;
        for (std::size_t n = 1; n < column.size(); ++n)
            if (std::abs(column[n] - column[n - 1] - step) > 0.1 * step) return false;
        return true;
    }

    Status read_nameless(PointTable& table) {
        std::size_t count = 0;
        bool first_is_word = false;
        bool unit_normals = true, colours = true, whole = true, ascends = true;
        // A scanner's points (PTS): their number above x, y, z, intensity, or those and a colour.
        bool scanned = false;
        std::vector<double> first_column;
        const Line* first_line = nullptr;
        for (std::size_t n = layout_.first; n < lines_.size(); ++n) {
            const Line& line = lines_[n];
            if (line.comment) continue;
            cells_.split(line.text, layout_.separator);
            if (first_line == nullptr) {
                first_line = &line;
                count = cells_.size();
                first_is_word = !cells_.number(0);
                const bool named = count == 4 && (first_is_word || options_.names);
                scanned = layout_.stated >= kFewRows && !named && (count == 4 || count == 7);
                if (count < 3)
                    return Error{"row of " + std::to_string(count) + " cells", place(line),
                                 "expected x, y and z"};
                if (cells_.numbers() + first_is_word != count ||
                    (count != 3 && count != 6 && !named && !scanned) || (first_is_word && !named))
                    return which_columns(
                        count,
                        std::to_string(count) + " columns have no names: " + cell_list(cells_),
                        place(line));
                if (named) {
                    layout_.columns.point = {1, 2, 3};
                    layout_.columns.name = 0;
                }
                if (count == 6) layout_.columns.normal = {3, 4, 5};
            }
            if (cells_.size() > count || (cells_.size() < count && layout_.separator == ' '))
                return Error{"row of " + std::to_string(cells_.size()) + " cells after rows of " +
                                 std::to_string(count),
                             place(line), "give every row the same columns"};
            if (const auto value = cells_.number(0)) {
                ascends = ascends && (first_column.empty() || *value > first_column.back());
                first_column.push_back(*value);
            }
            for (std::size_t c = 0; c < 3 && whole; ++c) {
                const auto value = cells_.number(c);
                whole = !value || (*value == std::floor(*value) && is_digits(cells_[c]));
            }
            if (count >= 6) {
                double square = 0;
                for (std::size_t c = count - 3; c < count; ++c) {
                    const double v = cells_.number(c).value_or(kNan);
                    square += v * v;
                    colours = colours && v >= 0 && v <= 255 && v == std::floor(v);
                }
                unit_normals = unit_normals && std::abs(square - 1) < 0.02;
            }
            Point3 point;
            SONOCASE_TRY(const bool ok, read_point(line, point));
            keep(table, ok, point);
        }
        if (first_line == nullptr) return Done{};
        if (count == 6 && whole && layout_.separator == ',') {
            cells_.split(first_line->text, layout_.separator);
            return Error{
                "6 columns of whole numbers: is a decimal comma among them? " + cell_list(cells_),
                place(*first_line),
                "put ';' between numbers with a decimal comma, or above the first row the "
                "line of names that is true: 'x,y,z,c4,c5,c6'"};
        }
        if (count == 6 && !unit_normals) {
            layout_.columns.normal = {-1, -1, -1};
            table.normals.clear();
        }
        cells_.split(first_line->text, layout_.separator);
        // Names may be numbers, but whole ones.
        const bool numbered = layout_.columns.name == 0 && !first_is_word;
        if (numbered) {
            for (const double v : first_column)
                if (v != std::floor(v))
                    return which_columns(count, "4 columns have no names: " + cell_list(cells_),
                                         place(*first_line));
            return Done{};
        }
        // Numbers and times ascend.
        const bool other =
            scanned ? ascends || (count == 7 && !colours) : count == 6 && !unit_normals && !colours;
        if (other || (count != 4 && counts_up(first_column)))
            return which_columns(
                count,
                (counts_up(first_column) ? "The first column counts upwards: "
                                         : std::to_string(count) + " columns have no names: ") +
                    cell_list(cells_),
                place(*first_line));
        return Done{};
    }

    std::vector<Line> lines_;
    const std::string& where_;
    const PointTableOptions& options_;
    Cells cells_;
    Layout layout_;
    char stated_separator_ = 0;
    std::size_t rows_ = 0, at_zero_ = 0;
    std::vector<std::string> sources_;  // the first few
    std::string bad_status_;
};

}  // namespace

double length_unit_mm(std::string_view word) {
    const std::string unit = lower_case(word);
    if (is_one_of(unit, {"mm", "millimeter", "millimeters", "millimetre", "millimetres"})) return 1;
    if (is_one_of(unit, {"cm", "centimeter", "centimeters", "centimetre", "centimetres"}))
        return 10;
    if (is_one_of(unit, {"m", "meter", "meters", "metre", "metres"})) return 1000;
    if (is_one_of(unit, {"in", "inch", "inches"})) return 25.4;
    if (is_one_of(unit, {"um", "micrometer", "micrometers", "micrometre", "micrometres"}))
        return 0.001;
    return 0;
}

Result<PointTable> parse_point_table(std::string_view text,
                                     const std::string& where,
                                     const PointTableOptions& options) {
    SONOCASE_TRY_DONE(expect_utf8(text, where));
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    return Parser(text, where, options).parse();
}

Result<PointTable> parse_markups(std::string_view json, const std::string& where) {
    SONOCASE_TRY_DONE(expect_utf8(json, where));
    if (json.starts_with("\xEF\xBB\xBF")) json.remove_prefix(3);
    detail::Json root;
    detail::JsonFault fault{where, {}};
    if (!detail::parse_json(json, root, fault)) return *fault.error;
    PointTable table;
    detail::JsonObject file(root, "", fault);
    for (detail::JsonObject& markup : file.objects("markups")) {
        const std::string system = markup.text_or("coordinateSystem", "");
        SONOCASE_TRY(const Axes axes, axes_said("CoordinateSystem=" + system, where));
        double unit = 1;
        if (fault.error) return *fault.error;
        if (markup.has("coordinateUnits")) {
            // One unit, or one for each axis.
            const auto words = markup.texts_or_none("coordinateUnits");
            if (fault.error) {
                fault.error.reset();
                unit = length_unit_mm(markup.text("coordinateUnits"));
            } else {
                unit = words.empty() ? 0 : length_unit_mm(words[0]);
                for (const std::string& other : words)
                    if (length_unit_mm(other) != unit) unit = 0;
            }
            if (unit <= 0)
                return Error{"the unit of the coordinates is not known", where,
                             "expected coordinateUnits mm, cm or m"};
        }
        if (!table.points.empty() && (axes != table.axes || unit != table.unit_mm))
            return Error{"its markups have different axes or units", where,
                         "save them in files of their own"};
        table.axes = axes;
        table.unit_mm = unit;
        for (detail::JsonObject& point : markup.objects("controlPoints")) {
            if (point.text_or("positionStatus", "defined") != "defined" || !point.has("position")) {
                ++table.left_out;
                continue;
            }
            table.points.push_back(point.point("position"));
            table.names.push_back(point.text_or("label", ""));
        }
    }
    if (fault.error) return *fault.error;
    if (table.points.empty())
        return Error{"no control point is placed", where, "expected a markups file of 3D Slicer"};
    return table;
}

bool is_markups_file(std::string_view path) {
    return lower_case(path).ends_with(".mrk.json");
}

Result<PointTable> load_point_table(const std::string& path, const PointTableOptions& options) {
    SONOCASE_TRY(const std::string text, read_text_file(path));
    return is_markups_file(path) ? parse_markups(text, path)
                                 : parse_point_table(text, path, options);
}

void place_points(PointTable& table, double scale, Axes told) {
    const double mm = scale != 1 ? scale : table.unit_mm > 0 ? table.unit_mm : 1;
    const Axes axes = told != Axes::unsaid ? told : table.axes;
    for (Point3& p : table.points) p = to_ras(mm == 1 ? p : Point3{} + mm * (p - Point3{}), axes);
    for (Vector3& n : table.normals) n = to_ras(Point3{} + n, axes) - Point3{};
}

}  // namespace sonocase::pipeline::inline base
