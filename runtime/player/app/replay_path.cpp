// SPDX-License-Identifier: Apache-2.0

#include "runtime/player/app/replay_path.h"

#include <algorithm>
#include <cmath>

#include "runtime/player/app/attempt_steps.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/recording/settings_text.h"

namespace sonocase::runtime {
namespace {

constexpr double kStepMm = 2;
constexpr std::size_t kMostPoints = 4000;

// The console as it was recorded up to a time of the replay: mode, box, gate, gain and the rest.
// What the user changes stays until the recording changes it.
void take_recorded_settings(App& app) {
    ScanState& scan = app.scan;
    if (!scan.recorded || !scan.tracker.paced) return;
    const SessionReplay& recorded = *scan.recorded;
    const double at_s = scan.tracker.paced->at_s();
    const auto after = std::upper_bound(recorded.times_s.begin(), recorded.times_s.end(), at_s);
    const auto end = static_cast<std::size_t>(after - recorded.times_s.begin());
    // Back to an earlier time: from the beginning.
    std::size_t from = end < scan.replayed_frame ? 0 : scan.replayed_frame;
    scan.replayed_frame = end;
    ImageSettings settings = scan.controls.settings;
    bool changed = false;
    for (; from < end; ++from) {
        if (recorded.settings[from].empty()) continue;
        apply_settings_text(recorded.settings[from], settings);
        changed = true;
    }
    if (!changed) return;
    choose_mode(app, settings.doppler.mode);
    settings.doppler.mode = scan.controls.settings.doppler.mode;  // off where it cannot be shown
    scan.controls.settings = settings;
}

}  // namespace

std::vector<Point3> straight_way(Point3 a, Point3 b) {
    const Vector3 way = b - a;
    const int steps = std::max(static_cast<int>(std::lround(norm(way) / kStepMm)), 1);
    std::vector<Point3> points;
    for (int i = 0; i <= steps; ++i) points.push_back(a + (double(i) / steps) * way);
    return points;
}

void follow_replay(App& app) {
    ScanState& scan = app.scan;
    if (!replays(scan)) {
        scan.tip_path.clear();
        scan.best_way.clear();
        return;
    }
    take_recorded_settings(app);
    if (scan.best_way.empty() && scan.score) {
        // The insertion that came nearest to its target.
        const InsertionScore* best = nullptr;
        for (const InsertionScore& insertion : scan.score->insertions) {
            if (insertion.target < 0) continue;
            if (!best || insertion.tip_to_target_mm < best->tip_to_target_mm) best = &insertion;
        }
        if (best) scan.best_way = straight_way(best->entry, best->target_centre);
    }
    const FrameRecord& record = app.loaded.frame().record;
    if (record.input.time_s < scan.replay_s) scan.tip_path.clear();  // jumped back
    scan.replay_s = record.input.time_s;
    if (!record.tools.has_needle || record.needle.depth_mm <= 0) return;
    const Point3 tip = record.needle.mannequin_from_drawn * Point3{0, 0, 0};
    const bool moved = scan.tip_path.empty() || distance(scan.tip_path.back(), tip) > 0.5;
    if (moved && scan.tip_path.size() < kMostPoints) scan.tip_path.push_back(tip);
}

}  // namespace sonocase::runtime
