// SPDX-License-Identifier: Apache-2.0

// The exercises of the scenarios cannot be passed without looking, and can be passed by looking.
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>

#include "end_to_end/scripted_trainees.h"
#include "formats/files/load_save.h"
#include "formats/scoring/draw_attempt.h"
#include "support/cooked_case.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/whole_sets.h"

namespace sonocase {
namespace {

namespace fs = std::filesystem;
using testing::Attempt;

struct Passed {
    int attempts = 0, passed = 0;
};

struct Case {
    CaseBundle bundle;
    std::vector<Exercise> exercises;
    explicit Case(const std::string& path) {
        auto loaded = load_bundle(path);
        EXPECT_TRUE(loaded) << loaded.error().message();
        bundle = std::move(*loaded);
        for (const EmbeddedExercise& embedded : bundle.exercises) {
            auto exercise = parse_exercise(embedded.toml, embedded.name);
            EXPECT_TRUE(exercise) << exercise.error().message();
            exercises.push_back(std::move(*exercise));
        }
    }
};

Passed bluff(const Case& of, const Exercise& exercise, int attempts) {
    const CaseAnatomy at_rest(of.bundle), breathing(of.bundle, exercise.breathing);
    testing::Random random(7);
    Passed out;
    for (int i = 0; i < attempts; ++i) {
        // Who fails is given easier attempts: bluffing must not pass those either.
        const std::uint64_t seed =
            seed_with_difficulty(1000u + static_cast<unsigned>(i), i / 3 % 2 ? kEasiest : 0);
        Attempt attempt(of.bundle, at_rest, breathing, exercise, seed);
        if (i % 3 == 0) testing::bluff_with_fixed_keys(attempt, i / 3 % 20);
        if (i % 3 == 1) testing::bluff_with_a_random_walk(attempt, random);
        if (i % 3 == 2) testing::bluff_with_a_straight_push(attempt, random);
        ++out.attempts;
        if (attempt.score().passed) ++out.passed;
    }
    return out;
}

Passed expert(const Case& of, const Exercise& exercise, int attempts) {
    const CaseAnatomy at_rest(of.bundle), breathing(of.bundle, exercise.breathing);
    Passed out;
    for (int i = 0; i < attempts; ++i) {
        const std::uint64_t seed =
            seed_with_difficulty(1u + static_cast<unsigned>(i), i % 2 ? kHardest : 0);
        Attempt attempt(of.bundle, at_rest, breathing, exercise, seed);
        ++out.attempts;
        const bool tried = testing::play_as_an_expert(attempt);
        const SessionScore score = attempt.score();
        if (tried && score.passed) {
            ++out.passed;
            continue;
        }
        std::printf("%s, seed %d: %s", exercise.name.c_str(), i + 1,
                    tried ? "failed at" : "no way to the target was seen");
        for (const PassResult& mark : score.pass_marks) {
            if (tried && !mark.passed) std::printf(" %s = %.3g", mark.metric.c_str(), mark.value);
        }
        std::printf("\n");
    }
    return out;
}

// Whoever copies the script that shows how an exercise is done passes it. Every exercise with pass
// marks has one.
void expect_scripts_pass(const Case& of) {
    for (const Exercise& exercise : of.exercises) {
        const CaseAnatomy at_rest(of.bundle), breathing(of.bundle, exercise.breathing);
        Attempt attempt(of.bundle, at_rest, breathing, exercise, 0);
        testing::play_script(attempt, "needle", 120);
        EXPECT_TRUE(exercise.pass_marks.empty() || !attempt.session.samples.empty())
            << exercise.name << " has no script named needle";
        if (attempt.session.samples.empty()) continue;
        for (const PassResult& mark : attempt.score().pass_marks) {
            std::printf("%-18s script: %-32s %8.3g %s\n", exercise.name.c_str(),
                        mark.metric.c_str(), mark.value, mark.passed ? "" : "MISSED");
            EXPECT_TRUE(mark.passed) << exercise.name << ": " << mark.metric << " = " << mark.value;
        }
    }
}

// A thousand bluffs, spread over the exercises, and twenty attempts of an expert at each; a change
// tries half of them.
void expect_honest(const Case& of) {
    const int bluffs = testing::whole_sets() ? 1000 : 500;
    const int expert_attempts = testing::whole_sets() ? 20 : 10;
    expect_scripts_pass(of);
    const int each = bluffs / static_cast<int>(of.exercises.size());
    Passed all_bluffs, all_experts;
    for (const Exercise& exercise : of.exercises) {
        const Passed b = bluff(of, exercise, each);
        const Passed e = expert(of, exercise, expert_attempts);
        std::printf("%-18s bluffed %d of %d, expert %d of %d\n", exercise.name.c_str(), b.passed,
                    b.attempts, e.passed, e.attempts);
        all_bluffs.attempts += b.attempts;
        all_bluffs.passed += b.passed;
        all_experts.attempts += e.attempts;
        all_experts.passed += e.passed;
    }
    // The bars: at most 1 % by bluffing, at least 95 % by looking.
    EXPECT_LE(all_bluffs.passed, 0.01 * all_bluffs.attempts);
    EXPECT_GE(all_experts.passed, 0.95 * all_experts.attempts);
}

// Our own torsos are cooked without a warning; the gallery says that its map is known.
std::string cooked_in_silence(const std::string& arguments) {
    const testing::CookedCase& cooked = testing::cooked_case(arguments);
    EXPECT_EQ(cooked.error.find("warning"), std::string::npos) << cooked.error;
    return cooked.path;
}

TEST(HonestExercises, OfTheDemoTorso) {
    expect_honest(Case(cooked_in_silence("--preset draft")));
}

TEST(HonestExercises, OfTheRealTorso) {
    const std::string data = SONOCASE_DATA;
    if (!fs::exists(data + "/ct/labels.nii.gz")) GTEST_SKIP() << "no " << data;
    const auto& cooked =
        testing::cooked_scenario("real-torso/case.toml", "--set resample.voxel_mm=2");
    expect_honest(Case(cooked.path));
}

// Exercises of the other scenarios whose script has a needle from the start; those that press or
// look in colour first are played by pressing_exercises_test.cpp and doppler_runs_test.cpp.
TEST(HonestExercises, ScriptsOfTheGalleryPassTheirMarks) {
    expect_scripts_pass(Case(testing::cooked_scenario("lesion-gallery", "--preset draft").path));
}

TEST(HonestExercises, ScriptsOfTheWomanPassTheirMarks) {
    const std::string data = SONOCASE_DATA;
    if (!fs::exists(data + "/organ_meshes")) GTEST_SKIP() << "no " << data;
    const auto& cooked = testing::cooked_scenario(
        "atlas-woman/case.toml", "--set import.voxel_mm=2 --set resample.voxel_mm=2");
    expect_scripts_pass(Case(cooked.path));
    testing::expect_expert_ticks_all(cooked.path, "diaphragm");
}

// The experts of the procedures pass where a trainee meets them: cooked, on the mannequin, through
// the player.
TEST(HonestExercises, ExpertsPassTheProceduresInThePlayer) {
    const std::string path =
        cooked_in_silence(SONOCASE_SOURCE "/scenarios/procedures --preset draft");
    for (const Exercise& exercise : Case(path).exercises) {
        testing::expect_expert_ticks_all(path, exercise.name);
    }
}

TEST(HonestExercises, TheExpertPassesTheCentralLineInThePlayerAndTheNeckIsChecked) {
    const testing::TemporaryFolder folder;
    const std::string path = testing::cooked_scenario("neck").path;
    for (const char* exercise : {"central-line", "jugular-across"})
        testing::expect_expert_ticks_all(path, exercise);
    const auto check = testing::run_command(std::string(SONOCASE_BIN) + "/sonocase check " + path +
                                            " -o " + (folder / "check.html"));
    EXPECT_EQ(check.status, 0) << check.out << check.error;
}

}  // namespace
}  // namespace sonocase
