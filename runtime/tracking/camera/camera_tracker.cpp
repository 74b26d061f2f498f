// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/camera/camera_tracker.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "formats/files/atomic_file.h"
#include "formats/files/jpeg_video.h"
#include "formats/markers/detect/camera_poses.h"

namespace sonocase::runtime::inline tracking_camera {
namespace {

SensorState state_of(MarkerStatus status) {
    return status == MarkerStatus::good   ? SensorState::ok
           : status == MarkerStatus::poor ? SensorState::poor
                                          : SensorState::lost;
}

}  // namespace

CameraTracker::CameraTracker(OpenSource open, SessionClock clock, CameraTrackerOptions options)
    : open_(std::move(open)), clock_(std::move(clock)), options_(std::move(options)) {
    health_.device = "Camera";
    thread_ = std::thread([this] { run(); });
}

CameraTracker::~CameraTracker() {
    stop_ = true;
    thread_.join();
}

bool CameraTracker::poll(double, TrackerReading& reading) {
    if (!box_.refresh()) return false;
    reading = box_.value();
    return true;
}

TrackerHealth CameraTracker::health() const {
    const std::lock_guard lock(mutex_);
    return health_;
}

void CameraTracker::set_wake(std::function<void()> wake) {
    const std::lock_guard lock(mutex_);
    wake_ = std::move(wake);
}

void CameraTracker::set_health(TrackerPhase phase, const Message& message) {
    const std::lock_guard lock(mutex_);
    health_.phase = phase;
    health_.message = message;
}

void CameraTracker::pause(double seconds) {
    const double until_s = clock_() + seconds;
    while (!stop_ && clock_() < until_s) std::this_thread::sleep_for(std::chrono::milliseconds(10));
}

void CameraTracker::run() {
    set_health(TrackerPhase::searching, "Looking for a camera.");
    while (!stop_) {
        Result<std::unique_ptr<PictureSource>> source = open_();
        if (source) {
            stream(**source);
        } else {
            const Error& error = source.error();
            // A camera that is there and cannot be used needs the user.
            set_health(TrackerPhase::searching, error.where.empty() ? error.what : error.message());
        }
        pause(options_.retry_s);
    }
}

void CameraTracker::stream(PictureSource& source) {
    Result<CameraPoses> poses =
        CameraPoses::create(options_, source.width_px(), source.height_px());
    if (!poses) {
        set_health(TrackerPhase::failed, poses.error().message());
        while (!stop_) pause(options_.retry_s);
        return;
    }
    {
        const std::lock_guard lock(mutex_);
        health_.device = Message("Camera {}", {source.name()});
        health_.phase = TrackerPhase::starting;
        ++health_.connects;
    }
    GreyImage picture;
    double late_s = -1;
    double last_s = -1, period_s = 0;
    constexpr double kSilenceS = 3;
    double heard_s = clock_();
    while (!stop_) {
        double age_s = 0;
        Result<bool> came = source.next(picture, age_s);
        const double now_s = clock_();
        if (!came) {
            set_health(TrackerPhase::searching, came.error().what);
            return;
        }
        if (!*came) {
            if (now_s - heard_s > kSilenceS) {
                set_health(TrackerPhase::searching,
                           "The camera sends no pictures: it is started again.");
                return;
            }
            continue;
        }
        heard_s = now_s;
        const double time_s = now_s - age_s;
        const FollowerPicture& seen = poses->follow(
            {picture.pixels.data(), picture.width_px, picture.height_px, picture.width_px}, time_s,
            now_s);
        TrackerReading reading;
        reading.sequence = ++sequence_;
        reading.time_s = clock_();
        reading.device_time_s = time_s;
        const double took_s = reading.time_s - time_s;
        late_s = late_s < 0 ? took_s : 0.9 * late_s + 0.1 * took_s;
        reading.sensor_count = 2;
        constexpr MarkerRole kRoles[] = {MarkerRole::probe, MarkerRole::needle};
        for (int k = 0; k < 2; ++k) {
            SensorReading& sensor = reading.sensors[k];
            sensor.state = state_of(seen.tools[k].status);
            sensor.world_from_sensor = poses->pose_at(kRoles[k], reading.time_s);
            // 1 at a tenth of a millimetre, 0.5 at one.
            sensor.quality = seen.tools[k].sigma_mm < 0
                                 ? 0
                                 : static_cast<float>(1 / (1 + seen.tools[k].sigma_mm));
            sensor.time_s = reading.time_s;  // what the pose is for
        }
        box_.publish(reading);
        if (last_s >= 0)
            period_s = period_s > 0 ? 0.9 * period_s + 0.1 * (now_s - last_s) : now_s - last_s;
        last_s = now_s;
        std::function<void()> wake;
        {
            const std::lock_guard lock(mutex_);
            health_.phase = TrackerPhase::streaming;
            health_.message = poses->message();
            health_.rate_hz = period_s > 0 ? 1 / period_s : 0;
            health_.late_s = late_s;
            ++health_.readings;
            wake = wake_;
        }
        if (wake) wake();
    }
}

Result<Recording> load_camera_video(const std::string& path, const CameraTrackerOptions& options) {
    SONOCASE_TRY(const JpegVideo video, load_jpeg_video(path));
    SONOCASE_TRY(GreyJpegReader reader, GreyJpegReader::create());
    Recording recording;
    recording.name = path;
    std::optional<PictureFollower> follower;
    GreyImage picture;
    Message problem, nothing_seen;
    bool any_tags = false;
    int probes = 0, needles = 0, damaged = 0;
    for (std::size_t i = 0; i < video.pictures.size(); ++i) {
        const double time_s = static_cast<double>(i) / video.rate_hz;
        Pose probe, needle;
        probe.frame = needle.frame = static_cast<std::int64_t>(i);
        probe.timestamp_s = needle.timestamp_s = time_s;
        if (!reader.read(video.pictures[i], picture)) {
            ++damaged;
        } else {
            if (!follower) {
                SONOCASE_TRY(const CameraModel camera,
                             camera_for(options, picture.width_px, picture.height_px));
                SONOCASE_TRY(TagDetector detector, TagDetector::create());
                follower.emplace(std::move(detector),
                                 MarkerFollower(camera, marker_bodies(options.setup)));
            }
            const CameraModel& camera = follower->follower().camera();
            if (picture.width_px != camera.width_px || picture.height_px != camera.height_px)
                return Error{"the size of the pictures changes", path, "use one video at a time"};
            const FollowerPicture seen = follower->follow(
                {picture.pixels.data(), picture.width_px, picture.height_px, picture.width_px},
                time_s);
            probe.tracker_from_tool = seen.tools[0].world_from_body;
            needle.tracker_from_tool = seen.tools[1].world_from_body;
            probe.ok = seen.tools[0].status == MarkerStatus::good;
            needle.ok = seen.tools[1].status == MarkerStatus::good;
            probes += probe.ok, needles += needle.ok;
            if (problem.empty()) problem = seen.problem;
            any_tags = any_tags || follower->any_tags();
            if (!any_tags && nothing_seen.empty())
                nothing_seen = why_no_tags(
                    {picture.pixels.data(), picture.width_px, picture.height_px, picture.width_px},
                    follower->detector());
        }
        recording.probe.push_back(probe);
        recording.needle.push_back(needle);
    }
    if (!any_tags) problem = nothing_seen;
    if (probes == 0 && needles == 0)
        return Error{problem.empty()
                         ? Message("no picture shows a probe or a needle that can be followed")
                         : problem,
                     path, ""};
    if (needles == 0) recording.needle.clear();
    if (damaged > 0) {
        recording.note =
            Message("{} pictures of the video cannot be read.", {std::to_string(damaged)});
    } else if (!options.calibrated) {
        recording.note = kNotCalibrated;
    } else if (!problem.empty()) {
        recording.note = problem;
    }
    return recording;
}

Result<CameraArgument> parse_camera_argument(const std::string& argument) {
    CameraArgument out;
    std::string source = argument;
    constexpr std::string_view kEnding = ".json";
    const std::size_t comma = argument.rfind(',');
    const std::string last = comma == std::string::npos ? argument : argument.substr(comma + 1);
    if (last.size() > kEnding.size() &&
        last.compare(last.size() - kEnding.size(), kEnding.size(), kEnding) == 0) {
        SONOCASE_TRY(const std::string text, read_text_file(last));
        SONOCASE_TRY(out.options.setup, parse_camera(text, last));
        out.options.calibrated = true;
        source = comma == std::string::npos ? "" : argument.substr(0, comma);
    }
    if (source.empty()) return out;
    if (source.size() <= 2 && source.find_first_not_of("0123456789") == std::string::npos) {
        out.number = std::stoi(source);
        return out;
    }
    out.video = source;
    return out;
}

}  // namespace sonocase::runtime::inline tracking_camera
