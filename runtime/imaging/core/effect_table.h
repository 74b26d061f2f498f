// SPDX-License-Identifier: Apache-2.0

// The effects of an image model as rows of a table, in order of execution, and which of them a list
// of names turns on. What `--effects`, `--stats`, the panel on screen and docs/effects.md say about
// an effect comes from its row.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "formats/base/result.h"
#include "runtime/imaging/core/frame_input.h"

namespace sonocase::runtime {

struct EffectChoice {
    std::vector<bool> on;   // one per effect of the model
    bool keep_all = false;  // "all": also what cannot show is worked out
};

// requested: "auto" and "all" turn on every effect, "none" none, NAME turns one on and -NAME one
// off. A list that only turns off begins with every effect, any other with none.
// own, others: names of the effects of the model, and of other models, which an exercise may name
// too and which do nothing here.
// Error: an unknown name; it suggests the nearest one.
Result<EffectChoice> choose_effects(std::span<const std::string> requested,
                                    std::span<const char* const> own,
                                    std::span<const char* const> others);

// The timed parts of a frame. Effects of one pass are fused into one loop, and the pass's time is
// shared among those that ran by fixed weights, since a clock inside the loop would cost more than
// they do: an estimate. What an effect costs is measured by leaving it out (`sonoplay
// --measure-effects`).
enum class Pass { contact, beams, needle, filter, grey, convert };
inline constexpr std::size_t kPassCount = 6;
using PassTimes = std::array<double, kPassCount>;  // ms

// Switches: the model's struct of one bool per effect. Scene: what the model knows about a frame
// once it is rendered.
template <class Switches, class Scene>
struct EffectEntry {
    const char* name;
    Pass pass;
    double weight;          // share of the pass's time, relative to the other effects
    double gathers, bytes;  // per sample: scattered reads, and bytes from beyond the first cache
    bool Switches::*on = nullptr;  // null: always on
    // Returns "" where the effect ran; null: it always does.
    const char* (*skipped_because)(const Scene& scene) = nullptr;
    const char* called_for_by = "part of every picture";  // why it ran
};

// Fills in the cost of each effect: why it did not run, or its part of its pass's time. scene: null
// after the reference renderer, which leaves out only what is switched off.
template <class Switches, class Scene>
void fill_costs(std::type_identity_t<std::span<const EffectEntry<Switches, Scene>>> table,
                const Switches& switches,
                const Scene* scene,
                const PassTimes& pass_ms,
                std::span<EffectCost> costs) {
    std::array<double, kPassCount> weight{};
    for (std::size_t i = 0; i < table.size(); ++i) {
        const auto& effect = table[i];
        const char* why = "";
        if (effect.on != nullptr && !(switches.*effect.on)) {
            why = "switched off";
        } else if (scene != nullptr && effect.skipped_because != nullptr) {
            why = effect.skipped_because(*scene);
        }
        const bool ran = *why == '\0';
        costs[i] = {effect.name, 0, ran, ran ? effect.called_for_by : why, effect.on != nullptr};
        if (costs[i].ran) weight[static_cast<std::size_t>(effect.pass)] += effect.weight;
    }
    for (std::size_t i = 0; i < table.size(); ++i) {
        const auto pass = static_cast<std::size_t>(table[i].pass);
        if (costs[i].ran) costs[i].ms = pass_ms[pass] * table[i].weight / weight[pass];
    }
}

template <class Entry, std::size_t N>
constexpr std::array<const char*, N> effect_names_of(const std::array<Entry, N>& table) {
    std::array<const char*, N> names{};
    for (std::size_t i = 0; i < N; ++i) names[i] = table[i].name;
    return names;
}

// The switches that a choice of effects turns on; on: one per row of the table.
template <class Switches, class Entry, std::size_t N>
Switches switches_of(const std::array<Entry, N>& table, const std::vector<bool>& on) {
    Switches switches;
    for (std::size_t i = 0; i < N; ++i) {
        if (table[i].on != nullptr) switches.*table[i].on = on[i];
    }
    return switches;
}

// The same without the effect of one row; -1: with all.
template <class Switches, class Entry, std::size_t N>
Switches switches_without(const std::array<Entry, N>& table, Switches switches, int row) {
    if (row >= 0 && table[static_cast<std::size_t>(row)].on != nullptr)
        switches.*table[static_cast<std::size_t>(row)].on = false;
    return switches;
}

}  // namespace sonocase::runtime
