// SPDX-License-Identifier: Apache-2.0

// The player with a window: what it holds, and the steps that its panels and keys can take. The
// panels are free functions over this one struct, each in its own file.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "runtime/display/image_texture.h"
#include "runtime/display/view3d.h"
#include "runtime/display/window.h"
#include "runtime/player/attempt.h"
#include "runtime/player/command_line.h"
#include "runtime/player/image_view.h"
#include "runtime/player/input_script.h"
#include "runtime/player/open_case.h"
#include "runtime/player/scan_thread.h"
#include "runtime/player/serve.h"
#include "runtime/player/settings.h"
#include "runtime/player/setup_guide.h"
#include "runtime/player/view_pace.h"
#include "runtime/tracking/mouse_tracker.h"
#include "runtime/tracking/paced_tracker.h"
#include "runtime/tracking/push_tracker.h"

namespace sonocase::runtime {

struct Notice {
    enum class Kind { news, warning, error } kind = Kind::news;
    std::string text;
    double since_s = 0;
};

enum class Page { bundles, scan };

struct App {
    PlayerArguments arguments;
    Settings settings;
    std::string settings_file;
    double clock_start_s = 0;
    std::unique_ptr<Window> window;

    Page page = Page::bundles;
    std::vector<BundleEntry> bundles;
    int bundle_cursor = 0;
    char bundle_path[1024] = "";

    // The open case. The scan thread's engine points into it: closed first.
    std::unique_ptr<OpenCase> open;
    bool damage_told = false;  // of `open`: VoxelBlocks::damaged()
    std::unique_ptr<Skin> skin;
    int exercise = 0;
    std::string model;  // "paper", "physical"
    double depth_mm = 0, focus_mm = 0;
    int render_px = 512;
    Calibrations calibrations;
    std::string tracker_spec = "mouse";
    std::unique_ptr<MouseTracker> mouse;  // while tracker_spec is mouse
    std::shared_ptr<PushTracker> mouse_feed;
    std::shared_ptr<PacedTracker> paced;               // while it is a recording or a script
    std::string checked_device;                        // whose calibrations were compared with it
    std::shared_ptr<const Anatomy> anatomy;            // of the open case, as the picture breathes
    std::shared_ptr<const PhysicalTextures> textures;  // made with the first engine
    bool exact = false;  // a session is recorded: no accuracy is given up
    std::unique_ptr<ScanThread> scan;
    ScanControls controls;

    // An attempt at the exercise, and the scores of the last one.
    std::shared_ptr<Attempt> attempt;    // shared with the scan thread
    std::shared_ptr<IgtlServer> server;  // --serve
    std::optional<SessionScore> score;
    std::string score_file;
    bool show_score = false;

    // Of the picture
    std::unique_ptr<ImageTexture> texture;
    std::unique_ptr<View3d> view3d;
    ImageView image;
    bool measuring = false;
    int cine_back = 0;
    bool playing_cine = false;
    double cine_clock_s = 0;
    std::vector<bool> hits;  // targets reached in free scanning or in the attempt
    void* view_texture = nullptr;
    ViewPace view_pace;
    double screen_ms = 0;  // pose to the picture handed to the display, of the last frame shown
    double ui_rate = 0;
    WindowStats window_stats;
    std::set<std::string> told;  // of the tracker, on standard error: each sentence once

    std::unique_ptr<SetupGuide> guide;  // of the open case
    bool show_help = false, show_setup = false;
    std::vector<Notice> notices;
    InputScript script;
    double now_s = 0;  // of this picture

    const Exercise& current() const { return open->exercises[static_cast<std::size_t>(exercise)]; }
    const ScanFrame& frame() const { return scan->frame(); }
};

// Steps. Failures become notices; what still works goes on.
void notify(App& app, Notice::Kind kind, const std::string& text);
bool open_bundle(App& app, const std::string& path, const std::string& exercise);
void close_bundle(App& app);
void choose_exercise(App& app, int index);
void choose_tracker(App& app, const std::string& spec);
void rebuild_engine(App& app, bool keep_session = true);  // after depth, focus, model, picture size
void change_depth(App& app, double by_mm);
void change_focus(App& app, double by_mm);
void set_frozen(App& app, bool frozen);
void step_cine(App& app, int frames);
void toggle_needle(App& app, bool in_plane);
void change_pace(App& app, int steps);                  // of a recording or script: slower, faster
Point3 target_now(const App& app, std::size_t target);  // where breathing has taken it
void start_attempt(App& app, const std::string& path);  // "": a new file of the user's
void finish_attempt(App& app);
Status save_screenshot(App& app, const std::string& path);

// Panels, one file each.
void draw_bundle_page(App& app);
void draw_scan_page(App& app);
void draw_top_bar(App& app, float height);
void draw_exercise_panel(App& app);
void draw_tracker_panel(App& app);
void draw_console_panel(App& app);
void draw_effects_panel(App& app);
void draw_view3d_panel(App& app, float height);
void draw_help(App& app);
void draw_notices(App& app);
void draw_setup(App& app);
void draw_score_window(App& app);

// Mouse on the picture and keys everywhere.
void handle_keys(App& app, double seconds);
void handle_picture_mouse(App& app);

// Runs until the window is closed; errors only before it is open.
Status run_window(const PlayerArguments& arguments, double start_s);

}  // namespace sonocase::runtime
