// SPDX-License-Identifier: Apache-2.0

#include "pipeline/export/publish.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <map>

#include "formats/base/digest.h"
#include "formats/bundle/case_bundle.h"
#include "formats/exercise/case_exercises.h"
#include "formats/exercise/course.h"
#include "formats/files/atomic_file.h"
#include "formats/text/toml_reader.h"
#include "pipeline/export/course_package.h"
#include "support/paths.h"
#include "support/small_case.h"
#include "support/temporary_folder.h"

namespace sonocase::pipeline {
namespace {

namespace fs = std::filesystem;
using sonocase::testing::TemporaryFolder;

class Publish : public ::testing::Test {
  protected:
    void SetUp() override {
        const auto put = [&](const std::string& name, const std::string& text) {
            ASSERT_TRUE(write_file(folder_.path() + "/" + name, std::string_view(text)));
        };
        put("program/index.html", "<meta content=\"connect-src 'self'; img-src 'self'\">");
        put("program/single.html", "<meta content=\"connect-src 'none'\"><!--LIST--><!--CASES-->");
        for (const char* name : {"style.css", "sonoplay.js", "course.js", "sonoplay.wasm",
                                 "sonoplay-scalar.wasm", "worker.js"})
            put(std::string("program/") + name, name);
        CaseBundle bundle = sonocase::testing::small_case();
        bundle.manifest.case_name = "Round </script> body";
        bundle.manifest.recipe = "title = \"A vessel to find\"\n";
        bytes_ = write_bundle(bundle);
        ASSERT_TRUE(write_file(case_path("round body"), std::span<const std::uint8_t>(bytes_)));
        options_.program_folder = folder_.path() + "/program";
    }
    std::string case_path(const std::string& name) const {
        return folder_.path() + "/" + name + ".sonocase";
    }
    std::string site(const std::string& name = "") const { return folder_.path() + "/site" + name; }
    std::string text_of(const std::string& path) const { return *read_text_file(path); }

    TemporaryFolder folder_;
    std::vector<std::uint8_t> bytes_;
    PublishOptions options_;
};

TEST_F(Publish, a_site_holds_page_program_and_the_cases_bytes) {
    const auto published = publish({case_path("round body")}, site(), options_);
    ASSERT_TRUE(published) << published.error().message();
    for (const std::string& file : published->files) EXPECT_TRUE(fs::is_regular_file(file)) << file;
    EXPECT_EQ(text_of(site("/sonoplay.wasm")), "sonoplay.wasm");
    EXPECT_FALSE(fs::exists(site("/camera.js"))) << "this page was built without its camera";
    // The same chunks, in the order in which a page loads them.
    const std::vector<std::uint8_t> sent = *arranged_for_loading(bytes_, false, "round body");
    const std::string digest = digest_of(sent);
    const std::string file = site("/round-body-" + digest.substr(0, 8) + ".sonocase");
    const auto copy = read_file(file);
    ASSERT_TRUE(copy);
    EXPECT_EQ(*copy, sent);
    EXPECT_EQ(write_bundle(*read_bundle(*copy, "copy")), bytes_);
    const auto hashes = read_file(file + ".segments");
    ASSERT_TRUE(hashes);
    ASSERT_EQ(hashes->size(), (sent.size() + kSegmentBytes - 1) / kSegmentBytes * 8);
    const std::span<const std::uint8_t> last =
        std::span(sent).subspan((hashes->size() / 8 - 1) * kSegmentBytes);
    std::uint64_t hash = 0;
    std::memcpy(&hash, hashes->data() + hashes->size() - 8, 8);
    EXPECT_EQ(hash, hash_of(last));
    const std::string list = text_of(site("/cases.json"));
    EXPECT_NE(list.find("\"segments_digest\":\"" + digest_of(*hashes) + "\""), std::string::npos);
    EXPECT_NE(list.find("\"first\":[[0,"), std::string::npos) << list;
    EXPECT_NE(list.find("\"digest\":\"" + digest + "\""), std::string::npos) << list;
    EXPECT_NE(list.find("\"name\":\"round-body\""), std::string::npos);
    EXPECT_NE(list.find("\"title\":\"Find the vessel\""), std::string::npos);
}

TEST_F(Publish, the_same_cases_give_the_same_site) {
    ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
    const std::string first = text_of(site("/cases.json"));
    ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
    EXPECT_EQ(text_of(site("/cases.json")), first);
}

TEST_F(Publish, a_site_grows_by_add_and_says_what_leaves_it) {
    ASSERT_TRUE(write_file(case_path("second"), std::span<const std::uint8_t>(bytes_)));
    const auto first = publish({case_path("round body")}, site(), options_);
    ASSERT_TRUE(first);
    options_.add = true;
    const auto added = publish({case_path("second")}, site(), options_);
    ASSERT_TRUE(added) << added.error().message();
    for (const std::string& warning : added->warnings)
        EXPECT_EQ(warning.find("No longer"), std::string::npos) << warning;
    std::string list = text_of(site("/cases.json"));
    EXPECT_NE(list.find("\"name\":\"second\""), std::string::npos);
    EXPECT_NE(list.find("\"name\":\"round-body\""), std::string::npos);
    ASSERT_TRUE(publish({case_path("second")}, site(), options_));
    EXPECT_EQ(text_of(site("/cases.json")), list);  // the same again
    options_.add = false;
    const auto alone = publish({case_path("second")}, site(), options_);
    ASSERT_TRUE(alone);
    ASSERT_FALSE(alone->warnings.empty());
    EXPECT_NE(alone->warnings.back().find("No longer on the page: round-body"), std::string::npos);
    EXPECT_EQ(text_of(site("/cases.json")).find("round-body"), std::string::npos);
}

TEST_F(Publish, another_page_is_not_overwritten) {
    for (const char* list : {"", "{\"format\": 3}", "[]", "{\"format\": \"sonocase site\"}"}) {
        TemporaryFolder other;
        ASSERT_TRUE(write_file(other / "index.html", std::string_view("mine")));
        if (*list != 0) {
            ASSERT_TRUE(write_file(other / "cases.json", std::string_view(list)));
        }
        EXPECT_FALSE(publish({case_path("round body")}, other.path(), options_)) << list;
        EXPECT_EQ(text_of(other / "index.html"), "mine");
    }
}

TEST_F(Publish, a_record_store_is_allowed_by_the_policy_and_no_other_host) {
    options_.xapi = "https://store.example.org/xapi";
    ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
    EXPECT_NE(text_of(site("/index.html")).find("connect-src 'self' https://store.example.org;"),
              std::string::npos);
    EXPECT_NE(text_of(site("/cases.json")).find("\"xapi\":\"https://store.example.org/xapi\""),
              std::string::npos);
    for (const char* wrong : {"store.example.org", "http://store.example.org/x",
                              "https://a; script-src *", "javascript://x/"}) {
        options_.xapi = wrong;
        EXPECT_FALSE(publish({case_path("round body")}, site("-wrong"), options_)) << wrong;
    }
}

TEST_F(Publish, a_page_that_was_built_with_trackers_brings_them) {
    const std::vector<std::string> names{"camera.js", "camera_worker.js", "camera.wasm", "usb.js",
                                         "usb.wasm"};
    for (const std::string& name : names)
        ASSERT_TRUE(write_file(folder_.path() + "/program/" + name, std::string_view(name)));
    ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
    for (const std::string& name : names) EXPECT_EQ(text_of(site("/" + name)), name);
}

TEST_F(Publish, a_key_of_the_record_store_is_given_to_the_page) {
    options_.xapi = "https://store.example.org/xapi";
    for (const auto& [key, header] :
         {std::pair{"key:secret", "Basic a2V5OnNlY3JldA=="}, {"Bearer abc", "Bearer abc"}}) {
        options_.xapi_key = key;
        ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
        EXPECT_NE(
            text_of(site("/cases.json")).find("\"xapi_auth\":\"" + std::string(header) + "\""),
            std::string::npos);
    }
    for (const char* wrong : {"secret", "key:se\ncret", "key:\xC3\xBC"}) {
        options_.xapi_key = wrong;
        EXPECT_FALSE(publish({case_path("round body")}, site("-wrong"), options_)) << wrong;
    }
    options_.xapi = "";
    options_.xapi_key = "key:secret";
    EXPECT_FALSE(publish({case_path("round body")}, site("-wrong"), options_));
}

TEST_F(Publish, a_pose_server_is_allowed_by_the_policy) {
    options_.poses = "ws://127.0.0.1:18946/?token=secret";
    ASSERT_TRUE(publish({case_path("round body")}, site(), options_));
    const std::string page = text_of(site("/index.html"));
    EXPECT_NE(page.find("connect-src 'self' ws://127.0.0.1:18946;"), std::string::npos) << page;
    EXPECT_EQ(page.find("secret"), std::string::npos);
    for (const char* wrong : {"127.0.0.1:18946", "http://127.0.0.1:1", "ws://a; script-src *"}) {
        options_.poses = wrong;
        EXPECT_FALSE(publish({case_path("round body")}, site("-wrong"), options_)) << wrong;
    }
}

TEST_F(Publish, one_page_holds_the_case_and_no_text_of_it_ends_the_element) {
    options_.single_file = true;
    const auto published = publish({case_path("round body")}, site(".html"), options_);
    ASSERT_TRUE(published) << published.error().message();
    const std::string page = text_of(site(".html"));
    EXPECT_EQ(page.find("<!--"), std::string::npos);
    EXPECT_NE(page.find("Round \\u003c/script> body"), std::string::npos);
    // Length of base64: four digits for three bytes.
    const std::string mark = "id=\"case-round-body\">";
    const std::size_t from = page.find(mark) + mark.size();
    const std::size_t sent = arranged_for_loading(bytes_, false, "round body")->size();
    EXPECT_EQ(page.find("</script>", from) - from, (sent + 2) / 3 * 4);
    EXPECT_FALSE(
        publish({case_path("round body"), case_path("round body")}, site("2.html"), options_));
}

TEST_F(Publish, what_cannot_be_published_is_refused_and_leaves_no_list) {
    ASSERT_TRUE(write_file(case_path("holiday"), std::string_view("holiday")));
    const auto damaged = publish({case_path("round body"), case_path("holiday")}, site(), options_);
    ASSERT_FALSE(damaged);
    EXPECT_NE(damaged.error().message().find("holiday"), std::string::npos);
    fs::create_directory(folder_.path() + "/other");
    fs::copy(case_path("round body"), folder_.path() + "/other/round body.sonocase");
    EXPECT_FALSE(publish({case_path("round body"), folder_.path() + "/other/round body.sonocase"},
                         site(), options_));
    options_.program_folder = folder_.path() + "/nowhere";
    EXPECT_FALSE(publish({case_path("round body")}, site(), options_));
    EXPECT_FALSE(fs::exists(site("/cases.json")));
}

constexpr const char* kCourse = R"(name = "First needles"
title = "Needles & <more>"
[texts.de]
title = "Erste Nadeln"
[[modules]]
name = "look"
text = "Look first."
case = "Round </script> body"
exercise = "scan"
expert = "along"
gate = { passes_in_a_row = 2 }
retention_days = 30
[[modules]]
name = "in plane"
text = "Then the needle."
case = "Round </script> body"
exercise = "scan"
gate = { steady = true }
)";

TEST_F(Publish, a_course_is_on_the_site_and_in_packages_that_are_the_same_each_time) {
    options_.course = folder_.write("course.toml", kCourse);
    options_.packages = {"cmi5", "scorm12", "scorm2004"};
    const auto published = publish({case_path("round body")}, site(), options_);
    ASSERT_TRUE(published) << published.error().message();
    const std::string list = text_of(site("/cases.json"));
    const std::string name = "course-" + digest_of(*read_file(options_.course)).substr(0, 8);
    EXPECT_NE(list.find("\"course\":\"" + name + ".toml\""), std::string::npos) << list;
    EXPECT_EQ(list.find("package"), std::string::npos) << list;
    EXPECT_EQ(text_of(site("/" + name + ".toml")), kCourse);
    ASSERT_EQ(published->warnings.size(), 1u);
    EXPECT_NE(published->warnings[0].find("1 of 2 modules"), std::string::npos);
    EXPECT_EQ(text_of(site("/index.html")).find("https:"), std::string::npos);
    ASSERT_TRUE(publish({case_path("round body")}, site("2"), options_));
    for (const char* kind : {"cmi5", "scorm12", "scorm2004"}) {
        const std::string file = std::string("/First-needles-") + kind + ".zip";
        const auto zip = read_file(site(file));
        ASSERT_TRUE(zip) << file;
        EXPECT_EQ(*zip, *read_file(site("2") + file));
    }
}

TEST_F(Publish, a_course_that_lacks_something_is_refused_at_its_line) {
    const auto refused = [&](const std::string& was, const std::string& is) {
        std::string text = kCourse;
        text.replace(text.find(was), was.size(), is);
        options_.course = folder_.write("course.toml", text);
        const auto published = publish({case_path("round body")}, site("-wrong"), options_);
        EXPECT_FALSE(published) << is;
        return published ? std::string() : published.error().message();
    };
    const auto says = [](const std::string& text, const char* words) {
        EXPECT_NE(text.find(words), std::string::npos) << text;
    };
    std::string text = refused("Round </script> body", "Neck");
    says(text, "course.toml:8");
    says(text, "'look' needs the case 'Neck'");
    says(text, "valid here: Round </script> body");
    text = refused("exercise = \"scan\"", "exercise = \"scam\"");
    says(text, "course.toml:9");
    says(text, "did you mean 'scan'?");
    text = refused("expert = \"along\"", "expert = \"across\"");
    says(text, "course.toml:10");
    text = refused("gate = { steady = true }", "gate = { steadily = true }");
    says(text, "course.toml:18");
    text = refused("name = \"in plane\"", "name = \"look\"");
    says(text, "given twice");
    EXPECT_FALSE(fs::exists(site("-wrong") + "/cases.json"));
}

TEST_F(Publish, a_course_that_names_a_case_by_its_title_is_still_taken) {
    std::string text = kCourse;
    for (std::size_t at = 0; (at = text.find("Round </script> body")) != text.npos;)
        text.replace(at, 20, "A vessel to find");
    options_.course = folder_.write("course.toml", text);
    const auto published = publish({case_path("round body")}, site(), options_);
    EXPECT_TRUE(published) << published.error().message();
}

// Stand-ins with the names, titles and exercises of the recipes that the course is written for.
TEST_F(Publish, the_course_of_the_scenarios_is_published_with_its_cases) {
    const std::string scenarios = SONOCASE_SOURCE "/scenarios/";
    options_.course = scenarios + "course/course.toml";
    const auto course = parse_course(text_of(options_.course), options_.course);
    ASSERT_TRUE(course) << course.error().message();
    std::map<std::string, CaseBundle> bundles;
    for (const CourseModule& module : course->modules) {
        const std::string recipe = scenarios + module.case_name + "/case.toml";
        auto [it, is_new] = bundles.try_emplace(module.case_name, sonocase::testing::small_case());
        CaseBundle& bundle = it->second;
        if (is_new) {
            bundle.manifest.recipe = text_of(recipe);
            const auto table = TomlTable::parse(bundle.manifest.recipe, recipe);
            ASSERT_TRUE(table) << table.error().message();
            table->text("name", bundle.manifest.case_name);
            EXPECT_NE(case_title(bundle.manifest), bundle.manifest.case_name) << recipe;
            bundle.exercises.clear();
        }
        EXPECT_NE(bundle.manifest.recipe.find('"' + module.exercise + '"'), std::string::npos)
            << recipe << " has no exercise " << module.exercise;
        std::string exercise = sonocase::testing::small_exercise_toml();
        exercise.replace(exercise.find("scan"), 4, module.exercise);
        if (!module.expert.empty())
            exercise.replace(exercise.find("along\"\nsnap"), 5, module.expert);
        bundle.exercises.push_back({module.exercise, exercise});
    }
    std::vector<std::string> paths;
    for (const auto& [name, bundle] : bundles) {
        paths.push_back(case_path(name));
        ASSERT_TRUE(write_file(paths.back(), std::span<const std::uint8_t>(write_bundle(bundle))));
    }
    const auto published = publish(paths, site(), options_);
    EXPECT_TRUE(published) << published.error().message();
}

// The page finds its module by the same rule (course.js).
TEST_F(Publish, names_beyond_ascii_are_plain_by_their_bytes) {
    EXPECT_EQ(plain_identifier("in plane 2"), "in-plane-2");
    EXPECT_EQ(plain_identifier("Gef\xC3\xA4\xC3\x9F"), "Gef----");
    EXPECT_EQ(plain_identifier("\xE9\x87\x9D"), "---");
    EXPECT_EQ(plain_identifier(""), "-");
}

TEST_F(Publish, packages_need_a_course_and_a_kind_that_exists) {
    options_.packages = {"cmi5"};
    auto published = publish({case_path("round body")}, site(), options_);
    ASSERT_FALSE(published);
    EXPECT_NE(published.error().message().find("--course"), std::string::npos);
    options_.course = folder_.write("course.toml", kCourse);
    options_.packages = {"scorm13"};
    published = publish({case_path("round body")}, site(), options_);
    ASSERT_FALSE(published);
    EXPECT_NE(published.error().message().find("scorm12"), std::string::npos);
    options_.packages = {};
    options_.single_file = true;
    EXPECT_FALSE(publish({case_path("round body")}, site(".html"), options_));
    options_.single_file = false;
    options_.course = folder_.path() + "/nowhere.toml";
    EXPECT_FALSE(publish({case_path("round body")}, site(), options_));
}

}  // namespace
}  // namespace sonocase::pipeline
