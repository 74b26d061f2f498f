// SPDX-License-Identifier: Apache-2.0

// The catalogue of words: every language has every word, with the same printf fields.
#include "runtime/player/words/words.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <regex>

#include "formats/exercise/metric_table.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/training/attempt_result.h"
#include "runtime/player/training/guided_start.h"
#include "runtime/player/ui/pages/shortcuts.h"
#include "runtime/player/words/said.h"
#include "support/paths.h"
#include "support/run_command.h"

namespace sonocase::runtime {
namespace {

class Words : public ::testing::Test {
  protected:
    void SetUp() override { use_language("de"); }
    void TearDown() override { use_language("en"); }
};

std::string fields(const std::string& words) {
    static const std::regex kField("%[-+ 0-9.]*[a-z]*[a-zA-Z]|%%");
    std::string all;
    for (std::sregex_iterator it(words.begin(), words.end(), kField), end; it != end; ++it) {
        if (it->str() != "%%") all += it->str() + " ";
    }
    return all;
}

TEST_F(Words, KeepPrintfFieldsInTheirOrderAndAreListedOnce) {
    for (const Language& language : languages()) {
        for (std::size_t i = 0; i < language.catalogue.size(); ++i) {
            const Translation& t = language.catalogue[i];
            EXPECT_NE(t.other[0], 0) << t.english;
            // "100 % of" would read as a field; catalogue words with per cent write %%.
            if (std::strchr(t.english, '%')) {
                EXPECT_EQ(fields(t.english), fields(t.other)) << t.english;
            }
            if (i > 0) {
                EXPECT_STRNE(language.catalogue[i - 1].english, t.english);
            }
        }
    }
}

// Every tr("...") of the window's sources; words that reach tr() through a table or as a tooltip
// are found by the tour of the window in German (window_pictures_test.cpp).
TEST_F(Words, EveryWordInTheSourcesIsInTheCatalogue) {
    const std::regex call(R"re(\btr\(\s*((?:"(?:[^"\\]|\\.)*"\s*)+)\))re");
    const std::regex tip(R"re(\.tip = ((?:"(?:[^"\\]|\\.)*"\s*)+);)re");
    int found = 0;
    for (const char* folder : {"/runtime/player/ui", "/runtime/player/app"}) {
        for (const auto& entry :
             std::filesystem::recursive_directory_iterator(SONOCASE_SOURCE + std::string(folder))) {
            if (entry.path().extension() != ".cpp") continue;
            const std::string source = sonocase::testing::read_text(entry.path().string());
            for (const std::regex& pattern : {call, tip}) {
                for (std::sregex_iterator it(source.begin(), source.end(), pattern), end; it != end;
                     ++it, ++found) {
                    const std::string quoted = (*it)[1];
                    std::string words;
                    bool inside = false;
                    for (const char c : quoted) {
                        if (c == '"') {
                            inside = !inside;
                        } else if (inside) {
                            words += c;
                        }
                    }
                    tr(words.c_str());
                }
            }
        }
    }
    EXPECT_GT(found, 100);
    for (const std::string& words : missing_words()) ADD_FAILURE() << "no German for: " << words;
}

TEST_F(Words, MeasuresAdviceGuideHelpAndPresetsAreInTheCatalogue) {
    const auto has = [](const char* words) {
        for (const Translation& t : language_in_use().catalogue) {
            if (std::strcmp(t.english, words) == 0) return true;
        }
        return *words == 0;
    };
    for (const MetricInfo& info : metric_table()) {
        EXPECT_TRUE(has(info.title)) << info.title;
        EXPECT_TRUE(has(advice_for(info.name))) << advice_for(info.name);
    }
    for (int i = 0; i <= kGuideSteps; ++i) {
        EXPECT_TRUE(has(guide_title(static_cast<GuideStep>(i))));
        EXPECT_TRUE(has(guide_words(static_cast<GuideStep>(i))));
    }
    for (const Shortcut& s : shortcuts()) EXPECT_TRUE(has(s.does)) << s.does;
    for (const ImagePreset& preset : kPresets) {
        EXPECT_TRUE(has(preset.name));
        EXPECT_TRUE(has(preset.tip));
    }
}

TEST_F(Words, TissueIsNamedWithItsSideAndNumber) {
    EXPECT_EQ(tissue_words("liver"), "Leber");
    EXPECT_EQ(tissue_words("kidney_left"), "Niere links");
    EXPECT_EQ(tissue_words("rib_right_7"), "Rippe rechts 7");
    EXPECT_EQ(tissue_words("vertebrae_L3"), "Wirbel L3");
    EXPECT_EQ(tissue_words("metastasis_12"), "Metastase 12");
    EXPECT_EQ(tissue_words("portal_vein_and_splenic_vein"), "Pfortader und Milzvene");
    EXPECT_EQ(tissue_words("green_cheese_left"), "Green cheese left");
    EXPECT_EQ(tissue_words("_"), " ");
    EXPECT_EQ(tissue_words(""), "");
    use_language("en");
    EXPECT_EQ(tissue_words("portal_vein_left"), "Portal vein left");
}

TEST_F(Words, SentencesAreSaidWholeOrPartByPart) {
    EXPECT_EQ(tr_said("Saved as /tmp/a_b.png."), "Gespeichert als /tmp/a_b.png.");
    EXPECT_EQ(tr_said("No Polhemus Viper is plugged in; plug it in and switch it on."),
              "Kein Polhemus Viper ist angesteckt; stecken Sie ihn an und schalten Sie ihn ein.");
    EXPECT_EQ(tr_said("An attempt is running. F5 again ends it as it is; B finishes it and shows "
                      "the result."),
              "Ein Versuch läuft. F5 noch einmal beendet ihn, wie er ist; B schließt ihn ab und "
              "zeigt das Ergebnis.");
    // What is not known stays, and takes nothing known with it.
    EXPECT_EQ(tr_said("Nobody wrote this; replug it."),
              "Nobody wrote this; stecken Sie ihn neu an.");
    EXPECT_EQ(tr_said(""), "");
    EXPECT_EQ(tr_said(";;;: ; : "), ";;;: ; : ");
    EXPECT_TRUE(missing_words().empty());
    use_language("en");
    EXPECT_EQ(tr_said("Saved as x."), "Saved as x.");
}

// A literal of a notice, or of an error that becomes one; "a" + b + "c" is "a%sc".
std::vector<std::string> said_in(const std::string& source, const std::regex& call) {
    static const std::regex kParts(R"re("((?:[^"\\]|\\.)*)"|\+)re");
    std::vector<std::string> found;
    for (std::sregex_iterator it(source.begin(), source.end(), call), end; it != end; ++it) {
        const std::string inside = (*it)[1];
        std::string words;
        std::size_t at = 0;
        bool literal_before = false, any = false;
        for (std::sregex_iterator part(inside.begin(), inside.end(), kParts); part != end; ++part) {
            const std::string between =
                inside.substr(at, static_cast<std::size_t>(part->position()) - at);
            const bool value = between.find_first_not_of(" \n") != std::string::npos;
            if (value) words += "%s";
            if (part->str() != "+") {
                words += (*part)[1];
                any = true;
            }
            literal_before = part->str() != "+";
            at = static_cast<std::size_t>(part->position() + part->length());
        }
        if (!literal_before && inside.find_first_not_of(" \n", at) != std::string::npos)
            words += "%s";
        if (any) found.push_back(words);
    }
    return found;
}

// Every notice of the window, and every message of a USB tracker.
TEST_F(Words, EveryNoticeIsInTheCatalogue) {
    const std::regex notice(R"re(notices\.(?:news|warning|error)\(([^;?]*?)\);)re");
    const auto known = [](const std::string& words) {
        return !words.empty() && translation(words.c_str()) != nullptr;
    };
    int found = 0;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(SONOCASE_SOURCE "/runtime/player/app")) {
        if (entry.path().extension() != ".cpp") continue;
        for (const std::string& words :
             said_in(sonocase::testing::read_text(entry.path().string()), notice)) {
            EXPECT_TRUE(known(words)) << entry.path() << ": " << words;
            ++found;
        }
    }
    EXPECT_GT(found, 15);
    // As the trackers say them.
    for (const char* message :
         {"No Polhemus Liberty is plugged in; plug it in and switch it on.",
          "No permission for the Polhemus Viper at bus 1, device 2; install the rule "
          "60-sonocase-trackers.rules in /etc/udev/rules.d, run udevadm control --reload, then "
          "replug it.",
          "The Polhemus Viper at bus 1, device 2 is in use by another program; close the other "
          "program, or replug it.",
          "The tracker does not answer; switch it off and on.", "Looking for a server.",
          "No sensor is connected to the tracker; plug the probe's and the needle's sensors in."}) {
        const std::string german = tr_said(message);
        for (const char* english : {" the ", "plug", "switch", "No "})
            EXPECT_EQ(german.find(english), std::string::npos) << german;
    }
}

TEST(Languages, AreChosenByCodeOrLocaleAndElseEnglish) {
    for (const char* code : {"de", "de_AT.UTF-8", "de-CH"}) {
        use_language(code);
        EXPECT_STREQ(language_in_use().code, "de") << code;
    }
    EXPECT_STREQ(tr("Gain"), "Gain");
    EXPECT_STREQ(tr("Depth"), "Tiefe");
    EXPECT_STREQ(tr("words that nobody wrote"), "words that nobody wrote");
    for (const char* code : {"en", "C", "", "den_XX", "fr_FR.UTF-8"}) {
        use_language(code);
        EXPECT_STREQ(language_in_use().code, "en") << code;
    }
    EXPECT_STREQ(tr("Depth"), "Depth");
}

}  // namespace
}  // namespace sonocase::runtime
