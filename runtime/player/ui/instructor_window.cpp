// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/ui/instructor_window.h"

#include <algorithm>

#include "runtime/player/session/pictures/png_file.h"
#include "runtime/player/ui/box_file.h"
#include "runtime/player/ui/pages/pages.h"
#include "runtime/player/words/words.h"

namespace sonocase::runtime {
namespace {

// As large as leaves the room that the page needs.
float fitting_scale(int width_px, int height_px) {
    const float fits =
        std::min(static_cast<float>(width_px) / 1200, static_cast<float>(height_px) / 660);
    return std::clamp(fits, 0.75f, 4.0f);
}

void open_or_close(App& app) {
    InstructorView& view = app.view.instructor;
    if (view.window && view.window->shown() && view.window->should_close()) view.wanted = false;
    if (view.window) {
        view.window->show(view.wanted);
        return;
    }
    if (!view.wanted) return;
    const Window::Size size = app.view.window->size();
    auto opened = SecondWindow::open(*app.view.window, tr("Instructor's display"), size.width_px,
                                     size.height_px);
    if (!opened) {
        app.view.notices.error(opened.error().message());
        view.wanted = false;
        return;
    }
    view.window = std::move(*opened);
    view.frame = 0;
}

}  // namespace

Status follow_instructor_window(App& app,
                                Ui& ui,
                                const TrackerHealth& tracker,
                                const std::string& shot) {
    InstructorView& view = app.view.instructor;
    open_or_close(app);
    if (!view.window || !view.window->shown()) return Done{};
    if (!view.pace.due(app.player.now_s) && shot.empty()) return Done{};
    view.window->begin_frame(fitting_scale);
    ui.begin(view.window->scale(), app.player.now_s);
    draw_instructor_page(app, ui, tracker);
    view.window->end_frame(!shot.empty());
    if (shot.empty()) return Done{};
    const Window::Capture& picture = view.window->captured();
    if (Status saved = write_png(shot, picture.width_px, picture.height_px, 3, picture.pixels);
        !saved)
        return saved;
    return write_boxes(ui, shot);
}

}  // namespace sonocase::runtime
