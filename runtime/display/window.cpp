// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/window.h"

#include <epoxy/gl.h>
// GLFW must follow the OpenGL loader.
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_glfw.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cfloat>
#include <cmath>
#include <cstdlib>
#include <map>
#include <thread>
#include <utility>
#include <vector>

#include "runtime/display/key_taps.h"

namespace sonocase::runtime::inline display {
namespace {

std::string g_glfw_error;  // GLFW reports to a function without context

void on_glfw_error(int, const char* text) {
    g_glfw_error = text ? text : "";
}

KeyTaps<GLFW_KEY_LAST + 1> g_taps;  // GLFW calls back without context
struct {
    bool shift = false, control = false, alt = false;
} g_held;  // as they were before the taps of a picture were added

void on_key(GLFWwindow* window, int key, int scancode, int action, int modifiers) {
    if (action == GLFW_PRESS) g_taps.press(key, modifiers);
    ImGui_ImplGlfw_KeyCallback(window, key, scancode, action, modifiers);
}

std::string g_dropped;  // GLFW calls back without context

void on_drop(GLFWwindow*, int count, const char** paths) {
    if (count > 0) g_dropped = paths[0];
}

// Without a graphics card Mesa paints on threads of this process, one per core. One fewer leaves a
// core to the thread that renders the ultrasound, so that a pose does not wait until panels are
// painted.
void leave_a_core_to_imaging() {
    const unsigned cores = std::thread::hardware_concurrency();
    const std::string painters = std::to_string(std::max(1u, cores - std::min(cores, 1u)));
    setenv("LP_NUM_THREADS", painters.c_str(), 0);
}

// Draws ImGui's picture into the current OpenGL context; capture: may be null.
void paint_window(GLFWwindow* window, Window::Capture* capture) {
    int width = 0, height = 0;
    glfwGetFramebufferSize(window, &width, &height);
    glBindFramebuffer(GL_FRAMEBUFFER, 0);
    glViewport(0, 0, width, height);
    // The page's colour: clearing takes less time than a page-sized rectangle where the processor
    // paints.
    glClearColor(0x0B / 255.0f, 0x0C / 255.0f, 0x0D / 255.0f, 1);
    glClear(GL_COLOR_BUFFER_BIT);
    ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
    if (capture) {
        // Before the swap, after which the content of the buffers is undefined.
        const std::ptrdiff_t row = std::ptrdiff_t{3} * width;
        std::vector<std::uint8_t>& pixels = capture->pixels;
        pixels.resize(row * height);
        capture->width_px = width;
        capture->height_px = height;
        glPixelStorei(GL_PACK_ALIGNMENT, 1);
        glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, pixels.data());
        for (int y = 0; y < height / 2; ++y) {  // OpenGL counts rows from the bottom
            const auto top = pixels.begin() + row * y;
            const auto bottom = pixels.begin() + row * (height - 1 - y);
            std::swap_ranges(top, top + row, bottom);
        }
    }
    glfwSwapBuffers(window);
}

// Fills the monitor that the window is on, and goes back to `windowed`: x, y, width, height.
void switch_full_screen(GLFWwindow* window, int windowed[4]) {
    int* old = windowed;
    if (glfwGetWindowMonitor(window)) {
        glfwSetWindowMonitor(window, nullptr, old[0], old[1], old[2], old[3], 0);
        return;
    }
    glfwGetWindowPos(window, &old[0], &old[1]);
    glfwGetWindowSize(window, &old[2], &old[3]);
    // The monitor that holds the window's middle.
    GLFWmonitor* monitor = glfwGetPrimaryMonitor();
    int count = 0;
    GLFWmonitor** all = glfwGetMonitors(&count);
    for (int i = 0; i < count; ++i) {
        int x = 0, y = 0, w = 0, h = 0;
        glfwGetMonitorWorkarea(all[i], &x, &y, &w, &h);
        const int across = old[0] + old[2] / 2 - x, down = old[1] + old[3] / 2 - y;
        if (across >= 0 && across < w && down >= 0 && down < h) monitor = all[i];
    }
    if (!monitor) return;
    const GLFWvidmode* mode = glfwGetVideoMode(monitor);
    glfwSetWindowMonitor(window, monitor, 0, 0, mode->width, mode->height, mode->refreshRate);
}

}  // namespace

struct Window::Impl {
    GLFWwindow* window = nullptr;
    bool imgui = false, imgui_glfw = false, imgui_gl = false;
    int windowed[4] = {0, 0, 0, 0};
};

Result<std::unique_ptr<Window>> Window::open(const WindowOptions& options) {
    leave_a_core_to_imaging();
    glfwSetErrorCallback(on_glfw_error);
    if (!glfwInit()) {
        return Error{"no display can be opened (" + g_glfw_error + ")", "window",
                     "start it in a desktop session, or use --headless, which needs no display"};
    }
    glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
    glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 3);
    glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
    glfwWindowHint(GLFW_OPENGL_FORWARD_COMPAT, GLFW_TRUE);
    glfwWindowHint(GLFW_VISIBLE, options.visible ? GLFW_TRUE : GLFW_FALSE);
    glfwWindowHint(GLFW_SCALE_TO_MONITOR, options.ui_scale > 0 ? GLFW_FALSE : GLFW_TRUE);
    auto window = std::unique_ptr<Window>(new Window);
    window->impl_ = std::make_unique<Impl>();
    Impl& impl = *window->impl_;
    impl.window = glfwCreateWindow(options.width_px, options.height_px, options.title.c_str(),
                                   nullptr, nullptr);
    if (!impl.window) {
        return Error{"no window with OpenGL 3.3 can be made (" + g_glfw_error + ")", "window",
                     "install or update the graphics driver (Mesa's software one will do), or use "
                     "--headless"};
    }
    glfwMakeContextCurrent(impl.window);
    if (epoxy_gl_version() < 33) {
        return Error{"the graphics driver offers OpenGL " +
                         std::to_string(epoxy_gl_version() / 10) + "." +
                         std::to_string(epoxy_gl_version() % 10),
                     "window",
                     "the window needs 3.3: update the driver, set LIBGL_ALWAYS_SOFTWARE=1, or use "
                     "--headless"};
    }
    glfwSwapInterval(1);
    glfwSetWindowSizeLimits(impl.window, 960, 600, GLFW_DONT_CARE, GLFW_DONT_CARE);
    float scale = static_cast<float>(options.ui_scale);
    if (!(scale > 0)) {
        float y = 1;
        glfwGetWindowContentScale(impl.window, &scale, &y);
    }
    window->scale_ = window->asked_scale_ = std::clamp(scale, 0.75f, 4.0f);
    IMGUI_CHECKVERSION();
    ImGui::CreateContext();
    impl.imgui = true;
    ImGui::GetIO().IniFilename = nullptr;  // the layout is ours; settings are in the XDG folder
    ImGui::GetIO().ConfigWindowsMoveFromTitleBarOnly = true;
    impl.imgui_glfw = ImGui_ImplGlfw_InitForOpenGL(impl.window, true);
    glfwSetKeyCallback(impl.window, on_key);  // calls ImGui's
    glfwSetDropCallback(impl.window, on_drop);
    impl.imgui_gl = ImGui_ImplOpenGL3_Init("#version 330 core");
    if (!impl.imgui_glfw || !impl.imgui_gl) {
        return Error{"the OpenGL functions of the window cannot be loaded", "window",
                     "update the graphics driver, or use --headless"};
    }
    apply_theme(window->scale_);
    return window;
}

Window::~Window() {
    if (!impl_) return;
    if (impl_->imgui_gl) ImGui_ImplOpenGL3_Shutdown();
    if (impl_->imgui_glfw) ImGui_ImplGlfw_Shutdown();
    if (impl_->imgui) ImGui::DestroyContext();
    if (impl_->window) glfwDestroyWindow(impl_->window);
    glfwTerminate();
}

bool Window::should_close() const {
    return glfwWindowShouldClose(impl_->window);
}
void Window::request_close() {
    glfwSetWindowShouldClose(impl_->window, GLFW_TRUE);
}
void Window::set_title(const std::string& title) {
    glfwSetWindowTitle(impl_->window, title.c_str());
}

bool Window::key_held() const {
    const ImGuiIO& io = ImGui::GetIO();
    return g_taps.waiting() ||
           std::any_of(std::begin(io.KeysDown), std::end(io.KeysDown), [](bool d) { return d; }) ||
           std::any_of(std::begin(io.MouseDown), std::end(io.MouseDown), [](bool d) { return d; });
}

bool Window::typing() const {
    return ImGui::GetIO().WantTextInput;
}

void Window::wait_events(double seconds) {
    if (seconds > 0) {
        glfwWaitEventsTimeout(seconds);
    } else {
        glfwPollEvents();
    }
}

void Window::set_scale(float scale) {
    asked_scale_ = std::clamp(scale, 0.75f, 4.0f);
}

Window::Size Window::size() const {
    Size size;
    glfwGetFramebufferSize(impl_->window, &size.width_px, &size.height_px);
    return size;
}

std::string Window::dropped_file() {
    return std::exchange(g_dropped, {});
}

void Window::begin_frame(const InjectedInput& injected) {
    const Size now = size();
    const float wanted =
        fits_ && now.width_px > 0 ? fits_(now.width_px, now.height_px, asked_scale_) : asked_scale_;
    if (std::abs(wanted - scale_) > 0.01f) {
        scale_ = wanted;
        ImGui_ImplOpenGL3_DestroyFontsTexture();
        apply_theme(scale_);
        ImGui_ImplOpenGL3_CreateFontsTexture();
    }
    ImGui_ImplOpenGL3_NewFrame();
    ImGui_ImplGlfw_NewFrame();
    ImGuiIO& io = ImGui::GetIO();
    if (injected.active) {
        io.MousePos = {injected.x, injected.y};
        for (std::size_t i = 0; i < injected.buttons.size(); ++i) {
            io.MouseDown[i] = injected.buttons[i];
        }
        io.MouseWheel = injected.wheel;
        for (bool& down : io.KeysDown) down = false;
        for (int key : injected.keys) {
            if (key >= 0 && key < static_cast<int>(std::size(io.KeysDown))) io.KeysDown[key] = true;
        }
        io.KeyShift = injected.shift;
        io.KeyCtrl = injected.control;
        io.KeyAlt = injected.alt;
    }
    g_held = {io.KeyShift, io.KeyCtrl, io.KeyAlt};
    const int modifiers = g_taps.hold(io.KeysDown);
    io.KeyShift = io.KeyShift || (modifiers & GLFW_MOD_SHIFT) != 0;
    io.KeyCtrl = io.KeyCtrl || (modifiers & GLFW_MOD_CONTROL) != 0;
    io.KeyAlt = io.KeyAlt || (modifiers & GLFW_MOD_ALT) != 0;
    ImGui::NewFrame();
}

void Window::end_frame(bool capture) {
    end_frame_unseen();
    paint_window(impl_->window, capture ? &capture_ : nullptr);
}

void Window::end_frame_unseen() {
    ImGui::Render();
    ImGuiIO& io = ImGui::GetIO();
    g_taps.release(io.KeysDown);
    io.KeyShift = g_held.shift;
    io.KeyCtrl = g_held.control;
    io.KeyAlt = g_held.alt;
}

void* Window::native() const {
    return impl_->window;
}

void Window::toggle_full_screen() {
    switch_full_screen(impl_->window, impl_->windowed);
}

int key_code(const std::string& name) {
    if (name.size() == 1) return std::toupper(static_cast<unsigned char>(name[0]));
    if (name.size() >= 2 && name[0] == 'f' && std::isdigit(static_cast<unsigned char>(name[1]))) {
        const int n = std::atoi(name.c_str() + 1);
        return n >= 1 && n <= 12 ? GLFW_KEY_F1 + n - 1 : -1;
    }
    static const std::map<std::string, int> kNamed = {
        {"left", GLFW_KEY_LEFT},           {"right", GLFW_KEY_RIGHT},  {"up", GLFW_KEY_UP},
        {"down", GLFW_KEY_DOWN},           {"space", GLFW_KEY_SPACE},  {"enter", GLFW_KEY_ENTER},
        {"escape", GLFW_KEY_ESCAPE},       {"tab", GLFW_KEY_TAB},      {"pageup", GLFW_KEY_PAGE_UP},
        {"pagedown", GLFW_KEY_PAGE_DOWN},  {"home", GLFW_KEY_HOME},    {"end", GLFW_KEY_END},
        {"backspace", GLFW_KEY_BACKSPACE}, {"delete", GLFW_KEY_DELETE}};
    const auto found = kNamed.find(name);
    return found == kNamed.end() ? -1 : found->second;
}

struct SecondWindow::Impl {
    GLFWwindow *window = nullptr, *first = nullptr;
    ImGuiContext *imgui = nullptr, *first_imgui = nullptr;
    bool imgui_gl = false;
    Fonts fonts, first_fonts;
    int windowed[4] = {0, 0, 1280, 720};
    double last_s = 0;

    void use_first() {
        ImGui::SetCurrentContext(first_imgui);
        use_fonts(first_fonts);
    }
};

namespace {

void on_second_key(GLFWwindow* window, int key, int, int action, int) {
    if (key != GLFW_KEY_F11 || action != GLFW_PRESS) return;
    auto* impl = static_cast<SecondWindow::Impl*>(glfwGetWindowUserPointer(window));
    switch_full_screen(window, impl->windowed);
}

// The monitor beside the primary one; null: there is none.
GLFWmonitor* other_monitor() {
    int count = 0;
    GLFWmonitor** all = glfwGetMonitors(&count);
    return count > 1 ? all[1] : nullptr;
}

}  // namespace

Result<std::unique_ptr<SecondWindow>> SecondWindow::open(const Window& first,
                                                         const std::string& title,
                                                         int width_px,
                                                         int height_px) {
    auto second = std::unique_ptr<SecondWindow>(new SecondWindow);
    second->impl_ = std::make_unique<Impl>();
    Impl& impl = *second->impl_;
    impl.first = static_cast<GLFWwindow*>(first.native());
    int x = 0, y = 0;
    if (GLFWmonitor* monitor = other_monitor())
        glfwGetMonitorWorkarea(monitor, &x, &y, &width_px, &height_px);
    glfwWindowHint(GLFW_FOCUSED, GLFW_FALSE);  // the trainee's keys go on
    glfwWindowHint(GLFW_FOCUS_ON_SHOW, GLFW_FALSE);
    impl.window = glfwCreateWindow(width_px, height_px, title.c_str(), nullptr, impl.first);
    glfwWindowHint(GLFW_FOCUSED, GLFW_TRUE);
    glfwWindowHint(GLFW_FOCUS_ON_SHOW, GLFW_TRUE);
    if (!impl.window)
        return Error{"no second window can be made", "window", "go on with one display"};
    if (other_monitor()) glfwSetWindowPos(impl.window, x, y);
    glfwSetWindowSizeLimits(impl.window, 640, 360, GLFW_DONT_CARE, GLFW_DONT_CARE);
    glfwSetWindowUserPointer(impl.window, &impl);
    glfwSetKeyCallback(impl.window, on_second_key);
    glfwMakeContextCurrent(impl.window);
    glfwSwapInterval(0);  // the first window's display sets the pace
    glfwMakeContextCurrent(impl.first);
    impl.first_imgui = ImGui::GetCurrentContext();
    impl.first_fonts = fonts();
    impl.imgui = ImGui::CreateContext();
    ImGui::SetCurrentContext(impl.imgui);
    ImGui::GetIO().IniFilename = nullptr;
    impl.imgui_gl = ImGui_ImplOpenGL3_Init("#version 330 core");
    impl.use_first();
    if (!impl.imgui_gl)
        return Error{"the OpenGL functions of the second window cannot be loaded", "window",
                     "go on with one display"};
    return second;
}

SecondWindow::~SecondWindow() {
    if (!impl_ || !impl_->window) return;
    // What its context has bound is released in that context, before the context goes.
    glfwMakeContextCurrent(impl_->window);
    if (impl_->imgui) {
        ImGui::SetCurrentContext(impl_->imgui);
        if (impl_->imgui_gl) ImGui_ImplOpenGL3_Shutdown();
        ImGui::DestroyContext(impl_->imgui);
        ImGui::SetCurrentContext(impl_->first_imgui);
    }
    glBindTexture(GL_TEXTURE_2D, 0);
    glFinish();
    glfwMakeContextCurrent(impl_->first);
    glfwDestroyWindow(impl_->window);
}

bool SecondWindow::should_close() const {
    return glfwWindowShouldClose(impl_->window);
}

void SecondWindow::show(bool shown) {
    if (shown == shown_) return;
    shown_ = shown;
    if (shown) {
        glfwSetWindowShouldClose(impl_->window, GLFW_FALSE);
        glfwShowWindow(impl_->window);
    } else {
        glfwHideWindow(impl_->window);
    }
}

void SecondWindow::begin_frame(const std::function<float(int, int)>& fits) {
    Impl& impl = *impl_;
    impl.first_fonts = fonts();
    ImGui::SetCurrentContext(impl.imgui);
    ImGuiIO& io = ImGui::GetIO();
    int width = 0, height = 0;
    glfwGetFramebufferSize(impl.window, &width, &height);
    const float wanted = fits(width, height);
    if (std::abs(wanted - scale_) > 0.01f) {
        const bool had_fonts = scale_ > 0;
        scale_ = wanted;
        if (had_fonts) ImGui_ImplOpenGL3_DestroyFontsTexture();
        apply_theme(scale_);
        impl.fonts = fonts();
        if (had_fonts) ImGui_ImplOpenGL3_CreateFontsTexture();
    }
    use_fonts(impl.fonts);
    const double now_s = glfwGetTime();
    io.DeltaTime = static_cast<float>(impl.last_s > 0 ? std::max(now_s - impl.last_s, 1e-3) : 0.1);
    impl.last_s = now_s;
    io.DisplaySize = {static_cast<float>(width), static_cast<float>(height)};
    io.MousePos = {-FLT_MAX, -FLT_MAX};
    ImGui_ImplOpenGL3_NewFrame();
    ImGui::NewFrame();
}

void SecondWindow::end_frame(bool capture) {
    Impl& impl = *impl_;
    ImGui::Render();
    glFlush();  // what the first context drew into textures is there for the second
    glfwMakeContextCurrent(impl.window);
    paint_window(impl.window, capture ? &capture_ : nullptr);
    glfwMakeContextCurrent(impl.first);
    impl.use_first();
}

}  // namespace sonocase::runtime::inline display
