// SPDX-License-Identifier: Apache-2.0

// The catalogue of words: every language has every word, with the same printf fields.
#include "runtime/player/words/words.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <regex>

#include "formats/base/clinical_names.h"
#include "formats/base/result.h"
#include "formats/exercise/metric_table.h"
#include "formats/exercise/needle_makes.h"
#include "formats/scoring/attempt_result.h"
#include "formats/words/catalogue.h"
#include "runtime/imaging/paper/paper_model.h"
#include "runtime/imaging/physical/model/physical_effects.h"
#include "runtime/player/app/case_steps.h"
#include "runtime/player/ui/keys.h"
#include "runtime/tracking/guided_start.h"
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

int count_of(const std::string& part, const std::string& text) {
    int count = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
        ++count;
    return count;
}

TEST_F(Words, KeepPrintfFieldsInTheirOrderAndAreListedOnce) {
    for (const Language& language : languages()) {
        for (std::size_t i = 0; i < language.catalogue.size(); ++i) {
            const Translation& t = language.catalogue[i];
            EXPECT_FALSE(t.other.empty()) << t.english;
            // "100 % of" would read as a field; catalogue words with per cent write %%.
            if (t.english.find('%') != std::string::npos) {
                EXPECT_EQ(fields(t.english), fields(t.other)) << t.english;
            }
            EXPECT_EQ(count_of("{}", t.english), count_of("{}", t.other)) << t.english;
            if (i > 0) {
                EXPECT_NE(language.catalogue[i - 1].english, t.english);
            }
        }
    }
}

// read_po() leaves out what gettext leaves out; the files themselves hold nothing of the kind.
TEST_F(Words, CataloguesHoldNoEmptyFuzzyOrObsoleteEntry) {
    std::size_t catalogues = 0;
    for (const auto& entry :
         std::filesystem::directory_iterator(SONOCASE_SOURCE "/formats/words/locale")) {
        const std::string text = sonocase::testing::read_text(entry.path().string());
        const Language language = read_po(text);
        EXPECT_EQ(language.code, entry.path().stem()) << entry.path();
        EXPECT_FALSE(language.name.empty()) << entry.path();
        EXPECT_EQ(count_of("\nmsgid ", text), static_cast<int>(language.catalogue.size()) + 1)
            << entry.path();  // and the header
        EXPECT_EQ(count_of("\nmsgstr ", text), count_of("\nmsgid ", text)) << entry.path();
        for (const char* never : {"fuzzy", "\n#~", "\nmsgctxt", "\nmsgid_plural"})
            EXPECT_EQ(count_of(never, text), 0) << entry.path() << never;
        ++catalogues;
    }
    EXPECT_EQ(catalogues + 1, languages().size());
}

TEST(Catalogue, IsReadAsGettextReadsIt) {
    const Language language = read_po(
        "# a comment\n"
        "msgid \"\"\n"
        "msgstr \"\"\n"
        "\"Language: xx\\n\"\n"
        "\"X-Language-Name: Xish\\n\"\n"
        "\n"
        "#, c-format\n"
        "msgid \"\"\n"
        "\"two \"\n"
        "\"lines\"\n"
        "msgstr \"zwei \\\"Zeilen\\\" \\\\\"\n"
        "#, fuzzy\n"
        "msgid \"fuzzy\"\n"
        "msgstr \"ungenau\"\n"
        "msgid \"empty\"\n"
        "msgstr \"\"\n"
        "#~ msgid \"old\"\n"
        "#~ msgstr \"alt\"\n"
        "msgid \"a\"\n"
        "msgstr \"b\"");
    EXPECT_EQ(language.code, "xx");
    EXPECT_EQ(language.name, "Xish");
    ASSERT_EQ(language.catalogue.size(), 2u);
    EXPECT_EQ(language.catalogue[0].english, "a");
    EXPECT_EQ(language.catalogue[0].other, "b");
    EXPECT_EQ(language.catalogue[1].english, "two lines");
    EXPECT_EQ(language.catalogue[1].other, "zwei \"Zeilen\" \\");
    EXPECT_TRUE(read_po("").catalogue.empty());
}

template <class Met, class Table>
void expect_reasons(const Table& table) {
    Met shows_nothing, shows_all;
    if constexpr (requires { shows_all.shows_wall; })
        shows_all.shows_parenchyma = shows_all.shows_streaks = shows_all.shows_diaphragm =
            shows_all.shows_wall = true;
    for (const auto& effect : table) {
        EXPECT_NE(translation(effect.called_for_by), nullptr) << effect.called_for_by;
        for (const Met& met : {shows_nothing, shows_all}) {
            if (effect.skipped_because == nullptr) continue;
            const char* why = effect.skipped_because(met);
            EXPECT_NE(translation(why), nullptr) << effect.name << ": " << why;
        }
    }
}

// The panel of effects says why each is on or skipped.
TEST_F(Words, EveryReasonOfAnEffectIsInTheCatalogue) {
    expect_reasons<PaperMet>(kPaperEffects);
    expect_reasons<PhysicalMet>(kPhysicalEffects);
    for (const char* why : {"switched off", "needle outside the slab"})
        EXPECT_NE(translation(why), nullptr) << why;
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
    const auto has = [](const char* words) { return *words == 0 || translation(words) != nullptr; };
    for (const MetricInfo& info : metric_table()) {
        EXPECT_TRUE(has(info.title)) << info.title;
        EXPECT_TRUE(has(info.advice)) << info.advice;
    }
    for (int i = 0; i <= kGuideSteps; ++i) {
        EXPECT_TRUE(has(guide_title(static_cast<GuideStep>(i))));
        EXPECT_TRUE(has(guide_words(static_cast<GuideStep>(i))));
    }
    for (const Shortcut& s : shortcuts()) EXPECT_TRUE(has(s.does)) << s.does;
    for (const NeedleMake& make : needle_makes())
        EXPECT_TRUE(!make.echogenic || has(make.about)) << make.about;
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
    EXPECT_EQ(tissue_words("portal_vein_and_splenic_vein"), "Pfortader oder Milzvene");
    EXPECT_EQ(tissue_words("common_femoral_vein_right"), "Vena femoralis communis rechts");
    EXPECT_EQ(tissue_words("green_cheese_left"), "Left green cheese");
    EXPECT_EQ(tissue_words("_"), " ");
    EXPECT_EQ(tissue_words(""), "");
    use_language("en");
    EXPECT_EQ(tissue_words("portal_vein_left"), "Left portal vein");
    EXPECT_EQ(tissue_words("rib_right_7"), "Right 7th rib");
    EXPECT_EQ(tissue_words("rib_left_12"), "Left 12th rib");
    EXPECT_EQ(tissue_words("vertebrae_L3"), "L3 vertebra");
    EXPECT_EQ(tissue_words("hepatic_vein_3mm"), "Hepatic vein");
    EXPECT_EQ(tissue_words("other_muscle_like"), "Muscle and soft tissue");
    EXPECT_EQ(tissue_words("metastasis_12"), "Metastasis 12");
}

// Labels of cases, and words of exercises, have a clinician's words in every language.
TEST_F(Words, EveryClinicalNameIsInTheCatalogue) {
    for (const ClinicalName& name : clinical_names())
        EXPECT_NE(translation(std::string(name.words).c_str()), nullptr) << name.words;
    for (const char* label : {"liver",
                              "kidney_left",
                              "iliac_vena_right",
                              "common_femoral_artery_left",
                              "gluteus_medius_left",
                              "autochthon_right",
                              "rib_left_9",
                              "costal_cartilages",
                              "visceral_fat",
                              "hepatic_artery_1p5mm",
                              "lung_lower_lobe_right",
                              "adrenal_gland_left",
                              "lower calyx",
                              "spleen metastasis",
                              "second cyst",
                              "right vein",
                              "left vein",
                              "portal vein",
                              "artery",
                              "vein",
                              "abscess",
                              "lesion",
                              "cyst",
                              "tube"})
        EXPECT_NE(translation(label_parts(label).words.c_str()), nullptr) << label;
}

// An error as a tracker and a notice say it.
std::string said(const Message& what, const Message& expected) {
    return tr_message(Message("{}.", {Error{what, "", expected}.message()}));
}

TEST_F(Words, SentencesAreSaidWholeOrPartByPart) {
    EXPECT_EQ(tr_message(Message("Saved as {}.", {"/tmp/a_b.png"})),
              "Gespeichert als /tmp/a_b.png.");
    EXPECT_EQ(
        said(Message("No {} is plugged in", {"Polhemus Viper"}), "plug it in and switch it on"),
        "Kein Polhemus Viper ist angesteckt; stecken Sie ihn an und schalten Sie ihn ein.");
    EXPECT_EQ(tr_message(Message("An attempt is running. {} again ends it as it is; B finishes it "
                                 "and shows the result.",
                                 {"F5"})),
              "Ein Versuch läuft. F5 noch einmal beendet ihn, wie er ist; B schließt ihn ab und "
              "zeigt das Ergebnis.");
    // Arguments are translated too.
    EXPECT_EQ(tr_message(Message("{} is in use by another program",
                                 {Message("The {} at {}", {"Polhemus Viper", "bus 1, device 2"})})),
              "Polhemus Viper an bus 1, device 2 ist von einem anderen Programm belegt");
    // What is not known stays, and takes nothing known with it.
    EXPECT_EQ(said("Nobody wrote this", "replug it"), "Nobody wrote this; stecken Sie ihn neu an.");
    EXPECT_EQ(tr_message(""), "");
    EXPECT_EQ(tr_message(";;;: ; : "), ";;;: ; : ");
    // An error's place is named as it is, without the line breaks of what it quotes.
    EXPECT_EQ(tr_message(Error{"not a numeric address", "a\nb", "replug it"}.message()),
              "a b: keine Adresse aus Zahlen; stecken Sie ihn neu an");
    EXPECT_TRUE(missing_words().empty());
    use_language("en");
    EXPECT_EQ(tr_message(Message("Saved as {}.", {"x"})), "Saved as x.");
}

// The literals at the beginning of each call's arguments, one after the other.
std::vector<std::string> literals_of(const std::string& source, const std::regex& call) {
    static const std::regex kLiteral(R"re("((?:[^"\\]|\\.)*)")re");
    std::vector<std::string> found;
    for (std::sregex_iterator it(source.begin(), source.end(), call), end; it != end; ++it) {
        const std::string inside = (*it)[1];
        std::string words;
        for (std::sregex_iterator part(inside.begin(), inside.end(), kLiteral); part != end; ++part)
            words += (*part)[1];
        found.push_back(std::regex_replace(words, std::regex(R"re(\\(["\\]))re"), "$1"));
    }
    return found;
}

// Every notice of the window, and every message with arguments.
TEST_F(Words, EveryNoticeIsInTheCatalogue) {
    const std::string literals = R"re(((?:"(?:[^"\\]|\\.)*"\s*)+))re";
    const std::regex notice(R"re(notices\.(?:news|warning|error)\(\s*\{?\s*)re" + literals);
    const std::regex message(R"re((?:\bMessage(?: \w+)?\(|push_back\(\{|return \{)\s*)re" +
                             literals + R"re(,\s*\{)re");
    const auto known = [](const std::string& words) {
        return !words.empty() && translation(words.c_str()) != nullptr;
    };
    int found = 0, messages = 0;
    for (const char* folder : {"/formats", "/runtime"}) {
        for (const auto& entry :
             std::filesystem::recursive_directory_iterator(SONOCASE_SOURCE + std::string(folder))) {
            if (entry.path().extension() != ".cpp") continue;
            // What the page's programs alone say is in its catalogue (its own test of words).
            if (entry.path().string().find("/web/program/") != std::string::npos) continue;
            const std::string source = sonocase::testing::read_text(entry.path().string());
            for (const std::string& words : literals_of(source, notice)) {
                EXPECT_TRUE(known(words)) << entry.path() << ": " << words;
                ++found;
            }
            for (const std::string& words : literals_of(source, message)) {
                if (words.find_first_not_of("{}:;. ") == std::string::npos) continue;
                EXPECT_TRUE(known(words)) << entry.path() << ": " << words;
                ++messages;
            }
        }
    }
    EXPECT_GT(found, 15);
    EXPECT_GT(messages, 30);
    // The words of the trackers.
    const Message device("The {} at {}", {"Polhemus Viper", "bus 1, device 2"});
    for (const std::string& german :
         {said(Message("No {} is plugged in", {"Polhemus Liberty"}), "plug it in and switch it on"),
          said(Message("No permission for the {} at {}", {"Polhemus Viper", "bus 1, device 2"}),
               "install the rule 60-sonocase-trackers.rules in /etc/udev/rules.d, run udevadm "
               "control --reload, then replug it"),
          said(Message("{} is in use by another program", {device}),
               "close the other program, or replug it"),
          said("The tracker does not answer", "switch it off and on"),
          tr_message("Looking for a server."),
          said("No sensor is connected to the tracker",
               "plug the probe's and the needle's sensors in")}) {
        for (const char* english : {" the ", "plug", "switch", "No "})
            EXPECT_EQ(german.find(english), std::string::npos) << german;
    }
}

// "... Pfeil hoch fuehrt dort." is longer than "... arrow up leads there.": nothing is cut.
TEST_F(Words, AFormatIsFilledWhateverItsLength) {
    const std::string words(500, 'w');
    EXPECT_EQ(filled((words + " %d " + words).c_str(), 7), words + " 7 " + words);
    EXPECT_EQ(filled("%s", words.c_str()), words);
    EXPECT_EQ(filled("%.1f mm", 1e300).size(), 306u);
    EXPECT_EQ(filled(""), "");
}

TEST(Languages, AreChosenByCodeOrLocaleAndElseEnglish) {
    for (const char* code : {"de", "de_AT.UTF-8", "de-CH"}) {
        use_language(code);
        EXPECT_EQ(language_in_use().code, "de") << code;
    }
    EXPECT_STREQ(tr("Gain"), "Gain");
    EXPECT_STREQ(tr("Depth"), "Tiefe");
    EXPECT_STREQ(tr("words that nobody wrote"), "words that nobody wrote");
    for (const char* code : {"en", "C", "", "den_XX", "fr_FR.UTF-8"}) {
        use_language(code);
        EXPECT_EQ(language_in_use().code, "en") << code;
    }
    EXPECT_STREQ(tr("Depth"), "Depth");
}

}  // namespace
}  // namespace sonocase::runtime
