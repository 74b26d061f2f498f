// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>

#include "formats/exercise/metric_table.h"
#include "formats/files/atomic_file.h"
#include "formats/files/load_save.h"
#include "formats/scoring/procedure_run.h"
#include "formats/scoring/session_monitor.h"
#include "formats/words/catalogue.h"
#include "pipeline/review/review.h"
#include "support/paths.h"
#include "support/run_command.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;

// Down to 40 mm above the middle and out again, the probe on top.
Session insertion(int samples) {
    Session s;
    s.header.case_name = "cylinder";
    s.header.exercise = "scan";
    s.header.trainee = "Eve <script>alert(1)</script>";
    s.header.started = "2026-01-02T00:00:00Z";
    s.header.program = "sonoplay";
    for (int i = 0; i < samples; ++i) {
        SessionSample sample;
        sample.time_s = i / 30.0;
        sample.frame = i;
        sample.probe_ok = sample.needle_ok = true;
        sample.mannequin_from_probe = {Matrix3::from_columns({1, 0, 0}, {0, -1, 0}, {0, 0, -1}),
                                       {0, 0, 59}};
        const double way = std::abs(2.0 * i / samples - 1);  // 1, 0, 1
        const Vector3 z = normalized({-1, 0, -1}), x = normalized({1, 0, -1});
        sample.mannequin_from_needle = {Matrix3::from_columns(x, cross(z, x), z),
                                        Vector3{0, 0, 25} - (way * 90) * z};
        sample.mannequin_from_drawn = sample.mannequin_from_needle;
        s.samples.push_back(sample);
    }
    s.events = {{s.samples[static_cast<std::size_t>(samples / 3)].time_s, samples / 3,
                 "needle_entry", "insertion=1"},
                {s.samples[static_cast<std::size_t>(samples / 2)].time_s, samples / 2, "target_hit",
                 "name=<b>x</b>"}};
    return s;
}

struct Files {
    testing::TemporaryFolder folder;
    std::string session = folder.path() + "/s.igs.mha", bundle = folder.path() + "/small.sonocase";
    explicit Files(int samples = 90) {
        EXPECT_TRUE(save_bundle(testing::small_case(), bundle));
        EXPECT_TRUE(save_sequence(sequence_from_session(insertion(samples)), session));
    }
    void add_pictures() {
        Sequence p;
        p.width = 16;
        p.height = 12;
        for (int i = 0; i < 2; ++i) {
            SequenceFrame f;
            f.timestamp_s = 1 + i;
            f.fields = {{"Event", "needle_entry"}};
            p.frames.push_back(f);
        }
        p.pixels.assign(2 * 16 * 12, 90);
        EXPECT_TRUE(save_sequence(p, folder.path() + "/s.frames.igs.mha", true));
    }
};

std::size_t count(const std::string& text, const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
        ++n;
    return n;
}

TEST(Review, ThePageHasEverythingAndNeedsNothing) {
    Files files;
    files.add_pictures();
    ReviewOptions options;
    options.width_px = 160;
    options.height_px = 120;
    const std::string out = files.folder.path() + "/review";
    const auto report = make_review(files.session, files.bundle, out, options);
    ASSERT_TRUE(report) << report.error().message();
    const std::string page = *read_text_file(out + "/review.html");
    EXPECT_EQ(page.find("http:"), std::string::npos);
    EXPECT_EQ(page.find("https:"), std::string::npos);
    EXPECT_EQ(page.find("<script"),
              std::string::npos);  // a trainee's name is text, and there is no other
    EXPECT_NE(page.find("Eve &lt;script&gt;"), std::string::npos);
    EXPECT_EQ(page.find("<b>x</b>"), std::string::npos);
    EXPECT_EQ(count(page, "data:image/png;base64,iVBORw0KGgo"), 2 + 4u);  // frames and views
    EXPECT_NE(page.find("target hit"), std::string::npos);
    for (const MetricInfo& info : metric_table()) {
        EXPECT_NE(page.find(std::string("title=\"") + info.name), std::string::npos) << info.name;
    }
    EXPECT_NE(read_text_file(out + "/scores.json")->find("\"targets_hit\": 1"), std::string::npos);
    EXPECT_TRUE(report->warnings.empty());
}

// Opened in a browser with a line of script at its end that counts the pictures that were drawn.
TEST(Review, ABrowserShowsThePageWithAllItsPicturesAndNoComplaint) {
    Files files;
    if (testing::run_command("command -v chromium").status != 0)
        GTEST_SKIP() << "chromium is not installed";
    files.add_pictures();
    ReviewOptions options;
    options.width_px = 160;
    options.height_px = 120;
    const std::string out = files.folder / "review";
    const auto report = make_review(files.session, files.bundle, out, options);
    ASSERT_TRUE(report) << report.error().message();
    const std::string page = testing::read_text(out + "/review.html");
    const std::string counter =
        "<script>addEventListener('load', () => { const all = [...document.images];"
        "document.title = 'drawn ' + all.filter(i => i.naturalWidth > 0).length + ' of ' +"
        "all.length + ', plots ' + [...document.querySelectorAll('svg')].filter("
        "s => s.getBoundingClientRect().width > 50).length; });</script></body>";
    const std::size_t end = page.rfind("</body>");
    ASSERT_NE(end, std::string::npos);
    files.folder.write("counted.html", page.substr(0, end) + counter);
    const auto seen = testing::run_command(
        "env HOME=" + files.folder.path() +
        " timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-dev-shm-usage"
        " --enable-logging=stderr --user-data-dir=" +
        (files.folder / "profile") + " --dump-dom file://" + (files.folder / "counted.html"));
    ASSERT_EQ(seen.status, 0) << seen.error;
    EXPECT_NE(seen.out.find("<title>drawn 6 of 6, plots "), std::string::npos)
        << seen.out.substr(seen.out.find("<title>"), 80);
    EXPECT_EQ(seen.out.find("plots 0<"), std::string::npos);
    EXPECT_EQ(seen.error.find("CONSOLE"), std::string::npos) << seen.error;
}

TEST(Review, ComparesWithEarlierSessionsOfTheSameTrainee) {
    Files files;
    const std::string path = files.folder.path() + "/progress.sqlite";
    {
        auto book = ProgressBook::open(path);
        ASSERT_TRUE(book);
        ProgressEntry e;
        e.trainee = "Eve <script>alert(1)</script>";
        e.exercise = "scan";
        e.started = "2026-01-01T00:00:00Z";
        e.metrics = {{"elapsed_time_s", 77}};
        ASSERT_TRUE(book->add(e));
        e.trainee = "somebody else";
        e.metrics = {{"elapsed_time_s", 55555}};
        ASSERT_TRUE(book->add(e));
        e.trainee = "Eve <script>alert(1)</script>";
        e.started = "2026-03-01T00:00:00Z";  // after this session
        e.metrics = {{"elapsed_time_s", 44444}};
        ASSERT_TRUE(book->add(e));
    }
    ReviewOptions options;
    options.progress_path = path;
    const auto input = load_review(files.session, files.bundle, options);
    ASSERT_TRUE(input) << input.error().message();
    ASSERT_EQ(input->earlier.size(), 1u);
    const std::string page = review_page(*input, {});
    EXPECT_NE(page.find("77 s"), std::string::npos);
    EXPECT_EQ(page.find("55555"), std::string::npos);
    EXPECT_EQ(page.find("44444"), std::string::npos);
    EXPECT_NE(progress_svg(*input, "elapsed_time_s"), "");
}

TEST(Review, OddSessionsStillGiveAPage) {
    for (const int samples : {1, 2}) {
        Files files(samples == 1 ? 1 : 2);
        const auto input = load_review(files.session, files.bundle, {});
        ASSERT_TRUE(input) << input.error().message();
        EXPECT_NE(review_page(*input, {}).find("</html>"), std::string::npos);
    }
    Files files;
    Session lost = insertion(60);
    for (SessionSample& s : lost.samples) s.needle_ok = s.probe_ok = false;
    ASSERT_TRUE(save_sequence(sequence_from_session(lost), files.session));
    const auto input = load_review(files.session, files.bundle, {});
    ASSERT_TRUE(input) << input.error().message();
    EXPECT_NE(review_page(*input, {}).find("</html>"), std::string::npos);
    EXPECT_TRUE(std::any_of(input->warnings.begin(), input->warnings.end(), [](const auto& w) {
        return w.find("cannot be judged") != std::string::npos;
    }));
}

// The words of the page stand in its template, in its source and in tables of formats.
TEST(Review, EveryLanguageHasEveryWord) {
    std::set<std::string> words;
    const auto collect = [&](const std::string& file, const char* pattern) {
        const std::string text = testing::read_text(SONOCASE_SOURCE "/pipeline/review/" + file);
        const std::regex form(pattern);
        std::size_t found = 0;
        for (std::sregex_iterator it(text.begin(), text.end(), form), end; it != end; ++it, ++found)
            words.insert((*it)[1]);
        EXPECT_GT(found, 1u) << file << " " << pattern;
    };
    collect("review_page.html", R"(\{\{_([^}]+)\}\})");
    collect("review.cpp", R"re(words\(\{?\s*"([^"]+)")re");
    collect("review.cpp", R"re(words\([\w.]+ \? "([^"]+)")re");
    collect("review.cpp", R"re(\{"[a-z]+", "([A-Z][a-z]+)"\})re");
    collect("review_input.cpp", R"re(push_back\(\s*\{"([^"]+\.)")re");
    collect("session_views.cpp", R"re(\{"([A-Z][^"]+)",)re");
    for (int kind = 0; kind <= static_cast<int>(LiveEventKind::complication); ++kind) {
        std::string name =
            session_event({.kind = static_cast<LiveEventKind>(kind), .index = 0}, {}, {}).name;
        std::replace(name.begin(), name.end(), '_', ' ');
        words.insert(name);
    }
    for (const char* why : {"too_early", "too_late", "happened", "not_tried", "wrong_answer",
                            "not_answered", "not_done"})
        words.insert(missed_words(why));
    words.insert({"not passed", "picture"});
    for (const MetricInfo& metric : metric_table()) words.insert(metric.title);
    for (const char* title : complication_titles()) words.insert(title);
    for (const Language& language : languages().subspan(1)) {
        for (const std::string& english : words)
            EXPECT_NE(language.find(english), nullptr) << language.code << ": " << english;
    }
}

TEST(Review, IsWrittenInTheLanguageOfItsReader) {
    Files files;
    ReviewOptions options;
    options.language = "de_AT.UTF-8";
    const auto input = load_review(files.session, files.bundle, options);
    ASSERT_TRUE(input) << input.error().message();
    const std::string page = review_page(*input, {});
    EXPECT_NE(page.find("<html lang=de>"), std::string::npos);
    for (const char* words : {"Zeitverlauf", "Alle Werte", "Einstich", "Spitze zum Ziel"})
        EXPECT_NE(page.find(words), std::string::npos) << words;
    for (const char* words : {"Time line", "All scores", "needle entry", "tip to target", "{{"})
        EXPECT_EQ(page.find(words), std::string::npos) << words;
}

// As the window does.
TEST(Review, NamesTheNearestTargetInWordsOfItsLanguage) {
    Files files;
    for (const auto& [language, target] : {std::pair("de", ">Herd<"), {"en", ">Lesion<"}}) {
        ReviewOptions options;
        options.language = language;
        auto input = load_review(files.session, files.bundle, options);
        ASSERT_TRUE(input) << input.error().message();
        ASSERT_FALSE(input->exercise.targets.empty());
        input->exercise.targets[0].name = "lesion";
        input->score.insertions.resize(1);
        input->score.insertions[0].target = 0;
        EXPECT_NE(review_page(*input, {}).find(target), std::string::npos) << language;
    }
}

TEST(Progress, ColumnsStandUnderEachOtherWhateverTheNames) {
    const testing::TemporaryFolder folder;
    const std::string path = folder / "book.sqlite";
    ProgressEntry entry;
    entry.started = "2026-01-02T00:00:00Z";
    entry.exercise = "line";
    for (const char* name : {"Bjoern", "Bj\u00f6rn", "\u0141ucja \u017b\u00f3\u0142\u0107"}) {
        entry.trainee = name;
        ASSERT_TRUE(ProgressBook::open(path)->add(entry));
    }
    const auto said = testing::run_command(SONOCASE_BIN "/sonocase progress --progress " + path);
    ASSERT_EQ(said.status, 0) << said.error;
    std::set<std::ptrdiff_t> columns;
    std::istringstream in(said.out);
    for (std::string line; std::getline(in, line);) {
        const std::string before = line.substr(0, line.find("line"));
        columns.insert(
            std::count_if(before.begin(), before.end(), [](char c) { return (c & 0xC0) != 0x80; }));
    }
    EXPECT_EQ(columns.size(), 1u) << said.out;
}

TEST(Review, ALanguageThatIsNotThereIsWrongUsage) {
    Files files;
    const auto said =
        testing::run_command(SONOCASE_BIN "/sonocase review " + files.session + " --case " +
                             files.bundle + " --language fr -o " + (files.folder / "review"));
    EXPECT_EQ(said.status, 2);
    EXPECT_NE(said.error.find("--language fr: there are en and de"), std::string::npos)
        << said.error;
}

TEST(Review, AnotherCaseAndAMissingExerciseAreSaid) {
    Files files;
    Session s = insertion(30);
    s.header.case_name = "another";
    s.header.exercise = "gone";
    ASSERT_TRUE(save_sequence(sequence_from_session(s), files.session));
    const auto input = load_review(files.session, files.bundle, {});
    ASSERT_TRUE(input);
    EXPECT_EQ(input->warnings.size(), 2u);
    ReviewOptions options;
    options.exercise = "scam";
    const auto wrong = load_review(files.session, files.bundle, options);
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().message().find("scan"), std::string::npos);
    EXPECT_FALSE(load_review(files.bundle, files.bundle, {}));
    options.exercise = "scan";
    const auto other = load_review(files.session, files.bundle, options);
    ASSERT_TRUE(other);
    ASSERT_EQ(other->warnings.size(), 2u);
    EXPECT_EQ(std::string(other->warnings[0]),
              "The session was recorded on the case 'another' and not on 'cylinder'.");
    EXPECT_EQ(std::string(other->warnings[1]),
              "The session was recorded for the exercise 'gone' and not for 'scan'.");
    // `sonocase score` says the same.
    for (const char* form : {"", " --json"}) {
        const auto said =
            testing::run_command(SONOCASE_BIN "/sonocase score " + files.session + " --case " +
                                 files.bundle + " --exercise scan" + form);
        EXPECT_EQ(said.status, 0) << said.error;
        for (const Message& warning : other->warnings)
            EXPECT_NE(said.out.find(std::string(warning)), std::string::npos) << form << said.out;
    }
    EXPECT_FALSE(load_review(files.session, files.session, {}));
}

}  // namespace
}  // namespace sonocase::pipeline
