// SPDX-License-Identifier: Apache-2.0

// One camera and printed markers as a tracker: sensor 0 is the probe's body, sensor 1 the needle's;
// world is the board (formats/markers/marker_set.h).
//
// A live camera is read by a thread of its own, which hands readings over. Their poses are
// predicted over the time from the picture's exposure to the reading, which health() tells
// (formats/markers/pose_predictor.h). A pose whose spread is too wide to be trusted is `poor`, one
// tag alone always.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "formats/base/mailbox.h"
#include "formats/markers/detect/camera_poses.h"
#include "formats/markers/detect/grey_jpeg.h"
#include "runtime/tracking/replay_tracker.h"
#include "runtime/tracking/tracker.h"

namespace sonocase::runtime::inline tracking_camera {

// What a camera is to the tracker: one grey picture after another, with the time of its exposure.
class PictureSource {
  public:
    virtual ~PictureSource() = default;
    virtual std::string name() const = 0;  // "HD Webcam"
    virtual int width_px() const = 0;
    virtual int height_px() const = 0;
    // Waits up to 0.1 s for the newest picture; older ones that were not asked for are dropped.
    // True: one came. age_s: since the middle of its exposure. Errors end the source: unplugged,
    // pictures that cannot be read.
    virtual Result<bool> next(GreyImage& picture, double& age_s) = 0;
};

// Opens a camera. An error with an empty `where` means that there is none yet; others, such as a
// camera that another program uses, are shown. Either way it is tried again.
using OpenSource = std::function<Result<std::unique_ptr<PictureSource>>()>;

struct CameraTrackerOptions : KnownCamera {
    double retry_s = 0.5;
};

class CameraTracker final : public Tracker {
  public:
    CameraTracker(OpenSource open, SessionClock clock, CameraTrackerOptions options);
    ~CameraTracker() override;
    bool poll(double now_s, TrackerReading& reading) override;
    TrackerHealth health() const override;
    void set_wake(std::function<void()> wake) override;
    bool is_device() const override { return true; }

  private:
    void run();
    void stream(PictureSource& source);
    void set_health(TrackerPhase phase, const Message& message);
    void pause(double seconds);

    OpenSource open_;
    SessionClock clock_;
    CameraTrackerOptions options_;
    std::atomic<bool> stop_{false};
    Mailbox<TrackerReading> box_;
    std::uint64_t sequence_ = 0;
    mutable std::mutex mutex_;
    TrackerHealth health_;
    std::function<void()> wake_;
    std::thread thread_;
};

// The poses in a video (load_jpeg_video), as a recording to replay. Pictures in which a tool's pose
// is not good count as not seen. setup: as of a live camera; `calibrated` as above. Errors: those
// of load_jpeg_video; pictures of another shape than the calibration's; a video in which nothing is
// ever followed, with what was seen instead. Cost: about 12 ms per picture.
Result<Recording> load_camera_video(const std::string& path, const CameraTrackerOptions& options);

// "", "N", "VIDEO", each with ",CAMERA.json" behind it: what follows "camera:".
struct CameraArgument {
    int number = -1;    // of /dev/videoN; -1: the first
    std::string video;  // a file or folder instead; empty: none
    CameraTrackerOptions options;
};
Result<CameraArgument> parse_camera_argument(const std::string& argument);

}  // namespace sonocase::runtime::inline tracking_camera
