// SPDX-License-Identifier: Apache-2.0

#include "runtime/display/second_window.h"

#include <epoxy/gl.h>
// GLFW must follow the OpenGL loader.
#include <GLFW/glfw3.h>
#include <backends/imgui_impl_opengl3.h>
#include <imgui.h>

#include <cfloat>
#include <cmath>

#include "runtime/display/window_native.h"

namespace sonocase::runtime {

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
    toggle_full_screen(window, impl->windowed);
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
    // In its own context: what that one has bound is let go of there, before the context goes.
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

}  // namespace sonocase::runtime
