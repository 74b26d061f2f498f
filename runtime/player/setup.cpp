// Guided set-up: trackers, probe, needle, mannequin, try, save.
#include <imgui.h>

#include "runtime/player/app.h"

namespace sonocase::runtime {

void draw_setup(App& app) {
    (void)app;
}

}  // namespace sonocase::runtime
