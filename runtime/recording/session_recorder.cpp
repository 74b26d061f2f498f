// SPDX-License-Identifier: Apache-2.0

#include "runtime/recording/session_recorder.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>

#include "formats/files/growing_sequence.h"
#include "formats/files/load_save.h"
#include "formats/text/number_text.h"
#include "runtime/recording/session_words.h"

namespace sonocase::runtime::inline recording {
namespace {

constexpr std::size_t kQueue = 8192;  // frames: more than a minute at 120 Hz
constexpr std::size_t kEvents = 8;
constexpr std::size_t kMaxPictures = 64;
constexpr auto kBatchEvery = std::chrono::milliseconds(400);

struct Record {
    RecordedFrame frame;
    std::array<LiveEvent, kEvents> events;
    std::size_t event_count = 0;
};

struct Picture {
    std::atomic<bool> full{false};
    std::int64_t frame = 0;
    double time_s = 0;
    const char* why = "";
    int width_px = 0, height_px = 0;
    Renderer::Layout layout;
    std::vector<std::uint8_t> pixels;
};

}  // namespace

std::string pictures_path(const std::string& session_path) {
    for (const std::string ending : {".igs.mha", ".igs.nrrd", ".mha"}) {
        if (session_path.size() > ending.size() &&
            session_path.compare(session_path.size() - ending.size(), ending.size(), ending) == 0) {
            return session_path.substr(0, session_path.size() - ending.size()) + ".frames.igs.mha";
        }
    }
    return session_path + ".frames.igs.mha";
}

struct SessionRecorder::Impl {
    Impl(GrowingSequence opened, std::string where, Exercise e, std::vector<Label> l)
        : file(std::move(opened)),
          path(std::move(where)),
          exercise(std::move(e)),
          labels(std::move(l)),
          queue(kQueue) {
        picture.pixels.resize(std::size_t{2048} * 2048);
    }

    void run() {
        std::unique_lock lock(mutex);
        while (!stopping) {
            wake.wait_for(lock, kBatchEvery, [&] { return stopping || hurry; });
            hurry = false;
            lock.unlock();
            write_batch();
            write_picture();
            lock.lock();
            room.notify_all();
        }
    }

    void write_batch() {
        std::size_t at = taken.load(std::memory_order_relaxed);
        const std::size_t end = given.load(std::memory_order_acquire);
        // Frames that an earlier batch could not write come first.
        for (; at != end && waiting.size() < 20 * kQueue; ++at)
            waiting.push_back(frame_of(queue[at % kQueue]));
        taken.store(at, std::memory_order_release);
        if (waiting.empty()) return;
        const Status written = file.append(waiting);
        const std::lock_guard lock(mutex);
        if (written) {
            state.frames_written += waiting.size();
            waiting.clear();
            state.problem = {};
        } else {
            state.problem = Message("The session goes on but is not being recorded: {}.",
                                    {written.error().message()});
        }
        state.frames_dropped = dropped.load();
    }

    SequenceFrame frame_of(const Record& record) const {
        const RecordedFrame& f = record.frame;
        SessionSample sample;
        sample.time_s = f.time_s;
        sample.frame = f.frame;
        sample.probe_ok = f.probe_ok;
        sample.needle_ok = f.needle_ok;
        sample.probe_age_s = f.probe_age_s;
        sample.needle_age_s = f.needle_age_s;
        sample.mannequin_from_probe = f.mannequin_from_probe;
        sample.mannequin_from_needle = f.mannequin_from_needle;
        sample.mannequin_from_drawn = f.mannequin_from_drawn;
        sample.has_press = f.has_press;
        sample.press = f.press;
        sample.has_doppler = f.doppler.on;
        sample.doppler = doppler_sample(f.doppler, labels);
        sample.acts = f.acts;
        sample.unseen = f.unseen;
        sample.settings.assign(f.settings.data(), ::strnlen(f.settings.data(), f.settings.size()));
        std::vector<SessionEvent> events;
        for (std::size_t i = 0; i < record.event_count; ++i) {
            events.push_back(session_event(record.events[i], exercise, labels));
        }
        return frame_from_sample(sample, events);
    }

    void write_picture() {
        if (!picture.full.load(std::memory_order_acquire)) return;
        const bool fits = pictures.frames.empty() || (pictures.width == picture.width_px &&
                                                      pictures.height == picture.height_px);
        if (fits && pictures.frames.size() < kMaxPictures) {
            pictures.width = picture.width_px;
            pictures.height = picture.height_px;
            SequenceFrame frame;
            frame.number = picture.frame;
            frame.timestamp_s = frame.unfiltered_timestamp_s = picture.time_s;
            frame.fields = {{"Event", picture.why}};
            if (picture.layout.mm_per_px > 0) {  // with these a viewer can measure in the picture
                const Renderer::Layout& layout = picture.layout;
                frame.fields.push_back({"MmPerPx", number_text(layout.mm_per_px)});
                frame.fields.push_back({"OriginXPx", number_text(layout.origin_x_px)});
                frame.fields.push_back({"OriginYPx", number_text(layout.origin_y_px)});
            }
            const auto bytes = static_cast<std::ptrdiff_t>(picture.width_px) * picture.height_px;
            const auto later = std::upper_bound(
                pictures.frames.begin(), pictures.frames.end(), frame.timestamp_s,
                [](double time_s, const SequenceFrame& f) { return time_s < f.timestamp_s; });
            pictures.pixels.insert(
                pictures.pixels.begin() + bytes * (later - pictures.frames.begin()),
                picture.pixels.begin(), picture.pixels.begin() + bytes);
            pictures.frames.insert(later, std::move(frame));
            const Status saved = save_sequence(pictures, pictures_path(path), true);
            if (!saved) {
                const std::lock_guard lock(mutex);
                state.problem = Message("A picture of this session was not kept: {}.",
                                        {saved.error().message()});
            }
        }
        picture.full.store(false, std::memory_order_release);
    }

    GrowingSequence file;
    std::string path;
    Exercise exercise;
    std::vector<Label> labels;

    // One writer (the frame loop), one reader (the thread).
    std::vector<Record> queue;
    std::atomic<std::size_t> given{0}, taken{0}, dropped{0};
    std::vector<SequenceFrame> waiting;
    Picture picture;
    Sequence pictures;

    mutable std::mutex mutex;
    std::condition_variable wake, room;
    bool stopping = false, hurry = false;
    RecorderStatus state;
    std::thread thread;
};

SessionRecorder::SessionRecorder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

SessionRecorder::~SessionRecorder() {
    (void)finish();
}

Result<std::unique_ptr<SessionRecorder>> SessionRecorder::start(const std::string& path,
                                                                const SessionHeader& header,
                                                                const Exercise& exercise,
                                                                const std::vector<Label>& labels) {
    Sequence head;
    head.transforms = {kProbeTransform, kNeedleTransform, kDrawnTransform};
    head.fields = fields_from_header(header);
    SONOCASE_TRY(auto file, GrowingSequence::create(path, head));
    auto impl = std::make_unique<Impl>(std::move(file), path, exercise, labels);
    impl->pictures.fields = head.fields;
    impl->thread = std::thread([raw = impl.get()] { raw->run(); });
    return std::unique_ptr<SessionRecorder>(new SessionRecorder(std::move(impl)));
}

bool SessionRecorder::push(const RecordedFrame& frame, std::span<const LiveEvent> events) {
    Impl& impl = *impl_;
    const std::size_t at = impl.given.load(std::memory_order_relaxed);
    if (at - impl.taken.load(std::memory_order_acquire) >= kQueue) {
        ++impl.dropped;
        return false;
    }
    Record& record = impl.queue[at % kQueue];
    record.frame = frame;
    record.event_count = std::min(events.size(), kEvents);
    std::copy_n(events.begin(), record.event_count, record.events.begin());
    impl.given.store(at + 1, std::memory_order_release);
    return true;
}

void SessionRecorder::wait_for_room() {
    Impl& impl = *impl_;
    const auto roomy = [&] {
        return impl.given.load() - impl.taken.load() < kQueue / 2 && !impl.picture.full.load();
    };
    if (roomy()) return;
    std::unique_lock lock(impl.mutex);
    impl.hurry = true;
    impl.wake.notify_all();
    impl.room.wait(lock, roomy);
}

bool SessionRecorder::push_picture(std::int64_t frame,
                                   double time_s,
                                   const char* why,
                                   int width_px,
                                   int height_px,
                                   std::span<const std::uint8_t> pixels,
                                   const Renderer::Layout& layout) {
    Picture& picture = impl_->picture;
    if (picture.full.load(std::memory_order_acquire) || pixels.size() > picture.pixels.size())
        return false;
    picture.frame = frame;
    picture.time_s = time_s;
    picture.why = why;
    picture.width_px = width_px;
    picture.height_px = height_px;
    picture.layout = layout;
    std::copy(pixels.begin(), pixels.end(), picture.pixels.begin());
    picture.full.store(true, std::memory_order_release);
    return true;
}

RecorderStatus SessionRecorder::status() const {
    const std::lock_guard lock(impl_->mutex);
    return impl_->state;
}

Status SessionRecorder::finish() {
    Impl& impl = *impl_;
    if (!impl.thread.joinable()) return Done{};
    {
        const std::lock_guard lock(impl.mutex);
        impl.stopping = true;
    }
    impl.wake.notify_all();
    impl.thread.join();
    impl.write_batch();
    impl.write_picture();
    if (!impl.waiting.empty()) {
        return Error{Message("{} frames were not recorded", {std::to_string(impl.waiting.size())}),
                     impl.path, impl.state.problem};
    }
    return Done{};
}

}  // namespace sonocase::runtime::inline recording
