// SPDX-License-Identifier: Apache-2.0

#include "formats/text/toml_reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

// toml++ 3.3 has an assertion that hostile input ("[[[") breaks; without it, toml++ reports the
// error.
#define TOML_ASSERT(expr) static_cast<void>(0)
#define TOML_EXCEPTIONS 0
#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"

namespace sonocase {

struct TomlTable::Document {
    std::string where;
    toml::table root;
    std::optional<Error> fault;
};

struct TomlTable::Part {
    std::shared_ptr<Document> document;
    const toml::table* table;
    std::string path;                // of keys, with a dot at the end: "targets[0]."
    std::vector<std::string> asked;  // keys that were asked for

    const toml::node* find(std::string_view key) {
        if (std::find(asked.begin(), asked.end(), key) == asked.end()) asked.emplace_back(key);
        return table->get(key);
    }
};

namespace {

std::string line_of(const std::string& where, const toml::source_region& source) {
    return source.begin ? where + ":" + std::to_string(source.begin.line) : where;
}

std::string plain_text_of(const toml::node& node) {
    if (node.is_string()) return **node.as_string();
    if (node.is_boolean()) return **node.as_boolean() ? "true" : "false";
    if (node.is_integer()) return std::to_string(**node.as_integer());
    if (node.is_floating_point()) {
#ifdef __cpp_lib_to_chars
        char text[32];
        return {text, std::to_chars(text, text + sizeof text, **node.as_floating_point()).ptr};
#else
        return number_text(**node.as_floating_point());
#endif
    }
    return node.is_array() ? "(a list)" : node.is_table() ? "(a table)" : "(a date or time)";
}

}  // namespace

Error toml_fault(std::string_view description, const std::string& where) {
    // "Error while parsing key-value pair: cannot redefine existing string 'name'"
    std::string what(description), in;
    const std::string start = "Error while parsing ";
    if (const auto at = what.find(": "); what.starts_with(start) && at != std::string::npos) {
        in = " in a " + what.substr(start.size(), at - start.size());
        what = what.substr(at + 2);
    }
    if (const std::string cut = "encountered end-of-file"; what.starts_with(cut))
        what = "the file ends too early" + what.substr(cut.size());
    if (const std::string twice = "cannot redefine existing "; what.starts_with(twice))
        return {"the " + what.substr(twice.size()) + " is given twice", where,
                "remove one of the two"};
    std::string expected = "correct this line";
    const auto says = [&](const char* word) { return (what + in).find(word) != std::string::npos; };
    if (says("utf-8") || says("u0000"))
        expected = "save the file as UTF-8";
    else if (says("scalar") || says("escape"))
        expected = "in a path write / for \\, or put it in single quotes";
    return {"not valid TOML (" + what + in + ")", where, expected};
}

Result<TomlTable> TomlTable::parse(std::string_view text, const std::string& where) {
    toml::parse_result parsed = toml::parse(text, std::string_view(where));
    if (!parsed) {
        const toml::parse_error& error = parsed.error();
        return toml_fault(error.description(), line_of(where, error.source()));
    }
    auto document = std::make_shared<Document>();
    document->where = where;
    document->root = std::move(parsed).table();
    const toml::table* root = &document->root;
    return TomlTable(std::make_shared<Part>(Part{std::move(document), root, "", {}}));
}

bool TomlTable::has(std::string_view key) const {
    return part_->table->contains(key);
}

std::vector<std::string> TomlTable::keys() const {
    std::vector<std::string> names;
    for (const auto& [key, node] : *part_->table) names.emplace_back(key.str());
    return names;
}

int TomlTable::line(std::string_view key) const {
    const auto found = part_->table->find(key);
    const toml::source_region& source =
        found != part_->table->end() ? found->first.source() : part_->table->source();
    return static_cast<int>(source.begin.line);
}

std::string TomlTable::place(std::string_view key) const {
    const int at = line(key);
    const std::string& where = part_->document->where;
    return at > 0 ? where + ":" + std::to_string(at) : where;
}

bool TomlTable::text(std::string_view key,
                     std::string& to,
                     const std::vector<std::string>& choices) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    if (!node->is_string()) {
        add_fault(key, "is " + plain_text_of(*node), "expected text in quotes");
        return false;
    }
    const std::string& given = **node->as_string();
    if (!choices.empty() && std::find(choices.begin(), choices.end(), given) == choices.end()) {
        add_fault(key, "has the unknown value '" + given + "'", suggest_name(given, choices));
        return false;
    }
    to = given;
    return true;
}

bool TomlTable::texts(std::string_view key,
                      std::vector<std::string>& to,
                      bool single_allowed) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    std::vector<std::string> items;
    if (single_allowed && node->is_string()) {
        items.push_back(**node->as_string());
    } else if (const toml::array* list = node->as_array()) {
        for (const toml::node& item : *list) {
            if (!item.is_string()) {
                add_fault(key, "holds " + plain_text_of(item), "expected texts in quotes");
                return false;
            }
            items.push_back(**item.as_string());
        }
    } else {
        add_fault(key, "is not a list", "expected a list of texts, as in [\"a\", \"b\"]");
        return false;
    }
    to = std::move(items);
    return true;
}

bool TomlTable::number(
    std::string_view key, double& to, double low, double high, bool above_low) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    const std::string expected = std::string("expected a number ") +
                                 (above_low ? "above " : "from ") + number_text(low, 6) +
                                 (above_low ? " and up to " : " to ") + number_text(high, 6);
    const auto value = node->value<double>();
    if (!node->is_number() || !value) {
        add_fault(key, "is " + plain_text_of(*node) + ", not a number", expected);
        return false;
    }
    if (!(*value >= low) || !(*value <= high) || (above_low && *value == low)) {
        add_fault(key, "is " + plain_text_of(*node) + ", out of range", expected);
        return false;
    }
    to = *value;
    return true;
}

bool TomlTable::whole(std::string_view key, int& to, double low, double high) const {
    double value = 0;
    if (!number(key, value, low, high)) return false;
    if (value != std::floor(value)) {
        add_fault(key, "is " + number_text(value, 6), "expected a whole number");
        return false;
    }
    to = static_cast<int>(value);
    return true;
}

bool TomlTable::numbers(std::string_view key,
                        std::vector<double>& to,
                        double low,
                        double high,
                        std::size_t min_count,
                        std::size_t max_count) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    const toml::array* list = node->as_array();
    bool good = list && list->size() >= min_count && list->size() <= max_count;
    std::vector<double> read;
    for (std::size_t i = 0; good && i < list->size(); ++i) {
        const toml::node& item = *list->get(i);
        const auto value = item.value<double>();
        good = item.is_number() && value && *value >= low && *value <= high;
        if (good) read.push_back(*value);
    }
    if (!good) {
        add_fault(key, "is not such a list",
                  "expected " + std::to_string(min_count) + " to " + std::to_string(max_count) +
                      " numbers from " + number_text(low, 6) + " to " + number_text(high, 6));
        return false;
    }
    to = std::move(read);
    return true;
}

bool TomlTable::flag(std::string_view key, bool& to) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    if (!node->is_boolean()) {
        add_fault(key, "is " + plain_text_of(*node), "expected true or false");
        return false;
    }
    to = **node->as_boolean();
    return true;
}

template <class V>
bool TomlTable::triple(std::string_view key, V& to) const {
    const toml::node* node = part_->find(key);
    if (!node) return false;
    const toml::array* list = node->as_array();
    bool good = list && list->size() == 3;
    V read;
    for (int axis = 0; good && axis < 3; ++axis) {
        const auto value = (*list)[axis].value<double>();
        good = value && std::isfinite(*value) && std::abs(*value) <= 1e5;
        if (good) read[axis] = *value;
    }
    if (!good) {
        add_fault(key, "is not a list of 3 numbers",
                  "expected numbers up to 1e5, as in [10, 20.5, 30]");
        return false;
    }
    to = read;
    return true;
}

bool TomlTable::point(std::string_view key, Point3& to) const {
    return triple(key, to);
}

bool TomlTable::vector(std::string_view key, Vector3& to) const {
    return triple(key, to);
}

bool TomlTable::direction(std::string_view key, Vector3& to) const {
    Vector3 v;
    if (!triple(key, v)) return false;
    if (!(norm(v) > 1e-9)) {
        add_fault(key, "is a direction of length zero", "expected a direction, as in [0, 0, 1]");
        return false;
    }
    to = normalized(v);
    return true;
}

std::optional<std::size_t> TomlTable::choice(std::string_view key,
                                             const std::vector<std::string>& names) const {
    std::string name;
    if (!text(key, name, names)) return std::nullopt;
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
}

std::optional<std::string> TomlTable::plain_value(std::string_view key) const {
    const toml::node* node = part_->find(key);
    if (!node) return std::nullopt;
    return plain_text_of(*node);
}

std::optional<TomlTable> TomlTable::table(std::string_view key) const {
    const toml::node* node = part_->find(key);
    if (!node) return std::nullopt;
    if (!node->is_table()) {
        add_fault(key, "is not a table", "expected [" + part_->path + std::string(key) + "]");
        return std::nullopt;
    }
    return TomlTable(std::make_shared<Part>(
        Part{part_->document, node->as_table(), part_->path + std::string(key) + ".", {}}));
}

std::vector<TomlTable> TomlTable::tables(std::string_view key) const {
    std::vector<TomlTable> out;
    const toml::node* node = part_->find(key);
    if (!node) return out;
    const toml::array* list = node->as_array();
    if (!list) {
        add_fault(key, "is not a list of tables", "expected [[" + std::string(key) + "]]");
        return out;
    }
    for (const toml::node& item : *list) {
        if (!item.is_table()) {
            add_fault(key, "holds " + plain_text_of(item), "expected only tables");
            return out;
        }
        const std::string index = "[" + std::to_string(out.size()) + "].";
        out.push_back(TomlTable(std::make_shared<Part>(
            Part{part_->document, item.as_table(), part_->path + std::string(key) + index, {}})));
    }
    return out;
}

void TomlTable::finish() const {
    for (const auto& [key, node] : *part_->table) {
        const std::string name(key.str());
        if (std::find(part_->asked.begin(), part_->asked.end(), name) != part_->asked.end())
            continue;
        keep({"unknown key '" + part_->path + name + "'",
              line_of(part_->document->where, key.source()), suggest_name(name, part_->asked)});
    }
}

void TomlTable::add_fault(std::string_view key,
                          const std::string& what,
                          const std::string& expected) const {
    const toml::node* node = part_->table->get(key);
    keep({part_->path + std::string(key) + " " + what,
          line_of(part_->document->where, node ? node->source() : part_->table->source()),
          expected});
}

void TomlTable::keep(Error error) const {
    if (!part_->document->fault) part_->document->fault = std::move(error);
}

const std::optional<Error>& TomlTable::fault() const {
    return part_->document->fault;
}

}  // namespace sonocase
