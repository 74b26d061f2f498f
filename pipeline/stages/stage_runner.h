// SPDX-License-Identifier: Apache-2.0

// Plans which stages a case has, what each depends on and the key of each, and runs them one after
// the other, each through the cache.
//
// There are two kinds of key. The cache's key (cache_key) takes the digests of the results before,
// known only once those exist: when a stage gives the same result as before, what follows is found
// in the cache. The plan's key takes the plan keys of the stages before, known without running
// anything: as long as it stays the same, nothing that the stage depends on has changed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/stages/stage_cache.h"
#include "pipeline/stages/stage_table.h"

namespace sonocase::pipeline::inline stages {

struct PlannedStage {
    std::string stage;
    const StageDescriptor* descriptor = nullptr;
    std::vector<std::string> own;     // texts and digests besides the results of other stages
    std::vector<std::size_t> inputs;  // in the plan; # descriptor->takes
    std::vector<std::string> needs;   // stages whose results it takes, directly or through steps
    std::string plan_key;

    // Steps run with the stage that needs them, and are no jobs of their own.
    bool is_step() const { return !descriptor->reports; }
};

// The stages and steps of a case in the order in which they run, by the table of the recipe's
// settings. A role that nothing provides is a mistake in the table: assert.
std::vector<PlannedStage> plan_stages(const Recipe& recipe, const InputDigests& inputs);

// digests  those of the results taken, # inputs
std::string cache_key(const PlannedStage& stage, const std::vector<std::string>& digests);

// One part of a stage as it ran or was read.
struct StageRun {
    StageReport report;  // with the seconds of the run that made the result
    std::string key;     // in the cache; empty without one
    bool from_cache = false;
    double processor_seconds = 0;          // of this run; the first part of a stage carries the sum
    std::vector<std::string> cache_notes;  // what happened in the cache; not part of the result
};

struct RunnerOptions {
    std::string cache_folder;       // empty: no cache
    std::uint64_t cache_bytes = 0;  // bound of the cache; 0: none
    std::string until;              // the stage to stop at; empty: the last of the plan
};

// Runs the stages of a case one after the other, and keeps their reports.
//
// A stage that is wanted is read from the cache, or run and stored there. Stages before the one
// that a run stops at are only looked up: the digest of their result is enough for the keys that
// follow, and the result itself is read when a stage asks for it. A result is freed as soon as no
// later stage takes it.
class StageRunner {
  public:
    // All of them must outlive the runner; options.until must be in the plan.
    StageRunner(const Recipe& recipe,
                const std::vector<PlannedStage>& plan,
                const RunnerOptions& options,
                const Progress& progress);

    // Errors: those of the stages; a result that is not the one whose digest was promised.
    Status run();

    std::vector<StageRun> runs;  // of the results that were made or read, in that order

    // The result, and its digest, of the stage that run() stopped at.
    StageValue result() const { return slots_[goal_].value; }
    const std::string& digest() const { return slots_[goal_].digest; }

  private:
    struct Slot {
        StageValue value;    // empty: not needed yet, or no longer
        std::string digest;  // stands for the value in later keys; empty without a cache
        std::string key;
        double begin = 0, share = 0;  // of the whole run's progress
    };

    bool wanted(std::size_t i) const { return i == goal_ || goal_ + 1 == plan_.size(); }
    Status look_up_or_obtain(std::size_t i);
    Status obtain(std::size_t i);
    Status make(std::size_t i, bool damaged, const Progress& progress);
    bool read(std::size_t i, bool* damaged);
    void keep_reports(std::size_t i, double seconds, bool cached, std::vector<std::string> notes);
    double processor_seconds_ = 0;  // of the stage made last
    StageInputs inputs_of(std::size_t i);
    void let_go_after(std::size_t i);

    const Recipe& recipe_;
    const std::vector<PlannedStage>& plan_;
    StageCache cache_;
    const Progress& progress_;
    std::vector<Slot> slots_;  // # plan
    std::size_t goal_ = 0;
    bool cache_fault_told_ = false;  // told once: the cause of one fault is that of all
    std::vector<bool> needed_;       // # plan: what the goal takes, directly or through others
    std::vector<std::string> step_warnings_;  // for the next stage's report
};

}  // namespace sonocase::pipeline::inline stages
