// SPDX-License-Identifier: Apache-2.0

// The effects of both image models, one entry each, in order of execution: the one table that the
// plan, `--effects`, `--stats`, the on-screen panel and docs/effects.md speak of.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "formats/base/result.h"
#include "runtime/imaging/paper/paper_reference.h"
#include "runtime/imaging/physical/model/physical_frame.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime {

// The timed part of a frame in which an effect is worked out. Effects of one pass are fused into
// one loop; the pass's time is shared among those that ran by their measured weights
// (sonocase_bench, Effect/*), since a clock inside the loop would cost more than they do.
enum class Pass { contact, beams, needle, filter, grey, convert };

struct EffectEntry {
    const char* name;
    Pass pass;
    double weight;          // of the pass's time, relative
    double gathers, bytes;  // scattered reads, and bytes from beyond the first cache, a sample
    bool PaperEffects::*paper = nullptr;  // switch; null: always on
    bool PhysicalEffects::*physical = nullptr;
};

std::span<const EffectEntry> effect_table(ImageModel model);

// Which switches a list of names turns on. "auto" and "all": every one; "none": none; "-name" takes
// one away. An unknown name is an error that names the nearest one.
struct EffectChoice {
    PaperEffects paper;
    PhysicalEffects physical;
    bool keep_all = false;  // "all": nothing is pruned
};
Result<EffectChoice> choose_effects(ImageModel model, const std::vector<std::string>& names);

}  // namespace sonocase::runtime
