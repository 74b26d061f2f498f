// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/class_steps.h"

#include <algorithm>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/session/clock.h"

namespace sonocase::runtime::inline player_app {

const ClassRecords& class_records(PlayerState& player) {
    std::optional<ClassRecords>& kept = player.progress.class_records;
    if (kept) return *kept;
    kept.emplace();
    std::error_code ignored;
    if (!std::filesystem::exists(default_progress_path(), ignored)) return *kept;
    auto book = ProgressBook::open(default_progress_path());
    auto entries = book ? book->sessions("", "") : Result<std::vector<ProgressEntry>>(book.error());
    if (!entries) {
        player.notices.error(entries.error().message());
        return *kept;
    }
    const Progress& progress = player.progress;
    kept = make_class_records(
        std::move(*entries), {player.settings.experts.begin(), player.settings.experts.end()},
        progress.courses.empty() ? nullptr : &progress.courses[progress.course], utc_now());
    return *kept;
}

bool is_expert(const Settings& settings, const std::string& trainee) {
    return std::find(settings.experts.begin(), settings.experts.end(), trainee) !=
           settings.experts.end();
}

void toggle_expert(PlayerState& player, const std::string& trainee) {
    auto& experts = player.settings.experts;
    if (is_expert(player.settings, trainee)) {
        std::erase(experts, trainee);
    } else {
        experts.push_back(trainee);
    }
    player.progress.class_records.reset();
}

void save_class_file(PlayerState& player, const std::string& kind) {
    const std::string folder = data_folder() + "/class";
    std::error_code failed;
    if (!data_folder().empty()) std::filesystem::create_directories(folder, failed);
    std::string text;
    if (kind == "csv") {
        auto book = ProgressBook::open(default_progress_path());
        auto csv = book ? book->csv("", "") : Result<std::string>(book.error());
        if (!csv) {
            player.notices.error(csv.error().message());
            return;
        }
        text = std::move(*csv);
    } else {
        text = xapi_json(class_records(player).entries);
    }
    const std::string path = folder + (kind == "csv" ? "/attempts.csv" : "/statements.json");
    if (const Status saved = write_file(path, text); !saved) {
        player.notices.error(saved.error().message());
    } else {
        player.notices.news({"Saved as {}.", {path}});
    }
}

void remove_from_class(PlayerState& player, const std::string& trainee) {
    auto book = ProgressBook::open(default_progress_path());
    const auto removed =
        book ? book->remove_trainee(trainee) : Result<RemovedTrainee>(book.error());
    if (!removed) {
        player.notices.error(removed.error().message());
    } else if (!removed->not_deleted.empty()) {
        player.notices.warning({"{} could not be deleted.", {removed->not_deleted.front()}});
    } else {
        player.notices.news(
            {"Removed: sessions {}, recordings {}, review pages {}.",
             {std::to_string(removed->sessions), std::to_string(removed->recordings),
              std::to_string(removed->reviews)}});
    }
    player.progress.class_records.reset();
    sign_in(player, player.progress.trainee == trainee ? "" : player.progress.trainee);
}

}  // namespace sonocase::runtime::inline player_app
