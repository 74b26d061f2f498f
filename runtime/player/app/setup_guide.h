// SPDX-License-Identifier: Apache-2.0

// The guided set-up without its window: what it asks for, what it has collected, how good that is.
//
//   trackers > probe tip > probe depth > probe lateral > needle > mannequin > done
//
// Readings come in as they arrive, and a step is fitted again as its readings grow in number, so
// that residuals and coverage are live. The fits are those of formats/calibration.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/calibration/direction.h"
#include "formats/calibration/landmarks.h"
#include "formats/calibration/needle.h"
#include "formats/calibration/point.h"
#include "runtime/engine/scan_engine.h"

namespace sonocase::runtime::inline player_app {

enum class SetupStep { trackers, probe_tip, probe_depth, probe_lateral, needle, mannequin, done };
inline constexpr int kSetupSteps = 7;

const char* setup_title(SetupStep step);
const char* setup_instruction(SetupStep step);

// How long the readings of a step take, about.
double setup_seconds(SetupStep step);

// Where a tool that pivots on its tip has leaned, as fields seen along its mean direction: the
// middle (0), six about it (1 to 6) and ten about those (7 to 16).
struct TiltFields {
    static constexpr int kInner = 6, kOuter = 10, kCount = 1 + kInner + kOuter;
    // Where a ring begins, and where the outer one ends on the screen.
    static constexpr double kInnerRad = 0.14, kOuterRad = 0.35, kEdgeRad = 0.6;

    std::array<bool, kCount> leaned{};
    double x_rad = 0, y_rad = 0;  // where the newest reading leans

    int count() const { return static_cast<int>(std::count(leaned.begin(), leaned.end(), true)); }
};
// tip_mm: in the sensor's frame. Nothing if the sensor sits on the tip, where no lean shows.
std::optional<TiltFields> tilt_fields(std::span<const Pose> poses, Vector3 tip_mm);

// What the screen shows of the current step.
struct SetupView {
    double seconds = 0;    // that the readings of this step span
    int readings = 0;      // collected in this step
    int recordings = 0;    // of the needle: depths recorded so far
    double rms_mm = -1;    // negative: no fit yet
    double sigma_mm = -1;  // standard deviation of what the step finds; negative: no fit yet
    // The figure that decides: how well the step's result is known, of a direction 100 mm away; of
    // the mannequin how well the skin fits. Negative: none yet.
    double figure_mm = -1;
    double coverage = 0;              // [0, 1]; 1: as much movement as the fit can use
    std::optional<TiltFields> tilts;  // of a step in which a tool pivots
    bool good_enough = false;
    std::string sentence;             // what is still missing, or that the step is done
    std::vector<float> residuals_mm;  // of the newest readings
};

// What the step's figure has to stay below; 0: it has none.
double setup_needed_mm(SetupStep step);

class SetupGuide {
  public:
    // The bundle must outlive the guide.
    explicit SetupGuide(const CaseBundle& bundle) : bundle_(&bundle) {}

    SetupStep step() const { return step_; }
    void go_to(SetupStep step);
    void next() {
        go_to(static_cast<SetupStep>(std::min(static_cast<int>(step_) + 1, kSetupSteps - 1)));
    }

    bool recording() const { return recording_; }
    void record(bool on);
    void clear_step();
    // Takes a reading of the tracker while recording. Cost: a fit (10 ms) at most twice per second.
    void observe(const TrackerReading& reading, const SensorAssignment& assignment, double now_s);

    const SetupView& view() const { return view_; }
    // What has been found so far; a tool whose steps are not finished is absent. The sensor and the
    // date are written into the calibrations.
    Calibrations calibrations(const std::string& sensor, const std::string& date) const;
    // Whether a step has found what it is for.
    bool found(SetupStep step) const;
    bool probe_ready() const { return tip_.determined && frame_.determined; }

  private:
    void fit();  // the current step again
    void fit_probe_direction(const std::vector<Pose>& poses);
    void fit_needle_depths(const std::vector<Pose>& poses);
    void fit_mannequin(const std::vector<Pose>& poses);
    std::vector<Pose>& poses_of(SetupStep step) { return poses_[static_cast<int>(step)]; }

    const CaseBundle* bundle_;
    SetupStep step_ = SetupStep::trackers;
    bool recording_ = false;
    std::array<std::vector<Pose>, kSetupSteps> poses_;
    std::vector<std::vector<Pose>> depths_;  // finished recordings of the needle
    std::uint64_t last_sequence_ = 0;
    double fitted_s_ = -1;
    SetupView view_;
    PointFit tip_;
    DirectionFit depth_, lateral_;
    ProbeFrame frame_;
    NeedleFit needle_;
    RigidFit mannequin_;
};

}  // namespace sonocase::runtime::inline player_app
