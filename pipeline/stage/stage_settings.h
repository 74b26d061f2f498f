// SPDX-License-Identifier: Apache-2.0

// The values of all options of a case: one options struct per stage.
//
//     StageSettings settings(built_in_stages());
//     settings.set("resample.voxel_mm", "0.5", "--set");
//     settings.of<ResampleOptions>("resample").voxel_mm;    // 0.5
#pragma once

#include <any>
#include <map>
#include <string>
#include <string_view>

#include "formats/base/result.h"
#include "pipeline/stage/option.h"

namespace sonocase::pipeline {

struct StageTable;

class StageSettings {
  public:
    StageSettings() = default;  // no stages, no options
    // Every option at its default. The table must outlive the settings.
    explicit StageSettings(const StageTable& table);

    const StageTable& table() const { return *table_; }

    // The options struct of a stage, or of the table's common options. The stage must be in the
    // table, and T must be its type.
    template <class T>
    T& of(const std::string& stage) {
        return std::any_cast<T&>(values_.at(stage));
    }
    template <class T>
    const T& of(const std::string& stage) const {
        return std::any_cast<const T&>(values_.at(stage));
    }
    std::any& options(const std::string& stage) { return values_.at(stage); }
    const std::any& options(const std::string& stage) const { return values_.at(stage); }

    // Sets "section.key" from text. Errors: no such option, with the nearest; a value that the
    // option does not take.
    Status set(const std::string& name, const std::string& value, const std::string& where);

  private:
    const StageTable* table_ = nullptr;
    std::map<std::string, std::any> values_;  // by stage
};

}  // namespace sonocase::pipeline
