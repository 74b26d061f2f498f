// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/training/case_cards.h"

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <map>
#include <mutex>
#include <thread>

#include "runtime/engine/scan_engine.h"
#include "runtime/player/session/case_set_up.h"
#include "runtime/tracking/mouse_tracker.h"

namespace sonocase::runtime {
namespace {

constexpr int kWidthPx = 416, kHeightPx = 260;

// The same file as before, as far as size and time of change say.
std::string state_of(const std::string& path) {
    std::error_code failed;
    const auto size = std::filesystem::file_size(path, failed);
    const auto time = std::filesystem::last_write_time(path, failed);
    return std::to_string(size) + "/" + std::to_string(time.time_since_epoch().count());
}

void draw_picture(const OpenCase& open, CaseCard& card) {
    const Exercise& exercise = open.exercises.front();
    PlayerArguments arguments;
    ImageChoice image = initial_image(arguments, exercise);
    image.width_px = kWidthPx;
    image.height_px = kHeightPx;
    image.depth_mm = exercise.probe.depth_mm;
    image.focus_mm = exercise.probe.focus_mm;
    Result<ScanEngine> engine = make_engine(open, exercise, arguments, image);
    if (!engine) return;
    MouseTracker mouse(Skin(*open.bundle), exercise);
    TrackerReading reading;
    mouse.poll(0, reading);
    engine->observe(reading, false);
    std::vector<std::uint8_t> pixels(static_cast<std::size_t>(kWidthPx) * kHeightPx);
    if (engine->frame(0.1, {}, pixels) != FrameStatus::rendered) return;
    card.width_px = kWidthPx;
    card.height_px = kHeightPx;
    card.pixels = std::move(pixels);
}

}  // namespace

CaseCard make_case_card(const std::string& path) {
    CaseCard card;
    card.path = path;
    const auto open = open_case_to_render(path);
    if (!open) {
        card.fault = open.error().message();
        return card;
    }
    card.case_name = (*open)->bundle->manifest.case_name;
    for (const Exercise& exercise : (*open)->exercises)
        card.exercises.push_back({exercise.name,
                                  exercise.title.empty() ? exercise.name : exercise.title,
                                  exercise.mastery, exercise.difficulty});
    draw_picture(**open, card);
    return card;
}

struct CaseCards::Impl {
    mutable std::mutex mutex;
    std::condition_variable wake;
    std::deque<std::string> wanted;
    std::map<std::string, std::string> states;  // of the files that were read or are being read
    std::map<std::string, std::shared_ptr<const CaseCard>> cards;
    bool working = false, stop = false;
    std::thread thread;

    void run() {
        std::unique_lock lock(mutex);
        for (;;) {
            wake.wait(lock, [this] { return stop || !wanted.empty(); });
            if (stop) return;
            const std::string path = wanted.front();
            wanted.pop_front();
            working = true;
            lock.unlock();
            auto card = std::make_shared<const CaseCard>(make_case_card(path));
            lock.lock();
            cards[path] = std::move(card);
            working = false;
        }
    }
};

CaseCards::CaseCards() : impl_(std::make_unique<Impl>()) {}

CaseCards::~CaseCards() {
    {
        const std::lock_guard lock(impl_->mutex);
        impl_->stop = true;
    }
    impl_->wake.notify_all();
    if (impl_->thread.joinable()) impl_->thread.join();
}

void CaseCards::want(const std::vector<std::string>& paths) {
    {
        const std::lock_guard lock(impl_->mutex);
        impl_->wanted.clear();
        for (const std::string& path : paths) {
            const std::string state = state_of(path);
            const bool known = impl_->states[path] == state;
            if (known && impl_->cards.count(path)) continue;
            impl_->states[path] = state;
            impl_->wanted.push_back(path);
        }
        if (!impl_->wanted.empty() && !impl_->thread.joinable())
            impl_->thread = std::thread([this] { impl_->run(); });
    }
    impl_->wake.notify_all();
}

std::shared_ptr<const CaseCard> CaseCards::find(const std::string& path) const {
    const std::lock_guard lock(impl_->mutex);
    const auto found = impl_->cards.find(path);
    return found == impl_->cards.end() ? nullptr : found->second;
}

bool CaseCards::busy() const {
    const std::lock_guard lock(impl_->mutex);
    return impl_->working || !impl_->wanted.empty();
}

}  // namespace sonocase::runtime
