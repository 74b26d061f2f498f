// SPDX-License-Identifier: Apache-2.0

#include "pipeline/anatomy/label_table.h"

#include <cmath>
#include <cstdlib>

#include "formats/files/atomic_file.h"
#include "pipeline/anatomy/tissue_table.h"
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

Result<LabelTable> parse_label_csv(std::string_view csv, const std::string& where) {
    const std::vector<TextRow> rows = split_rows(csv);
    if (rows.empty()) return Error{"label table is empty", where, "expected rows of value,name"};
    int value_column = 0, name_column = 1, tissue_column = -1;
    std::size_t first = 0;
    if (!whole_in(cell_at(rows[0], 0))) {
        first = 1;
        value_column = column_named(rows[0], {"value", "label", "index", "id", "key"});
        name_column = column_named(rows[0], {"name", "structure", "label_name"});
        tissue_column = column_named(rows[0], {"tissue", "tissue_class"});
        if (value_column < 0 || name_column < 0)
            return Error{"label table has no columns 'value' and 'name'",
                         where + ":" + std::to_string(rows[0].line),
                         "expected a header such as value,name or value,name,tissue_class"};
    }
    LabelTable table;
    for (std::size_t r = first; r < rows.size(); ++r) {
        const std::string place = where + ":" + std::to_string(rows[r].line);
        LabelTableEntry entry;
        const auto value = whole_in(cell_at(rows[r], value_column));
        entry.name = cell_at(rows[r], name_column);
        if (!value)
            return Error{"'" + cell_at(rows[r], value_column) + "' is not a label value", place,
                         "expected a whole number"};
        if (entry.name.empty())
            return Error{"value " + std::to_string(*value) + " has no name", place,
                         "expected value,name"};
        entry.value = *value;
        entry.tissue_class = cell_at(rows[r], tissue_column);
        table.push_back(std::move(entry));
    }
    return table;
}

Result<LabelTable> load_label_csv(const std::string& path) {
    SONOCASE_TRY(auto text, read_text_file(path));
    return parse_label_csv(text, path);
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

Result<LabelTable> segments_of_fields(const std::map<std::string, std::string>& fields,
                                      const std::string& where) {
    LabelTable table;
    for (int number = 0;; ++number) {
        const std::string prefix = "Segment" + std::to_string(number) + "_";
        const auto field = [&](const char* key) -> std::optional<std::string> {
            const auto found = fields.find(prefix + key);
            if (found == fields.end()) return std::nullopt;
            return found->second;
        };
        const auto name = field("Name");
        if (!name && !field("ID")) break;
        LabelTableEntry entry;
        entry.name = trimmed(name ? *name : *field("ID"));
        const auto value = field("LabelValue");
        // Files of Slicer before 4.11 have one layer per segment, with the values 0 and 1, and lack
        // these fields.
        const auto whole = value ? whole_in(trimmed(*value)) : 1;
        const auto layer = field("Layer");
        const auto whole_layer = layer ? whole_in(trimmed(*layer)) : (value ? 0 : number);
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
