// SPDX-License-Identifier: Apache-2.0

#include "runtime/tracking/camera/v4l2_camera.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

#include <fcntl.h>
#include <linux/videodev2.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace sonocase::runtime::inline tracking_camera {
namespace {

constexpr int kCameras = 64;  // /dev/video0 to /dev/video63
constexpr std::size_t kBuffers = 3;

// What a file of /dev says that it is; false: no camera that streams.
bool describe(VideoCalls& calls, int file, std::string& name) {
    v4l2_capability can{};
    if (calls.control(file, VIDIOC_QUERYCAP, &can) < 0) return false;
    const std::uint32_t caps =
        can.capabilities & V4L2_CAP_DEVICE_CAPS ? can.device_caps : can.capabilities;
    if (!(caps & V4L2_CAP_VIDEO_CAPTURE) || !(caps & V4L2_CAP_STREAMING)) return false;
    name.assign(reinterpret_cast<const char*>(can.card),
                strnlen(reinterpret_cast<const char*>(can.card), sizeof can.card));
    return true;
}

std::string path_of(int number) {
    return "/dev/video" + std::to_string(number);
}

class V4l2Camera final : public PictureSource {
  public:
    V4l2Camera(GreyJpegReader reader, VideoCalls& calls)
        : reader_(std::move(reader)), calls_(calls) {}
    ~V4l2Camera() override {
        if (streaming_) {
            int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
            calls_.control(file_, VIDIOC_STREAMOFF, &type);
        }
        for (const auto& [memory, size] : buffers_)
            if (memory) calls_.unmap(memory, size);
        if (file_ >= 0) calls_.close(file_);
    }
    V4l2Camera(const V4l2Camera&) = delete;
    V4l2Camera& operator=(const V4l2Camera&) = delete;

    std::string name() const override { return name_; }
    int width_px() const override { return width_px_; }
    int height_px() const override { return height_px_; }

    Status open(int number) {
        const std::string path = path_of(number);
        file_ = calls_.open(path.c_str());
        if (file_ < 0) {
            if (errno == EACCES)
                return Error{"This user may not use the camera", path,
                             "add the user to the group video, and log in again"};
            return Error{"No camera is connected", "", "connect one"};
        }
        if (!describe(calls_, file_, name_))
            return Error{"No camera is connected", "", "connect one"};
        if (Status done = choose_format(path); !done) return done;
        choose_rate();
        return start(path);
    }

    Result<bool> next(GreyImage& picture, double& age_s) override {
        const int ready = calls_.wait(file_);
        if (ready == 0) return false;
        if (ready < 0) return unplugged();
        // The newest one: what waited longer is old.
        v4l2_buffer newest{};
        bool have = false;
        for (;;) {
            v4l2_buffer buffer{};
            buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
            buffer.memory = V4L2_MEMORY_MMAP;
            if (calls_.control(file_, VIDIOC_DQBUF, &buffer) < 0) {
                if (errno == EAGAIN) break;
                return unplugged();
            }
            if (have && calls_.control(file_, VIDIOC_QBUF, &newest) < 0) return unplugged();
            newest = buffer;
            have = true;
        }
        if (!have) return false;
        const bool read = !(newest.flags & V4L2_BUF_FLAG_ERROR) && unpack(newest, picture);
        timespec now{};
        clock_gettime(CLOCK_MONOTONIC, &now);
        age_s = static_cast<double>(now.tv_sec - newest.timestamp.tv_sec) +
                1e-9 * static_cast<double>(now.tv_nsec) -
                1e-6 * static_cast<double>(newest.timestamp.tv_usec);
        // A driver whose clock is another one.
        if (!(age_s >= 0 && age_s < 1)) age_s = 0;
        if (calls_.control(file_, VIDIOC_QBUF, &newest) < 0) return unplugged();
        return read;
    }

  private:
    static Error unplugged() { return Error{"The camera was unplugged.", "", ""}; }

    Status choose_format(const std::string& path) {
        for (const std::uint32_t format : {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV}) {
            v4l2_format wanted{};
            wanted.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
            wanted.fmt.pix.width = 1280;
            wanted.fmt.pix.height = 720;
            wanted.fmt.pix.pixelformat = format;
            wanted.fmt.pix.field = V4L2_FIELD_NONE;
            if (calls_.control(file_, VIDIOC_S_FMT, &wanted) < 0) {
                if (errno == EBUSY)
                    return Error{"Another program uses the camera", path, "close that program"};
                continue;
            }
            if (wanted.fmt.pix.pixelformat != format) continue;
            jpeg_ = format == V4L2_PIX_FMT_MJPEG;
            width_px_ = static_cast<int>(wanted.fmt.pix.width);
            height_px_ = static_cast<int>(wanted.fmt.pix.height);
            bytes_per_row_ = wanted.fmt.pix.bytesperline;
            return Done{};
        }
        return Error{"The camera gives neither MJPEG nor YUYV pictures", path,
                     "use another camera"};
    }

    void choose_rate() {
        v4l2_streamparm rate{};
        rate.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        rate.parm.capture.timeperframe = {1, 60};
        calls_.control(file_, VIDIOC_S_PARM, &rate);
        // In a dark room a camera may expose for longer than a picture's time: the picture would
        // come late and blurred.
        v4l2_control exposure{V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0};
        calls_.control(file_, VIDIOC_S_CTRL, &exposure);
    }

    Status start(const std::string& path) {
        v4l2_requestbuffers wanted{};
        wanted.count = kBuffers;
        wanted.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        wanted.memory = V4L2_MEMORY_MMAP;
        const Error busy{"Another program uses the camera", path, "close that program"};
        if (calls_.control(file_, VIDIOC_REQBUFS, &wanted) < 0 || wanted.count == 0) return busy;
        for (std::uint32_t k = 0; k < std::min<std::uint32_t>(wanted.count, kBuffers); ++k) {
            v4l2_buffer buffer{};
            buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
            buffer.memory = V4L2_MEMORY_MMAP;
            buffer.index = k;
            if (calls_.control(file_, VIDIOC_QUERYBUF, &buffer) < 0) return busy;
            void* memory = calls_.map(file_, buffer.length, buffer.m.offset);
            if (!memory) return busy;
            buffers_[k] = {memory, buffer.length};
            if (calls_.control(file_, VIDIOC_QBUF, &buffer) < 0) return busy;
        }
        int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
        if (calls_.control(file_, VIDIOC_STREAMON, &type) < 0) return busy;
        streaming_ = true;
        return Done{};
    }

    bool unpack(const v4l2_buffer& buffer, GreyImage& picture) {
        if (buffer.index >= kBuffers) return false;
        const auto [memory, size] = buffers_[buffer.index];
        const std::size_t used = std::min<std::size_t>(buffer.bytesused, size);
        const auto* bytes = static_cast<const std::uint8_t*>(memory);
        if (jpeg_) return reader_.read({bytes, used}, picture);
        const std::size_t row = std::max<std::size_t>(bytes_per_row_, 2 * std::size_t(width_px_));
        if (used < row * height_px_) return false;
        picture.width_px = width_px_;
        picture.height_px = height_px_;
        picture.pixels.resize(static_cast<std::size_t>(width_px_) * height_px_);
        for (int y = 0; y < height_px_; ++y)
            for (int x = 0; x < width_px_; ++x)
                picture.pixels[static_cast<std::size_t>(y) * width_px_ + x] =
                    bytes[y * row + 2 * x];
        return true;
    }

    GreyJpegReader reader_;
    VideoCalls& calls_;
    int file_ = -1;
    bool streaming_ = false, jpeg_ = false;
    std::string name_;
    int width_px_ = 0, height_px_ = 0;
    std::uint32_t bytes_per_row_ = 0;
    std::array<std::pair<void*, std::size_t>, kBuffers> buffers_{};
};

}  // namespace

int VideoCalls::open(const char* path) {
    return ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
}
void VideoCalls::close(int file) {
    ::close(file);
}
int VideoCalls::control(int file, unsigned long request, void* argument) {
    int status;
    do status = ioctl(file, request, argument);
    while (status < 0 && errno == EINTR);
    return status;
}
void* VideoCalls::map(int file, std::size_t size, long offset) {
    void* memory = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, offset);
    return memory == MAP_FAILED ? nullptr : memory;
}
void VideoCalls::unmap(void* memory, std::size_t size) {
    munmap(memory, size);
}
int VideoCalls::wait(int file) {
    pollfd waiting{file, POLLIN, 0};
    const int ready = poll(&waiting, 1, 100);
    if (ready < 0) return errno == EINTR ? 0 : -1;
    return waiting.revents & (POLLERR | POLLHUP | POLLNVAL) ? -1 : ready;
}
VideoCalls& system_video() {
    static VideoCalls calls;
    return calls;
}

Result<std::unique_ptr<PictureSource>> open_v4l2_camera(int number, VideoCalls& calls) {
    Error first{"No camera is connected", "", "connect one"};
    for (int n = std::max(0, number); n < (number < 0 ? kCameras : number + 1); ++n) {
        SONOCASE_TRY(GreyJpegReader reader, GreyJpegReader::create());
        auto camera = std::make_unique<V4l2Camera>(std::move(reader), calls);
        Status opened = camera->open(n);
        if (opened) return std::unique_ptr<PictureSource>(std::move(camera));
        if (first.where.empty() && !opened.error().where.empty()) first = opened.error();
    }
    return first;
}

std::vector<CameraDevice> v4l2_cameras(VideoCalls& calls) {
    std::vector<CameraDevice> found;
    for (int n = 0; n < kCameras; ++n) {
        const int file = calls.open(path_of(n).c_str());
        if (file < 0) continue;
        CameraDevice device{n, ""};
        if (describe(calls, file, device.name)) found.push_back(std::move(device));
        calls.close(file);
    }
    return found;
}

}  // namespace sonocase::runtime::inline tracking_camera
