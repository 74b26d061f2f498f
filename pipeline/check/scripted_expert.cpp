// SPDX-License-Identifier: Apache-2.0

#include "pipeline/check/scripted_expert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "formats/scoring/anatomy.h"
#include "pipeline/check/needle_plan.h"

namespace sonocase::pipeline::inline check {
namespace {

constexpr double kTickS = 0.05;
constexpr double kPushMmS = 10, kWithdrawMmS = 40;
constexpr double kBeforeSkinMm = 8;

// The hands of the expert: they add samples to a session.
class Hands {
  public:
    Hands(const Exercise& exercise, Session& session) : exercise_(exercise), session_(session) {}

    void play(const AimWindow& window, Point3 target, bool last) {
        probe_ = probe_pose(window.skin, window.beam, window.lateral);
        has_needle_ = window.needle;
        if (!window.needle) {
            rest(2);
            return;
        }
        const double deep = distance(window.entry, target);
        move(window, -kBeforeSkinMm);
        rest(0.5);
        wait_for_breath_end();
        for (double s = -kBeforeSkinMm; s < deep; s += kPushMmS * kTickS) advance(window, s);
        advance(window, deep);
        rest(1);
        wait_for_breath_end();
        if (last) return;
        for (double s = deep; s > -kBeforeSkinMm; s -= kWithdrawMmS * kTickS) advance(window, s);
        move(window, -kBeforeSkinMm);
        rest(0.5);
    }

  private:
    void tick() {
        SessionSample sample;
        sample.time_s = kTickS * static_cast<double>(session_.samples.size());
        sample.frame = static_cast<std::int64_t>(session_.samples.size());
        sample.probe_ok = true;
        sample.mannequin_from_probe = probe_;
        sample.needle_ok = has_needle_;
        sample.mannequin_from_needle = sample.mannequin_from_drawn = needle_;
        session_.samples.push_back(sample);
    }
    void rest(double seconds) {
        for (double t = 0; t < seconds; t += kTickS) tick();
    }
    void move(const AimWindow& w, double depth_mm) {
        const Vector3 x = any_perpendicular(w.needle_direction);
        needle_.rotation =
            Matrix3::from_columns(x, cross(w.needle_direction, x), w.needle_direction);
        needle_.translation = w.entry + depth_mm * w.needle_direction - Point3{};
    }
    void advance(const AimWindow& w, double depth_mm) {
        move(w, depth_mm);
        tick();
    }
    // Adds samples until the last one lies at the end of a breath.
    void wait_for_breath_end() {
        const BreathingMotion& breathing = exercise_.breathing;
        if (breathing.amplitude_mm == 0 || !(breathing.period_s > 0)) return;
        double off_s = 0;
        do {
            tick();
            off_s = std::fmod(session_.samples.back().time_s, breathing.period_s);
            off_s = std::min(off_s, breathing.period_s - off_s);
        } while (off_s > 0.51 * kTickS);
    }

    const Exercise& exercise_;
    Session& session_;
    Rigid probe_, needle_;
    bool has_needle_ = false;
};

// Scores that need a probe that presses, and tissue that yields.
bool needs_pressing(std::string_view metric) {
    constexpr std::array<std::string_view, 5> kWords{"press", "compression", "force", "collapse",
                                                     "wall_punctures"};
    return std::any_of(kWords.begin(), kWords.end(), [&](std::string_view word) {
        return metric.find(word) != std::string_view::npos;
    });
}

}  // namespace

ExpertAttempt play_as_expert(const CaseBundle& bundle,
                             const Exercise& exercise,
                             const std::vector<AimWindow>& windows) {
    ExpertAttempt attempt;
    attempt.session.header.case_name = bundle.manifest.case_name;
    attempt.session.header.exercise = exercise.name;
    Hands hands(exercise, attempt.session);
    const std::size_t count = std::min(windows.size(), exercise.targets.size());
    for (std::size_t t = 0; t < count; ++t)
        hands.play(windows[t], exercise.targets[t].centre, t + 1 == count);
    const CaseAnatomy anatomy(bundle, exercise.breathing);
    attempt.score = score_session(attempt.session, exercise, &anatomy, bundle.labels);
    for (const PassResult& mark : attempt.score.pass_marks) {
        if (mark.passed || needs_pressing(mark.metric)) continue;
        char text[160];
        const bool above = mark.value > mark.at_most;
        std::snprintf(text, sizeof text, "%s = %.3g (at %s %.3g)", mark.metric.c_str(), mark.value,
                      above ? "most" : "least", above ? mark.at_most : mark.at_least);
        attempt.missed.push_back(text);
    }
    return attempt;
}

}  // namespace sonocase::pipeline::inline check
