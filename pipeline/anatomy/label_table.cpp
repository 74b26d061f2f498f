// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/label_table.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "formats/files/atomic_file.h"
#include "formats/text/json_reader.h"
#include "pipeline/anatomy/tissue_table.h"
#include "pipeline/base/source_checks.h"
#include "pipeline/base/text.h"

namespace sonocase::pipeline::inline anatomy {
namespace {

// A whole number from -2^31 to 2^31 - 1.
std::optional<int> whole_in(std::string_view cell) {
    const auto number = number_in(cell);
    if (!number || *number != std::floor(*number) || std::abs(*number) > 2147483647.0)
        return std::nullopt;
    return static_cast<int>(*number);
}

int column_named(const TextRow& header, std::initializer_list<const char*> names) {
    for (const char* name : names)
        for (std::size_t c = 0; c < header.cells.size(); ++c)
            if (lower_case(header.cells[c]) == name) return static_cast<int>(c);
    return -1;
}

std::string cell_at(const TextRow& row, int column) {
    if (column < 0 || static_cast<std::size_t>(column) >= row.cells.size()) return {};
    return row.cells[column];
}

std::string decoded_entities(std::string_view text) {
    std::string result;
    for (std::size_t i = 0; i < text.size(); ++i) {
        bool replaced = false;
        if (text[i] == '&') {
            for (const auto& [entity, plain] : {std::pair{"&amp;", '&'},
                                                {"&lt;", '<'},
                                                {"&gt;", '>'},
                                                {"&quot;", '"'},
                                                {"&apos;", '\''}}) {
                if (text.substr(i).starts_with(entity)) {
                    result += plain;
                    i += std::char_traits<char>::length(entity) - 1;
                    replaced = true;
                    break;
                }
            }
        }
        if (!replaced) result += text[i];
    }
    return result;
}

// Value of attribute `name` of a tag, given the text inside the tag; empty without it.
std::optional<std::string> attribute(std::string_view tag, std::string_view name) {
    for (std::size_t at = tag.find(name); at != std::string_view::npos;
         at = tag.find(name, at + 1)) {
        const bool starts = at > 0 && std::isspace(static_cast<unsigned char>(tag[at - 1]));
        std::size_t i = at + name.size();
        while (i < tag.size() && std::isspace(static_cast<unsigned char>(tag[i]))) ++i;
        if (!starts || i >= tag.size() || tag[i] != '=') continue;
        ++i;
        while (i < tag.size() && std::isspace(static_cast<unsigned char>(tag[i]))) ++i;
        if (i >= tag.size() || (tag[i] != '"' && tag[i] != '\'')) continue;
        const std::size_t end = tag.find(tag[i], i + 1);
        if (end == std::string_view::npos) return std::nullopt;
        return decoded_entities(tag.substr(i + 1, end - i - 1));
    }
    return std::nullopt;
}

// unit: the range of `value` is [0, 1] and not [0, 255].
std::uint8_t colour_byte(double value, bool unit) {
    const double scaled = unit ? value * 255 : value;
    return static_cast<std::uint8_t>(scaled <= 0 ? 0 : scaled >= 255 ? 255 : std::lround(scaled));
}

}  // namespace

std::string_view totalsegmentator_name(int value) {
    const auto names = total_segmentator_labels();
    if (value < 1 || static_cast<std::size_t>(value) > names.size()) return {};
    return names[value - 1];
}

int totalsegmentator_value(std::string_view name) {
    const auto names = total_segmentator_labels();
    for (std::size_t i = 0; i < names.size(); ++i)
        if (names[i] == name) return static_cast<int>(i) + 1;
    return 0;
}

namespace {

// The cells from one on as one name: "left lung" without quotation marks is two of them.
std::string joined_cells(const TextRow& row, std::size_t first, std::size_t end) {
    std::string name;
    for (std::size_t c = first; c < end; ++c)
        if (!row.cells[c].empty()) name += (name.empty() ? "" : " ") + row.cells[c];
    return name;
}

// blanks: they stand between the cells, and may stand within names.
Result<LabelTable> table_of_rows(const std::vector<TextRow>& rows,
                                 const std::string& where,
                                 bool blanks) {
    if (rows.empty()) return Error{"label table is empty", where, "expected rows of value,name"};
    // A label description of ITK-SNAP: index, four of colour, two switches, name.
    const bool itk_snap =
        rows[0].cells.size() == 8 && number_in(rows[0].cells[6]) && !number_in(rows[0].cells[7]);
    int value_column = 0, name_column = itk_snap ? 7 : 1, tissue_column = -1;
    int colour_column = itk_snap ? 1 : 2;
    std::size_t first = 0;
    if (!whole_in(cell_at(rows[0], 0))) {
        first = 1;
        colour_column = -1;
        value_column = column_named(rows[0], {"value", "label", "index", "id", "key", "labelvalue",
                                              "label_value", "label value", "label id"});
        name_column = column_named(
            rows[0], {"name", "structure", "label_name", "label name", "segment", "label"});
        if (name_column == value_column)  // "id,label": there the label is the name
            value_column = column_named(rows[0], {"index", "id", "key", "number"});
        tissue_column = column_named(rows[0], {"tissue", "tissue_class"});
        if (value_column < 0 || name_column < 0 || name_column == value_column)
            return Error{"label table has no columns 'value' and 'name'",
                         where + ":" + std::to_string(rows[0].line),
                         "expected a header such as value,name or value,name,tissue_class"};
    }
    LabelTable table;
    for (std::size_t r = first; r < rows.size(); ++r) {
        const std::string place = where + ":" + std::to_string(rows[r].line);
        LabelTableEntry entry;
        const auto value = whole_in(cell_at(rows[r], value_column));
        const std::vector<std::string>& cells = rows[r].cells;
        std::size_t used = cells.size();  // without empty ones at the end
        while (used > 0 && cells[used - 1].empty()) --used;
        const auto name_at = static_cast<std::size_t>(name_column);
        std::size_t name_end = name_at + 1;
        if (first == 1 && used > rows[0].cells.size()) {
            if (name_at + 1 != rows[0].cells.size())
                return Error{text("row of %zu cells under %zu names", used, rows[0].cells.size()),
                             place, "put names with blanks or commas in quotation marks"};
            name_end = used;
        } else if (first == 0 && blanks) {
            while (name_end < used && !number_in(cells[name_end])) ++name_end;
        }
        entry.name = name_end > name_at + 1 ? joined_cells(rows[r], name_at, name_end)
                                            : cell_at(rows[r], name_column);
        const int colour_at = colour_column < 0 ? -1
                              : itk_snap        ? colour_column
                                                : static_cast<int>(name_end);
        if (!value)
            return Error{"'" + cell_at(rows[r], value_column) + "' is not a label value", place,
                         "expected a whole number"};
        if (entry.name.size() > 2 && entry.name.front() == '\'' && entry.name.back() == '\'')
            entry.name = entry.name.substr(1, entry.name.size() - 2);
        if (entry.name.empty())
            return Error{"value " + std::to_string(*value) + " has no name", place,
                         "expected value,name"};
        entry.value = *value;
        entry.tissue_class = cell_at(rows[r], tissue_column);
        if (colour_at >= 0) {
            std::array<std::uint8_t, 3> rgb{};
            bool good = true;
            for (int c = 0; c < 3; ++c) {
                const auto number = number_in(cell_at(rows[r], colour_at + c));
                good = good && number.has_value();
                if (number) rgb[static_cast<std::size_t>(c)] = colour_byte(*number, false);
            }
            if (good) entry.colour = rgb;
        }
        table.push_back(std::move(entry));
    }
    if (std::all_of(table.begin(), table.end(),
                    [](const LabelTableEntry& entry) { return number_in(entry.name).has_value(); }))
        return Error{"label table has numbers in place of names", where,
                     "expected rows of value,name"};
    return table;
}

// [{"id": 5, "name": "liver"}, ...]
LabelTable table_of_objects(const detail::Json& list) {
    LabelTable table;
    for (const detail::Json& item : list) {
        std::optional<int> value;
        std::string name;
        if (!item.is_object()) return {};
        for (const char* key : {"value", "id", "index", "label", "labelValue"})
            if (const auto found = item.find(key); !value && found != item.end() &&
                                                   found->is_number_integer() &&
                                                   std::abs(found->get<double>()) <= 2147483647.0)
                value = found->get<int>();
        for (const char* key : {"name", "label", "title"})
            if (const auto found = item.find(key);
                name.empty() && found != item.end() && found->is_string())
                name = found->get<std::string>();
        if (!value || name.empty()) return {};
        table.push_back({*value, name, {}, {}, 0});
    }
    return table;
}

// The segments of dcmqi's description of a DICOM segmentation: a list for each map that it was made
// of, each with objects of labelID, SegmentLabel and codes.
Result<LabelTable> table_of_segments(const detail::Json& maps, const std::string& where) {
    LabelTable table;
    for (const detail::Json& map : maps)
        for (const detail::Json& segment : map.is_array() ? map : detail::Json::array({map})) {
            LabelTableEntry entry;
            if (!segment.is_object()) continue;
            const auto text_of = [](const detail::Json& of, const char* key) {
                const auto found = of.find(key);
                return found != of.end() && found->is_string() ? found->get<std::string>()
                                                               : std::string();
            };
            for (const char* key : {"SegmentLabel", "SegmentDescription"})
                if (entry.name.empty()) entry.name = trimmed(text_of(segment, key));
            if (const auto code = segment.find("SegmentedPropertyTypeCodeSequence");
                entry.name.empty() && code != segment.end() && code->is_object())
                entry.name = trimmed(text_of(*code, "CodeMeaning"));
            const auto value = segment.find("labelID");
            if (value == segment.end() || !value->is_number_integer() || entry.name.empty())
                return Error{"a segment has no labelID or no name", where,
                             "expected SegmentLabel and labelID in each of segmentAttributes"};
            entry.value = value->get<int>();
            for (const LabelTableEntry& other : table)
                if (other.value == entry.value)
                    return Error{"two segments have the labelID " + std::to_string(entry.value) +
                                     ": '" + other.name + "' and '" + entry.name + "'",
                                 where, "the segments of several maps: give a table for each"};
            table.push_back(std::move(entry));
        }
    return table;
}

// {"labels": {"liver": 5}}, {"labels": {"5": "liver"}}, {"labels": ["background", ...]}, or the
// inner object alone.
Result<LabelTable> parse_label_json(std::string_view text, const std::string& where) {
    const char* expected = "expected \"labels\" with names and values, as dataset.json of nnU-Net";
    detail::JsonFault fault;
    fault.where = where;
    detail::Json root;
    if (!detail::parse_json(text, root, fault))
        return fault.error ? *fault.error : Error{"is not JSON", where, expected};
    if (const auto segments = root.find("segmentAttributes");
        segments != root.end() && segments->is_array() && !segments->empty())
        return table_of_segments(*segments, where);
    const auto found = root.find("labels");
    const detail::Json& labels = found != root.end() ? *found : root;
    LabelTable table;
    if (labels.is_array()) {
        for (std::size_t n = 0; n < labels.size(); ++n)
            if (labels[n].is_string())
                table.push_back({static_cast<int>(n), labels[n].get<std::string>(), {}, {}, 0});
        if (table.empty()) table = table_of_objects(labels);
        if (table.size() != labels.size()) table.clear();
    } else if (labels.is_object()) {
        for (const auto& [key, value] : labels.items()) {
            LabelTableEntry entry;
            const auto key_value = whole_in(key);
            if (value.is_number_integer() && std::abs(value.get<double>()) <= 2147483647.0) {
                entry.value = value.get<int>();
                entry.name = key;
            } else if (value.is_string() && key_value) {
                entry.value = *key_value;
                entry.name = value.get<std::string>();
            } else if (value.is_array()) {
                return Error{"label '" + key + "' is a region of several values", where,
                             "expected one value for each name"};
            } else if (&labels == &root) {
                continue;  // another field of the file
            } else {
                return Error{"label '" + key + "' has no whole number", where, expected};
            }
            if (entry.name.empty())
                return Error{"value " + std::to_string(entry.value) + " has no name", where,
                             expected};
            table.push_back(std::move(entry));
        }
    }
    if (table.empty()) return Error{"names no labels", where, expected};
    return table;
}

}  // namespace

Result<LabelTable> parse_label_table(std::string_view text, const std::string& where) {
    if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
        return Error{"label table is UTF-16", where, "save it as CSV UTF-8"};
    int line = 1;
    for (std::string_view rest = text; !rest.empty(); ++line) {
        const std::size_t end = std::min(rest.find('\n'), rest.size());
        if (!is_utf8(rest.substr(0, end)))
            return Error{"a name is not UTF-8", where + ":" + std::to_string(line),
                         "save the table as CSV UTF-8"};
        rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    const std::string_view start = trimmed(text);
    if (start.starts_with('{')) return parse_label_json(text, where);
    if (start.starts_with('['))
        return parse_label_json("{\"labels\":" + std::string(text) + "}", where);
    if (lower_case(text.substr(0, 4)) == "sep=")  // Excel's line of the separator
        text.remove_prefix(std::min(text.find('\n'), text.size()));
    char separator = 0;
    for (std::string_view rest = text; separator == 0 && !rest.empty();) {
        const std::size_t end = std::min(rest.find_first_of("\r\n"), rest.size());
        const std::string_view first = trimmed(rest.substr(0, end));
        rest.remove_prefix(std::min(end + 1, rest.size()));
        if (!first.empty() && first.front() != '#' && !first.starts_with("//"))
            separator = separator_of(first);
    }
    return table_of_rows(split_rows(text), where, separator == ' ');
}

Result<LabelTable> load_label_table(const std::string& path) {
    SONOCASE_TRY_DONE(check_source_file(path, "expected a label table"));
    SONOCASE_TRY(auto text, read_text_file(path));
    return parse_label_table(text, path);
}

bool is_utf8(std::string_view text) {
    for (std::size_t i = 0; i < text.size();) {
        const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
        const unsigned char lead = byte(i);
        const std::size_t more = lead < 0x80                    ? 0
                                 : lead >= 0xC2 && lead <= 0xDF ? 1
                                 : lead >= 0xE0 && lead <= 0xEF ? 2
                                 : lead >= 0xF0 && lead <= 0xF4 ? 3
                                                                : 4;
        if (more == 4 || i + more >= text.size()) return false;
        for (std::size_t n = 1; n <= more; ++n)
            if ((byte(i + n) & 0xC0) != 0x80) return false;
        // Overlong forms, surrogates, and what lies beyond Unicode.
        if (more >= 2 &&
            ((lead == 0xE0 && byte(i + 1) < 0xA0) || (lead == 0xED && byte(i + 1) > 0x9F) ||
             (lead == 0xF0 && byte(i + 1) < 0x90) || (lead == 0xF4 && byte(i + 1) > 0x8F)))
            return false;
        i += more + 1;
    }
    return true;
}

std::string utf8_of_windows_1252(std::string_view text) {
    // 0x80 to 0x9F; the others are those of Unicode. 0: not used.
    constexpr std::uint16_t high[32] = {
        0x20AC, 0,      0x201A, 0x0192, 0x201E, 0x2026, 0x2020, 0x2021, 0x02C6, 0x2030, 0x0160,
        0x2039, 0x0152, 0,      0x017D, 0,      0,      0x2018, 0x2019, 0x201C, 0x201D, 0x2022,
        0x2013, 0x2014, 0x02DC, 0x2122, 0x0161, 0x203A, 0x0153, 0,      0x017E, 0x0178};
    std::string out;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        if (byte < 0x80) {
            out += c;
            continue;
        }
        unsigned code = byte < 0xA0 ? high[byte - 0x80] : byte;
        if (code == 0) code = '?';
        if (code < 0x80) {
            out += static_cast<char>(code);
        } else if (code < 0x800) {
            out += static_cast<char>(0xC0 | (code >> 6));
            out += static_cast<char>(0x80 | (code & 0x3F));
        } else {
            out += static_cast<char>(0xE0 | (code >> 12));
            out += static_cast<char>(0x80 | ((code >> 6) & 0x3F));
            out += static_cast<char>(0x80 | (code & 0x3F));
        }
    }
    return out;
}

Result<LabelTable> parse_label_xml(std::string_view xml, const std::string& where) {
    LabelTable table;
    std::size_t at = xml.find("<LabelTable");
    if (at == std::string_view::npos) return table;
    const std::size_t table_end = xml.find("</LabelTable>", at);
    if (table_end == std::string_view::npos)
        return Error{"label table in the header extension has no end", where,
                     "write the file again, or give a table as CSV"};
    xml = xml.substr(0, table_end);
    at = xml.find('>', at);
    while ((at = xml.find("<Label", at)) != std::string_view::npos) {
        const std::size_t tag_end = xml.find('>', at);
        if (tag_end == std::string_view::npos) break;
        const std::string_view tag = xml.substr(at + 6, tag_end - at - 6);
        at = tag_end + 1;
        std::string name;
        if (xml.substr(at).starts_with("<![CDATA[")) {
            const std::size_t end = xml.find("]]>", at);
            if (end == std::string_view::npos) break;
            name = std::string(xml.substr(at + 9, end - at - 9));
            at = end;
        } else {
            const std::size_t end = xml.find('<', at);
            if (end == std::string_view::npos) break;
            name = decoded_entities(xml.substr(at, end - at));
            at = end;
        }
        name = std::string(trimmed(name));
        const auto key = attribute(tag, "Key");
        const auto value = key ? whole_in(*key) : std::nullopt;
        if (!value || name.empty())
            return Error{"label table in the header extension has an entry without key or name",
                         where, "write the file again, or give a table as CSV"};
        LabelTableEntry entry;
        entry.value = *value;
        entry.name = name;
        const auto red = attribute(tag, "Red"), green = attribute(tag, "Green"),
                   blue = attribute(tag, "Blue");
        if (red && green && blue) {
            const auto r = number_in(*red), g = number_in(*green), b = number_in(*blue);
            if (r && g && b) {
                const bool unit = *r <= 1 && *g <= 1 && *b <= 1;
                entry.colour = {colour_byte(*r, unit), colour_byte(*g, unit),
                                colour_byte(*b, unit)};
            }
        }
        table.push_back(std::move(entry));
    }
    return table;
}

namespace {

// [{"labels": [{"name": "liver", "value": 1, "color": {"value": [1, 0, 0]}}]}]: the groups of
// MITK, each of them a layer.
Result<LabelTable> table_of_mitk(const std::string& text, const std::string& where) {
    const Error damaged{"MITK's label groups in the header are damaged", where,
                        "save the segmentation again, or give a table as CSV"};
    detail::JsonFault fault;
    fault.where = where;
    detail::Json root;
    if (!detail::parse_json("{\"groups\":" + text + "}", root, fault)) return damaged;
    LabelTable table;
    int layer = 0;
    for (const detail::Json& group : root["groups"]) {
        if (!group.is_object()) return damaged;
        const auto labels = group.find("labels");
        if (labels == group.end() || !labels->is_array()) return damaged;
        for (const detail::Json& label : *labels) {
            if (!label.is_object()) return damaged;
            const auto name = label.find("name"), value = label.find("value");
            if (name == label.end() || !name->is_string() || value == label.end() ||
                !value->is_number_integer() || std::abs(value->get<double>()) > 2147483647.0)
                return damaged;
            LabelTableEntry entry{value->get<int>(), name->get<std::string>(), {}, {}, layer};
            const auto colour = label.find("color");
            if (colour != label.end() && colour->is_object() && colour->contains("value")) {
                const detail::Json& rgb = (*colour)["value"];
                if (rgb.is_array() && rgb.size() >= 3 && rgb[0].is_number() && rgb[1].is_number() &&
                    rgb[2].is_number())
                    entry.colour = {colour_byte(rgb[0].get<double>(), true),
                                    colour_byte(rgb[1].get<double>(), true),
                                    colour_byte(rgb[2].get<double>(), true)};
            }
            table.push_back(std::move(entry));
        }
        ++layer;
    }
    return table;
}

}  // namespace

Result<LabelTable> segments_of_fields(const std::map<std::string, std::string>& fields,
                                      const std::string& where) {
    if (const auto mitk = fields.find("org.mitk.multilabel.segmentation.labelgroups");
        mitk != fields.end())
        return table_of_mitk(mitk->second, where);
    // The numbers of all keys "Segment<N>_...": writers other than Slicer begin at 1, or leave
    // gaps.
    std::map<std::string, int> prefixes;  // "Segment12_" and 12
    for (const auto& [key, text] : fields) {
        const std::size_t end = key.find('_');
        if (!key.starts_with("Segment") || end == std::string::npos || end == 7 || end > 7 + 9)
            continue;
        const auto number = whole_in(std::string_view(key).substr(7, end - 7));
        if (number && *number >= 0) prefixes[key.substr(0, end + 1)] = *number;
    }
    std::vector<std::pair<int, std::string>> segments;
    for (const auto& [prefix, number] : prefixes) segments.emplace_back(number, prefix);
    std::sort(segments.begin(), segments.end());
    LabelTable table;
    int order = -1;
    for (const auto& [number, prefix] : segments) {
        ++order;
        const auto field = [&, p = prefix](const char* key) -> std::optional<std::string> {
            const auto found = fields.find(p + key);
            if (found == fields.end()) return std::nullopt;
            return found->second;
        };
        const auto name = field("Name");
        if (!name && !field("ID")) continue;  // its value is then told of as unnamed
        LabelTableEntry entry;
        entry.name = trimmed(name ? *name : *field("ID"));
        const auto value = field("LabelValue");
        // Files of Slicer before 4.11 have one layer per segment, with the values 0 and 1, and lack
        // these fields.
        const auto whole = value ? whole_in(trimmed(*value)) : 1;
        const auto layer = field("Layer");
        const auto whole_layer = layer ? whole_in(trimmed(*layer)) : (value ? 0 : order);
        if (entry.name.empty() || !whole || !whole_layer || *whole_layer < 0)
            return Error{
                "segment " + std::to_string(number) + " has no usable name, label value or layer",
                where, "save the segmentation again"};
        entry.value = *whole;
        entry.layer = *whole_layer;
        if (const auto colour = field("Color")) {
            const std::vector<TextRow> row = split_rows(*colour);
            if (!row.empty() && row[0].cells.size() >= 3) {
                std::array<std::uint8_t, 3> rgb{};
                bool good = true;
                for (std::size_t c = 0; c < 3; ++c) {
                    const auto number_c = number_in(row[0].cells[c]);
                    good = good && number_c.has_value();
                    if (number_c) rgb[c] = colour_byte(*number_c, true);
                }
                if (good) entry.colour = rgb;
            }
        }
        table.push_back(std::move(entry));
    }
    return table;
}

}  // namespace sonocase::pipeline::inline anatomy
