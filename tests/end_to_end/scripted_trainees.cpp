// SPDX-License-Identifier: Apache-2.0

#include "end_to_end/scripted_trainees.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "formats/base/constants.h"
#include "formats/scoring/sight.h"
#include "formats/volume/tissue.h"
#include "runtime/tracking/scripted_sweep.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/temporary_folder.h"

namespace sonocase::testing {

using runtime::MouseTracker;

namespace {

void take_needle(Attempt& a, bool in_plane) {
    a.mouse.place_needle_beside_probe(in_plane ? half_face_mm(a.exercise.probe) + 8 : 18, in_plane);
    a.tick();
}

}  // namespace

void bluff_with_fixed_keys(Attempt& a, int recipe) {
    Random keys(static_cast<std::uint64_t>(recipe) + 1);  // of the recipe, not of the attempt
    for (int i = 0; i < recipe % 4; ++i) {
        a.mouse.slide(keys.uniform(-40, 40), keys.uniform(-40, 40));
        a.mouse.fan(keys.uniform(-0.3, 0.3));
        a.tick();
    }
    take_needle(a, recipe % 5 != 4);
    a.push_to(keys.uniform(20, 120), 25);
    for (int i = 0; i < 10; ++i) a.tick();
}

void bluff_with_a_random_walk(Attempt& a, Random& random) {
    const int steps = static_cast<int>(random.uniform(5, 60));
    for (int i = 0; i < steps; ++i) {
        a.mouse.slide(random.uniform(-15, 15), random.uniform(-15, 15));
        a.mouse.fan(random.uniform(-0.15, 0.15));
        a.mouse.rock(random.uniform(-0.1, 0.1));
        a.mouse.rotate(random.uniform(-0.3, 0.3));
        a.tick();
    }
    take_needle(a, random.uniform(0, 1) < 0.8);
    a.mouse.aim_needle(random.uniform(-0.3, 0.3), random.uniform(-0.1, 0.1));
    a.push_to(random.uniform(20, 120), 25);
    for (int i = 0; i < 10; ++i) a.tick();
}

void bluff_with_a_straight_push(Attempt& a, Random& random) {
    take_needle(a, random.uniform(0, 1) < 0.8);
    a.push_to(random.uniform(10, a.exercise.needle.length_mm), 25);
    for (int i = 0; i < 10; ++i) a.tick();
}

void play_script(Attempt& a, const std::string& name, int readings) {
    for (const Sweep& sweep : a.exercise.sweeps) {
        if (sweep.name != name) continue;
        const double first_s = sweep.keys.front().time_s;
        const double step_s = (sweep.keys.back().time_s - first_s) / (readings - 1);
        for (int i = 0; i < readings; ++i) {
            const runtime::SweepPose pose =
                runtime::sweep_pose(sweep, first_s + i * step_s, &a.skin);
            SessionSample sample;
            sample.time_s = i * step_s;
            sample.probe_ok = true;
            sample.mannequin_from_probe = pose.mannequin_from_probe;
            sample.needle_ok = pose.has_needle;
            if (pose.has_needle) {
                sample.mannequin_from_needle = pose.mannequin_from_needle;
                sample.mannequin_from_drawn =
                    a.needle.update(sample.time_s, pose.mannequin_from_needle).mannequin_from_drawn;
            }
            a.session.samples.push_back(sample);
        }
    }
}

namespace {

// What the expert sees and aims at.
class Expert {
  public:
    explicit Expert(Attempt& attempt) : a_(attempt), sight_(&attempt.anatomy, attempt.exercise) {
        const Exercise& e = a_.exercise;
        for (std::size_t i = 0; i < a_.bundle.labels.size(); ++i) {
            no_go_[i] = std::find(e.no_go.begin(), e.no_go.end(), a_.bundle.labels[i].name) !=
                        e.no_go.end();
            const std::string& name = a_.bundle.labels[i].name;
            if (name == e.targets[0].inside && vessel_of_label(name) != Vessel::unknown)
                vessel_ = static_cast<int>(i);
        }
    }

    std::optional<ExpertPlan> plan() {
        if (!find()) return {};
        return plan_;
    }
    // The probe with the target in the picture's middle, from places around the first one that
    // shows it, turned about its beam in steps of 30 degrees.
    std::vector<MouseTracker> above() {
        std::vector<MouseTracker> found;
        const auto start = look();
        for (const double x : {0.0, -15.0, 15.0})
            for (const double y : {0.0, -15.0, 15.0})
                for (int turn = 0; start && turn < 6; ++turn) {
                    MouseTracker hands = *start;
                    hands.slide(x, y);
                    hands.rotate(turn * kPi / 6);
                    centre(hands, 0);
                    if (sees(hands) && std::abs(target(hands).y) < 0.5) found.push_back(hands);
                }
        return found;
    }
    bool play() {
        if (!find()) return false;
        a_.mouse = plan_->hands;
        // The plan was made for the end of a breath; from there on the needle may go.
        for (int i = 0; i < 5; ++i) a_.tick();
        wait_for_the_breath();
        a_.push_to(plan_->depth_mm, 10);
        wait_for_the_breath();
        return true;
    }

  private:
    // The target in the `probe` frame of these hands.
    Point3 target(const MouseTracker& hands) const {
        return inverse(hands.mannequin_from_probe()) * a_.exercise.targets[0].centre;
    }
    // Any part of the target is in the picture, and sound reaches it.
    bool sees(const MouseTracker& hands) const {
        const Point3 p = target(hands);
        const Probe& probe = a_.exercise.probe;
        return std::abs(p.y) <= a_.exercise.targets[0].radius_mm && in_image(probe, p.x, p.z) &&
               sound_reaches(a_.anatomy, probe, hands.mannequin_from_probe(), p, 0);
    }
    void wait_for_the_breath() {
        const BreathingMotion& breathing = a_.exercise.breathing;
        if (breathing.amplitude_mm == 0) return;
        do {
            a_.tick();
        } while (std::fmod(a_.time_s - Attempt::kTickS, breathing.period_s) >
                 0.5 * Attempt::kTickS);
    }

    // Turns one of the hands' ways of moving until `off` is zero; by secants.
    template <class Move, class Off>
    static void bring_to_zero(MouseTracker& hands, double step, Move move, Off off) {
        for (int i = 0; i < 12 && std::abs(off(hands)) > 0.05; ++i) {
            const double before = off(hands);
            move(hands, step);
            const double slope = (off(hands) - before) / step;
            if (!(std::abs(slope) > 1e-3)) return;
            const double left = off(hands) / slope;
            move(hands, std::clamp(-left, -20 * step, 20 * step));
        }
    }
    // The target into the scan plane, and towards x_mm beside its middle.
    void centre(MouseTracker& hands, double x_mm) const {
        for (int i = 0; i < 3; ++i) {
            bring_to_zero(
                hands, 0.01, [](MouseTracker& m, double by) { m.fan(by); },
                [&](const MouseTracker& m) { return target(m).y; });
            bring_to_zero(
                hands, 1, [](MouseTracker& m, double by) { m.slide(by, 0); },
                [&](const MouseTracker& m) { return target(m).x - x_mm; });
        }
        bring_to_zero(
            hands, 0.01, [](MouseTracker& m, double by) { m.fan(by); },
            [&](const MouseTracker& m) { return target(m).y; });
    }

    // The first place of a spiral from where fanning shows the target; not yet over it.
    std::optional<MouseTracker> look() {
        std::optional<MouseTracker> found;
        spiral([&] {
            for (double fan = -0.7; fan <= 0.71; fan += 0.05) {
                MouseTracker hands = a_.mouse;
                hands.fan(fan);
                if (!sees(hands)) continue;
                found = a_.mouse;
                return true;
            }
            return false;
        });
        return found;
    }
    // In a square spiral over the skin from where the attempt began, fanning at each place.
    bool find() {
        return spiral([&] { return look_here() && plan_->visible > 0.8; }) || plan_.has_value();
    }
    // True as soon as done() is.
    template <class Done>
    bool spiral(Done done) {
        constexpr double kStepMm = 12;
        constexpr int kTurns = 22;
        const double way[4][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
        for (int leg = 0; leg < kTurns; ++leg) {
            for (int i = 0; i <= leg / 2; ++i) {
                if (done()) return true;
                a_.mouse.slide(kStepMm * way[leg % 4][0], kStepMm * way[leg % 4][1]);
                a_.tick();
            }
        }
        return false;
    }
    bool look_here() {
        for (double fan = -0.7; fan <= 0.71; fan += 0.05) {
            MouseTracker hands = a_.mouse;
            hands.fan(fan);
            if (!sees(hands)) continue;
            for (int turn = 0; turn < 12; ++turn) {
                for (const double x_mm : {0.0, -20.0, 20.0}) {
                    MouseTracker turned = hands;
                    turned.rotate(turn * kPi / 12);
                    centre(turned, x_mm);
                    if (!sees(turned) || std::abs(target(turned).y) > 0.5) continue;
                    plan_needle(turned);
                    if (plan_ && plan_->visible > 0.9) return true;
                }
            }
            return plan_.has_value();
        }
        return false;
    }
    void plan_needle(const MouseTracker& probe) {
        const double half = half_face_mm(a_.exercise.probe);
        for (const double side : {-1.0, 1.0}) {
            for (double beside = 6; beside < 60; beside += 6) {
                MouseTracker hands = probe;
                if (!hands.place_needle_beside_probe(side * (half + beside), true)) break;
                aim(hands);
                consider(hands);
            }
        }
    }
    // The entry into the scan plane, and the needle at the target.
    void aim(MouseTracker& hands) const {
        const Rigid pose = hands.mannequin_from_probe();
        for (int i = 0; i < 4; ++i)
            hands.slide_needle(0, -(inverse(pose) * hands.needle_entry()).y);
        const auto off = [&](const MouseTracker& m, int axis) {
            const Vector3 d =
                transpose(pose.rotation) * m.mannequin_from_needle().rotation.column(2);
            const Vector3 wanted = normalized(target(m) - inverse(pose) * m.needle_entry());
            return 100 * (axis == 0 ? d.x - wanted.x : d.y - wanted.y);
        };
        for (int i = 0; i < 2; ++i) {
            bring_to_zero(
                hands, 0.01, [](MouseTracker& m, double by) { m.aim_needle(by, 0); },
                [&](const MouseTracker& m) { return off(m, 0); });
            bring_to_zero(
                hands, 0.01, [](MouseTracker& m, double by) { m.aim_needle(0, by); },
                [&](const MouseTracker& m) { return off(m, 1); });
        }
    }
    // Whether the way is free, and how much of it the picture will show.
    void consider(const MouseTracker& hands) {
        const Point3 entry = hands.needle_entry(), end = a_.exercise.targets[0].centre;
        const double depth = distance(entry, end);
        if (depth > a_.exercise.needle.length_mm - 5) return;
        const Vector3 along = (end - entry) / depth;
        const Vector3 shaft = hands.mannequin_from_needle().rotation.column(2);
        if (norm(shaft - along) * depth > 1) return;
        for (const double part : {0.0, 0.5}) {
            const double time_s = part * a_.exercise.breathing.period_s;
            bool in_vessel = false;
            for (double s = 1; s < depth; s += vessel_ < 0 ? 1 : 0.25) {
                const Point3 p = a_.anatomy.at_rest(entry + s * along, time_s);
                const int label = a_.anatomy.label(p);
                if (a_.anatomy.blocks_sound(label) || no_go_[static_cast<std::size_t>(label)])
                    return;
                // Into a vessel once.
                if (vessel_ < 0) continue;
                if (label != vessel_ && in_vessel) return;
                in_vessel = label == vessel_;
            }
        }
        const Rigid pose = hands.mannequin_from_probe(), back = inverse(pose);
        const double seen = sight_.visible_mm(pose, back * end, back * entry, 0) / depth;
        if (plan_ && plan_->visible >= seen) return;
        plan_.emplace(ExpertPlan{hands, depth, seen});
    }

    Attempt& a_;
    NeedleSight sight_;
    std::array<bool, 256> no_go_{};
    int vessel_ = -1;  // label that the target lies in; -1: no vessel
    std::optional<ExpertPlan> plan_;
};

}  // namespace

std::optional<ExpertPlan> plan_as_an_expert(Attempt& attempt) {
    return Expert(attempt).plan();
}

std::vector<MouseTracker> look_as_an_expert(Attempt& attempt) {
    return Expert(attempt).above();
}

bool play_as_an_expert(Attempt& attempt) {
    return Expert(attempt).play();
}

void expect_expert_ticks_all(const std::string& bundle, const std::string& exercise) {
    const TemporaryFolder folder;
    const std::string stats = folder / "stats.json";
    const auto run =
        run_command(std::string(SONOCASE_BIN) + "/sonoplay " + bundle + " --exercise " + exercise +
                    " --headless --tracker sweep:expert --model paper --size 64x64 "
                    "--frames 720 --record " +
                    (folder / "attempt.igs.mha") + " --stats " + stats);
    ASSERT_EQ(run.status, 0) << run.error;
    const std::string text = read_text(stats);
    const std::size_t list = text.find("\"procedure\"");
    ASSERT_NE(list, std::string::npos) << exercise;
    EXPECT_NE(text.find("\"ticked\": true", list), std::string::npos) << exercise;
    EXPECT_EQ(text.find("\"ticked\": false", list), std::string::npos)
        << exercise << ": " << text.substr(list);
}

}  // namespace sonocase::testing
