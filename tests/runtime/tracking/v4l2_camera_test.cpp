// SPDX-License-Identifier: Apache-2.0

// The camera's driver against a camera that a test plays behind the system's calls.

#include "runtime/tracking/camera/v4l2_camera.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cstring>
#include <ctime>
#include <map>
#include <vector>

#include <linux/videodev2.h>

#include "support/marker_jpeg.h"

namespace sonocase::runtime {
namespace {

constexpr int kWidth = 640, kHeight = 360;

// /dev/video0 is a camera's metadata, /dev/video2 a camera.
struct PlayedVideo final : VideoCalls {
    bool allowed = true, busy = false, gone = false, jpeg = true;
    std::vector<std::uint8_t> picture;  // as the camera sends it
    int waiting = 0;                    // pictures that have come
    int streaming = 0, opened = 0;
    double age_s = 0.02;
    std::vector<std::vector<std::uint8_t>> buffers;
    std::vector<std::uint32_t> queued;

    int open(const char* path) override {
        const std::string name = path;
        if (name != "/dev/video0" && name != "/dev/video2") return errno = ENOENT, -1;
        if (!allowed) return errno = EACCES, -1;
        ++opened;
        return name == "/dev/video0" ? 100 : 102;
    }
    void close(int) override { --opened; }
    void* map(int, std::size_t, long offset) override {
        return buffers[static_cast<std::size_t>(offset)].data();
    }
    void unmap(void*, std::size_t) override {}
    int wait(int) override { return gone ? -1 : waiting > 0 ? 1 : 0; }

    int control(int file, unsigned long request, void* argument) override {
        if (gone) return errno = ENODEV, -1;
        switch (request) {
            case VIDIOC_QUERYCAP: {
                auto& can = *static_cast<v4l2_capability*>(argument);
                std::strcpy(reinterpret_cast<char*>(can.card), "Played Webcam");
                can.capabilities =
                    V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
                can.device_caps = file == 100 ? V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING
                                              : V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
                return 0;
            }
            case VIDIOC_S_FMT: {
                if (busy) return errno = EBUSY, -1;
                auto& format = static_cast<v4l2_format*>(argument)->fmt.pix;
                // A driver answers with what it has.
                format.pixelformat = jpeg ? V4L2_PIX_FMT_MJPEG : V4L2_PIX_FMT_YUYV;
                format.width = kWidth, format.height = kHeight;
                format.bytesperline = jpeg ? 0 : 2 * kWidth + 32;
                return 0;
            }
            case VIDIOC_REQBUFS: {
                buffers.assign(static_cast<v4l2_requestbuffers*>(argument)->count,
                               std::vector<std::uint8_t>(2 * (kWidth + 32) * kHeight));
                return 0;
            }
            case VIDIOC_QUERYBUF: {
                auto& buffer = *static_cast<v4l2_buffer*>(argument);
                buffer.length = static_cast<std::uint32_t>(buffers[buffer.index].size());
                buffer.m.offset = buffer.index;
                return 0;
            }
            case VIDIOC_QBUF:
                queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
                return 0;
            case VIDIOC_DQBUF: return take(*static_cast<v4l2_buffer*>(argument));
            case VIDIOC_STREAMON: ++streaming; return 0;
            case VIDIOC_STREAMOFF: --streaming; return 0;
            default: return errno = ENOTTY, -1;  // rates and exposure: many cameras have neither
        }
    }
    int take(v4l2_buffer& buffer) {
        if (waiting == 0 || queued.empty()) return errno = EAGAIN, -1;
        --waiting;
        buffer.index = queued.front();
        queued.erase(queued.begin());
        std::copy(picture.begin(), picture.end(), buffers[buffer.index].begin());
        buffer.bytesused = static_cast<std::uint32_t>(picture.size());
        timespec now{};
        clock_gettime(CLOCK_MONOTONIC, &now);
        const double then =
            static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec) - age_s;
        buffer.timestamp.tv_sec = static_cast<long>(then);
        buffer.timestamp.tv_usec =
            static_cast<long>(1e6 * (then - static_cast<double>(buffer.timestamp.tv_sec)));
        return 0;
    }
};

std::vector<std::uint8_t> ramp() {
    std::vector<std::uint8_t> grey(static_cast<std::size_t>(kWidth) * kHeight);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < kWidth; ++x) grey[y * kWidth + x] = static_cast<std::uint8_t>(x / 4);
    return grey;
}

TEST(V4l2Camera, CamerasAreListedByNameAndWithoutTheirMetadata) {
    PlayedVideo video;
    const std::vector<CameraDevice> found = v4l2_cameras(video);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].number, 2);
    EXPECT_EQ(found[0].name, "Played Webcam");
    EXPECT_EQ(video.opened, 0);
    // A camera that another program uses is in the list; one that is gone is not.
    video.busy = true;
    EXPECT_EQ(v4l2_cameras(video).size(), 1u);
    video.gone = true;
    EXPECT_TRUE(v4l2_cameras(video).empty());
}

TEST(V4l2Camera, PicturesComeAsJpegAndAsYuyvWithTheirAge) {
    const std::vector<std::uint8_t> grey = ramp();
    for (const bool jpeg : {true, false}) {
        PlayedVideo video;
        video.jpeg = jpeg;
        if (jpeg) {
            video.picture = sonocase::testing::jpeg_of(grey, kWidth, kHeight, 95);
        } else {
            video.picture.assign((2 * kWidth + 32) * kHeight, 7);
            for (int y = 0; y < kHeight; ++y)
                for (int x = 0; x < kWidth; ++x)
                    video.picture[y * (2 * kWidth + 32) + 2 * x] = grey[x];
        }
        {
            auto camera = open_v4l2_camera(-1, video);
            ASSERT_TRUE(camera) << camera.error().message();
            EXPECT_EQ((*camera)->name(), "Played Webcam");
            EXPECT_EQ((*camera)->width_px(), kWidth);
            GreyImage image;
            double age_s = 0;
            EXPECT_FALSE(*(*camera)->next(image, age_s));  // none has come
            // Of three that came the newest is read; all buffers go back.
            video.waiting = 3;
            const auto came = (*camera)->next(image, age_s);
            ASSERT_TRUE(came);
            EXPECT_TRUE(*came);
            EXPECT_EQ(video.waiting, 0);
            EXPECT_EQ(video.queued.size(), 3u);
            EXPECT_GE(age_s, 0.019);
            EXPECT_LT(age_s, 0.5);
            ASSERT_EQ(image.width_px, kWidth);
            EXPECT_NEAR(image.pixels[200 * kWidth + 320], 80, 3);
            // Half a picture is none, and no error.
            video.picture.resize(video.picture.size() / 3);
            video.waiting = 1;
            const auto half = (*camera)->next(image, age_s);
            ASSERT_TRUE(half);
            EXPECT_FALSE(*half);
            // Another clock's time stamps say nothing.
            video.age_s = 5000;
            video.waiting = 1;
            ASSERT_TRUE((*camera)->next(image, age_s));
            EXPECT_EQ(age_s, 0);
            video.gone = true;
            const auto unplugged = (*camera)->next(image, age_s);
            ASSERT_FALSE(unplugged);
            EXPECT_EQ(unplugged.error().what, "The camera was unplugged.");
            video.gone = false;
        }
        EXPECT_EQ(video.streaming, 0);
        EXPECT_EQ(video.opened, 0);
    }
}

TEST(V4l2Camera, WhatKeepsACameraFromUseIsSaid) {
    PlayedVideo video;
    EXPECT_EQ(open_v4l2_camera(5, video).error().what, "No camera is connected");
    // Metadata alone is no camera.
    EXPECT_EQ(open_v4l2_camera(0, video).error().what, "No camera is connected");
    video.busy = true;
    const auto busy = open_v4l2_camera(-1, video);
    ASSERT_FALSE(busy);
    EXPECT_EQ(busy.error().what, "Another program uses the camera");
    EXPECT_EQ(busy.error().where, "/dev/video2");
    video.allowed = false;
    EXPECT_EQ(open_v4l2_camera(-1, video).error().what, "This user may not use the camera");
    EXPECT_EQ(video.opened, 0);
}

}  // namespace
}  // namespace sonocase::runtime
