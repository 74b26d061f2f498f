// SPDX-License-Identifier: Apache-2.0

// A sentence for people that a program can show in another language.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sonocase {

// Puts the arguments in the places of the format's "{}", in order. Every "{}" that is left over
// stays.
inline std::string filled_in(std::string_view format, const std::vector<std::string>& arguments) {
    std::string text;
    std::size_t next = 0;
    while (!format.empty()) {
        const std::size_t field = format.find("{}");
        text += format.substr(0, field);
        if (field == std::string_view::npos) break;
        text += next < arguments.size() ? arguments[next++] : "{}";
        format.remove_prefix(field + 2);
    }
    return text;
}

// The finished English text, which also keeps the format and the arguments that it was made of: a
// catalogue of another language translates the format (formats/words). A text without
// arguments is its own format. Not to be edited once made: a changed text no longer fits its
// format.
class Message : public std::string {
  public:
    Message() = default;
    // Not inlined: with short literals GCC 12 warns wrongly of overlapping copies (its bug 105651).
    [[gnu::noinline]] Message(const char* text) : std::string(text) {}
    Message(std::string text) : std::string(std::move(text)) {}
    // format: a string literal (it is not copied), with one "{}" for each argument, in order.
    // Arguments are translated too where a catalogue has them: names and numbers stay.
    Message(const char* format, std::vector<Message> arguments)
        : std::string(filled_in(format, {arguments.begin(), arguments.end()})),
          format_(format),
          arguments_(std::move(arguments)) {}

    // The key of a catalogue.
    std::string_view format() const { return format_ ? std::string_view(format_) : *this; }
    const std::vector<Message>& arguments() const { return arguments_; }

    // The text alone.
    std::string text() const { return substr(0); }

    // The same message with blanks for line breaks and other control characters.
    Message on_one_line() const {
        Message line = *this;
        line.put_on_one_line();
        return line;
    }

  private:
    void put_on_one_line() {
        for (char& c : *this) {
            if (static_cast<unsigned char>(c) < 32 || c == 127) c = ' ';
        }
        for (Message& argument : arguments_) argument.put_on_one_line();
    }

    const char* format_ = nullptr;  // null: the text itself
    std::vector<Message> arguments_;
};

}  // namespace sonocase
