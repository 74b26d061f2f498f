// SPDX-License-Identifier: Apache-2.0

// The player of the page, run on the desktop: the same pictures as the engine, the same scores as a
// replay of its recording.
#include "runtime/web/page_player.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "formats/files/atomic_file.h"
#include "formats/scoring/anatomy.h"
#include "formats/scoring/draw_attempt.h"
#include "runtime/player/app/settings.h"
#include "runtime/player/session/open_case.h"
#include "runtime/web/page_json.h"
#include "runtime/web/warm_up.h"
#include "support/flowing_case.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::runtime {
namespace {

RawVector<std::uint8_t> bytes_of(const CaseBundle& bundle) {
    const std::vector<std::uint8_t> bytes = write_bundle(bundle);
    return {bytes.begin(), bytes.end()};
}

std::unique_ptr<PagePlayer> open_small() {
    auto player = PagePlayer::open(bytes_of(testing::small_case()), "small");
    EXPECT_TRUE(player);
    EXPECT_TRUE((*player)->choose_exercise(0, 128, 128));
    return std::move(*player);
}

std::vector<std::uint8_t> copy(std::span<const std::uint8_t> pixels) {
    return {pixels.begin(), pixels.end()};
}

TEST(PagePlayer, refuses_bytes_that_are_no_case_and_says_which) {
    RawVector<std::uint8_t> bytes(100, std::uint8_t{7});
    const auto player = PagePlayer::open(std::move(bytes), "holiday.png");
    ASSERT_FALSE(player);
    EXPECT_NE(player.error().message().find("holiday.png"), std::string::npos);
}

TEST(PagePlayer, a_kept_picture_is_rendered_again_to_the_same_pixels) {
    const auto player = open_small();
    std::vector<std::vector<std::uint8_t>> shown;
    for (int n = 0; n < 10; ++n) {
        player->hands().slide(0, 2);
        player->frame(0.1 * n, {});
        shown.push_back(copy(player->pixels()));
    }
    ASSERT_EQ(player->kept(), 10);
    for (int back : {0, 3, 9}) {
        player->frame_again(back, {});
        EXPECT_EQ(copy(player->pixels()), shown[9 - back]) << back;
        EXPECT_NEAR(player->kept_age_s(back), 0.1 * back, 1e-12);
    }
}

TEST(PagePlayer, an_attempt_that_ended_is_looked_at_again_from_any_moment) {
    const auto player = open_small();
    EXPECT_EQ(player->look_at_attempt(0), -1) << "there was none";
    ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 50));
    EXPECT_EQ(player->look_at_attempt(0), -1) << "it runs";
    std::vector<std::vector<std::uint8_t>> shown;
    constexpr int kFrames = 400;
    for (int n = 0; n < kFrames; ++n) {
        player->hands().slide(0, n < 200 ? 0.1 : -0.1);
        player->frame(50 + 0.1 * n, {});
        shown.push_back(copy(player->pixels()));
    }
    ASSERT_TRUE(player->finish_attempt());
    for (const int n : {0, 7, 250, kFrames - 1}) {
        const int back = player->look_at_attempt(0.1 * n + 0.05);
        ASSERT_EQ(back, kFrames - 1 - n);
        ASSERT_EQ(player->kept(), kFrames);
        player->frame_again(back, {});
        EXPECT_EQ(copy(player->pixels()), shown[static_cast<std::size_t>(n)]) << n;
    }
    EXPECT_EQ(player->look_at_attempt(-5), kFrames - 1) << "before it began: its first";
    EXPECT_EQ(player->look_at_attempt(1e9), 0);
    player->frame(100, {});
    EXPECT_EQ(player->kept(), kFrames + 1) << "live again: the ring goes on where it was";
    ASSERT_TRUE(player->choose_exercise(0, 128, 128));
    EXPECT_EQ(player->look_at_attempt(0), -1) << "another exercise";
}

TEST(PagePlayer, an_attempt_goes_on_unseen_behind_a_frozen_picture) {
    const auto player = open_small();
    ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 50));
    for (int n = 0; n < 5; ++n) player->frame(50 + 0.1 * n, {});
    const auto shown = copy(player->pixels());
    const int kept = player->kept();
    for (int n = 5; n < 15; ++n) {
        player->hands().slide(0, 1);
        player->frame_unseen(50 + 0.1 * n, {});
    }
    EXPECT_EQ(copy(player->pixels()), shown);
    EXPECT_EQ(player->kept(), kept);
    player->frame(51.5, {});
    const auto finished = player->finish_attempt();
    ASSERT_TRUE(finished);
    const auto sequence = read_sequence(finished->recording, "");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
    ASSERT_TRUE(session);
    ASSERT_EQ(session->samples.size(), 16u);
    for (std::size_t n = 0; n < 16; ++n)
        EXPECT_EQ(session->samples[n].unseen, n >= 5 && n < 15) << n;
    EXPECT_GT(norm(session->samples[14].mannequin_from_probe.translation -
                   session->samples[4].mannequin_from_probe.translation),
              5);
    player->frame_unseen(52, {});  // no attempt runs
    EXPECT_EQ(copy(player->pixels()).size(), shown.size());
}

// The list of an attempt and its score agree on what a frozen picture hides: the same hand does the
// step before a live picture.
TEST(PagePlayer, no_step_is_done_by_looking_behind_a_frozen_picture) {
    CaseBundle bundle = testing::small_case();
    bundle.exercises[0].toml += R"(
[procedure]
cut = 1
[[steps]]
name = "look"
title = "Find the vessel"
done = { shows = "vessel", hold_s = 1 }
[[items]]
name = "found"
step = "look"
)";
    for (const bool unseen : {true, false}) {
        auto opened = PagePlayer::open(bytes_of(bundle), "small");
        ASSERT_TRUE(opened) << opened.error().message();
        PagePlayer& player = **opened;
        ASSERT_TRUE(player.choose_exercise(0, 128, 128));
        ASSERT_TRUE(player.start_attempt("", "2026-01-31T12:00:00Z", 0));
        for (int n = 0; n < 60; ++n) {
            if (unseen)
                player.frame_unseen(0.05 * n, {});
            else
                player.frame(0.05 * n, {});
        }
        const bool done = procedure_json(player).find("\"state\":\"done\"") != std::string::npos;
        EXPECT_EQ(done, !unseen);
        const auto finished = player.finish_attempt();
        ASSERT_TRUE(finished) << finished.error().message();
        ASSERT_TRUE(finished->score.procedure);
        EXPECT_EQ(finished->score.procedure->passed, !unseen);
    }
}

TEST(PagePlayer, a_long_attempt_keeps_fewer_pictures_a_second) {
    const auto player = open_small();
    ASSERT_TRUE(player->choose_exercise(0, 16, 16));
    ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 0));
    for (int n = 0; n < 3300; ++n) player->frame(0.1 * n, {});
    ASSERT_TRUE(player->finish_attempt());
    const int back = player->look_at_attempt(165);
    EXPECT_GT(player->kept(), 1500);
    EXPECT_LT(player->kept(), 3000);
    EXPECT_NEAR(player->kept_age_s(back), 329.9 - 165, 0.3);
}

TEST(PagePlayer, a_signature_is_checked_bit_by_bit) {
    const std::vector<std::uint8_t> plain = write_bundle(testing::small_case());
    const SigningKey key{{1, 2, 3}};
    const auto made = signed_case(plain, key, "Anna", "small");
    ASSERT_TRUE(made);
    const auto said = [](const std::vector<std::uint8_t>& bytes) {
        auto player = PagePlayer::open({bytes.begin(), bytes.end()}, "small");
        EXPECT_TRUE(player);
        const CaseSignature* found = nullptr;
        int steps = 1;
        while (!(found = (*player)->check_signature())) ++steps;
        return std::pair{*found, steps};
    };
    EXPECT_EQ(said(plain).first.fit, SignatureFit::none);
    EXPECT_EQ(said(plain).second, 1) << "nothing is paid without one";
    const auto [found, steps] = said(*made);
    EXPECT_EQ(found.fit, SignatureFit::fits);
    EXPECT_GT(steps, 5);
    EXPECT_EQ(signature_json(found), "{\"fit\":\"fits\",\"name\":\"Anna\",\"fingerprint\":\"" +
                                         fingerprint_of(public_key_of(key)) + "\"}");
}

TEST(PagePlayer, an_attempt_is_scored_as_its_recording_is) {
    const auto player = open_small();
    ASSERT_TRUE(player->start_attempt("somebody", "2026-01-31T12:00:00Z", 50));
    ASSERT_TRUE(player->hands().take_needle(player->exercise().probe, true));
    ASSERT_TRUE(player->hands().aim_needle_at({0, 0, 25}));
    for (int n = 0; n < 200; ++n) {
        player->hands().advance_needle(0.4);
        player->frame(50 + 0.05 * n, {});
    }
    ASSERT_TRUE(player->attempt());
    EXPECT_EQ(player->attempt()->monitor().insertions(), 1);
    EXPECT_EQ(player->attempt()->monitor().targets_hit(), 1);
    const auto finished = player->finish_attempt();
    ASSERT_TRUE(finished);
    EXPECT_EQ(player->attempt(), nullptr);

    const auto sequence = read_sequence(finished->recording, "");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
    ASSERT_TRUE(session);
    EXPECT_EQ(session->samples.size(), 200u);
    EXPECT_EQ(session->header.trainee, "somebody");
    EXPECT_EQ(session->header.exercise, "scan");
    const auto whole = testing::small_case();
    const CaseAnatomy anatomy(whole, breathing_shown(player->exercises()[0], session->header));
    const SessionScore replayed =
        score_session(*session, player->exercises()[0], &anatomy, whole.labels);
    EXPECT_EQ(score_json(replayed, player->exercises()[0]), finished->score_json);
}

// Acts, steps and the list are those of the core: what the page says while it runs is what its
// recording is scored as.
TEST(PagePlayer, a_recording_names_the_tracker_that_moved_the_tools) {
    const auto player = open_small();
    for (const std::string tracker : {"", "camera"}) {
        ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 0));
        TrackerReading reading;
        reading.in_mannequin = true;
        reading.sensor_count = 2;
        for (int n = 0; n < 3; ++n) {
            reading.time_s = 0.05 * n;
            reading.sensors[kProbeSensor] = {SensorState::ok,
                                             player->hands().mannequin_from_probe()};
            player->put_tools(reading.time_s, reading, tracker);
            player->frame(reading.time_s, {});
        }
        const auto finished = player->finish_attempt();
        ASSERT_TRUE(finished);
        const auto sequence = read_sequence(finished->recording, "");
        ASSERT_TRUE(sequence);
        const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
        ASSERT_TRUE(session);
        EXPECT_EQ(detail_value(session->header.attempt, "tracker"), tracker);
    }
}

TEST(PagePlayer, a_procedure_is_done_asked_and_ticked) {
    CaseBundle bundle = testing::small_case();
    bundle.exercises[0].toml += R"(
[procedure]
cut = 2
[[steps]]
name = "numb"
title = "Numb the way"
done = { act = "inject", at_least = 2, tip_in = "body" }
[[items]]
name = "numbed"
step = "numb"
[[items]]
name = "asked"
question = "Ready?"
options = ["No", "Yes"]
answer = 1
)";
    auto opened = PagePlayer::open(bytes_of(bundle), "small");
    ASSERT_TRUE(opened) << opened.error().message();
    PagePlayer& player = **opened;
    ASSERT_TRUE(player.choose_exercise(0, 128, 128));
    ASSERT_TRUE(player.start_attempt("", "2026-01-31T12:00:00Z", 0));
    ASSERT_TRUE(player.hands().take_needle(player.exercise().probe, true));
    ASSERT_TRUE(player.hands().aim_needle_at({0, 0, 25}));
    const auto says = [&](const char* words) {
        const std::string json = procedure_json(player);
        return json.find(words) != std::string::npos;
    };
    for (int n = 0; n < 150; ++n) {
        player.hands().advance_needle(0.4);
        player.frame(0.05 * n, {});
    }
    EXPECT_TRUE(says("Ready?"));
    EXPECT_TRUE(says("Inject 1 ml"));
    EXPECT_TRUE(player.act({ActKind::answer, 1, 1}));
    player.frame(8, {});
    EXPECT_FALSE(says("Ready?"));
    EXPECT_TRUE(says("\"state\":\"present\""));
    for (int n = 0; n < 2; ++n) EXPECT_TRUE(player.act({ActKind::inject, 0, 1}));
    player.frame(8.1, {});
    EXPECT_TRUE(says("\"state\":\"done\""));
    EXPECT_TRUE(says("\"injected_ml\":2"));
    const auto finished = player.finish_attempt();
    ASSERT_TRUE(finished) << finished.error().message();
    ASSERT_TRUE(finished->score.procedure);
    EXPECT_TRUE(finished->score.procedure->passed);
    EXPECT_EQ(finished->score.procedure->points, 2);
    EXPECT_EQ(procedure_json(*open_small()), "{}");
}

// An attempt's targets lie where the seed in its recording says, as the desktop finds them.
TEST(PagePlayer, an_attempt_is_drawn_from_its_seed_and_scored_there) {
    CaseBundle bundle = testing::small_case();
    std::string& toml = bundle.exercises[0].toml;
    const std::string hit = "hit_radius_mm = 6";
    toml.replace(toml.find(hit), hit.size(), hit + "\nspread_mm = 20\nclearance_mm = 1");
    auto opened = PagePlayer::open(bytes_of(bundle), "small");
    ASSERT_TRUE(opened);
    PagePlayer& player = **opened;
    ASSERT_TRUE(player.choose_exercise(0, 128, 128));
    EXPECT_NE(case_json(player).find("\"drawn\":true"), std::string::npos);
    const Exercise written = player.exercises()[0];
    const AttemptDraw expected = draw_attempt(written, CaseAnatomy(bundle), bundle.labels, 5);
    ASSERT_TRUE(player.start_attempt("", "2026-01-31T12:00:00Z", 0, 5));
    EXPECT_EQ(player.exercise().targets[0].centre, expected.exercise.targets[0].centre);
    EXPECT_NE(player.exercise().targets[0].centre, written.targets[0].centre);
    player.frame(0, {});
    const Point3 shown = player.target_in_probe(0);
    const Rigid& place = player.engine().last().tools.mannequin_from_probe;
    EXPECT_LT(distance(place * shown, expected.exercise.targets[0].centre), 1e-9);
    for (int n = 1; n < 60; ++n) player.frame(0.1 * n, {});
    const auto finished = player.finish_attempt();
    ASSERT_TRUE(finished);
    const auto sequence = read_sequence(finished->recording, "");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
    ASSERT_TRUE(session);
    EXPECT_EQ(attempt_seed(session->header), 5u);
    // The next attempt without a seed is as written again.
    ASSERT_TRUE(player.choose_exercise(0, 128, 128));
    EXPECT_EQ(player.exercise().targets[0].centre, written.targets[0].centre);
}

TEST(PagePlayer, names_what_a_pixel_shows) {
    const auto player = open_small();
    EXPECT_EQ(player->name_at(64, 64), "");  // no picture yet
    player->frame(0, {});
    const Renderer::Layout layout = player->engine().renderer().layout();
    const auto at = [&](double x_mm, double z_mm) {
        return player->name_at(static_cast<int>(layout.origin_x_px + x_mm / layout.mm_per_px),
                               static_cast<int>(layout.origin_y_px + z_mm / layout.mm_per_px));
    };
    EXPECT_EQ(at(0, 20), "muscle");
    EXPECT_EQ(player->name_at(-1, 5), "");
    EXPECT_EQ(player->name_at(5, 128), "");
}

TEST(PagePlayer, another_image_goes_on_with_the_session) {
    const auto player = open_small();
    ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 0));
    player->frame(0, {});
    PageImage image = player->image();
    image.depth_mm = 60;
    image.model = ImageModel::physical;
    ASSERT_TRUE(player->set_image(image));
    player->frame(1, {});
    EXPECT_EQ(player->engine().last().input.frame, 1u);
    EXPECT_EQ(player->attempt()->seconds(), 1);
    EXPECT_EQ(player->kept(), 1);
}

TEST(PagePlayer, draws_a_picture_as_wide_and_high_as_it_is_asked) {
    const auto player = open_small();
    const double square_mm_per_px = player->engine().renderer().layout().mm_per_px;
    ASSERT_TRUE(player->choose_exercise(0, 256, 96));
    player->frame(0, {});
    EXPECT_EQ(player->pixels().size(), 256u * 96u);
    const Renderer::Layout layout = player->engine().renderer().layout();
    // The depth fits the height, and the face lies in the middle of the width.
    EXPECT_LE(layout.origin_y_px + player->image().depth_mm / layout.mm_per_px, 96);
    EXPECT_NEAR(layout.origin_x_px, 127.5, 0.5);
    ASSERT_TRUE(player->choose_exercise(0, 256, 256));
    EXPECT_NEAR(player->engine().renderer().layout().mm_per_px, square_mm_per_px / 2,
                0.02 * square_mm_per_px);
    EXPECT_TRUE(player->name_at(255, 0).empty());
}

TEST(PagePlayer, an_image_that_cannot_be_made_leaves_the_one_before) {
    const auto player = open_small();
    PageImage image = player->image();
    image.height_px = 0;
    EXPECT_FALSE(player->set_image(image));
    EXPECT_FALSE(player->choose_exercise(0, 0, 0));
    EXPECT_EQ(player->image().height_px, 128);
    player->frame(0, {});
    EXPECT_NE(*std::max_element(player->pixels().begin(), player->pixels().end()), 0);
}

TEST(PagePlayer, warms_up_with_a_case_of_its_own) {
    const auto player = warm_up_player(128);
    ASSERT_TRUE(player);
    EXPECT_TRUE(player->warnings().empty());
    player->frame(0, {});
    EXPECT_GT(std::count_if(player->pixels().begin(), player->pixels().end(),
                            [](std::uint8_t grey) { return grey > 20; }),
              1000);
}

TEST(PageJson, gives_the_texts_of_other_languages_whole) {
    CaseBundle bundle = testing::small_case();
    bundle.exercises[0].toml +=
        "[texts.de]\ntitle = \"Finden Sie das Gefäß\"\n";  // and the rest in the exercise's own
    const auto player = PagePlayer::open(bytes_of(bundle), "small");
    ASSERT_TRUE(player);
    EXPECT_NE(case_json(**player).find("\"texts\":{\"de\":{\"title\":\"Finden Sie das Gefäß\""),
              std::string::npos);
}

// What the page after an attempt shows is what the window's shows.
TEST(PageJson, says_values_limits_and_advice_of_an_attempt) {
    SessionScore score;
    score.passed = false;
    score.pass_marks = {{"final_tip_to_target_mm", 4.23, 9, -INFINITY, true},
                        {"tip_in_view_at_advance_fraction", NAN, INFINITY, 0.7, false}};
    score.metrics = {{"elapsed_time_s", 107.4}, {"insertions", NAN}};
    const std::string json = result_json(score);
    for (const char* part : {"\"value\":\"–\",\"measured\":false",
                             "\"at_least\":true,\"none\":false,\"limit\":\"70 %\"",
                             "\"value\":\"4.2 mm\"", "\"value\":\"1:47\"", "\"marks_reached\":1"})
        EXPECT_NE(json.find(part), std::string::npos) << part << "\n" << json;
    EXPECT_EQ(json.find("\"advice\":\"\""), std::string::npos) << json;
}

// With the window's settings of a first start, before anything has moved: of each exercise, drawn
// by either model.
TEST(PagePlayer, the_first_picture_is_the_windows) {
    CaseBundle bundle = testing::small_case();
    bundle.exercises.push_back(bundle.exercises[0]);
    EmbeddedExercise& physical = bundle.exercises[1];
    physical.name = "physical";
    const std::size_t at = physical.toml.find("\"paper\"");
    ASSERT_NE(at, std::string::npos);
    physical.toml.replace(at, 7, "\"physical\"");
    const sonocase::testing::TemporaryFolder folder;
    const std::string path = folder.path() + "/small.sonocase";
    const std::vector<std::uint8_t> bytes = write_bundle(bundle);
    ASSERT_TRUE(write_file(path, std::span<const std::uint8_t>(bytes)));
    const auto open = open_case_to_render(path);
    ASSERT_TRUE(open);
    const auto page = PagePlayer::open(bytes_of(bundle), "small");
    ASSERT_TRUE(page);
    ASSERT_EQ((*open)->exercises.size(), 2u);
    std::string warning;
    const Settings first = load_settings(folder.path() + "/none.json", warning);
    ImageSettings console;
    console.dynamic_range_db = first.dynamic_range_db;
    for (int n = 0; n < 2; ++n) {
        const Exercise& exercise = (*open)->exercises[static_cast<std::size_t>(n)];
        const PlayerArguments none;
        ImageChoice image = initial_image(none, exercise);
        image.depth_mm = exercise.probe.depth_mm;
        image.focus_mm = exercise.probe.focus_mm;
        auto engine = make_engine(**open, exercise, none, image);
        ASSERT_TRUE(engine) << engine.error().message();
        MouseTracker hands(Skin(*(*open)->bundle), exercise);
        TrackerReading reading;
        hands.poll(0.1, reading);
        engine->observe(reading, false);
        std::vector<std::uint8_t> window(static_cast<std::size_t>(image.width_px) *
                                         image.height_px);
        engine->frame(0.1, console, window);
        ASSERT_EQ(image.width_px, image.height_px);
        ASSERT_TRUE((*page)->choose_exercise(n, image.width_px, image.height_px));
        (*page)->frame(0.1, {});
        EXPECT_EQ(copy((*page)->pixels()), window) << exercise.name;
        EXPECT_GT(std::count_if(window.begin(), window.end(), [](auto grey) { return grey > 20; }),
                  1000);
    }
}

TEST(PageJson, names_what_the_page_shows) {
    const auto player = open_small();
    const std::string json = case_json(*player);
    EXPECT_NE(json.find("\"case_name\":\"cylinder\""), std::string::npos) << json;
    EXPECT_NE(json.find("\"title\":\"Find the vessel\""), std::string::npos) << json;
    EXPECT_NE(json.find("\"warnings\":[]"), std::string::npos) << json;
    EXPECT_NE(json.find("\"presets\":[{\"name\":\"Liver\""), std::string::npos) << json;
    EXPECT_NE(json.find("\"mark_mm\":"), std::string::npos) << json;
}

// The expert of a course's module: the sweep moves the tools, not the hands.
TEST(PagePlayer, an_expert_is_watched_and_hands_take_over_afterwards) {
    const auto player = open_small();
    ASSERT_FALSE(player->watch("nobody", 0));
    EXPECT_FALSE(player->watching());
    ASSERT_TRUE(player->watch("along", 10));
    player->frame(10, {});
    const double from_y = player->engine().last().tools.mannequin_from_probe.translation.y;
    player->hands().slide(0, 20);
    player->frame(11.9, {});
    const ToolPoses& tools = player->engine().last().tools;
    EXPECT_NEAR(tools.mannequin_from_probe.translation.y - from_y, 57, 2);  // 30 mm each second
    EXPECT_TRUE(tools.has_needle);
    EXPECT_TRUE(player->watching());
    player->frame(12.1, {});
    EXPECT_FALSE(player->watching());
    // An attempt ends it as well, and a new exercise.
    ASSERT_TRUE(player->watch("along", 20));
    ASSERT_TRUE(player->start_attempt("", "2026-01-31T12:00:00Z", 21));
    EXPECT_FALSE(player->watching());
    player->drop_attempt();
    ASSERT_TRUE(player->watch("along", 30));
    ASSERT_TRUE(player->choose_exercise(0, 128, 128));
    EXPECT_FALSE(player->watching());
}

// The gate is the window's: the page hands over what it has kept.
TEST(PageCourse, stands_as_the_windows_rule_says) {
    const auto course = parse_course(R"(name = "short"
[[modules]]
name = "look"
text = "Look."
case = "cylinder"
exercise = "scan"
expert = "along"
practice = { measure = "needle_in_beam_fraction", at_least = 0.6 }
gate = { passes_in_a_row = 3, steady = true }
retention_days = 30
[[modules]]
name = "exam"
text = "Show it."
case = "cylinder"
exercise = "scan"
gate = { passes_in_a_row = 1, exam = true }
)",
                                     "course.toml");
    ASSERT_TRUE(course) << course.error().message();
    EXPECT_NE(course_json(*course).find("\"at_most\":null,\"at_least\":0.6"), std::string::npos);
    const auto stands = [&](const std::string& attempts) {
        return course_standing_json(*course,
                                    R"({"today":"2026-03-05","attempts":[)" + attempts + "]}");
    };
    const auto attempt = [](int day, bool passed, bool exam = false) {
        return R"({"case":"cylinder","exercise":"scan","started":"2026-02-0)" +
               std::to_string(day) + R"(T10:00:00Z",)" +
               R"("values":{"needle_in_beam_fraction":0.7},"passed":)" +
               (passed ? "true" : "false") + R"(,"exam":)" + (exam ? "true}" : "false}");
    };
    auto now = stands("");
    ASSERT_TRUE(now) << now.error().message();
    EXPECT_NE(now->find(R"("passed":0,"due":0,"next":0)"), std::string::npos) << *now;
    now = stands(attempt(1, true) + "," + attempt(2, true));
    EXPECT_NE(now->find(R"("in_a_row":2)"), std::string::npos) << *now;
    EXPECT_NE(now->find(R"("part":0.666)"), std::string::npos) << *now;
    now = stands(attempt(1, true) + "," + attempt(2, true) + "," + attempt(3, true));
    EXPECT_NE(now->find(R"("passed_on":"2026-02-03","due_on":"2026-03-05")"), std::string::npos)
        << *now;
    EXPECT_NE(now->find(R"("due":1,"next":0)"), std::string::npos) << *now;
    EXPECT_EQ(now->find(R"("passed":2)"), std::string::npos) << "practice opens no exam's gate";
    now = stands(attempt(3, true, true));
    EXPECT_NE(now->find(R"("passed":1,"due":0,"next":0)"), std::string::npos) << *now;
    for (const char* damaged :
         {"", "[]", "{}", R"({"today":"x","attempts":[{"case":1}]})",
          R"({"today":"x","attempts":[],"answers":[{"module":"look","option":9}]})"})
        EXPECT_FALSE(course_standing_json(*course, damaged)) << damaged;
}

// The cards of the cases: the same rule for each exercise, easier attempts left out of mastery.
TEST(PageStandings, are_those_of_the_windows_rule) {
    const std::uint64_t written = 7, easy = seed_with_difficulty(7, -1);
    const auto attempt = [](const char* exercise, bool passed, std::uint64_t seed, double mm) {
        return R"({"case":"cylinder","exercise":")" + std::string(exercise) +
               R"(","started":"2026-02-01T10:00:00.250Z","seed":)" + std::to_string(seed) +
               R"(,"values":{"final_tip_to_target_mm":)" + std::to_string(mm) + R"(},"passed":)" +
               (passed ? "true}" : "false}");
    };
    const auto stands = [](const std::string& attempts) {
        return standings_json(R"({"attempts":[)" + attempts +
                              R"(],"asked":[{"case":"cylinder","exercise":"scan","mastery":2},)"
                              R"({"case":"cylinder","exercise":"needle","mastery":2}]})");
    };
    constexpr const char* kNone = R"({"attempts":0,"passes":0,"mastered":false,"best_mm":null})";
    EXPECT_EQ(*stands(""), "[" + std::string(kNone) + "," + kNone + "]");
    EXPECT_EQ(
        *stands(attempt("scan", true, written, 4) + "," + attempt("scan", true, easy, 2.5)),
        R"([{"attempts":2,"passes":2,"mastered":false,"best_mm":2.5},)" + std::string(kNone) + "]");
    EXPECT_EQ(
        *stands(attempt("needle", true, 0, 4) + "," + attempt("needle", false, 0, 9) + "," +
                attempt("needle", true, written, 3) + "," + attempt("needle", true, 0, 5)),
        "[" + std::string(kNone) + R"(,{"attempts":4,"passes":3,"mastered":true,"best_mm":3.0}])");
    for (const char* damaged : {"", "{}", R"({"attempts":[]})", R"({"attempts":[{}],"asked":[]})",
                                R"({"attempts":[],"asked":[{"case":"a","exercise":"b"}]})"})
        EXPECT_FALSE(standings_json(damaged)) << damaged;
}

// The Doppler modes: those of the desktop, in a recording too, and not before the flow of blood has
// arrived.

std::unique_ptr<PagePlayer> open_tube() {
    auto player = PagePlayer::open(bytes_of(testing::flowing_case()), "tube");
    EXPECT_TRUE(player);
    EXPECT_TRUE((*player)->choose_exercise(0, 128, 128));
    return std::move(*player);
}

ImageSettings settings_of(PagePlayer& player, DopplerMode mode) {
    ImageSettings settings;
    settings.doppler.mode = mode;
    EXPECT_TRUE(player.begin_doppler());
    settings.doppler = player.doppler().aimed(player.engine(), settings.doppler);
    return settings;
}

long coloured(const PagePlayer& player) {
    const auto overlay = player.doppler().overlay();
    return std::count_if(overlay.begin(), overlay.end(), [](std::uint8_t i) { return i != 0; });
}

TEST(PageDoppler, ShowsNothingUntilItIsBegunAndEachModeItsOwnPart) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    ImageSettings early;
    early.doppler.mode = DopplerMode::colour;
    player->frame(0.1, early);
    EXPECT_TRUE(player->doppler().overlay().empty());
    EXPECT_FALSE(player->doppler().report().on);

    player->frame(0.2, settings_of(*player, DopplerMode::colour));
    EXPECT_TRUE(player->doppler().has_flow());
    EXPECT_GT(coloured(*player), 50);
    EXPECT_TRUE(player->doppler().strip(64, 16).empty());
    EXPECT_TRUE(player->doppler().sound().empty());

    const ImageSettings spectral = settings_of(*player, DopplerMode::spectral);
    for (int n = 0; n < 30; ++n) player->frame(0.3 + 0.1 * n, spectral);
    EXPECT_TRUE(player->doppler().overlay().empty());
    EXPECT_EQ(player->doppler().strip(64, 16).size(), 64u * 16u);
    EXPECT_FALSE(player->doppler().sound().empty());
    EXPECT_GT(player->doppler().measures().psv_cm_s, 1);

    player->frame(4, {});
    EXPECT_TRUE(player->doppler().strip(64, 16).empty());
    EXPECT_FALSE(player->doppler().report().on);
}

// A kept picture has its colours again; the strip stays as it was frozen.
TEST(PageDoppler, AKeptPictureIsShownInItsColours) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings settings = settings_of(*player, DopplerMode::colour);
    std::vector<std::vector<std::uint8_t>> shown;
    for (int n = 0; n < 4; ++n) {
        player->hands().slide(0, 2);
        player->frame(1 + 0.1 * n, settings);
        shown.emplace_back(player->doppler().overlay().begin(), player->doppler().overlay().end());
    }
    player->frame_again(2, settings);
    const auto overlay = player->doppler().overlay();
    EXPECT_TRUE(std::equal(overlay.begin(), overlay.end(), shown[1].begin(), shown[1].end()));
}

// Another depth makes another view; the mode goes on in it.
TEST(PageDoppler, AnotherImageGoesOnInTheMode) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings settings = settings_of(*player, DopplerMode::power);
    player->frame(0.1, settings);
    EXPECT_GT(coloured(*player), 50);
    PageImage image = player->image();
    image.depth_mm = 80;
    image.width_px = 256;
    image.height_px = 192;
    ASSERT_TRUE(player->set_image(image));
    player->frame(0.2, settings);
    EXPECT_EQ(player->doppler().overlay().size(), 256u * 192u);
    EXPECT_GT(coloured(*player), 50);
}

TEST(PageDoppler, ARecordingKeepsWhatWasShownAndIsScoredAsOnTheDesktop) {
    const auto player = open_tube();
    player->hands().rotate(1.57);
    player->frame(0, {});
    const ImageSettings colour = settings_of(*player, DopplerMode::colour),
                        spectral = settings_of(*player, DopplerMode::spectral);
    ASSERT_TRUE(player->start_attempt("somebody", "2026-01-31T12:00:00Z", 10));
    for (int n = 0; n < 20; ++n) player->frame(10 + 0.1 * n, colour);
    for (int n = 0; n < 60; ++n) player->frame(12 + 0.1 * n, spectral);
    const auto finished = player->finish_attempt();
    ASSERT_TRUE(finished);
    const auto sequence = read_sequence(finished->recording, "");
    ASSERT_TRUE(sequence);
    const auto session = session_from_sequence(*sequence, guess_names(*sequence), "");
    ASSERT_TRUE(session);
    const SessionSample& first = session->samples[10];
    EXPECT_TRUE(first.has_doppler);
    EXPECT_EQ(first.doppler.coloured, std::vector<std::string>{"vessel"});
    const SessionSample& last = session->samples.back();
    EXPECT_EQ(last.doppler.gate, "vessel");
    EXPECT_GT(last.doppler.beats, 0);
    EXPECT_GT(last.doppler.psv_cm_s, 1);
    const auto whole = testing::flowing_case();
    const CaseAnatomy anatomy(whole, breathing_shown(player->exercises()[0], session->header));
    EXPECT_EQ(score_json(score_session(*session, player->exercises()[0], &anatomy, whole.labels),
                         player->exercises()[0]),
              finished->score_json);
}

TEST(PageDoppler, WaitsForTheFlowOfACaseThatArrives) {
    const auto file = arranged_for_loading(write_bundle(testing::flowing_case()), true, "tube");
    ASSERT_TRUE(file);
    constexpr std::size_t kSegment = 256;
    Arrivals arrivals(file->size(), kSegment);
    const auto parts = parts_to_open(*file, "tube");
    ASSERT_TRUE(parts);
    for (const ByteRange& range : *parts)
        for (std::size_t n = range.at / kSegment; n * kSegment < range.end(); ++n) arrivals.add(n);
    auto opened =
        PagePlayer::open_in_parts({file->begin(), file->end()}, std::move(arrivals), "tube");
    ASSERT_TRUE(opened) << opened.error().message();
    PagePlayer& player = **opened;
    ASSERT_TRUE(player.choose_exercise(0, 128, 128));
    player.frame(0, {});
    const Status early = player.begin_doppler();
    ASSERT_FALSE(early);
    EXPECT_NE(early.error().message().find("loading"), std::string::npos);
    for (std::size_t n = 0; n < player.bundle().arrivals()->segments(); ++n) player.arrived(n);
    ASSERT_TRUE(player.look_again());
    EXPECT_TRUE(player.begin_doppler());
    EXPECT_TRUE(player.doppler().has_flow());
}

TEST(PageDoppler, ACaseWithoutFlowSaysSo) {
    auto opened = PagePlayer::open(bytes_of(testing::small_case()), "still");
    ASSERT_TRUE(opened);
    ASSERT_TRUE((*opened)->choose_exercise(0, 128, 128));
    ASSERT_TRUE((*opened)->begin_doppler());
    EXPECT_FALSE((*opened)->doppler().has_flow());
    ImageSettings settings;
    settings.doppler.mode = DopplerMode::colour;
    (*opened)->frame(0, settings);
    EXPECT_EQ(coloured(**opened), 0);
}

}  // namespace
}  // namespace sonocase::runtime
