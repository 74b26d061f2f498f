// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/attempt.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "runtime/player/app/settings.h"
#include "runtime/player/session/clock.h"
#include "runtime/recording/session_words.h"

namespace sonocase::runtime::inline player_app {
UnkeptRecording::UnkeptRecording() {
    std::error_code failed;
    const std::filesystem::path all = std::filesystem::temp_directory_path(failed);
    if (failed) return;
    std::string name = (all / "sonoplay-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) return;
    folder_ = name;
    path_ = folder_ + "/attempt.igs.mha";
}

UnkeptRecording::~UnkeptRecording() {
    std::error_code ignored;
    if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

std::string new_session_path(const std::string& case_name, const std::string& exercise) {
    if (data_folder().empty()) return {};
    const std::string folder = data_folder() + "/sessions";
    std::error_code failed;
    std::filesystem::create_directories(folder, failed);
    if (failed) return {};
    std::string stamp = utc_now();
    stamp.erase(
        std::remove_if(stamp.begin(), stamp.end(), [](char c) { return c == ':' || c == '-'; }),
        stamp.end());
    std::string name = stamp + "_" + case_name + "_" + exercise;
    for (char& c : name) {
        const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') ||
                           (c >= 'A' && c <= 'Z') || c == '-' || c == '_';
        if (!plain) c = '-';
    }
    std::string path = folder + "/" + name + ".igs.mha";
    for (int n = 2; std::filesystem::exists(path, failed); ++n) {
        path = folder + "/" + name + "_" + std::to_string(n) + ".igs.mha";
    }
    return path;
}

void Attempt::observe(const FrameRecord& record,
                      int width_px,
                      int height_px,
                      const Renderer::Layout& layout,
                      std::span<const std::uint8_t> pixels) {
    run_->set_picture(width_px, height_px, layout);
    const std::span<const LiveEvent> events = run_->observe(record, pixels);
    const SessionMonitor& monitor = run_->monitor();
    const std::lock_guard lock(mutex_);
    view_.seconds = record.input.time_s;
    view_.insertions = monitor.insertions();
    view_.targets_hit = monitor.targets_hit();
    view_.depth_mm = monitor.depth_mm();
    view_.tip_in_view = monitor.tip_in_view();
    view_.in_no_go = monitor.in_no_go();
    for (const LiveEvent& event : events) {
        Message words = event_words(event, exercise_, open_->bundle->labels);
        if (words.empty()) continue;
        view_.events.push_back(std::move(words));
        if (view_.events.size() > 6) view_.events.erase(view_.events.begin());
    }
}

AttemptView Attempt::view() const {
    AttemptView view;
    {
        const std::lock_guard lock(mutex_);
        view = view_;
    }
    view.problem = run_->recorder_status().problem;
    return view;
}

}  // namespace sonocase::runtime::inline player_app
