// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/effects.h"

#include <algorithm>
#include <array>

#include "formats/text/nearest_name.h"

namespace sonocase::runtime {
namespace {

using P = PaperEffects;
using Y = PhysicalEffects;

constexpr std::array<EffectEntry, 8> kPaper{{
    {"slice", Pass::beams, 5, 2, 5, nullptr, nullptr},
    {"texture", Pass::beams, 3, 1, 1, &P::texture, nullptr},
    {"needle", Pass::needle, 1, 0, 2, &P::needle, nullptr},
    {"noise", Pass::beams, 1, 0, 1, &P::noise, nullptr},
    {"shadow", Pass::beams, 1, 0, 0, &P::shadow, nullptr},
    {"attenuation", Pass::beams, 0.5, 0, 0, &P::attenuation, nullptr},
    {"blur", Pass::filter, 1, 0, 2, &P::blur, nullptr},
    {"scan_conversion", Pass::convert, 1, 1, 7, nullptr, nullptr},
}};

constexpr std::array<EffectEntry, 25> kPhysical{{
    {"contact", Pass::contact, 1, 0, 0, nullptr, &Y::contact},
    {"slice", Pass::beams, 4, 2, 7, nullptr, nullptr},
    {"breathing", Pass::beams, 1, 0, 8, nullptr, &Y::breathing},
    {"pulsation", Pass::beams, 0.1, 0, 0, nullptr, &Y::pulsation},
    {"elevation", Pass::beams, 0.5, 0, 1, nullptr, &Y::elevation},
    {"boundaries", Pass::beams, 3, 3, 12, nullptr, &Y::boundaries},
    {"structure", Pass::beams, 1.5, 2, 5, nullptr, &Y::structure},
    {"fine_structure", Pass::beams, 1, 1, 1, nullptr, &Y::fine_structure},
    {"targets", Pass::beams, 0.5, 1, 4, nullptr, &Y::targets},
    {"speckle", Pass::beams, 2, 1, 2, nullptr, &Y::speckle},
    {"interfaces", Pass::beams, 1, 1, 4, nullptr, &Y::interfaces},
    {"edge_shadow", Pass::beams, 0.3, 0, 0, nullptr, &Y::edge_shadow},
    {"attenuation", Pass::beams, 0.7, 2, 8, nullptr, &Y::attenuation},
    {"bone_tail", Pass::beams, 0.2, 0, 4, nullptr, &Y::bone_tail},
    {"gas_ring_down", Pass::beams, 0.2, 0, 4, nullptr, &Y::gas_ring_down},
    {"needle", Pass::needle, 1, 0, 12, nullptr, &Y::needle},
    {"point_spread", Pass::filter, 5, 0, 0, nullptr, &Y::point_spread},
    {"near_field", Pass::filter, 0.7, 0, 2, nullptr, &Y::near_field},
    {"noise", Pass::filter, 0.7, 0, 2, nullptr, &Y::noise},
    {"persistence", Pass::filter, 0.7, 0, 6, nullptr, &Y::persistence},
    {"haze", Pass::grey, 1, 0, 4, nullptr, &Y::haze},
    {"compression", Pass::grey, 2, 0, 8, nullptr, nullptr},
    {"post_filter", Pass::grey, 1, 0, 0, nullptr, &Y::post_filter},
    {"grey_map", Pass::grey, 0.5, 0, 1, nullptr, &Y::grey_map},
    {"scan_conversion", Pass::convert, 1, 1, 7, nullptr, nullptr},
}};

template <std::size_t N>
constexpr std::array<const char*, N> names_of(const std::array<EffectEntry, N>& table) {
    std::array<const char*, N> names{};
    for (std::size_t i = 0; i < N; ++i) names[i] = table[i].name;
    return names;
}
constexpr auto kPaperNames = names_of(kPaper);
constexpr auto kPhysicalNames = names_of(kPhysical);

}  // namespace

std::span<const EffectEntry> effect_table(ImageModel model) {
    if (model == ImageModel::paper) return kPaper;
    return kPhysical;
}

std::span<const char* const> effect_names(ImageModel model) {
    if (model == ImageModel::paper) return kPaperNames;
    return kPhysicalNames;
}

Result<EffectChoice> choose_effects(ImageModel model, const std::vector<std::string>& names) {
    EffectChoice choice;
    const auto table = effect_table(model);
    const auto set = [&](const EffectEntry& e, bool on) {
        if (e.paper != nullptr) choice.paper.*e.paper = on;
        if (e.physical != nullptr) choice.physical.*e.physical = on;
    };
    // A list that only takes away starts from everything, any other from nothing.
    const bool from_all =
        names.empty() ||
        std::any_of(names.begin(), names.end(),
                    [](const std::string& n) { return n == "auto" || n == "all"; }) ||
        std::all_of(names.begin(), names.end(),
                    [](const std::string& n) { return !n.empty() && n[0] == '-'; });
    for (const EffectEntry& e : table) set(e, from_all);
    for (const std::string& given : names) {
        if (given == "auto" || given == "none") continue;
        if (given == "all") {
            choice.keep_all = true;
            continue;
        }
        const bool off = !given.empty() && given[0] == '-';
        const std::string name = off ? given.substr(1) : given;
        const auto it = std::find_if(table.begin(), table.end(),
                                     [&](const EffectEntry& e) { return name == e.name; });
        // An exercise may name effects of the other model: they do nothing here.
        const auto other =
            effect_table(model == ImageModel::paper ? ImageModel::physical : ImageModel::paper);
        const bool elsewhere = std::any_of(other.begin(), other.end(),
                                           [&](const EffectEntry& e) { return name == e.name; });
        if (it != table.end()) {
            set(*it, !off);
        } else if (!elsewhere) {
            std::vector<std::string> known{"auto", "all", "none"};
            for (const EffectEntry& e : table) known.emplace_back(e.name);
            const std::string nearest = nearest_name(name, known);
            return Error{"no effect is called " + name, "effects",
                         nearest.empty() ? "auto, all, none, or names of docs/effects.md"
                                         : "did you mean " + nearest + "?"};
        }
    }
    return choice;
}

}  // namespace sonocase::runtime
