// SPDX-License-Identifier: Apache-2.0

// From tracker readings to pixels: calibrations, sensor checks, needle, renderer. Poses go in, a
// frame and what happened to sensors and needle come out. One frame is one call; nothing here
// waits, reads a file or looks at a clock, so that the window, the headless run, a test and a
// browser drive the same engine.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "formats/bundle/case_bundle.h"
#include "formats/calibration/calibration.h"
#include "formats/exercise/exercise.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/procedure_run.h"
#include "formats/scoring/session_score.h"
#include "runtime/engine/needle_puncture.h"
#include "runtime/engine/needle_state.h"
#include "runtime/engine/sensor_watch.h"
#include "runtime/engine/skin.h"
#include "runtime/engine/tracker_reading.h"
#include "runtime/imaging/core/frame_input.h"
#include "runtime/imaging/renderer.h"

namespace sonocase::runtime::inline engine {

struct Calibrations {
    std::optional<Calibration> probe, needle, mannequin;
    double needle_lag_s = 0;  // how much later the needle's readings come than the probe's
};

// Which sensor is on which tool; -1: none. A reference is fixed to the mannequin: with one, probe
// and needle are taken relative to it, so that the mannequin may be moved.
struct SensorAssignment {
    int probe = kProbeSensor;
    int needle = kNeedleSensor;
    int reference = -1;
    friend bool operator==(const SensorAssignment&, const SensorAssignment&) = default;
};

// The assignment that holds for a reading: scripts, the mouse and recordings deliver tools rather
// than sensors, at the default indices.
SensorAssignment places_of(const TrackerReading& reading, const SensorAssignment& assignment);

// The tools of a reading, in the frame `mannequin`.
struct ToolPoses {
    bool has_probe = false, has_needle = false;
    Rigid mannequin_from_probe;
    Rigid mannequin_from_needle;  // origin at the tip, z from hub to tip
    // How long ago a device measured them; a tool that is lost keeps its last pose and is not
    // `has`.
    double probe_age_s = 0, needle_age_s = 0;
};

// A sensor that has a pose; null: it is absent or lost, or its pose is none (has_pose()).
const SensorReading* sensor_with_pose(const TrackerReading& reading, int index);

// The pose of a sensor as calibrations mean it: relative to the reference where there is one,
// unless the sensor's own pose is in `mannequin`. Nothing for a sensor that is absent or lost,
// whose pose is not a number, or whose reference is so or came more than 0.25 s before. Constant
// time.
std::optional<Rigid> sensor_pose(const TrackerReading& reading,
                                 const SensorAssignment& assignment,
                                 int index);

// Applies the reference, sensor_from_tool and world_from_mannequin (with its scale). A sensor that
// is absent or lost, or whose pose is not a number, yields no tool. Constant time.
ToolPoses tool_poses(const TrackerReading& reading,
                     const Calibrations& calibrations,
                     const SensorAssignment& assignment);

// What a frame was rendered from, enough to render the same pixels again: the cine loop keeps these
// instead of pictures.
struct FrameRecord {
    FrameInput input;
    ToolPoses tools;
    NeedleView needle;  // as drawn, after the bend constraint
    PressReport press;  // what the probe does to the tissue
    PunctureReport puncture;
    DopplerReport doppler;  // from the Doppler view beside the engine, where there is one
    ActList acts;           // of the procedure, in this frame
    std::uint32_t new_steps = 0, new_complications = 0;  // ProcedureRun's, as bits
    double reading_time_s = 0;
    bool skin_not_fitted = false;  // the probe touches skin that was not fitted; see SkinFit
    bool unseen = false;           // the picture on the screen was frozen
};

struct EngineOptions {
    RenderOptions render;
    double depth_mm = 0;  // > 0 overrides the exercise's
    double focus_mm = 0;  // > 0 overrides the exercise's
};

// True if the probe's face touches the skin somewhere: the body lies within 4 mm, which gel
// bridges, of one of five points across the face. Constant time.
bool probe_in_contact(const Skin& skin, const Probe& probe, const Rigid& mannequin_from_probe);

// Fills in the probe's motion since the frame before, which Doppler modes show; none across a gap
// or at the first frame.
void add_probe_motion(const FrameInput& before, FrameInput& input);

class ScanEngine {
  public:
    // The bundle must outlive the engine.
    static Result<ScanEngine> create(CaseView bundle,
                                     const Exercise& exercise,
                                     const EngineOptions& options);

    // Takes a new reading; the next frame shows it. A tool is lost, in the picture, the recording
    // and the scores, once its own sensor has no pose to be believed (SensorWatch::lost), whatever
    // the others say, and both are with the reference; so is one of a device at exactly 0, 0, 0,
    // which senders give for none.
    void observe(const TrackerReading& reading, bool is_device);
    void begin_procedure();  // as if nothing had been done yet
    // After a reading that restarts: takes the procedure through the samples that a recording or a
    // script holds before it, so that state, list and moments are those of playing it. Renders
    // nothing. Cost: an update of the procedure for each, and the press where they do not hold it.
    void pass_over(std::span<const SessionSample> samples);
    // An act of the exercise's procedure, for the next frame; at most four come into one frame, the
    // rest into those after it. False: dozens of them wait already.
    bool act(const Act& act);
    const ProcedureRun& procedure() const { return procedure_; }
    // Renders the frame of the last reading; pixels # width * height. unseen: another picture is on
    // the screen, so that no step of the procedure is done by looking. Neither throws nor
    // allocates.
    FrameStatus frame(double now_s,
                      const ImageSettings& settings,
                      std::span<std::uint8_t> pixels,
                      bool unseen = false);
    // Begins a session: its time and its frame numbers count from here, and no needle is inserted
    // yet. What is rendered afterwards depends on readings, settings and times since now_s alone,
    // so that a replay of the recording gives the same pixels.
    void begin_session(double now_s);
    // Continues from another engine of the same bundle and exercise: session clock, frame numbers,
    // tools, inserted needle. For a change of depth in the middle of a session.
    void take_over(const ScanEngine& before);
    // Renders a past frame again: the same pixels.
    FrameStatus frame_again(const FrameRecord& record, std::span<std::uint8_t> pixels);

    void set_calibrations(const Calibrations& calibrations) { calibrations_ = calibrations; }
    void set_assignment(const SensorAssignment& assignment) {
        // What was seen of a reference says nothing once there is another or none.
        if (assignment.reference != assignment_.reference) reference_watch_ = SensorWatch();
        assignment_ = assignment;
    }

    const FrameRecord& last() const { return last_; }
    std::shared_ptr<const Anatomy> anatomy() const { return anatomy_; }
    SensorVerdict probe_verdict(double now_s) const { return probe_watch_.verdict(now_s); }
    SensorVerdict needle_verdict(double now_s) const { return needle_watch_.verdict(now_s); }
    // absent: no reference is in use.
    SensorVerdict reference_verdict(double now_s) const { return reference_watch_.verdict(now_s); }
    // Of the pose last believed (SensorWatch::age_s()).
    double needle_age_s(double now_s) const { return needle_watch_.age_s(now_s); }
    int jumps() const { return probe_watch_.jumps() + needle_watch_.jumps(); }
    const Renderer& renderer() const { return renderer_; }
    const Exercise& exercise() const { return exercise_; }
    const RenderOptions& render_options() const { return options_.render; }

  private:
    ScanEngine(CaseView bundle,
               Exercise exercise,
               const Exercise& written,
               EngineOptions options,
               Renderer renderer)
        : skin_(*bundle),
          skin_fit_(*bundle),
          anatomy_(std::make_shared<CaseAnatomy>(
              bundle,
              breathing_shown(
                  exercise, options.render.model == ImageModel::physical, options.render.effects))),
          needle_(anatomy_.get(), exercise.needle),
          puncture_(*bundle, exercise.needle),
          procedure_(written, anatomy_, bundle->labels),
          exercise_(std::move(exercise)),
          options_(std::move(options)),
          renderer_(std::move(renderer)) {}

    FrameStatus finish(const FrameInput& input, FrameStatus status, std::span<std::uint8_t> pixels);

    Skin skin_;
    SkinFit skin_fit_;
    std::shared_ptr<CaseAnatomy> anatomy_;  // its address stays when the engine moves
    NeedleState needle_;
    PunctureState puncture_;
    ForceWatch force_watch_;
    ProcedureRun procedure_;
    static constexpr int kMaxWaitingActs = 64;
    std::array<Act, kMaxWaitingActs> waiting_acts_{};
    int waiting_act_count_ = 0;
    // The procedure's time less the session's: after a jump it is that of the recording.
    double procedure_shift_s_ = 0;
    double sensed_press_mm_ = 0;  // depth of pressing that the force sensor's last reading asks for
    Exercise exercise_;
    EngineOptions options_;
    Renderer renderer_;
    Calibrations calibrations_;
    SensorAssignment assignment_;
    SensorWatch probe_watch_, needle_watch_, reference_watch_;
    TrackerReading reading_;
    FrameRecord last_;
    ToolPoses tools_;
    std::uint32_t frame_ = 0;
    double origin_s_ = 0;  // when the session began
};

// Fills the part of a session's sample that comes from a frame: all but the settings' text. Sample
// is RecordedFrame on the desktop and SessionSample in a page. Does not allocate.
template <class Sample>
void fill_sample(const FrameRecord& record, Sample& sample) {
    sample.time_s = record.input.time_s;
    sample.frame = record.input.frame;
    sample.probe_ok = record.tools.has_probe;
    sample.needle_ok = record.tools.has_needle;
    sample.probe_age_s = record.tools.probe_age_s;
    sample.needle_age_s = record.tools.needle_age_s;
    sample.mannequin_from_probe = record.tools.mannequin_from_probe;
    sample.mannequin_from_needle = record.tools.mannequin_from_needle;
    sample.mannequin_from_drawn = record.needle.mannequin_from_drawn;
    sample.has_press = record.press.solved;
    sample.press = {record.press.force_n, record.press.pressure_kpa, record.press.vein_open};
    sample.acts = record.acts;
    sample.unseen = record.unseen;
}

}  // namespace sonocase::runtime::inline engine
