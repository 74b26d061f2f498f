// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/option.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <type_traits>

#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"

namespace sonocase::pipeline::inline stages {
namespace {

std::string joined(const std::vector<std::string>& words, const char* separator) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : separator) + word;
    return text;
}

bool is_among(const std::string& value, const std::vector<std::string>& choices) {
    return std::find(choices.begin(), choices.end(), value) != choices.end();
}

// The functions below set the value, or return what they expected instead.
template <class Number>
std::string set_number(const Option& option, const std::string& value, Number* to) {
    constexpr bool kWhole = std::is_same_v<Number, int>;
    double number = 0;
    const char* const end = value.data() + value.size();
    const auto parsed = std::from_chars(value.data(), end, number);
    const bool allowed = option.choices.empty() ? number >= option.low && number <= option.high
                                                : is_among(value, option.choices);
    if (parsed.ec == std::errc() && parsed.ptr == end && allowed &&
        (!kWhole || number == std::floor(number))) {
        *to = static_cast<Number>(number);
        return "";
    }
    const std::string unit = option.unit.empty() ? "" : " " + option.unit;
    if (!option.choices.empty()) return joined(option.choices, ", ") + unit;
    return std::string(kWhole ? "a whole number" : "a number") + " from " +
           number_text(option.low) + " to " + number_text(option.high) + unit;
}

std::string set_value(const Option& option, const std::string& value, double* to) {
    return set_number(option, value, to);
}
std::string set_value(const Option& option, const std::string& value, int* to) {
    return set_number(option, value, to);
}
std::string set_value(const Option&, const std::string& value, bool* to) {
    if (value != "true" && value != "false") return "true or false";
    *to = value == "true";
    return "";
}
std::string set_value(const Option& option, const std::string& value, std::string* to) {
    if (!is_among(value, option.choices))
        return joined(option.choices, "|") + "; " + suggest_name(value, option.choices);
    *to = value;
    return "";
}

}  // namespace

Status set_option(const Option& option,
                  const std::string& value,
                  std::any& options,
                  const std::string& where) {
    const std::string expected = std::visit(
        [&](auto* slot) { return set_value(option, value, slot); }, option.slot(options));
    if (!expected.empty())
        return Error{"'" + value + "' for " + option.name(), where, "expected " + expected};
    return Done{};
}

std::string option_value(const Option& option, const std::any& options) {
    std::any copy = options;
    return std::visit(
        [](const auto* slot) -> std::string {
            using T = std::remove_const_t<std::remove_pointer_t<decltype(slot)>>;
            if constexpr (std::is_same_v<T, bool>)
                return *slot ? "true" : "false";
            else if constexpr (std::is_same_v<T, std::string>)
                return *slot;
            else if constexpr (std::is_same_v<T, double>)
                return number_text(*slot);
            else
                return std::to_string(*slot);
        },
        option.slot(copy));
}

std::string option_range(const Option& option, const std::any& options) {
    std::any copy = options;
    if (std::holds_alternative<bool*>(option.slot(copy))) return "true, false";
    const std::string unit = option.unit.empty() ? "" : " " + option.unit;
    if (!option.choices.empty()) return joined(option.choices, ", ") + unit;
    return number_text(option.low, 6) + " to " + number_text(option.high, 6) + unit;
}

std::string OptionGroup::text(const std::any& options_struct) const {
    std::string text;
    for (const Option& option : options)
        text += option.key + "=" + option_value(option, options_struct) + "\n";
    return text;
}

}  // namespace sonocase::pipeline::inline stages
