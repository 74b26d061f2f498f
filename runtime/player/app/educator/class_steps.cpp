// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/educator/class_steps.h"

#include <algorithm>
#include <filesystem>

#include "formats/files/atomic_file.h"
#include "runtime/player/app/kept/user_folders.h"
#include "runtime/player/app/progress_steps.h"

namespace sonocase::runtime {

const ClassRecords& class_records(App& app) {
    std::optional<ClassRecords>& kept = app.view.class_records;
    if (kept) return *kept;
    kept.emplace();
    std::error_code ignored;
    if (!std::filesystem::exists(default_progress_path(), ignored)) return *kept;
    auto book = ProgressBook::open(default_progress_path());
    auto entries = book ? book->sessions("", "") : Result<std::vector<ProgressEntry>>(book.error());
    if (!entries) {
        app.view.notices.error(entries.error().message());
        return *kept;
    }
    kept = make_class_records(std::move(*entries), {app.player.settings.experts.begin(),
                                                    app.player.settings.experts.end()});
    return *kept;
}

bool is_expert(const App& app, const std::string& trainee) {
    const auto& experts = app.player.settings.experts;
    return std::find(experts.begin(), experts.end(), trainee) != experts.end();
}

void toggle_expert(App& app, const std::string& trainee) {
    auto& experts = app.player.settings.experts;
    if (is_expert(app, trainee)) {
        std::erase(experts, trainee);
    } else {
        experts.push_back(trainee);
    }
    app.view.class_records.reset();
}

void save_class_file(App& app, const std::string& kind) {
    const std::string folder = data_folder() + "/class";
    std::error_code failed;
    if (!data_folder().empty()) std::filesystem::create_directories(folder, failed);
    std::string text;
    if (kind == "csv") {
        auto book = ProgressBook::open(default_progress_path());
        auto csv = book ? book->csv("", "") : Result<std::string>(book.error());
        if (!csv) {
            app.view.notices.error(csv.error().message());
            return;
        }
        text = std::move(*csv);
    } else {
        text = xapi_json(class_records(app).entries);
    }
    const std::string path = folder + (kind == "csv" ? "/attempts.csv" : "/statements.json");
    if (const Status saved = write_file(path, text); !saved) {
        app.view.notices.error(saved.error().message());
    } else {
        app.view.notices.news("Saved as " + path + ".");
    }
}

void remove_from_class(App& app, const std::string& trainee) {
    auto book = ProgressBook::open(default_progress_path());
    std::vector<std::string> left;
    const Status removed = book ? book->remove_trainee(trainee, &left) : Status(book.error());
    if (!removed) {
        app.view.notices.error(removed.error().message());
    } else if (!left.empty()) {
        app.view.notices.warning(left.front() + " could not be deleted.");
    }
    app.view.class_records.reset();
    app.view.class_trainee.clear();
    sign_in(app, app.player.trainee == trainee ? "" : app.player.trainee);
}

}  // namespace sonocase::runtime
