// SPDX-License-Identifier: Apache-2.0

#include "pipeline/stages/stage_runner.h"

#include <algorithm>
#include <cassert>
#include <string_view>
#include <utility>

#include "formats/base/digest.h"
#include "pipeline/base/memory_limit.h"
#include "pipeline/base/stopwatch.h"

namespace sonocase::pipeline::inline stages {

namespace {

std::string key_of(std::string_view kind,
                   const PlannedStage& stage,
                   const std::vector<std::string>& inputs) {
    Digest digest;
    digest.add(kind).add(std::string_view(stage.stage));
    digest.add(std::int64_t{stage.descriptor->version});
    for (const auto* texts : {&stage.own, &inputs})
        for (const std::string& text : *texts) digest.add(std::string_view(text));
    return digest.hex();
}

// Index in the plan of the last stage that provides a role.
std::size_t provider_of(const std::string& role, const std::vector<PlannedStage>& plan) {
    std::size_t i = plan.size();
    while (i > 0 && plan[i - 1].descriptor->provides != role) --i;
    assert(i > 0 && "a stage takes a role that no stage before it provides");
    return i - 1;
}

std::vector<std::string> own_texts(const StageDescriptor& stage,
                                   const Recipe& recipe,
                                   const InputDigests& inputs) {
    std::vector<std::string> own;
    if (stage.key_texts) own = stage.key_texts(recipe, inputs);
    const StageSettings& settings = recipe.settings;
    const OptionGroup& common = settings.table().common;
    if (!stage.options.options.empty())
        own.push_back(stage.options.text(settings.values(stage.options)));
    if (stage.seeded && !common.options.empty())
        own.push_back(common.text(settings.values(common)));
    return own;
}

void add_needs(const PlannedStage& input,
               const std::vector<PlannedStage>& plan,
               std::vector<std::string>* needs) {
    if (input.is_step()) {
        for (const std::size_t i : input.inputs) add_needs(plan[i], plan, needs);
    } else if (std::find(needs->begin(), needs->end(), input.stage) == needs->end()) {
        needs->push_back(input.stage);
    }
}

}  // namespace

std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs) {
    std::vector<PlannedStage> plan;
    for (const StageDescriptor& stage : recipe.settings.table().stages) {
        if (stage.active && !stage.active(recipe)) continue;
        PlannedStage planned;
        planned.stage = stage.name;
        planned.descriptor = &stage;
        planned.own = own_texts(stage, recipe, inputs);
        std::vector<std::string> keys;
        for (const std::string& role : stage.takes) {
            const std::size_t i = provider_of(role, plan);
            planned.inputs.push_back(i);
            keys.push_back(plan[i].plan_key);
            add_needs(plan[i], plan, &planned.needs);
        }
        planned.plan_key = key_of("sonocase plan", planned, keys);
        plan.push_back(std::move(planned));
    }
    return plan;
}

std::string cache_key(const PlannedStage& stage, const std::vector<std::string>& digests) {
    return key_of("sonocase stage", stage, digests);
}

StageRunner::StageRunner(const Recipe& recipe,
                         const std::vector<PlannedStage>& plan,
                         const RunnerOptions& options,
                         const Progress& progress)
    : recipe_(recipe),
      plan_(plan),
      cache_(options.cache_folder, options.cache_bytes),
      progress_(progress),
      slots_(plan.size()),
      goal_(plan.size() - 1) {
    double sum = 0;
    for (const PlannedStage& stage : plan) sum += stage.descriptor->share;
    double done = 0;
    for (std::size_t i = 0; i < plan.size(); ++i) {
        slots_[i].begin = done;
        slots_[i].share = sum > 0 ? plan[i].descriptor->share / sum : 0;
        done += slots_[i].share;
        if (plan[i].stage == options.until) goal_ = i;
    }
    needed_.assign(plan.size(), false);
    needed_[goal_] = true;
    for (std::size_t i = goal_ + 1; i-- > 0;)
        if (needed_[i])
            for (const std::size_t input : plan[i].inputs) needed_[input] = true;
}

Status StageRunner::run() {
    for (std::size_t i = 0; i <= goal_; ++i) {
        if (!wanted(i) && !needed_[i]) continue;
        if (auto status = look_up_or_obtain(i); !status) return status;
        let_go_after(i);
    }
    return Done{};
}

Status StageRunner::look_up_or_obtain(std::size_t i) {
    const StageDescriptor& stage = *plan_[i].descriptor;
    Slot& slot = slots_[i];
    if (cache_.enabled()) {
        std::vector<std::string> digests;
        for (const std::size_t input : plan_[i].inputs) digests.push_back(slots_[input].digest);
        slot.key = cache_key(plan_[i], digests);
        const bool step_known_by_key = plan_[i].is_step() && !stage.digest;
        if (step_known_by_key) slot.digest = slot.key;
        if (!wanted(i)) {
            if (step_known_by_key) return Done{};
            const auto digest = stage.codec ? cache_.digest_in(stage.name, slot.key) : std::nullopt;
            if (digest) {
                slot.digest = *digest;
                return Done{};
            }
        }
    }
    return obtain(i);
}

// Reads the result from the cache, or makes it and stores it there.
Status StageRunner::obtain(std::size_t i) {
    const StageDescriptor& stage = *plan_[i].descriptor;
    Slot& slot = slots_[i];
    const std::string promised = slot.digest;
    const Progress progress = [this, &slot](double fraction, std::string_view doing) {
        report_progress(progress_, slot.begin + slot.share * fraction, doing);
    };
    progress(0, stage.name);
    bool damaged = false;
    if (!read(i, &damaged))
        if (auto status = make(i, damaged, progress); !status) return status;
    if (!promised.empty() && slot.digest != promised)
        return Error{"stage " + stage.name + " gave another result than the one in the cache",
                     cache_.path_of(stage.name, slot.key),
                     "run again; if it happens again, the stage's version was not raised"};
    if (stage.warnings)
        for (const std::string& warning : stage.warnings(slot.value))
            step_warnings_.push_back(warning);
    if (stage.check && wanted(i)) return stage.check(recipe_, slot.value);
    return Done{};
}

bool StageRunner::read(std::size_t i, bool* damaged) {
    const StageDescriptor& stage = *plan_[i].descriptor;
    Slot& slot = slots_[i];
    if (!stage.codec) return false;
    const auto entry = cache_.find(stage.name, slot.key, damaged);
    if (!entry) return false;
    auto value = stage.codec.decode(entry->bytes, cache_.path_of(stage.name, slot.key));
    if (!value) {
        *damaged = true;
        return false;
    }
    slot.value = std::move(*value);
    slot.digest = entry->digest;
    keep_reports(i, entry->seconds, true, {});
    return true;
}

Status StageRunner::make(std::size_t i, bool damaged, const Progress& progress) {
    const StageDescriptor& stage = *plan_[i].descriptor;
    Slot& slot = slots_[i];
    StageInputs inputs = inputs_of(i);
    const Stopwatch watch;
    const double processor_before = processor_seconds();
    SONOCASE_TRY(auto value, stage.run(inputs, progress));
    const double seconds = watch.seconds();
    processor_seconds_ = processor_seconds() - processor_before;
    slot.value = std::move(value);
    give_memory_back();
    std::vector<std::string> notes;
    if (damaged) notes.push_back("a damaged cache entry was made again");
    if (cache_.enabled() && stage.codec) {
        CacheEntry entry{stage.codec.encode(slot.value), "", seconds};
        slot.digest = entry.digest = digest_of(entry.bytes);
        if (auto status = cache_.store(stage.name, slot.key, entry);
            !status && !std::exchange(cache_fault_told_, true))
            notes.push_back("the cache could not be written (" + status.error().message() +
                            "): the case is cooked all the same, and will be anew next time");
    }
    if (stage.digest) slot.digest = stage.digest(slot.value);
    keep_reports(i, seconds, false, std::move(notes));
    return Done{};
}

void StageRunner::keep_reports(std::size_t i,
                               double seconds,
                               bool cached,
                               std::vector<std::string> notes) {
    const StageDescriptor& stage = *plan_[i].descriptor;
    if (!stage.reports) return;
    std::vector<StageReport> reports = stage.reports(slots_[i].value);
    // A stage of several parts (align, warp) knows its parts' shares itself when it has just run;
    // from the cache, whose entries hold no seconds, the first part carries the sum.
    double known = 0;
    for (const StageReport& report : reports) known += report.seconds;
    for (std::size_t n = 0; n < reports.size(); ++n) {
        StageRun run{std::move(reports[n]),
                     stage.codec ? slots_[i].key : "",
                     cached,
                     n == 0 && !cached ? processor_seconds_ : 0,
                     {}};
        if (known <= 0) run.report.seconds = n == 0 ? seconds : 0;
        runs.push_back(std::move(run));
    }
    if (reports.empty()) return;
    StageRun& last = runs.back();
    last.cache_notes = std::move(notes);
    last.report.warnings.insert(last.report.warnings.end(), step_warnings_.begin(),
                                step_warnings_.end());
    step_warnings_.clear();
}

StageInputs StageRunner::inputs_of(std::size_t i) {
    std::vector<StageReport> reported;
    for (const StageRun& run : runs) reported.push_back(run.report);
    return StageInputs(
        recipe_,
        [this, i](const std::string& role) -> Result<StageValue> {
            const std::vector<std::string>& takes = plan_[i].descriptor->takes;
            const auto found = std::find(takes.begin(), takes.end(), role);
            assert(found != takes.end() && "a stage asks for a role that it does not take");
            const std::size_t input = plan_[i].inputs[found - takes.begin()];
            if (!slots_[input].value) SONOCASE_TRY_DONE(obtain(input));
            return slots_[input].value;
        },
        std::move(reported));
}

void StageRunner::let_go_after(std::size_t i) {
    for (std::size_t input = 0; input <= i; ++input) {
        bool taken = input == goal_;
        for (std::size_t later = i + 1; later <= goal_; ++later) {
            const std::vector<std::size_t>& inputs = plan_[later].inputs;
            taken = taken || std::find(inputs.begin(), inputs.end(), input) != inputs.end();
        }
        if (!taken) slots_[input].value = {};
    }
}

}  // namespace sonocase::pipeline::inline stages
