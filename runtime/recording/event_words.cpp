// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/event_words.h"

#include <algorithm>
#include <cstdio>

namespace sonocase::runtime {

std::string event_words(const LiveEvent& event,
                        const Exercise& exercise,
                        const std::vector<Label>& labels) {
    const auto target = [&] {
        const auto i = static_cast<std::size_t>(event.index);
        return event.index >= 0 && i < exercise.targets.size() && !exercise.targets[i].name.empty()
                   ? exercise.targets[i].name
                   : "target " + std::to_string(event.index + 1);
    };
    const auto label = [&] {
        const auto i = static_cast<std::size_t>(event.index);
        std::string name = event.index >= 0 && i < labels.size() ? labels[i].name : "a structure";
        std::replace(name.begin(), name.end(), '_', ' ');
        return name;
    };
    char number[32];
    std::snprintf(number, sizeof number, "%.0f mm", event.value);
    switch (event.kind) {
        case LiveEventKind::needle_entry: return "Insertion " + std::to_string(event.index);
        case LiveEventKind::needle_exit: return std::string("Needle out, was ") + number + " deep";
        case LiveEventKind::target_hit: return "Reached: " + target();
        case LiveEventKind::target_scanned: return "Seen: " + target();
        case LiveEventKind::no_go_contact: return "Touched: " + label();
        case LiveEventKind::no_go_left: return "Left: " + label();
        case LiveEventKind::needle_lost: return "Needle lost";
        case LiveEventKind::probe_lost: return "Probe lost";
        default: return {};
    }
}

}  // namespace sonocase::runtime
