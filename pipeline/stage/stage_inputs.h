// SPDX-License-Identifier: Apache-2.0

// What a stage's `run` is given: the recipe with the options, and the results that it takes.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "formats/base/result.h"
#include "formats/base/stage_report.h"
#include "pipeline/stage/recipe.h"
#include "pipeline/stage/stage_value.h"

namespace sonocase::pipeline {

class StageInputs {
  public:
    using Find = std::function<Result<StageValue>(const std::string& role)>;

    // find      the result under a role
    // reported  what the stages so far have reported
    StageInputs(const Recipe& recipe, Find find, std::vector<StageReport> reported = {})
        : recipe_(recipe), find_(std::move(find)), reported_(std::move(reported)) {}

    const Recipe& recipe() const { return recipe_; }
    const std::vector<StageReport>& reported() const { return reported_; }

    template <class Options>
    const Options& options(const std::string& stage) const {
        return recipe_.settings.of<Options>(stage);
    }

    // The result under one of the roles that the stage takes. It may still be in the cache, and is
    // read or made when it is asked for; errors are those of the stage that makes it.
    template <class T>
    Result<const T*> get(const std::string& role) {
        auto value = find_(role);
        if (!value) return value.error();
        held_.push_back(*value);
        return &held_.back().as<T>();
    }

  private:
    const Recipe& recipe_;
    Find find_;
    std::vector<StageReport> reported_;
    std::vector<StageValue> held_;  // keeps what was asked for alive
};

}  // namespace sonocase::pipeline
