// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/core/effect_table.h"

#include <algorithm>

#include "formats/text/nearest_name.h"

namespace sonocase::runtime {
namespace {

bool turns_off(const std::string& name) {
    return !name.empty() && name[0] == '-';
}

bool begins_with_all(std::span<const std::string> requested) {
    return std::any_of(requested.begin(), requested.end(),
                       [](const std::string& n) { return n == "auto" || n == "all"; }) ||
           std::all_of(requested.begin(), requested.end(), turns_off);
}

Error unknown_effect(const std::string& name, std::span<const char* const> own) {
    std::vector<std::string> known{"auto", "all", "none"};
    known.insert(known.end(), own.begin(), own.end());
    const std::string nearest = nearest_name(name, known);
    return Error{"no effect is called " + name, "effects",
                 nearest.empty() ? "auto, all, none, or names of docs/effects.md"
                                 : "did you mean " + nearest + "?"};
}

}  // namespace

Result<EffectChoice> choose_effects(std::span<const std::string> requested,
                                    std::span<const char* const> own,
                                    std::span<const char* const> others) {
    EffectChoice choice;
    choice.on.assign(own.size(), begins_with_all(requested));
    for (const std::string& given : requested) {
        if (given == "auto" || given == "none") continue;
        if (given == "all") {
            choice.keep_all = true;
            continue;
        }
        const std::string name = turns_off(given) ? given.substr(1) : given;
        const auto it = std::find(own.begin(), own.end(), name);
        if (it != own.end()) {
            choice.on[it - own.begin()] = !turns_off(given);
        } else if (std::find(others.begin(), others.end(), name) == others.end()) {
            return unknown_effect(name, own);
        }
    }
    return choice;
}

}  // namespace sonocase::runtime
