// SPDX-License-Identifier: Apache-2.0

#include "formats/recording/acts.h"

#include <algorithm>
#include <cmath>

#include "formats/text/number_text.h"

namespace sonocase {

const std::vector<std::string>& act_names() {
    static const std::vector<std::string> names{
        "inject",   "aspirate", "core_throw", "wire", "dilate",   "catheter", "drain",
        "compress", "rescan",   "answer",     "tilt", "valsalva", "turn"};
    return names;
}

bool ActList::add(const Act& act) {
    if (count >= kMaxActs) return false;
    acts[static_cast<std::size_t>(count++)] = act;
    return true;
}

std::string acts_text(const ActList& list) {
    std::string text;
    for (int i = 0; i < list.count; ++i) {
        const Act& act = list.acts[static_cast<std::size_t>(i)];
        if (!text.empty()) text += ";";
        text += act_names()[static_cast<std::size_t>(act.kind)];
        if (act.index != 0) text += ":" + std::to_string(act.index);
        text += "=" + number_text(act.amount);
    }
    return text;
}

ActList acts_of(std::string_view text, std::string* unread) {
    ActList list;
    const auto skip = [&](std::string_view one) {
        if (unread && unread->empty()) *unread = one;
    };
    while (!text.empty()) {
        const std::string_view one = trimmed(text.substr(0, text.find(';')));
        const std::size_t end = text.find(';');
        text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
        if (one.empty()) continue;
        Act act;
        const std::size_t equal = one.find('=');
        std::string_view name = trimmed(one.substr(0, equal));
        const std::size_t colon = name.find(':');
        std::int64_t index = 0;
        bool ok = true;
        if (colon != std::string_view::npos) {
            ok = parse_number(name.substr(colon + 1), index) && index >= 0 && index < 1000;
            name = trimmed(name.substr(0, colon));
        }
        const auto& names = act_names();
        const auto found = std::find(names.begin(), names.end(), name);
        ok = ok && found != names.end();
        act.amount = 1;
        if (equal != std::string_view::npos)
            ok = ok && parse_number(one.substr(equal + 1), act.amount);
        ok = ok && std::isfinite(act.amount) && std::abs(act.amount) <= 1e5;
        if (ok) {
            act.kind = static_cast<ActKind>(found - names.begin());
            act.index = static_cast<int>(index);
            ok = list.add(act);
        }
        if (!ok) skip(one);
    }
    return list;
}

}  // namespace sonocase
