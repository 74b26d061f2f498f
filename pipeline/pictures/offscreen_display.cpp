// SPDX-License-Identifier: Apache-2.0

#include "pipeline/pictures/offscreen_display.h"

#include <dirent.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkRenderWindow.h>
#include <vtkWindowToImageFilter.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>

#include "pipeline/pictures/png.h"

namespace sonocase::pipeline::inline pictures {
namespace {

// Whether a local X server answers for $DISPLAY. Displays on other machines are assumed to.
bool display_answers() {
    const char* display = std::getenv("DISPLAY");
    if (display == nullptr || *display == '\0') return false;
    if (*display != ':') return true;
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    const std::string number(display + 1, std::strcspn(display + 1, "."));
    const std::string path = "/tmp/.X11-unix/X" + number;
    if (path.size() >= sizeof(address.sun_path)) return false;
    std::memcpy(address.sun_path, path.c_str(), path.size() + 1);
    const int s = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (s < 0) return false;
    const bool answers =
        connect(s, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
    close(s);
    return answers;
}

}  // namespace

OffscreenDisplay::OffscreenDisplay(OffscreenDisplay&& other) noexcept
    : child_(std::exchange(other.child_, -1)),
      previous_display_(std::move(other.previous_display_)) {}

OffscreenDisplay::~OffscreenDisplay() {
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
    if (previous_display_)
        setenv("DISPLAY", previous_display_->c_str(), 1);
    else
        unsetenv("DISPLAY");
}

Result<OffscreenDisplay> OffscreenDisplay::open() {
    OffscreenDisplay display;
    if (!display_answers()) {
        SONOCASE_TRY_DONE(display.start());
    }
    return display;
}

Status OffscreenDisplay::start() {
    if (const char* display = std::getenv("DISPLAY")) previous_display_ = display;
    int number_pipe[2];
    if (pipe2(number_pipe, O_CLOEXEC) != 0) {
        return Error{std::string("cannot open a pipe: ") + std::strerror(errno), "Xvfb", ""};
    }
    const pid_t parent = getpid();
    child_ = fork();
    if (child_ < 0)
        return Error{std::string("cannot start a process: ") + std::strerror(errno), "Xvfb", ""};
    if (child_ == 0) {
        // Ends with the parent, also if that is killed.
        prctl(PR_SET_PDEATHSIG, SIGTERM);
        if (getppid() != parent) _exit(1);
        dup2(number_pipe[1], 3);
        const int nothing = ::open("/dev/null", O_RDWR);
        dup2(nothing, 0);
        dup2(nothing, 1);
        dup2(nothing, 2);
        execlp("Xvfb", "Xvfb", "-displayfd", "3", "-screen", "0", "1600x1200x24", "-nolisten",
               "tcp", static_cast<char*>(nullptr));
        _exit(127);
    }
    close(number_pipe[1]);
    std::string number;
    char c;
    pollfd wait{number_pipe[0], POLLIN, 0};
    while (poll(&wait, 1, 20000) > 0 && read(number_pipe[0], &c, 1) == 1 && c != '\n') number += c;
    close(number_pipe[0]);
    if (number.empty()) {
        return Error{"no display, and Xvfb does not start", "pictures",
                     "install the Debian package xvfb, or run under a display"};
    }
    setenv("DISPLAY", (":" + number).c_str(), 1);
    return Done{};
}

std::vector<std::uint8_t> png_of_window(vtkRenderWindow& window) {
    window.Render();
    vtkNew<vtkWindowToImageFilter> grab;
    grab->SetInput(&window);
    grab->ReadFrontBufferOff();
    grab->Update();
    vtkImageData* image = grab->GetOutput();  // RGB, rows from the bottom up
    const int width = image->GetDimensions()[0], height = image->GetDimensions()[1];
    const std::ptrdiff_t row = static_cast<std::ptrdiff_t>(3) * width;
    const auto* pixels = static_cast<const std::uint8_t*>(image->GetScalarPointer());
    std::vector<std::uint8_t> turned(height * row);
    for (int y = 0; y < height; ++y)
        std::copy_n(pixels + y * row, row, turned.data() + (height - 1 - y) * row);
    return png_from_rgb(turned.data(), width, height);
}

}  // namespace sonocase::pipeline::inline pictures
