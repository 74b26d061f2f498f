// SPDX-License-Identifier: Apache-2.0

// The exercises of pressing, played through engine, recording and score: by hands that do what is
// asked, and by hands that leave something out.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <functional>

#include "end_to_end/pressing_hand.h"
#include "end_to_end/scripted_trainees.h"
#include "formats/files/load_save.h"
#include "support/cooked_case.h"
#include "support/hard_case.h"
#include "support/paths.h"

namespace sonocase::runtime {
namespace {

namespace fs = std::filesystem;
using sonocase::testing::Attempt;
using sonocase::testing::HandOptions;
using sonocase::testing::PressingHand;
using sonocase::testing::TemporaryFolder;

// The bundle of the recipe on the shared data, cooked once; null without them.
const OpenCase* pressing_case() {
    static const std::unique_ptr<OpenCase> open = [] {
        if (!fs::exists(SONOCASE_DATA "/ct/labels.nii.gz")) return std::unique_ptr<OpenCase>();
        auto opened = open_case(
            sonocase::testing::cooked_scenario("pressing/case.toml", "--set resample.voxel_mm=1.5")
                .path);
        EXPECT_TRUE(opened) << opened.error().message();
        return std::move(*opened);
    }();
    return open.get();
}

class PressingExercises : public ::testing::Test {
  protected:
    void SetUp() override {
        open_ = pressing_case();
        if (open_ == nullptr) GTEST_SKIP() << "no data";
        at_rest_.emplace(open_->bundle);
    }
    const Exercise& exercise(const std::string& name) const {
        return open_->exercises[static_cast<std::size_t>(*find_exercise(*open_, name))];
    }
    PressingHand hand(const Exercise& exercise, const HandOptions& options = {}) const {
        return {*open_, exercise, folder_ / "session.igs.mha", options};
    }
    // The exercise as written, by a hand without tremor.
    SessionScore play(const std::string& name,
                      const std::function<void(PressingHand&)>& what) const {
        PressingHand of = hand(exercise(name));
        what(of);
        return said(name.c_str(), of.score());
    }
    static SessionScore said(const std::string& name, SessionScore score) {
        std::printf("%-26s %s:", name.c_str(), score.passed ? "passed" : "failed");
        for (const PassResult& mark : score.pass_marks)
            std::printf(" %s%s %.3g", mark.metric.c_str(), mark.passed ? "" : "(!)", mark.value);
        std::printf("\n");
        return score;
    }

    const OpenCase* open_ = nullptr;
    TemporaryFolder folder_;
    std::optional<CaseAnatomy> at_rest_;
};

// Pushes the planned needle at what is seen of the target, by 10 mm/s, and holds it there.
void push(PressingHand& hand, sonocase::testing::ExpertPlan plan, double press_mm) {
    const Rigid probe = plan.hands.mannequin_from_probe();
    for (int n = 0; n < 4; ++n) hand.hold(probe, {}, press_mm);
    const Point3 rest = hand.exercise().targets.front().centre;
    plan.hands.aim_needle_at(hand.engine().renderer().current_position(rest));
    constexpr double kStepMm = 0.5;
    while (plan.hands.needle_depth_mm() < plan.depth_mm - 1e-6) {
        plan.hands.advance_needle(std::min(kStepMm, plan.depth_mm - plan.hands.needle_depth_mm()));
        hand.hold(probe, plan.hands.mannequin_from_needle(), press_mm);
    }
    for (int n = 0; n < 10; ++n) hand.hold(probe, plan.hands.mannequin_from_needle(), press_mm);
}

// What a hand does in an attempt; false: it did not find its way.
using Skill = std::function<bool(Attempt&, PressingHand&)>;

struct Outcome {
    int attempts = 0, passed = 0;
};

// Many attempts, each drawn from its own seed, by a hand that finds its own way over the body and
// trembles.
class ManyAttempts : public PressingExercises {
  protected:
    static constexpr int kSeeds = 20, kCarelessSeeds = 6;

    Outcome play_many(const std::string& name, const Skill& skill, int seeds = kSeeds) const {
        const Exercise& written = exercise(name);
        const CaseAnatomy breathing(open_->bundle, written.breathing);
        Outcome out;
        for (int seed = 1; seed <= seeds; ++seed) {
            Attempt attempt(*open_->bundle, *at_rest_, breathing, written,
                            static_cast<std::uint64_t>(seed));
            PressingHand of =
                hand(attempt.exercise, {"paper", 0.05, 0.05, static_cast<std::uint64_t>(seed)});
            const bool tried = skill(attempt, of);
            const SessionScore score =
                said(name + " " + std::to_string(seed) + (tried ? "" : " (lost)"), of.score());
            ++out.attempts;
            out.passed += tried && score.passed;
        }
        std::printf("%s: %d of %d\n", name.c_str(), out.passed, out.attempts);
        return out;
    }
    // The careful hand at each exercise.
    static bool compress_and_puncture(Attempt& attempt, PressingHand& hand) {
        if (!compress_times(1, attempt, hand)) return false;
        const auto plan = sonocase::testing::plan_as_an_expert(attempt);
        if (plan) push(hand, *plan, 0);
        return plan.has_value();
    }
    // Turns the probe until the vein closes under a force below the exercise's limit, and does so
    // some times; a vein that closes nowhere is left.
    static bool compress_times(
        int times, Attempt& attempt, PressingHand& hand, double gentle_n = 13, int tries = 24) {
        // Over the groin, as the exercise shows it: from elsewhere bone lies in the way.
        const SweepKey& groin = hand.exercise().sweeps.front().keys.front();
        if (attempt.exercise.targets.size() == 1) attempt.mouse.put_probe(groin.probe, groin.beam);
        const auto ways = sonocase::testing::look_as_an_expert(attempt);
        if (ways.empty()) return false;
        for (const Rigid& probe : hand.by_softness(ways)) {
            if (tries-- == 0) break;
            if (!hand.compress(probe, gentle_n)) continue;
            for (int n = 1; n < times; ++n) hand.compress(probe, gentle_n);
            break;
        }
        return true;
    }
    static bool puncture_lightly(Attempt& attempt, PressingHand& hand) {
        const auto plan = sonocase::testing::plan_as_an_expert(attempt);
        if (!plan) return false;
        push(hand, *plan, 2);
        return true;
    }
};

// The bar: 95 % of the attempts.
constexpr double kSkilled = 0.95;

TEST_F(ManyAttempts, AVeinThatWasPressedShutIsPunctured) {
    const Outcome out = play_many("femoral-compression", compress_and_puncture);
    EXPECT_GE(out.passed, kSkilled * out.attempts);
}

TEST_F(ManyAttempts, AVeinIsPressedShutThreeTimes) {
    const Outcome out = play_many("compression-test", [](Attempt& attempt, PressingHand& hand) {
        return compress_times(3, attempt, hand);
    });
    EXPECT_GE(out.passed, kSkilled * out.attempts);
}

TEST_F(ManyAttempts, BothGroinsArePressed) {
    const auto both_sides = [](Attempt& attempt, PressingHand& hand) {
        // Over one groin, as the exercise shows it, and then over the other.
        const SweepKey& right = hand.sweep("right").keys.front();
        if (!attempt.mouse.put_probe(right.probe, right.beam)) return false;
        if (!compress_times(2, attempt, hand)) return false;
        std::swap(attempt.exercise.targets[0], attempt.exercise.targets[1]);
        const SweepKey& left = hand.sweep("left").keys.front();
        if (!attempt.mouse.put_probe(left.probe, left.beam)) return false;
        // It does not close: no harder than the other one took, and not everywhere.
        return compress_times(1, attempt, hand, 11, 4);
    };
    const Outcome out = play_many("compression-both-sides", both_sides);
    EXPECT_GE(out.passed, kSkilled * out.attempts);
}

TEST_F(ManyAttempts, ALesionIsPuncturedWithALightHand) {
    const Outcome out = play_many("liver-light-hand", puncture_lightly);
    EXPECT_GE(out.passed, kSkilled * out.attempts);
}

TEST_F(ManyAttempts, AHandThatLeavesSomethingOutPassesNone) {
    const auto puncture_alone = [](Attempt& attempt, PressingHand& hand) {
        const auto plan = sonocase::testing::plan_as_an_expert(attempt);
        if (plan) push(hand, *plan, 0);
        return plan.has_value();
    };
    const auto never_ease_off = [](Attempt& attempt, PressingHand& hand) {
        if (!compress_times(1, attempt, hand)) return false;
        const auto plan = sonocase::testing::plan_as_an_expert(attempt);
        if (!plan) return false;
        double mm = 0;
        for (; mm < 36 && !(hand.vein_open() >= 0 && hand.vein_open() < 0.3); mm += 1)
            hand.hold(plan->hands.mannequin_from_probe(), {}, mm);
        push(hand, *plan, mm);
        return mm < 36;  // else bone holds the probe there, and the vein stays open
    };
    const auto too_light = [](Attempt& attempt, PressingHand& hand) {
        const auto ways = sonocase::testing::look_as_an_expert(attempt);
        for (int n = 0; !ways.empty() && n < 3; ++n)
            hand.compress(ways.front().mannequin_from_probe(), 2);
        return !ways.empty();
    };
    const auto one_side = [](Attempt& attempt, PressingHand& hand) {
        return compress_times(2, attempt, hand);
    };
    const auto heavy_hand = [](Attempt& attempt, PressingHand& hand) {
        const auto plan = sonocase::testing::plan_as_an_expert(attempt);
        if (plan) push(hand, *plan, 25);
        return plan.has_value();
    };
    EXPECT_EQ(play_many("femoral-compression", puncture_alone, kCarelessSeeds).passed, 0);
    EXPECT_EQ(play_many("femoral-compression", never_ease_off, kCarelessSeeds).passed, 0);
    EXPECT_EQ(play_many("compression-test", too_light, kCarelessSeeds).passed, 0);
    EXPECT_EQ(play_many("compression-both-sides", one_side, kCarelessSeeds).passed, 0);
    EXPECT_EQ(play_many("liver-light-hand", heavy_hand, kCarelessSeeds).passed, 0);
}

// The sweeps of the scenarios, which the player's demonstrations follow.
TEST_F(PressingExercises, TheirSweepsStandWhereTheVeinCloses) {
    const auto compress = [](int times, double most_n) {
        return [=](PressingHand& hand) {
            for (int n = 0; n < times; ++n)
                hand.compress(hand.probe_of(hand.sweep("stand")), most_n);
        };
    };
    EXPECT_TRUE(play("compression-test", compress(3, 30)).passed);
    EXPECT_FALSE(play("compression-test", compress(1, 30)).passed);
    EXPECT_FALSE(play("compression-test", compress(3, 2)).passed);  // too light
    const auto needle = [](double press_mm) {
        return [=](PressingHand& hand) { hand.play(hand.sweep("needle"), press_mm); };
    };
    EXPECT_TRUE(play("liver-light-hand", needle(0)).passed);
    EXPECT_FALSE(play("liver-light-hand", needle(25)).passed);
    EXPECT_FALSE(play("femoral-compression", needle(0)).passed);
}

// The line in the vein: pressed, punctured, wire, dilator, catheter.
TEST_F(PressingExercises, TheExpertOfTheFemoralLineTicksAll) {
    sonocase::testing::expect_expert_ticks_all(open_->path, "femoral-line");
}

// Two segments of each groin: the right ones close, the left ones do not.
TEST_F(PressingExercises, TheExpertOfTheSegmentsTicksAll) {
    sonocase::testing::expect_expert_ticks_all(open_->path, "dvt-by-segment");
}

// What a recording says of tissue and needle.
std::vector<std::string> tissue_events(const std::string& path) {
    const auto sequence = load_sequence(path);
    EXPECT_TRUE(sequence) << sequence.error().message();
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), path);
    EXPECT_TRUE(session) << session.error().message();
    std::vector<std::string> events;
    for (const SessionEvent& event : session->events)
        if (event.name == "tissue_puncture" || event.name == "posterior_wall" ||
            event.name == "needle_stopped")
            events.push_back(event.name + " " + event.detail);
    return events;
}

// The same insertion at three frame rates, through files: the same layers in the same order.
TEST_F(PressingExercises, AnInsertionPuncturesTheSameLayersAtAnyFrameRate) {
    std::vector<std::string> first;
    for (const double frame_s : {0.05, 0.02, 0.11}) {
        PressingHand of = hand(exercise("femoral-compression"), {"", frame_s, 0, 1});
        of.play(of.sweep("needle"), 2);
        (void)of.score();
        const std::vector<std::string> events = tissue_events(folder_ / "session.igs.mha");
        if (first.empty()) first = events;
        for (const std::string& event : events) std::printf("%.2f s: %s\n", frame_s, event.c_str());
        EXPECT_GE(events.size(), 3u);
        EXPECT_EQ(events, first);
    }
}

// A vein that holds a thrombus does not close; the other side does.
TEST_F(PressingExercises, AThrombosedVeinDoesNotClose) {
    double healthy = 1, thrombosed = 1;
    const auto both = [&](PressingHand& hand) {
        const Rigid right = hand.probe_of(hand.sweep("right")),
                    left = hand.probe_of(hand.sweep("left"));
        for (double mm = 0; mm < 36 && healthy >= 0.08; mm += 0.5) {
            hand.hold(right, {}, mm);
            if (hand.vein_open() >= 0) healthy = hand.vein_open();
        }
        for (int n = 0; n < 2; ++n) hand.compress(right);
        hand.play(hand.sweep("across"), 0);
        for (double mm = 0; mm < 18; mm += 1) {
            hand.hold(left, {}, mm);
            thrombosed = hand.vein_open();
        }
        hand.hold(left, {}, 0);
    };
    EXPECT_TRUE(play("compression-both-sides", both).passed);
    std::printf("open %.2f, thrombosed %.2f\n", healthy, thrombosed);
    sonocase::testing::HardCase left("lumen left of a vein that is pressed shut",
                                     sonocase::testing::HardCase::at_most, 0.1, "");
    left.see(healthy);
    EXPECT_LT(thrombosed, 0);  // no lumen that could close
    // One side alone shows nothing.
    EXPECT_FALSE(play("compression-both-sides", [](PressingHand& hand) {
                     for (int n = 0; n < 2; ++n) hand.compress(hand.probe_of(hand.sweep("right")));
                 }).passed);
    EXPECT_FALSE(play("compression-both-sides", [](PressingHand& hand) {
                     hand.play(hand.sweep("across"), 0);
                 }).passed);
}

}  // namespace
}  // namespace sonocase::runtime
