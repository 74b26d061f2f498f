// SPDX-License-Identifier: Apache-2.0

#include "pipeline/base/text.h"

#include <cctype>
#include <charconv>

namespace sonocase::pipeline::inline base {

std::vector<std::string> split_line(std::string_view line, char separator) {
    std::vector<std::string> cells;
    std::string cell;
    bool quoted = false;
    const auto flush = [&] {
        cells.emplace_back(trimmed(cell));
        cell.clear();
    };
    for (std::size_t i = 0; i < line.size(); ++i) {
        const char c = line[i];
        if (c == '"') {
            if (quoted && i + 1 < line.size() && line[i + 1] == '"')
                cell += line[++i];
            else
                quoted = !quoted;
        } else if (!quoted && separator == ' ' && (c == ' ' || c == '\t')) {
            if (!trimmed(cell).empty()) flush();
        } else if (!quoted && separator != ' ' && c == separator) {
            flush();
        } else {
            cell += c;
        }
    }
    if (separator != ' ' || !trimmed(cell).empty()) flush();
    return cells;
}

char separator_of(std::string_view line) {
    if (line.find(';') != std::string_view::npos) return ';';
    if (line.find('\t') != std::string_view::npos) {
        // Columns of numbers may be separated by blanks in some places and tabs in others.
        bool blanks_within = false;
        for (const std::string& cell : split_line(line, '\t'))
            blanks_within = blanks_within || cell.find(' ') != std::string::npos;
        if (!blanks_within) return '\t';
    }
    return line.find(',') != std::string_view::npos ? ',' : ' ';
}

namespace {

// Bytes of the UTF-8 character at the start of `text`; 0 where there is none.
std::size_t utf8_character(std::string_view text) {
    const auto byte = [&](std::size_t n) { return static_cast<unsigned char>(text[n]); };
    const unsigned first = byte(0);
    const std::size_t size = first < 0x80                    ? 1
                             : first >= 0xC2 && first < 0xE0 ? 2
                             : first >= 0xE0 && first < 0xF0 ? 3
                             : first >= 0xF0 && first < 0xF5 ? 4
                                                             : 0;
    if (size == 0 || size > text.size()) return 0;
    for (std::size_t n = 1; n < size; ++n)
        if (byte(n) < 0x80 || byte(n) > 0xBF) return 0;
    if (size < 3) return size;
    const unsigned second = byte(1);
    const bool overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
    const bool beyond = (first == 0xED && second > 0x9F) || (first == 0xF4 && second > 0x8F);
    return overlong || beyond ? 0 : size;
}

}  // namespace

Status expect_utf8(std::string_view text, const std::string& where) {
    if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF") ||
        text.substr(0, 4).find('\0') != std::string_view::npos)
        return Error{"the text is UTF-16 and not UTF-8", where + ":1",
                     "save it as UTF-8 (in a spreadsheet: CSV UTF-8)"};
    int line = 1;
    while (!text.empty()) {
        const std::size_t size = utf8_character(text);
        if (size == 0)
            return Error{"the text is not UTF-8", where + ":" + std::to_string(line),
                         "save it as UTF-8 (in a spreadsheet: CSV UTF-8)"};
        line += text.front() == '\n';
        text.remove_prefix(size);
    }
    return Done{};
}

std::vector<TextRow> split_rows(std::string_view text) {
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    std::vector<TextRow> rows;
    char separator = 0;
    int number = 0;
    while (!text.empty()) {
        const std::size_t end = text.find_first_of("\n\r");
        std::string_view line = text.substr(0, end);
        ++number;
        if (end == std::string_view::npos) {
            text = {};
        } else {
            const bool pair = text[end] == '\r' && end + 1 < text.size() && text[end + 1] == '\n';
            text.remove_prefix(end + (pair ? 2 : 1));
        }
        line = trimmed(line);
        if (line.empty() || line.front() == '#' || line.starts_with("//")) continue;
        if (separator == 0) {
            separator = separator_of(line);
        }
        TextRow row{number, split_line(line, separator)};
        if (separator == ';' || separator == '\t') {
            for (std::string& cell : row.cells) {
                const std::size_t comma = cell.find(',');
                if (comma == std::string::npos || cell.find(',', comma + 1) != std::string::npos)
                    continue;
                std::string dotted = cell;
                dotted[comma] = '.';
                if (number_in(dotted)) cell = dotted;
            }
        }
        rows.push_back(std::move(row));
    }
    return rows;
}

std::optional<double> number_in(std::string_view cell) {
    if (cell.starts_with('+')) cell.remove_prefix(1);
    double value = 0;
    const auto [end, code] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
    if (code != std::errc() || end != cell.data() + cell.size()) return std::nullopt;
    return value;
}

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())))
        text.remove_prefix(1);
    while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())))
        text.remove_suffix(1);
    return text;
}

}  // namespace sonocase::pipeline::inline base
