// SPDX-License-Identifier: Apache-2.0

// Put before the C library, this stands in for two cameras, /dev/video3 and /dev/video5, of which
// another program uses both.
#include <cerrno>
#include <cstdarg>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/stat.h>
#include <sys/types.h>

namespace {

constexpr int kFiles = 4096;
const char* g_cameras[kFiles];  // by file descriptor

template <class Function>
Function* next(const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

int open_at(const char* path, int flags, mode_t mode) {
    static auto* const real = next<int(const char*, int, ...)>("open64");
    const char* name = std::strcmp(path, "/dev/video3") == 0   ? "Desk Webcam"
                       : std::strcmp(path, "/dev/video5") == 0 ? "Arm Webcam"
                                                               : nullptr;
    const int file = real(name ? "/dev/null" : path, flags, mode);
    if (file >= 0 && file < kFiles) g_cameras[file] = name;
    return file;
}

}  // namespace

extern "C" {

int open(const char* path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    const auto mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;
    va_end(more);
    return open_at(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
    va_list more;
    va_start(more, flags);
    const auto mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0;
    va_end(more);
    return open_at(path, flags, mode);
}
int ioctl(int file, unsigned long request, ...) {
    va_list more;
    va_start(more, request);
    void* argument = va_arg(more, void*);
    va_end(more);
    static auto* const real = next<int(int, unsigned long, ...)>("ioctl");
    const char* name = file >= 0 && file < kFiles ? g_cameras[file] : nullptr;
    if (!name) return real(file, request, argument);
    if (request == VIDIOC_QUERYCAP) {
        auto& can = *static_cast<v4l2_capability*>(argument);
        can = {};
        std::strcpy(reinterpret_cast<char*>(can.card), name);
        can.capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
        return 0;
    }
    errno = request == VIDIOC_S_FMT ? EBUSY : ENOTTY;
    return -1;
}

}  // extern "C"
