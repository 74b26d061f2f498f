// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/input_script.h"

#include <cstdlib>
#include <sstream>
#include <utility>

#include "formats/files/atomic_file.h"

namespace sonocase::runtime::inline display {

Result<InputScript> InputScript::load(const std::string& path) {
    SONOCASE_TRY(auto content, read_text_file(path));
    std::istringstream file(std::move(content));
    InputScript script;
    int number = 0;
    for (std::string text; std::getline(file, text);) {
        Line line;
        line.number = ++number;
        std::istringstream words(text);
        for (std::string word; words >> word;) line.words.push_back(word);
        if (line.words.empty() || line.words[0][0] == '#') continue;
        const std::string& verb = line.words[0];
        const std::size_t n = line.words.size();
        const bool fine =
            (verb == "wait" && n == 2) || (verb == "move" && n == 3) ||
            (verb == "wheel" && n == 2) || (verb == "shot" && n == 2) ||
            (verb == "boxes" && n == 2) || (verb == "instructor" && n == 2) ||
            (verb == "press" && n >= 2) || (verb == "loop" && n == 2) ||
            (verb == "quit" && n == 1) || (verb == "only-shots" && n == 1) ||
            ((verb == "down" || verb == "up") && n == 2 && line.words[1].size() == 1 &&
             line.words[1][0] >= '0' && line.words[1][0] <= '2') ||
            (verb == "key" && n >= 2 && key_code(line.words[1]) >= 0) ||
            (verb == "hold" && n >= 3 && key_code(line.words[1]) >= 0);
        if (!fine) {
            return Error{
                "line not understood: " + text, path + ":" + std::to_string(number),
                "verbs are wait, key, hold, move, down, up, wheel, press, shot, boxes, instructor, "
                "only-shots, loop and quit"};
        }
        script.lines_.push_back(std::move(line));
    }
    script.input_.active = true;
    return script;
}

bool InputScript::saves_next() const {
    if (waiting_ > 0 || release_ || press_ > 0 || next_ >= lines_.size()) return false;
    const std::string& verb = lines_[next_].words[0];
    return verb == "shot" || verb == "boxes" || verb == "instructor";
}

InjectedInput InputScript::next(double now_s, bool ready, std::string& shot, bool& quit) {
    input_.wheel = 0;
    of_instructor_ = boxes_alone_ = false;
    if (!ready && !release_) return input_;
    if (waiting_ > 0) {
        --waiting_;
        return input_;
    }
    if (release_) {
        input_.keys.clear();
        input_.shift = input_.control = input_.alt = false;
        release_ = false;
        return input_;
    }
    if (press_ > 0) {  // over the control for two pictures, down for one, then up
        --press_;
        input_.buttons[0] = press_ == 1;
        return input_;
    }
    if (next_ >= lines_.size()) return input_;
    const Line& line = lines_[next_++];
    const auto number = [&](std::size_t i) { return std::strtod(line.words[i].c_str(), nullptr); };
    const auto modifiers = [&](std::size_t from) {
        for (std::size_t i = from; i < line.words.size(); ++i) {
            if (line.words[i] == "shift") input_.shift = true;
            if (line.words[i] == "ctrl") input_.control = true;
            if (line.words[i] == "alt") input_.alt = true;
        }
    };
    const std::string& verb = line.words[0];
    if (verb == "wait") {
        waiting_ = static_cast<int>(number(1)) - 1;
    } else if (verb == "key") {
        input_.keys = {key_code(line.words[1])};
        modifiers(2);
        release_ = true;
    } else if (verb == "hold") {
        input_.keys = {key_code(line.words[1])};
        modifiers(3);
        waiting_ = static_cast<int>(number(2)) - 1;
        release_ = true;
    } else if (verb == "move") {
        input_.x = static_cast<float>(number(1));
        input_.y = static_cast<float>(number(2));
    } else if (verb == "down" || verb == "up") {
        input_.buttons[static_cast<std::size_t>(number(1))] = verb == "down";
    } else if (verb == "wheel") {
        input_.wheel = static_cast<float>(number(1));
    } else if (verb == "press") {
        std::string name = line.words[1];
        for (std::size_t i = 2; i < line.words.size(); ++i) name += " " + line.words[i];
        if (find_ && find_(name, input_.x, input_.y)) press_ = 4;
    } else if (verb == "shot" || verb == "boxes" || verb == "instructor") {
        shot = line.words[1];
        of_instructor_ = verb == "instructor";
        boxes_alone_ = verb == "boxes";
    } else if (verb == "only-shots") {
        only_shots_ = true;
    } else if (verb == "loop") {
        if (now_s < number(1)) next_ = 0;
    } else if (verb == "quit") {
        quit = true;
    }
    return input_;
}

}  // namespace sonocase::runtime::inline display
