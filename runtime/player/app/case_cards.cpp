// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/case_cards.h"

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>

#include "formats/exercise/case_exercises.h"
#include "runtime/engine/scan_engine.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/session/open_case.h"
#include "runtime/player/words/words.h"
#include "runtime/tracking/mouse_tracker.h"

namespace sonocase::runtime::inline player_app {

namespace fs = std::filesystem;

namespace {

// The first bytes of every bundle (docs/format.md): a file that was cut off or is something else is
// not offered.
bool looks_like_a_bundle(const fs::path& path) {
    constexpr unsigned char kMagic[] = {0x89, 'S', 'O', 'N', 'O'};
    constexpr std::uintmax_t kMinBytes = 64;
    std::error_code failed;
    if (fs::file_size(path, failed) < kMinBytes || failed) return false;
    char first[sizeof kMagic] = {};
    std::ifstream in(path, std::ios::binary);
    return in.read(first, sizeof first) && std::memcmp(first, kMagic, sizeof kMagic) == 0;
}

}  // namespace

std::vector<fs::path> case_folders() {
    std::vector<fs::path> folders;
    if (!data_folder().empty()) folders.push_back(data_folder() + "/cases");
    std::stringstream system(std::getenv("XDG_DATA_DIRS") ? std::getenv("XDG_DATA_DIRS")
                                                          : "/usr/local/share:/usr/share");
    for (std::string root; std::getline(system, root, ':');) {
        if (!root.empty()) folders.push_back(root + "/sonocase/cases");
    }
    folders.push_back(fs::path("."));
    folders.push_back(fs::path("out"));
    return folders;
}

std::vector<fs::path> files_beside_cases(const std::string& name) {
    std::vector<fs::path> files;
    for (const fs::path& folder : case_folders()) {
        std::error_code failed;
        std::vector<fs::path> found;
        for (fs::directory_iterator it(folder, failed), end; !failed && it != end;
             it.increment(failed)) {
            const std::string called = it->path().filename().string();
            if (called == name || called.ends_with("." + name)) found.push_back(it->path());
        }
        std::sort(found.begin(), found.end());
        files.insert(files.end(), found.begin(), found.end());
    }
    return files;
}

std::vector<BundleEntry> find_bundles(const std::vector<std::string>& recent) {
    std::vector<BundleEntry> entries;
    std::set<std::string> seen;
    const auto add = [&](const fs::path& path, bool is_recent) {
        std::error_code failed;
        const fs::path whole = fs::weakly_canonical(path, failed);
        if (failed || !fs::is_regular_file(whole, failed)) return;
        if (!looks_like_a_bundle(whole)) return;
        if (!seen.insert(whole.string()).second) return;
        BundleEntry entry;
        entry.path = whole.string();
        entry.name = whole.stem().string();
        entry.folder = whole.parent_path().string();
        entry.megabytes = static_cast<double>(fs::file_size(whole, failed)) / 1e6;
        entry.recent = is_recent;
        entries.push_back(entry);
    };
    for (const std::string& path : recent) add(path, true);
    for (const fs::path& folder : case_folders()) {
        std::error_code failed;
        std::vector<fs::path> found;
        for (fs::directory_iterator it(folder, failed), end; !failed && it != end;
             it.increment(failed)) {
            if (it->path().extension() == ".sonocase") found.push_back(it->path());
        }
        std::sort(found.begin(), found.end());
        for (const fs::path& path : found) add(path, false);
    }
    return entries;
}

void remember_bundle(const std::string& path, std::vector<std::string>& recent) {
    std::error_code ignored;
    const std::string whole = fs::weakly_canonical(path, ignored).string();
    recent.erase(std::remove(recent.begin(), recent.end(), whole), recent.end());
    recent.insert(recent.begin(), whole);
    if (recent.size() > kMaxRecent) recent.resize(kMaxRecent);
}

namespace {

constexpr int kWidthPx = 416, kHeightPx = 260;

// The same file and the same exercises beside it as before, as far as sizes and times of change
// say.
std::string state_of(const std::string& path) {
    std::error_code failed;
    std::vector<std::string> states;
    const auto add = [&](const std::filesystem::path& file) {
        const auto size = std::filesystem::file_size(file, failed);
        const auto time = std::filesystem::last_write_time(file, failed);
        states.push_back(file.filename().string() + "/" + std::to_string(size) + "/" +
                         std::to_string(time.time_since_epoch().count()));
    };
    add(path);
    for (std::filesystem::directory_iterator it(path + ".exercises", failed), end;
         !failed && it != end; it.increment(failed))
        add(it->path());
    std::sort(states.begin(), states.end());  // folders list in any order
    std::string state;
    for (const std::string& one : states) state += one + " ";
    return state;
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

namespace {

template <class Named>
const std::string& title_in_use(const Named& named) {
    for (std::size_t i = 0; i < std::min(named.titles.size(), languages().size()); ++i)
        if (&languages()[i] == &language_in_use()) return named.titles[i];
    return named.titles.empty() ? named.name : named.titles[0];
}

}  // namespace

const std::string& title_of(const CaseCard::Exercise& exercise) {
    return title_in_use(exercise);
}

const std::string& title_of(const CaseCard::Exercise::Item& item) {
    return title_in_use(item);
}

CaseCard make_case_card(const std::string& path) {
    CaseCard card;
    card.path = path;
    const auto open = open_case_to_render(path);
    if (!open) {
        card.fault = open.error().message();
        return card;
    }
    card.case_name = (*open)->bundle->manifest.case_name;
    card.title = case_title((*open)->bundle->manifest);
    for (std::size_t i = 0; i < (*open)->exercises.size(); ++i) {
        const Exercise& exercise = (*open)->exercises[i];
        CaseCard::Exercise& shown = card.exercises.emplace_back();
        shown.name = exercise.name;
        shown.mastery = exercise.mastery;
        shown.difficulty = exercise.difficulty;
        for (const ProcedureItem& item : exercise.procedure.items)
            shown.items.push_back({item.name, {}});
        for (const Language& language : languages()) {
            const ExerciseTexts texts = texts_of(**open, static_cast<int>(i), language.code);
            shown.titles.push_back(texts.title);
            for (std::size_t at = 0; at < shown.items.size(); ++at)
                shown.items[at].titles.push_back(texts.items[at].title);
        }
    }
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

}  // namespace sonocase::runtime::inline player_app
