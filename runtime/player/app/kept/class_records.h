// SPDX-License-Identifier: Apache-2.0

// What an educator looks at: every trainee's standing with every exercise, out of the progress book
// of this machine.
#pragma once

#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "formats/progress_book/progress_book.h"
#include "runtime/player/app/kept/reliability.h"
#include "runtime/player/training/attempt_result.h"

namespace sonocase::runtime {

struct ClassRecords {
    std::vector<ProgressEntry> entries;                 // oldest first
    std::vector<std::string> trainees, exercises;       // those that occur, sorted
    std::map<std::string, std::vector<double>> curves;  // trainee -> tip to target, mm, by attempt
    std::map<std::string, ExerciseReliability> reliability;  // exercise ->
    std::string sentence;  // who needs help, in the language in use; empty: nobody

    Standing standing(const std::string& trainee, const std::string& exercise) const;
};

// experts: trainees whom the educator calls so.
ClassRecords make_class_records(std::vector<ProgressEntry> entries,
                                const std::set<std::string>& experts = {});

// Statements of the Experience API 1.0.3, one per attempt, as a JSON array. Trainees are accounts
// of this machine, not mail addresses.
std::string xapi_json(std::span<const ProgressEntry> entries);

}  // namespace sonocase::runtime
